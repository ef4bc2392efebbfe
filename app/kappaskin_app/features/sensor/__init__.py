"""The simulated sensor: skin, elements, electronics; and the region that is scanned."""

import time

from kappaskin_app.features.sensor.panel import (
    ElectronicsPanel,
    ElementsPanel,
    RegionPanel,
    ShapePanel,
    SpoilsPanel,
    SupportPanel,
)
from kappaskin_app.guard import guarded
from kappaskin_app.shell.pages import SENSOR, SKIN
from kappaskin_app.shell.window import MainWindow

_EACH = 1.0  # s between two looks at what a region buys


class SensorFeature:
    name = "sensor"

    def install(self, shell: MainWindow) -> None:
        self._shell, self._next = shell, 0.0
        add, session = shell.panels.add, shell.session
        self.shape, self.elements = add(SKIN, ShapePanel()), add(SKIN, ElementsPanel())
        self.support = add(SKIN, SupportPanel())
        self.electronics = add(SENSOR, ElectronicsPanel())
        self.spoils = add(SENSOR, SpoilsPanel())
        self.region = add(SENSOR, RegionPanel())
        session.refused.connect(guarded(self.shape.show_refusal))
        session.preparing.connect(guarded(self.shape.show_preparing))
        session.reported.connect(guarded(self._show_bargain))
        shell.selection.chosen.connect(guarded(self._choose))

    def _show_bargain(self, *_: object) -> None:
        now = time.monotonic()
        if now >= self._next:
            self._next = now + _EACH
            self.region.show_bargain(self._shell.session.scan_tradeoff())

    def _choose(self, element: int) -> None:
        """Take an element into the region of those chosen, or out of it."""
        history = self._shell.history
        if history.settings.region == "elements":
            chosen = set(history.settings.region_elements) ^ {element}
            history.change("Choose elements", region_elements=tuple(sorted(chosen)))
