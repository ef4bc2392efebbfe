"""Observability of shapes, and hard cases to try."""

import math
from functools import partial

from kappaskin_app.features.stability.demonstrations import Demonstrating
from kappaskin_app.features.stability.observability import Seeing
from kappaskin_app.features.stability.panel import StabilityPanel
from kappaskin_app.guard import guarded
from kappaskin_app.shell.window import MainWindow

_ABOUT = "Which shapes the elements see well, by singular values, and the hard cases"


class StabilityFeature:
    name = "stability"

    def install(self, shell: MainWindow) -> None:
        self._shell = shell
        session, stack = shell.session, shell.history.stack
        self.seeing, self.stability = Seeing(shell.history, shell.tasks, shell), StabilityPanel()
        self.demonstrating = Demonstrating(shell.history)
        shell.docks.put_below("stability", "Stability", self.stability, "F10", _ABOUT)
        shell.docks["stability"].visibilityChanged.connect(guarded(self.seeing.watch))
        session.reported.connect(guarded(self.seeing.follow))
        session.reported.connect(guarded(self.demonstrating.follow))
        session.reported.connect(
            guarded(lambda status: self.stability.show_status(status, session.inside))
        )
        shell.settings_shown.connect(guarded(self.stability.show_settings))
        self.stability.attend(self.seeing)
        self.stability.demonstrated.connect(guarded(self.demonstrating.demonstrate))
        self.stability.back.connect(guarded(stack.undo))
        self.stability.shown.connect(guarded(self._show_shape))
        stack.indexChanged.connect(guarded(self._show_back))
        self._show_back()
        shell.display.figures |= {
            "silent": partial(self._figure, "silent"),
            "condition": partial(self._figure, "condition"),
        }

    def _show_back(self, *_: object) -> None:
        self.stability.show_undo(self.demonstrating.demonstrates)

    def _show_shape(self) -> None:
        """Colour the skin by the shape that is looked at, while somebody looks and wants it."""
        session, selection = self._shell.session, self._shell.selection
        if session.closed:
            return  # the last panel hides while the window closes
        seen, setup = self.seeing.telling(), session.status.setup
        if seen is None or not self.stability.on_skin.isChecked():
            selection.show_mode(None)
            return
        number, count = self.seeing.chosen, len(seen.values)
        words = f"Colours: shape {number} of {count}, no measurement"
        selection.show_mode(seen.surface(number, setup.nx, setup.ny), words)

    def _figure(self, name: str) -> float:
        """A figure that a lesson may ask of; NaN while none is shown."""
        spectrum = self.seeing.seen
        if spectrum is None:
            return math.nan
        if name == "silent":
            return float(spectrum.silent)
        return math.inf if spectrum.silent else float(spectrum.values[0] / spectrum.values[-1])
