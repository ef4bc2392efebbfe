"""The zero that readings are taken from: taken now, undone, and how far it wandered."""

import math

from PySide6.QtWidgets import QWidget

from kappaskin.calibration import Tare
from kappaskin.errors import Refusal
from kappaskin.live import Status
from kappaskin_app.features.calibration.taring import Taring, when
from kappaskin_app.guard import guarded
from kappaskin_app.shell.panel import Panel
from kappaskin_app.shell.settings import Settings
from kappaskin_app.widgets.parts import button, in_a_row, sentence, text_label

_DEGREES = "\N{DEGREE SIGN}C"
_TAKE = "What is read now is zero from now on (Ctrl+0). Refused while the skin is loaded or moves."
_DRIFT = (
    "How far the readings of the unloaded skin have wandered since the tare: their root mean "
    "square, and the largest displacement that it looks like. It is shown, never taken off."
)


class TarePanel(Panel):
    """Says which tare is in use and how it does."""

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
        """Show how `taring` goes, and tell it what a person wishes."""
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
            return "None: every element reads from a zero of its own."
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
