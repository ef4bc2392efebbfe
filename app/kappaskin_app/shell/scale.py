"""Colour ranges that hold still: round numbers, quick to widen, slow to narrow."""

import math

import numpy as np
from numpy.typing import NDArray

from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.shades import SHADES
from kappaskin_app.widgets.numbers import round_up

Array = NDArray[np.float64]

_CLEARLY = 1.5  # times as far out as in, or in as out, before the colours change sides
_PATIENCE = 2.0  # s that the values must stay small before the range narrows


class SteadyRange:
    """Follows the largest value shown; a locked range is whatever it was locked to."""

    def __init__(self, least: float) -> None:
        self.least = self.limit = least
        self._small_since = math.inf

    def follow(self, largest: float, now: float) -> float:
        """The limit to use for values up to `largest` at time `now` in s."""
        wanted = max(self.least, round_up(largest))
        if wanted >= self.limit:
            self.limit, self._small_since = wanted, math.inf
        elif self._small_since == math.inf:
            self._small_since = now
        elif now - self._small_since > _PATIENCE:
            self.limit, self._small_since = wanted, math.inf
        return self.limit


class Ranges:
    """The colour limit of each quantity: locked by a setting, or following what is shown."""

    def __init__(self, side: float = 100.0) -> None:
        """`side` in mm is the skin's longer one: what moves less than a thousandth is at rest."""
        least = {"gaussian": 1.0, "displacement": 1e-3 * side}
        least |= dict.fromkeys(("error_bar", "difference"), 1e-5 * side)
        least |= dict.fromkeys((name for name in SHADES if name.startswith("residual_")), 0.1)
        self._steady = {name: SteadyRange(least.get(name, 0.5)) for name in SHADES}
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

    def limit(self, name: str, values: Array, settings: Settings, now: float) -> float:
        """The limit on the screen's scale for `values` of the quantity `name`, NaN or not.

        They count from what they are at rest.
        """
        largest = float(np.max(np.abs(values), where=np.isfinite(values), initial=0.0))
        self._steady[name].follow(largest, now)
        alike = (name,)
        if settings.one_range:
            shown = {*settings.maps, settings.colour_by}
            alike = (name, *(other for other in SHADES[name].alike if other in shown))
        return max(locked_at(one, settings) or self._steady[one].limit for one in alike)


def locked_at(name: str, settings: Settings) -> float:
    """What the range of the quantity `name` is locked to on the screen's scale, zero when not."""
    return getattr(settings, f"range_{name}", 0.0) * SHADES[name].scale
