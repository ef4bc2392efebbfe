"""All views of a window: what comes from the session, in each of them."""

import math
import time

import numpy as np
from numpy.typing import NDArray

from kappaskin import COMPONENTS, WHY, Estimate, Status
from kappaskin_app.scale import Ranges, locked_at
from kappaskin_app.session import Session
from kappaskin_app.settings import Settings
from kappaskin_app.theme import DARK_INK, DIVERGING, LIGHT_INK, PULLED, SEQUENTIAL, Colours, Theme
from kappaskin_app.touching import touches_at
from kappaskin_app.views.badge import GAP, LOST, OFF, STALE, WAITING, Badge
from kappaskin_app.views.colour_bar import SkinScale
from kappaskin_app.views.heatmap import Array, Heatmap, Mask
from kappaskin_app.views.membrane import MembraneView
from kappaskin_app.views.notice import Notice, warnings
from kappaskin_app.views.readouts import Health, Readouts

_OLD = (LOST, OFF, STALE, WAITING, GAP)  # what is shown is not so now
_HINT, _NO_LOAD_HINT = "Drag the red arrow to move the load; F1: shortcuts", "F1: shortcuts"
_HEATMAPS = 0.06  # s between two drawings of the heatmaps
_NUMBERS = 0.2  # s between two readouts: faster cannot be read
_TIPS = {
    "xx": "Bending along x as each element reads it (Eq. 3).",
    "yy": "Bending along y as each element reads it (Eq. 4).",
    "xy": "Twist as each element reads it (Eq. 5).",
}


class Display:
    """The views, and in which colours and how high they show what the `session` brings."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self.membrane, self.badge, self.readouts = MembraneView(), Badge(), Readouts()
        self.scale, self.notice = SkinScale(), Notice(_HINT)
        self.heatmaps = {name: Heatmap(name, _TIPS[name]) for name in COMPONENTS}
        self.ranges = Ranges()
        self._settings = Settings()
        self._mode: Array | None = None
        self.alarming = True
        """Whether the skin's picture says why nothing comes in, as nothing else does."""
        self.old = True
        """Whether what is shown is not coming in any more."""
        self._met, self._asked = 0, -1
        self._out = np.empty(0, np.intp)  # elements that are left out
        self._colours: object = None
        self._next_heatmaps = self._next_numbers = 0.0

    def point(self, element: int) -> None:
        """Point at an element in every heatmap; -1 at none."""
        for heatmap in self.heatmaps.values():
            heatmap.show_element(element)
        self._next_numbers = 0.0

    def show_settings(self, settings: Settings) -> None:
        self._settings = settings
        for name, heatmap in self.heatmaps.items():
            heatmap.show_lock(locked_at(name, settings) > 0)
        self.scale.lock.show_locked(locked_at(settings.colour_by, settings) > 0)
        self.membrane.show_options(settings.show_elements, settings.show_truth)

    def limit_shown(self) -> float:
        """Up to where the colours of the skin go, in SI units."""
        largest = max(abs(limit) for limit in self.scale.bar.limits)
        return largest * (1e-3 if self._settings.colour_by == "displacement" else 1.0)

    def show_mode(self, mode: Array | None, words: str = "") -> None:
        """Colour the skin by a shape (ny, nx) from -1 to 1 instead, which `words` say, or not."""
        self._mode = mode
        self.membrane.show_caption(words if mode is not None else "")
        self.scale.lock.setEnabled(mode is None)  # these colours have no range to keep

    def show_theme(self, theme: Theme) -> None:
        for view in (
            self.membrane,
            self.badge,
            self.readouts,
            self.notice,
            *self.heatmaps.values(),
        ):
            view.show_theme(theme)

    def show_status(self, status: Status) -> None:
        if status.sensor is not None and status.meetings != self._met:
            self._meet(status)
        state = self._session.badge()
        self.badge.show_state(state, status.recording.active)
        self.membrane.alarm.show(self._session.alarm() if self.alarming else "")
        self.old = lost = state in _OLD
        for view in (self.membrane, *self.heatmaps.values()):
            view.show_lost(lost)
        self._show_numbers(status, lost)

    def _meet(self, status: Status) -> None:
        sensor, setup = status.sensor, status.setup
        if sensor is None:
            return
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
        for row, heatmap in enumerate(self.heatmaps.values()):
            heatmap.show_reading(np.empty(0) if estimate is None else estimate.curvature[row])

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
        colour = settings.colour_by
        values = self._session.surface_values(estimate, colour)
        depth = self.ranges.limit("displacement", 1e3 * estimate.surface, settings, now)
        mode = self._mode
        if mode is not None and mode.shape == estimate.surface.shape:
            values, limits, colours, unit = mode, (-1.0, 1.0), DIVERGING, "shape"
        elif colour == "displacement":
            pulled = self.ranges.pulled(values)
            limits = (-depth, 0.0) if pulled else (0.0, depth)
            colours, unit = PULLED if pulled else SEQUENTIAL, "mm"
        else:
            readings = estimate.curvature[COMPONENTS.index(colour)]
            limit = self.ranges.limit(colour, readings, settings, now)
            limits, colours, unit = (-limit, limit), DIVERGING, "1/m"
        self._show_colours(colours)
        times = self._times()
        self.membrane.show_estimate(estimate, values, limits, times)
        self._show_loads(estimate)
        self.scale.bar.show_scale(colours, limits, unit)
        self.scale.show_times(times)
        if now >= self._next_heatmaps:
            self._next_heatmaps = now + _HEATMAPS
            crossed, dotted = self.marks(estimate.curvature)
            kinds = self._kinds(estimate)
            self._out = np.flatnonzero(kinds.any(axis=0))
            self.membrane.show_marked(self._out, self._asked)
            for row, (name, heatmap) in enumerate(self.heatmaps.items()):
                readings = estimate.curvature[row]
                heatmap.show_marks(crossed, dotted, kinds[row])
                heatmap.show_values(readings, self.ranges.limit(name, readings, settings, now))

    def _kinds(self, estimate: Estimate) -> NDArray[np.uint8]:
        """Why each channel (3, P) is left out, by number in `WHY`; 0 where it is not."""
        found = np.zeros(estimate.curvature.shape, np.uint8)
        for finding in self._session.status.health.findings:
            if finding.element < len(estimate.suspect):  # or it is of another skin
                row = COMPONENTS.index(finding.component)
                found[row, finding.element] = WHY.index(finding.kind)
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

    def _show_colours(self, colours: Colours) -> None:
        if colours is not self._colours:
            self._colours = colours
            self.membrane.show_colours(colours, DARK_INK if colours is DIVERGING else LIGHT_INK)

    def _show_loads(self, estimate: Estimate) -> None:
        session = self._session
        time = session.status.playing.time(estimate.device_time)
        touches = touches_at(session.scene, time) if session.inside else ()
        self.membrane.show_loads([touch.load for touch in touches])
