"""Colours of the skin and its heatmaps: quantities, steady ranges, values."""

import math
import time
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from kappaskin.bases import basis_for
from kappaskin.errors import RankDeficient
from kappaskin.estimation import FAULTS, Estimator, estimator_for
from kappaskin.frames import COMPONENTS, Array, Estimate
from kappaskin.live import Status
from kappaskin.pipeline import ErrorBars, Quantities, SkinColour, colours_of, skin_colours
from kappaskin.sensing import SHOWN_UNITS
from kappaskin_app.shell.background import BackgroundTask, Tasks
from kappaskin_app.shell.settings import Settings, locked_at
from kappaskin_app.widgets.text import round_up
from kappaskin_app.widgets.tint import Tint, rgb_of

_UNITS = {"m": (1e3, "mm"), "1/m": (1.0, "1/m"), "1/m^2": (1.0, "1/m\u00b2"), "": (1.0, "")}
_DIGITS = {
    "mm": ".3f",
    "1/m": ".2f",
    "1/m\u00b2": ".3g",
    "\N{MICRO SIGN}m": ".1f",
    "mrad": ".2f",
}

HEALTH_WORDS = ("OK", *FAULTS[1:])


# In the order of `FAULTS`: OK is inconspicuous, and each fault has another lightness too.
HEALTH_COLOURS = rgb_of(
    *("#5f7f8c", "#f0e060", "#d55e00", "#cc79a7", "#56b4e9"),
    *("#e69f00", "#1a1c20", "#9b30d0", "#00a070"),
)


HEALTH = Tint("sequential", (0.0, len(FAULTS) - 1.0), "", kinds=HEALTH_WORDS, own=HEALTH_COLOURS)


class Shade(SkinColour):
    """A quantity that colours the skin, in the units of the screen."""

    @property
    def _shown(self) -> tuple[float, str]:
        return (_UNITS if self.row < 0 else SHOWN_UNITS)[self.unit]

    @property
    def scale(self) -> float:
        """The factor from SI units to those of the screen."""
        return self._shown[0]

    @property
    def unit_shown(self) -> str:
        return self._shown[1]

    def tint(
        self, limit: float, at_rest: float = 0.0, pulled: bool = False, noise: float = 0.0
    ) -> Tint:
        """The colours of values with this `noise` up to `limit` from what they are `at_rest`."""
        if self.name == "health":
            return HEALTH
        part, limits = "sequential", (0.0, limit)
        if self.signed:
            part, limits = "diverging", (at_rest - limit, at_rest + limit)
        elif pulled:
            part, limits = "pulled", (-limit, 0.0)
        return Tint(part, limits, self.unit_shown, limit, noise=noise)

    def written(self, value: float) -> str:
        """A value on the screen's scale, with its unit."""
        if self.name == "health":
            return HEALTH_WORDS[int(value)]
        sign = "+" if self.signed else "-"  # and z: no minus before a zero
        return f"{value:{sign}z{_DIGITS[self.unit_shown]}} {self.unit_shown}".replace(
            "-", "\N{MINUS SIGN}"
        )


def shades_of(colours: Mapping[str, SkinColour]) -> dict[str, Shade]:
    """A shade of each colour, by name."""
    return {name: Shade(**vars(colour)) for name, colour in colours.items()}


SHADES = shades_of(skin_colours())  # of a curvature sensor


_CLEARLY = 1.5  # times as far out as in, or in as out, before the colours change sides
_SIGMAS = 5.0  # standard deviations that a range has at least: noise alone stays pale
# Widest ranges in the units of the screen, of lengths in skins: no object has a radius below 1 mm.
_MOST = {"mm": 1.0, "\N{MICRO SIGN}m": 1e3, "mrad": 2e3, "1/m": 1e3, "1/m\u00b2": 1e6}
_LENGTHS = "mm", "\N{MICRO SIGN}m"
_DISPLACED = "displacement", "difference"  # in m, of the whole surface
_PATIENCE = 2.0  # s that the values must stay small before the range narrows


