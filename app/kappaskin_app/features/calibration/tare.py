"""Tare: controller and panel."""

import math
from datetime import datetime

from PySide6.QtCore import QObject, Signal

from kappaskin.calibration import Tare, TareStore
from kappaskin.errors import Refusal
from kappaskin.live import Status
from kappaskin.sensing import Sensor
from kappaskin_app.guard import guarded
from kappaskin_app.shell.history import History
from kappaskin_app.shell.panel import Panel
from kappaskin_app.shell.session import RECORDED, Session
from kappaskin_app.shell.settings import Settings
from kappaskin_app.widgets.parts import button, in_a_row, plain_tip, sentence, text_label


class TareController(QObject):
    """Controller of tares, each an undoable setting.

    `message` is the reason why the last was refused or could not be stored; `stored` the tare that
    was found for this sensor when it was connected. `reported` emits what was done automatically,
    `changed` reports any change.
    """

    changed = Signal()
    reported = Signal(str)

    def __init__(
        self, history: History, session: Session, tares: TareStore, parent: QObject | None = None
    ) -> None:
        super().__init__(parent)
        self._history, self._session, self._tares = history, session, tares
        self._status = Status()
        self._connections, self._calibrating = 0, False
        self._before: Tare | None = None  # in use before the last one
        self._last = history.settings.tare
        self.stored: Tare | None = None
        self.message = ""
        history.changed.connect(self._store)

    @property
    def taking(self) -> bool:
        return self._status.tare.taking

    @property
    def why_not(self) -> str:
        """Reason why no tare can be taken now, or empty."""
        if self._status.sensor is None or self._status.state != "streaming":
            return "No readings: connect a sensor to tare it."
        if self._calibrating:
            return "Not during a calibration, which uses readings without a tare."
        return "A tare is being taken." if self.taking else ""

    @property
    def _recorded(self) -> bool:
        """Whether the source is a recording, whose tare is not that of a connected sensor."""
        return (self._session.engine.source or "").startswith(RECORDED)

    # Requests of the user.

    def tare(self) -> None:
        """Set the present readings as zero, unless the skin is loaded or moves."""
        if not self.why_not:
            self.message = ""
            self._session.engine.tare()
            self.changed.emit()

    def undo(self) -> None:
        """Return to the previous tare, or to none."""
        self.message = ""
        before = self._before if self._before != self._history.settings.tare else None
        self._history.change("Undo the tare", tare=before)
        self.changed.emit()

    # Input.

    def follow(self, status: Status) -> None:
        """Store the status of the engine, and use a tare that it has taken."""
        was, self._status = self._status, status
        if status.sensor is not None and status.connections != self._connections:
            self._connections = status.connections
            self._load_stored(status.sensor)
        state = status.tare
        if state != was.tare:
            self.message = state.refusal
            if state.tare is not None and state.ended != was.tare.ended:
                self._before = self._history.settings.tare
                self._history.change("Tare", tare=state.tare)
            self.changed.emit()
        elif (status.state, status.sensor) != (was.state, was.sensor):
            if status.state != "streaming":
                self.message = ""  # of a disconnected sensor
            self.changed.emit()

    def set_calibrating(self, aside: bool) -> None:
        """Refuse tares during a calibration."""
        if aside != self._calibrating:
            self._calibrating = aside
            self.changed.emit()

    def _load_stored(self, sensor: Sensor) -> None:
        """Use the stored tare of a sensor just connected, and report it."""
        self.message, self.stored, self._before = "", None, None
        if sensor.simulated or self._recorded:
            return  # a simulation starts without, a recording has its own
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
            self.reported.emit(f"In use: the stored tare of {when(found)}")
        self.changed.emit()

    def _store(self, settings: Settings) -> None:
        """Store the tare in use for the next connection of this sensor."""
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
    """Whether there is a tare, and it belongs to this sensor."""
    if tare is None:
        return False
    try:
        tare.check(sensor)
    except Refusal:
        return False
    return True


def when(tare: Tare) -> str:
    """Date of a tare, and its age."""
    now = datetime.now().astimezone()
    return f"{tare.date.astimezone():%Y-%m-%d %H:%M} ({ago((now - tare.date).total_seconds())})"


def ago(seconds: float) -> str:
    """An age in one number."""
    if seconds < 0:
        return "in the future; check this computer's clock"
    for length, unit in ((86400, "days"), (3600, "hours"), (60, "minutes")):
        if seconds >= 2 * length:
            return f"{seconds // length:.0f} {unit} ago"
    return f"{seconds:.0f} s ago"


