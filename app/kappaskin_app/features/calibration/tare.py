"""Tare: taken, undone and found again; and its panel."""

import math
from datetime import datetime

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QWidget

from kappaskin.calibration import Tare, TareStore
from kappaskin.errors import Refusal
from kappaskin.live import Engine, Status
from kappaskin.sensing import Sensor
from kappaskin_app.guard import guarded
from kappaskin_app.shell.history import History
from kappaskin_app.shell.panel import Panel
from kappaskin_app.shell.session import RECORDED
from kappaskin_app.shell.settings import Settings
from kappaskin_app.widgets.parts import button, in_a_row, sentence, text_label


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
        self._connections, self._aside = 0, False
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

    # Requests of the user.

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
        if status.sensor is not None and status.connections != self._connections:
            self._connections = status.connections
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


_DEGREES = "\N{DEGREE SIGN}C"
_TAKE = "What is read now is zero from now on (Ctrl+0). Refused while the skin is loaded or moves."
_DRIFT = (
    "How far the readings of the unloaded skin have wandered since the tare: their root mean "
    "square, and the largest displacement that it looks like. It is shown, never taken off."
)


class TarePanel(Panel):
    """Says which tare is in use and how it does."""

    purpose = (
        "Takes the mean of what every element reads now for its zero: \u03ba = reading \u2212 "
        "zero. The skin must be at rest and free, or a contact that is held would vanish."
    )
    guide_page = "connect"

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Tare", parent)
        self.what = text_label()
        self.drift = text_label(tip=_DRIFT)
        self.take = button("Tare now", "tare-now", _TAKE)
        self.undo = button(
            "Undo tare", "undo-tare", "Use the tare before, or none (Ctrl+Z takes it back)."
        )
        self.body.addLayout(in_a_row(self.take, self.undo))
        self.body.addWidget(self.what)
        self.body.addWidget(self.drift)
        self._taring: Taring | None = None
        self._tare: Tare | None = None
        self._status = Status()
        self._tell()

    def attend(self, taring: Taring) -> None:
        """Show how `taring` goes, and pass on what the user requests."""
        self._taring = taring
        self.take.clicked.connect(guarded(lambda *_: taring.tare()))
        self.undo.clicked.connect(guarded(lambda *_: taring.undo()))
        taring.changed.connect(guarded(self._tell))

    def show_settings(self, settings: Settings) -> None:
        self._tare = settings.tare
        self.undo.setEnabled(self._tare is not None)
        self._tell()

    def show_status(self, status: Status, simulating: bool) -> None:
        self._status = status
        self._tell()

    def _tell(self) -> None:
        taring, status, tare = self._taring, self._status, self._tare
        for label, text in ((self.what, self._words()), (self.drift, drift_words(status))):
            if text != label.text():
                label.setText(text)
            label.setVisible(bool(text))
        why_not = taring.why_not if taring else ""
        self.take.setEnabled(taring is not None and not why_not)
        self.take.setText("Taring\N{HORIZONTAL ELLIPSIS}" if status.tare.taking else "Tare now")
        self.take.setToolTip(why_not or _TAKE)
        alarm = (taring.message if taring else "") or unfit(tare, status)
        hint = "" if status.tare.taking else why_not
        self.show_message(sentence(alarm or hint), hint=not alarm)

    def _words(self) -> str:
        """Which tare is in use, in words."""
        tare = self._tare
        if tare is None:
            return "Not tared."
        stored = self._taring is not None and tare == self._taring.stored
        return f"{'Stored: taken' if stored else 'Taken'} {when(tare)}" + warmth(
            tare.temperature, self._status.temperature
        )


def warmth(then: float | None, now: float) -> str:
    """At which temperature a tare was taken, and which it is now, where that is known."""
    if then is None:
        return ""
    beside = f", now {now:.1f} {_DEGREES}" if math.isfinite(now) else ""
    return f",\nat {then:.1f} {_DEGREES}{beside}"


def drift_words(status: Status) -> str:
    """How far the tare in use has wandered, in words; nothing without one."""
    drift = status.drift
    if drift is None:
        return ""
    if not math.isfinite(drift.curvature):
        wait = "the skin is loaded" if drift.loaded else "wait two seconds"
        return f"Drift since: not known yet, {wait}"
    then = ", before the load" if drift.loaded else ""
    return (
        f"Drift since: {drift.curvature:.3f} 1/m (RMS), as if moved by "
        f"{1e3 * drift.displacement:.3f} mm{then}"
    )


def unfit(tare: Tare | None, status: Status) -> str:
    """Why a tare is not in use with the sensor that is connected, or nothing."""
    if tare is None or status.sensor is None:
        return ""
    try:
        tare.check(status.sensor)
    except Refusal as refusal:
        return f"Not in use: {refusal}"
    return ""