class SteadyRange:
    """A range from `least` to `most` that follows the largest value, and narrows after a delay."""

    def __init__(self, least: float, most: float = math.inf) -> None:
        self.least = self.limit = least
        self.most = most
        self._small_since = math.inf

    def follow(self, largest: float, now: float, noise: float = 0.0) -> float:
        """The limit to use for values up to `largest` at time `now` in s.

        It is five times their `noise` at least.
        """
        wanted = min(max(self.least, round_up(max(largest, _SIGMAS * noise))), self.most)
        if wanted >= self.limit:
            self.limit, self._small_since = wanted, math.inf
        elif self._small_since == math.inf:
            self._small_since = now
        elif now - self._small_since > _PATIENCE:
            self.limit, self._small_since = wanted, math.inf
        return self.limit


def largest(values: Array) -> float:
    """The largest absolute value; 0 where none is known."""
    return float(np.max(np.abs(values), where=np.isfinite(values), initial=0.0))


class Ranges:
    """The colour limit of each quantity: locked by a setting, or following what is shown."""

    def __init__(self, side: float = 100.0, shades: Mapping[str, Shade] = SHADES) -> None:
        """`side` in mm is the skin's longer one: what moves less than a thousandth is at rest.

        `shades` are those of all quantities, by name.
        """
        self._shades = shades
        self._steady = {
            name: SteadyRange(
                shade.least * (side if shade.unit_shown == "mm" else 1.0),
                _MOST.get(shade.unit_shown, math.inf)
                * (side if shade.unit_shown in _LENGTHS else 1.0),
            )
            for name, shade in shades.items()
        }
        self._pulled = False

    def pulled(self, displacement: Array) -> bool:
        """Whether the skin is pulled out rather than pressed in; in doubt it keeps its side."""
        seen = np.nan_to_num(displacement)
        out, into = -float(np.min(seen)), float(np.max(seen))
        if max(out, into) > self._steady["displacement"].least:
            if self._pulled and into > _CLEARLY * out:
                self._pulled = False
            elif not self._pulled and out > _CLEARLY * into:
                self._pulled = True
        return self._pulled

    def deepest(self) -> float:
        """The largest displacement in mm that was shown of late, as a round number."""
        return self._steady["displacement"].limit

    def limit(
        self, name: str, values: Array, settings: Settings, now: float, noise: float = 0.0
    ) -> float:
        """The limit on the screen's scale for `values` of the quantity `name`, NaN or not.

        They count from what they are at rest. It is five times their `noise` at least.
        """
        self._steady[name].follow(largest(values), now, noise)
        alike, group = [name], self._shades[name].group
        if settings.one_range and group:
            shown = {*settings.maps, settings.colour_by}
            alike += [other for other in shown if self._shades[other].group == group]
        return max(
            locked_at(one, settings) * self._shades[one].scale or self._steady[one].limit
            for one in alike
        )


_AGAIN = 0.5  # s after which error bars that depend on the readings are updated


class _Made(NamedTuple):
    """Error bars of one setup and set of readings; None where these do not determine a shape."""

    key: tuple[object, ...]
    bars: ErrorBars | None
    at: float


