"""Panels of the simulated sensor: skin, elements, electronics, scanned region."""

import time

from kappaskin_app.features.sensor.panel import (
    ElectronicsPanel,
    ElementsPanel,
    GagesPanel,
    RegionPanel,
    ShapePanel,
    StretchingPanel,
    SupportPanel,
)
from kappaskin_app.guard import guarded
from kappaskin_app.shell.pages import SENSOR, SKIN
from kappaskin_app.shell.window import MainWindow

_UPDATE = 1.0  # s between two updates of the scan's trade-off


class SensorFeature:
    name = "sensor"

    def install(self, shell: MainWindow) -> None:
        self._shell, self._next = shell, 0.0
        add, session = shell.panels.add, shell.session
        self.shape, self.elements = add(SKIN, ShapePanel()), add(SKIN, ElementsPanel())
        self.support = add(SKIN, SupportPanel())
        self.stretching = add(SKIN, StretchingPanel())
        self.electronics = add(SENSOR, ElectronicsPanel())
        self.gages = add(SENSOR, GagesPanel())
        self.region = add(SENSOR, RegionPanel())
        session.refused.connect(guarded(self.shape.show_refusal))
        session.preparing.connect(guarded(self.shape.show_preparing))
        session.reported.connect(guarded(self._show_tradeoff))
        shell.selection.chosen.connect(guarded(self._choose))

    def _show_tradeoff(self, *_: object) -> None:
        now = time.monotonic()
        if now >= self._next:
            self._next = now + _UPDATE
            self.region.show_tradeoff(self._shell.session.scan_tradeoff())

    def _choose(self, element: int) -> None:
        """Add an element to the selected ones, or remove it."""
        history = self._shell.history
        if history.settings.region == "elements":
            selected = set(history.settings.region_elements) ^ {element}
            history.change("Select elements", region_elements=tuple(sorted(selected)))
