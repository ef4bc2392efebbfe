"""Stability: observability of the modes, and hard cases."""

import math
from functools import partial

from kappaskin_app.features.stability.demonstrations import Demonstrator
from kappaskin_app.features.stability.observability import Observability
from kappaskin_app.features.stability.panel import StabilityPanel
from kappaskin_app.guard import guarded
from kappaskin_app.shell.selection import SkinMap
from kappaskin_app.shell.window import MainWindow
from kappaskin_app.widgets.tint import Tint

_ABOUT = "Observability of the modes by their singular values, and hard cases to try"


class StabilityFeature:
    name = "stability"

    def install(self, shell: MainWindow) -> None:
        self._shell = shell
        session, stack = shell.session, shell.history.stack
        self.observability = Observability(shell.history, shell.tasks, shell)
        self.stability = StabilityPanel()
        self.demonstrator = Demonstrator(shell.history)
        shell.docks.put_below("stability", "Stability", self.stability, "F10", _ABOUT)
        shell.docks["stability"].visibilityChanged.connect(guarded(self.observability.set_active))
        session.reported.connect(guarded(self.observability.follow))
        session.reported.connect(guarded(self.demonstrator.follow))
        session.reported.connect(
            guarded(lambda status: self.stability.show_status(status, session.inside))
        )
        shell.settings_shown.connect(guarded(self.stability.show_settings))
        self.stability.connect_to(self.observability)
        self.stability.demonstrated.connect(guarded(self.demonstrator.demonstrate))
        self.stability.back.connect(guarded(stack.undo))
        self.stability.shown.connect(guarded(self._show_shape))
        stack.indexChanged.connect(guarded(self._show_back))
        self._show_back()
        shell.display.figures |= {
            "silent": partial(self._figure, "silent"),
            "condition": partial(self._figure, "condition"),
        }

    def _show_back(self, *_: object) -> None:
        self.stability.show_undo(self.demonstrator.demonstrates)

    def _show_shape(self) -> None:
        """Colour the skin by the selected mode, while the panel is visible and the option is on."""
        session, selection = self._shell.session, self._shell.selection
        if session.closed:
            return  # the last panel hides while the window closes
        spectrum, setup = self.observability.selected(), session.status.setup
        if spectrum is None or not self.stability.on_skin.isChecked():
            selection.show_map(None)
            return
        number, count = self.observability.number, len(spectrum.values)
        text = f"Colours: mode {number} of {count}, no measurement"
        values = spectrum.surface(number, setup.nx, setup.ny)
        selection.show_map(SkinMap(values, Tint("diverging", (-1.0, 1.0), "shape"), text))

    def _figure(self, name: str) -> float:
        """A figure for the lessons; NaN while there is none."""
        spectrum = self.observability.visible_spectrum
        if spectrum is None:
            return math.nan
        if name == "silent":
            return float(spectrum.silent)
        return math.inf if spectrum.silent else float(spectrum.values[0] / spectrum.values[-1])
