"""All views of a window: what comes from the session, in each of them."""

import math
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QObject, Signal

from kappaskin.estimation import FAULTS
from kappaskin.frames import COMPONENTS, Estimate
from kappaskin.live import Status
from kappaskin_app.colouring import Colouring
from kappaskin_app.maps import Maps
from kappaskin_app.measuring import Measuring
from kappaskin_app.overlaying import Overlaying
from kappaskin_app.scale import Ranges, locked_at
from kappaskin_app.session import Session
from kappaskin_app.settings import Settings
from kappaskin_app.shades import SHADES, Tint
from kappaskin_app.theme import DIVERGING, LIGHT, Theme
from kappaskin_app.touching import touches_at
from kappaskin_app.views.badge import GAP, LOST, OFF, STALE, WAITING, Badge
from kappaskin_app.views.colour_bar import SkinScale
from kappaskin_app.views.membrane import MembraneView
from kappaskin_app.views.notice import Notice, warnings
from kappaskin_app.views.readouts import Health, Readouts

_OLD = (LOST, OFF, STALE, WAITING, GAP)  # what is shown is not so now
_HINT, _NO_LOAD_HINT = "Drag the red arrow to move the load; F1: shortcuts", "F1: shortcuts"
_HEATMAPS = 0.06  # s between two drawings of the heatmaps
_NUMBERS = 0.2  # s between two readouts: faster cannot be read
_UNKNOWN = {
    "difference": "No simulation: the true surface is not known",
    "error_bar": "Computing how sure the surface is\N{HORIZONTAL ELLIPSIS}",
}

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Kinds = NDArray[np.uint8]