class Colouring:
    """Computes quantities of estimates when they are needed, error bars in the background."""

    def __init__(self, tasks: Tasks) -> None:
        self._status = Status()
        self._read: tuple[object, ...] = ()
        self.shades = SHADES
        """What may be shown of the sensor, by name."""
        self._key: tuple[object, ...] = ()
        self._quantities: Quantities | None = None
        self._task = BackgroundTask(tasks, "", self._take)
        self._made = _Made((), None, 0.0)
        self._estimator: tuple[object, Estimator] | None = None

    def follow(self, status: Status) -> None:
        """Take the sensor and setup of the next estimates."""
        if status.sensor is not None:
            layout = status.sensor.layout  # another object in each status
            read = layout.patch.strip, layout.reads is None, *layout.kinds
            if read != self._read:
                self._read, self.shades = read, shades_of(colours_of(layout))
        self._status = status

    @property
    def maps(self) -> tuple[str, ...]:
        """What heatmaps may show: all but curvature that is not read."""
        return tuple(n for n, shade in self.shades.items() if shade.row >= 0 or n not in COMPONENTS)

    def possible(self, settings: Settings) -> Settings:
        """The settings with what may be shown of the sensor.

        A heatmap of what it does not read stands for those of all it reads, unless one of these is
        selected.
        """
        read = tuple(n for n, shade in self.shades.items() if shade.row >= 0 and shade.on_surface)
        maps = tuple(name for name in settings.maps if name in self.maps)
        if len(maps) < len(settings.maps) and not {*maps} & {*read}:
            maps = read + maps
        by = settings.colour_by if settings.colour_by in self.shades else Settings.colour_by
        return replace(settings, maps=maps, colour_by=by)

    def quantities(self, estimate: Estimate) -> Quantities | None:
        """The quantities of `estimate`; None while it is of another sensor."""
        sensor, setup = self._status.sensor, self._status.setup
        if sensor is None or estimate.curvature.shape != sensor.layout.frame_shape:
            return None
        shapes = estimate.coefficients.shape, estimate.surface.shape
        key = (self._status.connections, estimate.generation, *shapes)
        if key != self._key:
            basis = basis_for(sensor.layout.patch, setup.edge or sensor.edge, *shapes[0])
            ny, nx = shapes[1]
            self._key, self._quantities = key, Quantities(sensor.layout, basis, nx, ny)
        return self._quantities

    def on_surface(self, name: str, estimate: Estimate) -> Array:
        """The values (ny, nx) of a quantity at the points of the skin."""
        found = self._asked(name, estimate)
        if found is None:
            return np.full(estimate.surface.shape, np.nan)
        return self.shades[name].scale * found.on_surface(name, estimate)

    def of_elements(self, name: str, estimate: Estimate) -> Array:
        """The values (P,) of a quantity."""
        found = self._asked(name, estimate)
        if found is None:
            return np.full(len(estimate.suspect), np.nan)
        return self.shades[name].scale * found.of_elements(name, estimate)

    def noise(self, name: str, estimate: Estimate) -> float:
        """The standard deviation of a value on the screen's scale; 0 where it is not known.

        Of a curvature that of a reading, of the displacement its largest on the skin.
        """
        shade, sd, sensor = self.shades[name], math.nan, self._status.sensor
        if name in _DISPLACED:
            bars = self._bars_so_far(estimate)
            sd = math.nan if bars is None else largest(bars.on_surface(estimate.noise))
        elif estimate.curvature.ndim == 2:
            sd = estimate.noise if shade.unit == "1/m" else math.nan
        elif shade.row >= 0 and sensor is not None:
            times = sensor.sigma
            several = 1.0 if times is None else largest(sensor.layout.by_kind(times)[shade.row])
            sd = estimate.noise * several
        return shade.scale * sd if math.isfinite(sd) else 0.0

    def at_rest(self, name: str, estimate: Estimate) -> float:
        """The value of a quantity of a skin at rest."""
        found = self.quantities(estimate)
        return 0.0 if found is None else self.shades[name].scale * found.at_rest(name)

    def _asked(self, name: str, estimate: Estimate) -> Quantities | None:
        found = self.quantities(estimate)
        if found is not None and name == "error_bar":
            found.error_bars = self.error_bars(estimate)
        return found

    # Error bars: a moment for each set of readings, longer with many functions.

    def _bars_so_far(self, estimate: Estimate) -> ErrorBars | None:
        """Error bars of the setup of `estimate`, whatever readings were missing then."""
        there = self.quantities(estimate) is not None and self._made.key[:-1] == self._key
        return self._made.bars if there else self.error_bars(estimate)

    def error_bars(self, estimate: Estimate) -> ErrorBars | None:
        """The error bars of the setup of `estimate`; None until they are computed."""
        found = self.quantities(estimate)
        if found is None or not np.isfinite(estimate.noise):
            return None
        used = np.isfinite(estimate.residual)
        key = (*self._key, used.tobytes())
        made, now = self._made, time.monotonic()
        anew = self._estimator is not None and self._estimator[1].has_prior
        if not self._task.running and (made.key != key or (anew and now - made.at > _AGAIN)):
            readings = np.where(used, estimate.curvature, np.nan)
            self._task.run(self._make, key, found, self._status, readings)
        return made.bars if made.key[:-1] == self._key else None

    def _make(
        self, key: tuple[object, ...], found: Quantities, status: Status, readings: Array
    ) -> _Made:
        setup = status.setup
        if self._estimator is None or self._estimator[0] is not found:
            layout = found.layout
            sigma = status.sensor.sigma if status.sensor else None
            how = estimator_for(setup.method, found.basis, layout, sigma, setup.rim_sd)
            self._estimator = found, how
        try:
            bars = ErrorBars(self._estimator[1], readings, *found.grid)
        except (RankDeficient, MemoryError):
            bars = None
        return _Made(key, bars, time.monotonic())

    def _take(self, made: _Made) -> None:
        self._made = made
