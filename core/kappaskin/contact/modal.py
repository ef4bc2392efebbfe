"""Readings to what they have in common with those of each function's unit force."""

from collections.abc import Callable

import numpy as np

from kappaskin.bases import Basis, SineBasis, multipliers
from kappaskin.frames import Array
from kappaskin.mechanics import Compliance
from kappaskin.sensing import SensorLayout

_SECOND = (2, 0), (0, 2), (1, 1)  # orders of the derivatives that flat skins read (Eqs. 3-5)
_ROUNDING = 1e-15  # of the largest: a part as small is none

Modal = Callable[[Array], Array]
"""Readings K (3 P,) in 1/m, zero where there is none, to M'K (N,)."""


def modal(layout: SensorLayout, basis: Basis, compliance: Compliance, M: Array) -> Modal:
    """M'K for what the elements read of unit modal forces, M (3 P, N).

    Where the elements stand on a grid, and the functions are sines that a load does not mix, M is
    for each component a matrix for x times one for y: a hundredth of the numbers.
    """
    unmixed = compliance.values.ndim == 1 and compliance.volume is None
    if isinstance(basis, SineBasis) and unmixed and _is_grid(layout):
        return _OnGrid(layout, basis, compliance.values)
    return lambda K: K @ M


def _sides(layout: SensorLayout) -> tuple[Array, Array]:
    """x of the columns and y of the rows of elements, if they stand so."""
    m = layout.shape[0] if layout.shape else 1
    return layout.positions[:m, 0], layout.positions[::m, 1]


def _is_grid(layout: SensorLayout) -> bool:
    x, y = _sides(layout)
    grid = np.stack(np.meshgrid(x, y), -1).reshape(-1, 2)
    return layout.shape is not None and np.array_equal(grid, layout.positions)


class _OnGrid:
    def __init__(self, layout: SensorLayout, basis: SineBasis, compliance: Array) -> None:
        maps = [basis.on_grid(*_sides(layout), *order) for order in _SECOND]
        terms = _products(multipliers(basis, layout.gage_length))
        self._X = np.hstack([(maps[c].X * along_x).T for c, along_x, _ in terms])
        self._Y = np.stack([maps[c].Y * along_y for c, _, along_y in terms])
        self._compliance = compliance.reshape(basis.shape)
        self._cells = 3, len(maps[0].Y), len(maps[0].X)
        components = [c for c, _, _ in terms]
        self._components = ... if components == [0, 1, 2] else components

    def __call__(self, readings: Array) -> Array:
        K = readings.reshape(self._cells)[self._components]
        along_y = np.matmul(K.mT, self._Y)
        modes: Array = self._X.dot(along_y.reshape(-1, along_y.shape[2]))
        modes *= self._compliance
        return modes.ravel()


def _products(factors: Array) -> list[tuple[int, Array, Array]]:
    """Factors (3, Ni, Nj) as sums of products of one in x and one in y, with their component."""
    terms: list[tuple[int, Array, Array]] = []
    for c, (U, s, Vt) in enumerate(np.linalg.svd(one) for one in factors):
        terms += [(c, U[:, r] * s[r], Vt[r]) for r in np.flatnonzero(s > _ROUNDING * s[0])]
    return terms