class Display(QObject):
    """The views, and in which colours and how high they show what the `session` brings.

    `pointed` tells which element is pointed at, -1 none.
    """

    pointed = Signal(int)

    def __init__(self, session: Session) -> None:
        super().__init__()
        self._session = session
        self.membrane, self.badge, self.readouts = MembraneView(), Badge(), Readouts()
        self.scale, self.notice = SkinScale(), Notice(_HINT)
        self.maps, self.colouring = Maps(), Colouring()
        self.heatmaps = self.maps.heatmaps
        self.measuring = Measuring(self.membrane)
        self.overlays = Overlaying(self.membrane, self.colouring, session)
        self.ranges = Ranges()
        self._settings = Settings()
        self._mode: Array | None = None
        self.alarming = True
        """Whether the skin's picture says why nothing comes in, as nothing else does."""
        self.old = True
        """Whether what is shown is not coming in any more."""
        self._missing = LIGHT.missing
        self._met, self._asked, self._element = 0, -1, -1
        self._out = np.empty(0, np.intp)  # elements that are left out
        self._colours: object = None
        self._next_heatmaps = self._next_numbers = 0.0

    def point(self, element: int) -> None:
        """Point at an element in every view; -1 at none."""
        if element == self._element:
            return
        self._element = element
        self.membrane.point(element)
        self.pointed.emit(element)
        for heatmap in self.heatmaps.values():
            heatmap.show_element(element)
        self._next_numbers = 0.0

    def show_settings(self, settings: Settings) -> None:
        self._settings = settings
        self.maps.show_those(settings.maps)
        for name, heatmap in self.heatmaps.items():
            heatmap.show_lock(locked_at(name, settings) > 0)
        self.scale.lock.show_locked(locked_at(settings.colour_by, settings) > 0)
        self._allow_lock()
        s = settings
        self.membrane.show_box((s.from_x, s.to_x, s.from_y, s.to_y, s.from_z, s.to_z))
        self.membrane.show_options(settings.show_elements, settings.show_truth)
        self.membrane.gaze.show(settings.look, settings.camera)

    def limit_shown(self) -> float:
        """How far the colours of the skin reach, in SI units."""
        return self.scale.bar.reach / SHADES[self._settings.colour_by].scale

    def limits_shown(self) -> dict[str, float]:
        """How far the colours of the skin and of each heatmap reach, by the setting of its range.

        In SI units; of those alone that are seen.
        """
        settings, maps = self._settings, self.heatmaps
        found = {name: maps[name].limit for name in settings.maps if maps[name].isVisible()}
        if self._mode is None:
            found[settings.colour_by] = self.limit_shown()
        return {f"range_{name}": limit for name, limit in found.items() if name != "health"}

    def show_mode(self, mode: Array | None, words: str = "") -> None:
        """Colour the skin by a shape (ny, nx) from -1 to 1 instead, which `words` say, or not."""
        self._mode = mode
        self.membrane.show_caption(words if mode is not None else "")
        self._allow_lock()

    def _allow_lock(self) -> None:
        """Some colours have no range to keep."""
        self.scale.lock.setEnabled(self._mode is None and self._settings.colour_by != "health")

    def show_theme(self, theme: Theme) -> None:
        self._missing = theme.missing
        self.measuring.ruler.show_theme(theme)
        for view in (
            self.membrane,
            self.badge,
            self.readouts,
            self.notice,
            *self.heatmaps.values(),
        ):
            view.show_theme(theme)

    def show_status(self, status: Status) -> None:
        self.colouring.follow(status)
        if status.sensor is not None and status.meetings != self._met:
            self._meet(status)
        state = self._session.badge()
        self.badge.show_state(state, status.recording.active)
        self.membrane.alarm.show(self._session.alarm() if self.alarming else "")
        self.old = lost = state in _OLD
        for view in (self.membrane, *self.heatmaps.values()):
            view.show_lost(lost)
        if lost:
            self.overlays.hide()
        self._show_numbers(status, lost)

    def _meet(self, status: Status) -> None:
        sensor, setup = status.sensor, status.setup
        if sensor is None:
            return
        self._element = -1
        self._met, self._out = status.meetings, np.empty(0, np.intp)
        self.membrane.show_skin(sensor, setup.nx, setup.ny)
        self.ranges = Ranges(1e3 * max(sensor.layout.patch.a, sensor.layout.patch.b))
        for heatmap in self.heatmaps.values():
            heatmap.show_layout(sensor.layout)

    def _show_numbers(self, status: Status, lost: bool) -> None:
        now = time.monotonic()
        if now < self._next_numbers:
            return
        self._next_numbers = now + _NUMBERS
        recent = [] if lost else self._ages(now)
        counts = status.accounting
        self.readouts.show_health(
            Health(
                status.rate,
                len(recent),
                float(np.median(recent)) if recent else math.nan,
                self.membrane.age_sd,
                counts.lost,
                counts.bytes_discarded,
                status.skipped,
            )
        )
        estimate = self.estimate_shown()
        self.readouts.show_estimate(estimate)
        self._warn(estimate)
        for name in self._settings.maps:
            values = np.empty(0)
            if estimate is not None:
                values = self._of_elements(name, estimate, self._kinds(estimate))
            self.heatmaps[name].show_reading(values)

    def _ages(self, now: float) -> list[float]:
        """How old in s what was drawn within the last second was."""
        return [age for when, age in self.membrane.ages if when > now - 1.0]

    def age(self) -> tuple[float, bool]:
        """How old in s what is drawn is, and whether that is only the least."""
        recent = self._ages(time.monotonic())
        known = math.isfinite(self.membrane.age_sd)
        return (float(np.median(recent)) if recent else math.nan), not known

    def _warn(self, estimate: Estimate | None) -> None:
        there = self._session.inside and estimate is not None and self._session.scene.stimuli
        self.notice.show_hint(_HINT if there else _NO_LOAD_HINT)
        told = [self._session.stranger()]
        if estimate is not None:
            crossed, _ = self.marks(estimate.curvature)
            told.append(warnings(estimate, int(crossed.sum())))
        self.notice.show_warning("; ".join(filter(None, told)))

    def estimate_shown(self) -> Estimate | None:
        """The newest estimate, None while what it shows is not coming in any more."""
        lost = self._session.badge() in _OLD
        return None if lost else self._session.estimate

    def show_estimate(self, estimate: Estimate) -> None:
        if not self.membrane.ready:
            return  # a picture is due; the next tick brings a newer estimate
        settings, now = self._settings, time.monotonic()
        self.ranges.limit("displacement", 1e3 * estimate.surface, settings, now)
        kinds = self._kinds(estimate)
        railed = self._railed(estimate, kinds)
        self._colour_skin(estimate, kinds, railed, now)
        self._show_loads(estimate)
        self.overlays.show(estimate, settings, self._times())
        self.measuring.show(estimate)
        if now >= self._next_heatmaps:
            self._next_heatmaps = now + _HEATMAPS
            self._show_heatmaps(estimate, kinds, railed, now)

    def _colour_skin(self, estimate: Estimate, kinds: Kinds, railed: Mask, now: float) -> None:
        name, times = self._settings.colour_by, self._times()
        mode, shade, beside = self._mode, SHADES[name], ()
        if mode is not None and mode.shape == estimate.surface.shape:
            tint, values = Tint(DIVERGING, (-1.0, 1.0), "shape"), mode
        elif shade.surface and self._settings.colour_from == "smooth":
            values = self.colouring.on_surface(name, estimate)
            tint = self._tint(name, estimate, values, now)
        else:
            of_elements = self._of_elements(name, estimate, kinds)
            tint, on_rail = self._tint(name, estimate, of_elements, now), _of_row(name, railed)
            values = tint.rgb(of_elements, self._missing, on_rail)
            beside = tint.legend(of_elements, self._missing, on_rail)
        self._show_colours(tint)
        self._say_unknown(name, values)
        self.membrane.show_estimate(estimate, values, tint.limits, times)
        self.scale.bar.show_tint(tint, beside)
        self.scale.show_what("" if tint.unit == "shape" else shade.symbol, shade.tip)
        self.scale.show_times(times)

    def _show_heatmaps(self, estimate: Estimate, kinds: Kinds, railed: Mask, now: float) -> None:
        crossed, dotted = self.marks(estimate.curvature)
        self._out = np.flatnonzero(kinds.any(axis=0))
        self.membrane.show_marked(self._out, self._asked)
        for name in self._settings.maps:
            heatmap = self.heatmaps[name]
            if heatmap.isVisible():
                values = self._of_elements(name, estimate, kinds)
                heatmap.show_marks(crossed, dotted, _of_row(name, kinds))
                tint = self._tint(name, estimate, values, now)
                heatmap.show_values(values, tint, _of_row(name, railed))

    def _of_elements(self, name: str, estimate: Estimate, kinds: Kinds) -> Array:
        """What to colour the elements (P,) by, on the screen's scale."""
        if name == "health":
            return kinds.max(axis=0).astype(float)
        return self.colouring.of_elements(name, estimate)

    def _tint(self, name: str, estimate: Estimate, values: Array, now: float) -> Tint:
        shade, at_rest = SHADES[name], self.colouring.at_rest(name, estimate)
        if name in COMPONENTS:  # whatever is shown of them, one range for the skin and the map
            values = estimate.curvature[COMPONENTS.index(name)]
        elif name == "displacement":
            values = 1e3 * estimate.surface
        limit = self.ranges.limit(name, values - at_rest, self._settings, now)
        pulled = name == "displacement" and self.ranges.pulled(values)
        return shade.tint(limit, at_rest, pulled)

    def _say_unknown(self, name: str, values: NDArray[Any]) -> None:
        """Say in the picture why there are no colours."""
        known = name == "health" or values.dtype == np.uint8 or bool(np.isfinite(values).any())
        if self._mode is None:
            self.membrane.show_caption("" if known else _UNKNOWN.get(name, ""))

    def _railed(self, estimate: Estimate, kinds: Kinds) -> Mask:
        """Which readings (3, P) stand on a rail, as far as that is known."""
        status = self._session.status
        on_rail = kinds == FAULTS.index("saturated")
        if status.sensor is not None and status.region.around == "off":
            # Every channel was scanned: what lives and has no reading is at the end of its range.
            on_rail |= np.isnan(estimate.nominal) & status.sensor.layout.live & (kinds == 0)
        return on_rail

    def _kinds(self, estimate: Estimate) -> Kinds:
        """Why each channel (3, P) is left out, by number in `FAULTS`; 0 where it is not."""
        found = np.zeros(estimate.curvature.shape, np.uint8)
        for finding in self._session.status.health.findings:
            if finding.element < len(estimate.suspect):  # or it is of another skin
                row = COMPONENTS.index(finding.component)
                found[row, finding.element] = FAULTS.index(finding.kind)
        # What the fit itself suspects, it suspects of an element as a whole.
        whole = np.where(found.any(axis=0), 0, estimate.suspect)
        return np.maximum(found, whole)

    def ask_for(self, element: int) -> None:
        """Show which element is to be pressed; -1 for none."""
        self._asked = element
        self.membrane.show_marked(self._out, element)
        for heatmap in self.heatmaps.values():
            heatmap.show_wanted(element)

    def marks(self, curvature: Array) -> tuple[Mask, Mask]:
        """Which elements are bent beyond their strain limit, and which were chosen to scan."""
        sensor, settings = self._session.status.sensor, self._settings
        none = np.zeros(curvature.shape[1], bool)
        crossed = none if sensor is None else sensor.transduction.overstrained(curvature)
        dotted = none.copy()
        if settings.region == "elements":
            dotted[[p for p in settings.region_elements if p < len(none)]] = True
        return crossed, dotted

    def _times(self) -> float:
        """How many times the displacement is drawn larger: as wanted, or as much as fits."""
        fits = self.membrane.skin.deepest / self.ranges.deepest()
        return min(self._settings.exaggeration, fits)

    def _show_colours(self, tint: Tint) -> None:
        if tint.colours is not self._colours:
            self._colours = tint.colours
            self.membrane.show_colours(tint.colours, tint.ink)

    def _show_loads(self, estimate: Estimate) -> None:
        session = self._session
        time = session.status.playing.time(estimate.device_time)
        touches = touches_at(session.scene, time) if session.inside else ()
        self.membrane.show_loads([touch.load for touch in touches])

    def close(self) -> None:
        """Before the window goes: end what is computed beside it, and give VTK's resources back."""
        self.colouring.close()
        self.membrane.close_plotter()


def _of_row(name: str, of_channels: NDArray[Any]) -> NDArray[Any]:
    """What holds for the elements (P,), of what holds for channels (3, P).

    Of that component which a quantity is made from, or of any of them.
    """
    component = name.removeprefix("residual_")
    row = of_channels[COMPONENTS.index(component)] if component in COMPONENTS else None
    return of_channels.max(axis=0) if row is None else row
