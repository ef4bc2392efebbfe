"""Readings to what they have in common with those of each function's unit force."""

from collections.abc import Callable

import numpy as np

from kappaskin.bases import Basis, SineBasis
from kappaskin.bases.gage import multipliers
from kappaskin.frames import Array
from kappaskin.layout import SensorLayout
from kappaskin.mechanics import Compliance

_SECOND = (2, 0), (0, 2), (1, 1)  # orders of the derivatives that flat skins read (Eqs. 3-5)

Modal = Callable[[Array], Array]
"""Readings K (3 P,) in 1/m, zero where there is none, to M'K (N,)."""


def modal(layout: SensorLayout, basis: Basis, compliance: Compliance, M: Array) -> Modal:
    """M'K for what the elements read of unit modal forces, M (3 P, N).

    Where the elements stand on a grid, and the functions are sines that a load does not mix, M is
    for each component a matrix for x times one for y: a hundredth of the numbers.
    """
    flat = isinstance(basis, SineBasis) and not basis.patch.base_curvature
    if flat and _is_grid(layout) and compliance.values.ndim == 1 and compliance.volume is None:
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
        self._X, self._Y = np.stack([one.X for one in maps]), np.stack([one.Y.T for one in maps])
        gain = multipliers(basis, layout.gage_length) * compliance.reshape(basis.shape)
        self._gain = np.ascontiguousarray(gain.swapaxes(1, 2))
        self._cells = 3, self._Y.shape[2], self._X.shape[1]

    def __call__(self, readings: Array) -> Array:
        parts = np.matmul(np.matmul(self._Y, readings.reshape(self._cells)), self._X)
        parts *= self._gain
        return np.add.reduce(parts).T.ravel()
