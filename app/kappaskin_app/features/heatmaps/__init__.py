"""Heatmaps: quantities of every element, one cell each, not interpolated."""

from collections.abc import Iterable
from functools import partial

import numpy as np

from kappaskin.frames import Estimate
from kappaskin.live import Status
from kappaskin_app.features.heatmaps.heatmap import Heatmap, HeatmapGrid
from kappaskin_app.guard import guarded
from kappaskin_app.shell.display import Display, Shown, of_row
from kappaskin_app.shell.settings import Settings, locked_at
from kappaskin_app.shell.window import MainWindow

_PERIOD = 0.06  # s between two drawings

_TIP = "Heatmaps of every element: curvature xx, yy, xy or others selected under View"


class HeatmapsFeature:
    name = "heatmaps"

    def install(self, shell: MainWindow) -> None:
        self._display: Display = shell.display
        self._next = 0.0
        self._names: tuple[str, ...] = ()
        self.maps = HeatmapGrid()
        self.heatmaps = self.maps.heatmaps
        shell.docks.put_right("curvature", "By element", self.maps, _TIP, share=0.22)
        self._list_maps(self.heatmaps)
        display, selection = shell.display, shell.selection
        display.limits.append(self._limits)
        display.restarted.connect(guarded(self._restart))
        display.status_shown.connect(guarded(self._show_status))
        display.numbers.connect(guarded(self._show_readings))
        display.shown.connect(guarded(self._show))
        shell.settings_shown.connect(guarded(self._show_settings))
        self._selection, self._requests = selection, shell.requests
        for heatmap in self.heatmaps.values():
            self._connect(heatmap)

    def _list_maps(self, names: Iterable[str]) -> None:
        """Offer pictures of the maps of these names."""
        shades = self._display.colouring.shades
        self._display.views["Picture of a &map"] = {
            f"the map of {label[0].lower()}{label[1:]}": self.heatmaps[name]
            for name, label in ((name, shades[name].label) for name in names)
        }

    def _connect(self, heatmap: Heatmap) -> None:
        selection, display = self._selection, self._display
        display.places.setdefault("heatmaps", []).append(heatmap.cells)
        heatmap.lock_wanted.connect(guarded(partial(self._requests.lock, heatmap.name)))
        heatmap.pointed.connect(guarded(selection.point))
        heatmap.pointed.connect(guarded(lambda *_: display.show_numbers_soon()))
        heatmap.chosen.connect(selection.chosen)
        selection.pointed.connect(guarded(heatmap.show_element))
        selection.target_changed.connect(guarded(heatmap.show_target))

    def _show_settings(self, settings: Settings) -> None:
        self._names = settings.maps
        self.maps.show_selected(settings.maps)
        for name, heatmap in self.heatmaps.items():
            heatmap.show_lock(locked_at(name, settings) > 0)

    def _limits(self) -> dict[str, float]:
        """Colour limits of the visible heatmaps, in SI units."""
        visible = [name for name in self._names if self.heatmaps[name].isVisible()]
        return {name: self.heatmaps[name].limit for name in visible}

    def _restart(self, status: Status) -> None:
        if status.sensor is None:
            return
        for heatmap in self.maps.add(self._display.colouring.shades):
            self._connect(heatmap)
        self._list_maps(self._display.colouring.maps)
        for heatmap in self.heatmaps.values():
            heatmap.show_layout(status.sensor.layout)

    def _show_status(self, _: Status) -> None:
        for heatmap in self.heatmaps.values():
            heatmap.show_lost(self._display.old)

    def _show_readings(self, estimate: Estimate | None) -> None:
        for name in self._names:
            values = np.empty(0)
            if estimate is not None:
                kinds = self._display.kinds(estimate)
                values = self._display.of_elements(name, estimate, kinds)
            self.heatmaps[name].show_reading(values)

    def _show(self, shown: Shown) -> None:
        if shown.now < self._next:
            return
        self._next = shown.now + _PERIOD
        display, estimate = self._display, shown.estimate
        crossed, dotted = display.marks(estimate.curvature)
        for name in self._names:
            heatmap, row = self.heatmaps[name], display.colouring.shades[name].row
            if heatmap.isVisible():
                values = display.of_elements(name, estimate, shown.kinds)
                heatmap.show_marks(crossed, dotted, of_row(row, shown.kinds))
                tint = display.tint(name, estimate, values, shown.now)
                heatmap.show_values(values, tint, of_row(row, shown.railed))
