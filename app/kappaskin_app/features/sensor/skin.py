"""The simulated skin: its shape, its elements and what is below it."""

import math
from contextlib import suppress

from PySide6.QtWidgets import QLabel, QWidget

from kappaskin.bases import edges_of
from kappaskin.errors import Refusal
from kappaskin.live import Status
from kappaskin_app.shell.form import SimulationForm
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.simulation import patch_of
from kappaskin_app.shell.skins import SHAPES
from kappaskin_app.shell.states import in_use

_PREPARING = "Computing this skin; the last one stays until then."
_NUMBERS = ("side_x", "side_y", "base_radius", "rim_radius")


class ShapePanel(SimulationForm):
    """Asks for the shape, its sizes and its edge; says why there can be no such skin."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Shape", ("shape", *_NUMBERS, "edge"), parent)
        self.opening = QLabel()
        self._opening_name = QLabel("Opening")
        self._opening_name.setToolTip("The angle of the arc: its length over its radius.")
        self.form.insertRow(len(_NUMBERS) + 1, self._opening_name, self.opening)
        self._refusal, self._preparing = "", False

    def show_settings(self, settings: Settings) -> None:
        super().show_settings(settings)
        asked = set(SHAPES[settings.shape].asks)
        self.show_rows({"shape", "edge"} | asked)
        with suppress(Refusal):  # what cannot be is said below
            self.offer("edge", edges_of(patch_of(settings)))
        self.form.setRowVisible(self.opening, "base_radius" in asked)
        degrees = math.degrees(settings.side_x / settings.base_radius)
        self.opening.setText(f"{degrees:.1f}\N{DEGREE SIGN}")

    def show_refusal(self, text: str) -> None:
        """Say why the skin asked for cannot be, or nothing when it can."""
        self._refusal = text

    def show_preparing(self, preparing: bool) -> None:
        """Say that the skin asked for is on its way."""
        self._preparing = preparing

    def show_status(self, status: Status, simulating: bool) -> None:
        super().show_status(status, simulating)
        if simulating and self._preparing:
            self.show_message(_PREPARING, hint=True)

    def alarm(self, status: Status) -> str:
        return f"The last skin stays: {self._refusal}." if self._refusal else ""


class ElementsPanel(SimulationForm):
    """Asks for m x n elements, and says when they are too few for the functions of the fit."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Elements", ("elements_x", "elements_y"), parent)

    def alarm(self, status: Status) -> str:
        return in_use(status)


class SupportPanel(SimulationForm):
    """Asks for what holds the skin besides its own stiffness."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Below and around", ("tension", "foam", "fluid"), parent)