_DEGREES = "\N{DEGREE SIGN}C"
_TAKE = "Set the present readings as zero (Ctrl+0). Refused while the skin is loaded or moves."
_DRIFT = (
    "RMS change of the unloaded readings since the tare, and the largest displacement to which "
    "it corresponds. Shown, never subtracted."
)


class TarePanel(Panel):
    """The tare in use and its drift."""

    purpose = (
        "Sets the present mean reading of every element as its zero: \u03ba = reading \u2212 "
        "zero. The skin must be at rest and unloaded, or a held contact would vanish."
    )
    guide_page = "connect"

    def __init__(self) -> None:
        super().__init__("Tare")
        self.what = text_label()
        self.drift = text_label(tip=_DRIFT)
        self.take = button("Tare now", "tare-now", _TAKE)
        self.undo = button(
            "Undo tare", "undo-tare", "Return to the previous tare, or to none (Ctrl+Z undoes)."
        )
        self.body.addLayout(in_a_row(self.take, self.undo))
        self.body.addWidget(self.what)
        self.body.addWidget(self.drift)
        self._tare_controller: TareController | None = None
        self._tare: Tare | None = None
        self._status = Status()
        self._show()

    def connect_to(self, tare_controller: TareController) -> None:
        """Show the state of `tare_controller`, and pass the user's requests to it."""
        self._tare_controller = tare_controller
        self.take.clicked.connect(guarded(lambda *_: tare_controller.tare()))
        self.undo.clicked.connect(guarded(lambda *_: tare_controller.undo()))
        tare_controller.changed.connect(guarded(self._show))

    def show_settings(self, settings: Settings) -> None:
        self._tare = settings.tare
        self.undo.setEnabled(self._tare is not None)
        self._show()

    def show_status(self, status: Status, simulating: bool) -> None:
        self._status = status
        self._show()

    def _show(self) -> None:
        tare_controller, status, tare = self._tare_controller, self._status, self._tare
        for label, text in ((self.what, self._description()), (self.drift, drift_text(status))):
            if text != label.text():
                label.setText(text)
            label.setVisible(bool(text))
        why_not = tare_controller.why_not if tare_controller else ""
        self.take.setEnabled(tare_controller is not None and not why_not)
        self.take.setText("Taring\N{HORIZONTAL ELLIPSIS}" if status.tare.taking else "Tare now")
        self.take.setToolTip(plain_tip(why_not or _TAKE))
        alarm = (tare_controller.message if tare_controller else "") or unfit(tare, status)
        hint = "" if status.tare.taking else why_not
        self.show_message(sentence(alarm or hint), hint=not alarm)

    def _description(self) -> str:
        """Text of the tare in use."""
        tare = self._tare
        if tare is None:
            return "Not tared."
        stored = self._tare_controller is not None and tare == self._tare_controller.stored
        return f"{'Stored: taken' if stored else 'Taken'} {when(tare)}" + temperature_text(
            tare.temperature, self._status.temperature
        )


def temperature_text(then: float | None, now: float) -> str:
    """Text of the temperatures at the tare and now, where known."""
    if then is None:
        return ""
    present = f", now {now:.1f} {_DEGREES}" if math.isfinite(now) else ""
    return f",\nat {then:.1f} {_DEGREES}{present}"


def drift_text(status: Status) -> str:
    """Text of the drift since the tare in use; empty without one."""
    drift = status.drift
    if drift is None:
        return ""
    if not math.isfinite(drift.curvature):
        wait = "the skin is loaded" if drift.loaded else "wait two seconds"
        return f"Drift since the tare: unknown, {wait}"
    then = ", before the load" if drift.loaded else ""
    sensor, by = status.sensor, f"{drift.curvature:.3f} 1/m"
    if sensor is not None and sensor.layout.reads:
        unit = sensor.layout.units if sensor.sigma is None else "times the noise"
        by = f"{drift.curvature:.2g} {unit}"
    return (
        f"Drift since the tare: {by} (RMS), equal to a displacement of "
        f"{1e3 * drift.displacement:.3f} mm{then}"
    )


def unfit(tare: Tare | None, status: Status) -> str:
    """Reason why a tare is not in use with the connected sensor, or empty."""
    if tare is None or status.sensor is None:
        return ""
    try:
        tare.check(status.sensor)
    except Refusal as refusal:
        return f"Not in use: {refusal}"
    return ""
