"""Load detection in readings whose zero is unknown."""

import math
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from kappaskin.bases import basis_for
from kappaskin.contact.drift import level_and_slopes
from kappaskin.estimation import PatternCache, power_of_two
from kappaskin.frames import Array, Mask
from kappaskin.sensing import Sensor

_FUNCTIONS = 15  # along each side, of the shape a point load makes
_SEARCHED = 21  # places along each side
_SIGNIFICANT = 30.0  # drop of chi-squared below which a load may be noise found by searching
_SHARE = 0.5  # of what stands out: so much a load explains and nothing else does
_CHANCE = 1e-4  # of a load found in offsets that know nothing of each other
_FAINT = 1e-6  # of the norm of the loads best seen: below it, one is not seen at all


@dataclass(frozen=True, slots=True, eq=False)
class DetectedLoad:
    """A load of `force` in N near `position` (2,) in m; it explains this `share` of the readings.

    Of their squares, once a level and two slopes in each component are taken out.
    """

    position: Array
    force: float
    share: float


@dataclass(frozen=True, slots=True, eq=False)
class _LoadTables:
    """For the readings used: level and slopes Q (R, n), loads T (R, G) without them, T'T (G,)."""

    Q: Array
    T: Array
    norm: Array
    by_chance: float


class LoadDetector:
    """Distinguishes a load from the offsets of the elements.

    Warmth shifts all readings of a component alike, or more towards one side, and so does a bent
    mount: a level and two slopes for each component, which are taken out first. Other offsets
    differ at random from element to element. A load bends the skin in all three components at once,
    and its readings resemble those of a point load, which explains three quarters of the readings
    of a whole hand and more of any smaller contact, but an eighth of a smooth change that is no
    load, and a few per cent of random offsets.
    """

    def __init__(self, sensor: Sensor, edge: str = "") -> None:
        layout, plate = sensor.layout, sensor.plate
        patch, strip = layout.patch, layout.patch.strip
        basis = basis_for(patch, edge or sensor.edge, _FUNCTIONS, 1 if strip else _FUNCTIONS)
        x, y = patch.grid(_SEARCHED + 2, 3 if strip else _SEARCHED + 2)
        points = np.stack(np.meshgrid(x[1:-1], y[1:-1]), -1).reshape(-1, 2)
        self._points = points[patch.moves(points)]
        M = plate.compliance(basis).after(layout.operator(basis, plate))
        self.sigma = np.ones(layout.channels) if sensor.sigma is None else sensor.sigma
        """Standard deviation (C,) of readings that differ in unit, their weight; else 1."""
        self._T = M @ basis.at(self._points).T / self.sigma[:, None]
        self._plain = level_and_slopes(layout).T / self.sigma[:, None]
        self._live = layout.live.ravel()
        self._cache = PatternCache[_LoadTables]()

    def _tables(self, used: Mask) -> _LoadTables:
        U, s, _ = np.linalg.svd(self._plain[used], full_matrices=False)
        Q: Array = U[:, s > _FAINT * s.max(initial=0.0)]
        T = self._T[used] - Q @ (Q.T @ self._T[used])
        squares = np.einsum("rg,rg->g", T, T)
        observed = squares > _FAINT * squares.max(initial=0.0)
        spare = len(Q) - Q.shape[1]
        return _LoadTables(Q, T, np.where(observed, squares, math.inf), _by_chance(spare))

    def __call__(
        self, readings: Array, variance: float, share: float = _SHARE
    ) -> DetectedLoad | None:
        """The load in `readings` (C,) with noise of `variance`; None where there is none.

        The variance is that of `readings / sigma`.

        It must explain this `share` of what the level and slopes leave, and more than chance.
        """
        used: NDArray[np.bool_] = self._live & np.isfinite(readings)
        tables = self._cache(used, self._tables)
        read: Array = readings[used] / self.sigma[used]
        unit = float(power_of_two(read)[0])
        read, variance = read / unit, (math.sqrt(variance) / unit) ** 2
        K: Array = read - tables.Q @ (tables.Q.T @ read)
        power, h = float(K @ K), K @ tables.T
        explained = h**2 / tables.norm
        best = int(explained.argmax())
        least = max(_SIGNIFICANT * variance, max(share, tables.by_chance) * power)
        if not explained[best] > least:
            return None
        force = unit * float(h[best] / tables.norm[best])
        return DetectedLoad(self._points[best], force, float(explained[best] / power))


def _by_chance(spare: int) -> float:
    """The share of `spare` random numbers that one load explains once in ten thousand times.

    The share of one direction among n random ones follows a beta distribution (1/2, (n - 1)/2), and
    no more than n of the places searched are independent.
    """
    if spare < 2:
        return math.inf
    return float(scipy.special.betaincinv(0.5, (spare - 1) / 2, 1 - _CHANCE / spare))
