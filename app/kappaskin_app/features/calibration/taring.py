"""Tares as a person takes, undoes and finds them again; those of a real sensor are kept."""

from datetime import datetime

from PySide6.QtCore import QObject, Signal

from kappaskin.calibration import Tare, TareStore
from kappaskin.errors import Refusal
from kappaskin.live import Engine, Status
from kappaskin.sensing import Sensor
from kappaskin_app.shell.history import History
from kappaskin_app.shell.session import RECORDED
from kappaskin_app.shell.settings import Settings


class Taring(QObject):
    """Has the engine take tares, and makes what comes of it a setting that may be undone.

    `message` says why the last was refused, or what could not be kept; `stored` is the tare that
    was found where this sensor was connected. `told` brings what was done without being asked for,
    `changed` tells of anything new.
    """

    changed = Signal()
    told = Signal(str)

    def __init__(
        self, history: History, engine: Engine, tares: TareStore, parent: QObject | None = None
    ) -> None:
        super().__init__(parent)
        self._history, self._engine, self._tares = history, engine, tares
        self._status = Status()
        self._meetings, self._aside = 0, False
        self._before: Tare | None = None  # what was in use when the last was taken
        self._last = history.settings.tare
        self.stored: Tare | None = None
        self.message = ""
        history.changed.connect(self._keep)

    @property
    def taking(self) -> bool:
        return self._status.tare.taking

    @property
    def why_not(self) -> str:
        """Why no tare can be taken now, or nothing."""
        if self._status.sensor is None or self._status.state != "streaming":
            return "Nothing streams: connect a sensor to tare it."
        if self._aside:
            return "Not while calibrating: readings come as they are."
        return "A tare is being taken." if self.taking else ""

    @property
    def _recorded(self) -> bool:
        """Whether a recording is read, or is to be: what is in use with it is no sensor's now."""
        return (self._engine.source or "").startswith(RECORDED)

    # What a person wishes.

    def tare(self) -> None:
        """Take what is read now as the zero, unless the skin is loaded or moves."""
        if not self.why_not:
            self.message = ""
            self._engine.tare()
            self.changed.emit()

    def undo(self) -> None:
        """Go back to the tare before, or to none."""
        self.message = ""
        before = self._before if self._before != self._history.settings.tare else None
        self._history.change("Undo the tare", tare=before)
        self.changed.emit()

    # News.

    def follow(self, status: Status) -> None:
        """Take note of how the engine is doing."""
        was, self._status = self._status, status
        if status.sensor is not None and status.meetings != self._meetings:
            self._meetings = status.meetings
            self._find(status.sensor)
        news = status.tare
        if news != was.tare:
            self.message = news.refusal
            if news.tare is not None and news.ended != was.tare.ended:
                self._before = self._history.settings.tare
                self._history.change("Tare", tare=news.tare)
            self.changed.emit()
        elif (status.state, status.sensor) != (was.state, was.sensor):
            if status.state != "streaming":
                self.message = ""  # of a skin that is not there any more
            self.changed.emit()

    def stand_aside(self, aside: bool) -> None:
        """Take none while a calibration does without, or again."""
        if aside != self._aside:
            self._aside = aside
            self.changed.emit()

    def _find(self, sensor: Sensor) -> None:
        """Use the tare that is kept of a sensor just connected, and say so."""
        self.message, self.stored, self._before = "", None, None
        if sensor.simulated or self._recorded:
            return  # one begins anew each time, the other has the tare that it had
        try:
            found = self._tares.load(sensor.serial_number).fit_for(sensor)
        except Refusal as refusal:
            self.message = str(refusal)
            self.changed.emit()
            return
        if found is not None:
            self.stored = self._last = found
            if found != self._history.settings.tare:
                self._history.change("Use the stored tare", tare=found)
            self.told.emit(f"In use: the stored tare of {when(found)}")
        self.changed.emit()

    def _keep(self, settings: Settings) -> None:
        """Remember which tare of the sensor connected is in use, for the next time."""
        tare, sensor = settings.tare, self._status.sensor
        if tare == self._last:
            return
        self._last = tare
        if sensor is not None and not sensor.simulated and not self._recorded:
            try:
                self._tares.use(sensor.serial_number, tare if is_of(tare, sensor) else None)
            except Refusal as refusal:
                self.message = str(refusal)
        self.changed.emit()


def is_of(tare: Tare | None, sensor: Sensor) -> bool:
    """Whether there is a tare, and it is one of this sensor."""
    if tare is None:
        return False
    try:
        tare.check(sensor)
    except Refusal:
        return False
    return True


def when(tare: Tare) -> str:
    """When a tare was taken, and how long ago that is."""
    now = datetime.now().astimezone()
    return f"{tare.date.astimezone():%Y-%m-%d %H:%M} ({ago((now - tare.date).total_seconds())})"


def ago(seconds: float) -> str:
    """A time that passed in one number."""
    if seconds < 0:
        return "in the future: is this machine's clock right?"
    for length, unit in ((86400, "days"), (3600, "hours"), (60, "minutes")):
        if seconds >= 2 * length:
            return f"{seconds // length:.0f} {unit} ago"
    return f"{seconds:.0f} s ago"
