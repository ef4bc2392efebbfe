"""Readings of elements on a grid: sines along x, and then along y."""

from collections.abc import Callable

import numpy as np
from scipy import linalg

from kappaskin.bases import Basis, SineBasis
from kappaskin.frames import Array
from kappaskin.mechanics import Compliance
from kappaskin.sensing import SensorLayout, gage_multipliers

_SECOND = (2, 0), (0, 2), (1, 1)  # orders of the derivatives that skins read (Eqs. 3-5)
_ROUNDING = 1e-15  # of the largest: a part as small is none

ModalProjection = Callable[[Array], Array]
"""From readings K (C,) in 1/m, zero where missing, to M'K (N,)."""


def modal_projection(
    layout: SensorLayout, basis: Basis, compliance: Compliance, M: Array
) -> ModalProjection:
    """The map from readings K to M'K, where M (3 P, N) are the readings of unit modal forces."""
    return element_grid(layout, basis, compliance) or (lambda K: K @ M)


def element_grid(
    layout: SensorLayout, basis: Basis, compliance: Compliance
) -> "ElementGrid | None":
    """The elements of a layout, if on a grid and the functions are sines that a load does not mix.

    The readings of unit modal forces M (3 P, N) are then for each component a matrix for x times
    one for y: a hundredth of the numbers.
    """
    unmixed = compliance.values.ndim == 1 and compliance.volume is None
    if isinstance(basis, SineBasis) and unmixed and not layout.reads and _is_grid(layout):
        return ElementGrid(layout, basis, compliance.values)
    return None


def _sides(layout: SensorLayout) -> tuple[Array, Array]:
    """x of the columns and y of the rows of elements, for a grid."""
    m = layout.shape[0] if layout.shape else 1
    return layout.positions[:m, 0], layout.positions[::m, 1]


def _is_grid(layout: SensorLayout) -> bool:
    x, y = _sides(layout)
    grid = np.stack(np.meshgrid(x, y), -1).reshape(-1, 2)
    return layout.shape is not None and np.array_equal(grid, layout.positions)


class ElementGrid:
    """Elements on a grid; called with readings K (3 P,), it gives M'K (N,)."""

    def __init__(self, layout: SensorLayout, basis: SineBasis, compliance: Array) -> None:
        maps = [basis.on_grid(*_sides(layout), *order) for order in _SECOND]
        terms = _products(gage_multipliers(basis, layout.gage_length))
        self._X = np.hstack([(maps[c].X * along_x).T for c, along_x, _ in terms])
        self._Y = np.stack([maps[c].Y * along_y for c, _, along_y in terms])
        self._compliance = compliance.reshape(basis.shape)
        ki, kj = basis.wavenumbers
        self._k, self._each_k = linalg.block_diag(ki, kj), np.concatenate([ki, kj])
        self._cells = 3, len(maps[0].Y), len(maps[0].X)
        components = [c for c, _, _ in terms]
        self._components = ... if components == [0, 1, 2] else np.array(components)

    def __call__(self, readings: Array) -> Array:
        K = readings.reshape(self._cells)[self._components]
        along_y = np.matmul(K.mT, self._Y)
        modes: Array = self._X.dot(along_y.reshape(-1, along_y.shape[2]))
        modes *= self._compliance
        return modes.ravel()

    def under(self, points: Array, adds: Array) -> Array:
        """Readings (n, 3 P) in 1/m under forces at `points` (k, 2) in m, and as these move.

        Each of n sums `adds` (2, k, n, 2) products of values and slopes there: of the functions of
        x by its first axis, of y by its last. In N; those with one slope in N m.
        """
        k, Ni = len(points), len(self._X)
        waves = np.empty((2, k, self._k.shape[1]))
        angles = np.matmul(points, self._k, out=waves[1])
        np.sin(angles, out=waves[0])
        np.cos(angles, out=waves[1])
        waves[1] *= self._each_k
        along_y = adds @ waves[..., Ni:].transpose(1, 0, 2)
        along_x = waves[..., :Ni].reshape(2 * k, Ni).T
        modes = (along_x @ along_y.reshape(2 * k, -1)).reshape(Ni, adds.shape[2], -1)
        modes *= self._compliance[:, None]
        return self._read(modes)

    def read(self, modal: Array) -> Array:
        """Readings (n, 3 P) in 1/m under modal forces (n, N) in N."""
        modes = modal.reshape(-1, *self._compliance.shape) * self._compliance
        return self._read(modes.transpose(1, 0, 2))

    def _read(self, modes: Array) -> Array:
        """The readings of modes (Ni, n, Nj) in m."""
        (Ni, n, Nj), (terms, rows, _) = modes.shape, self._Y.shape
        along_x = (self._X.T @ modes.reshape(Ni, n * Nj)).reshape(terms, -1, Nj)
        read = (along_x @ self._Y.mT).reshape(terms, -1, n, rows)
        if self._components is not ...:
            read = np.stack([read[c == self._components].sum(axis=0) for c in range(3)])
        return read.transpose(2, 0, 3, 1).reshape(n, -1)

    def gives(self, points: Array, weights: Array, places: Array) -> Array:
        """Displacement (m,) in m at `places` (m, 2) under forces `weights` in N at `points`."""
        Ni, at = len(self._X), len(places)
        sines = np.sin(np.vstack([places, points]) @ self._k)
        X, Y = sines[:, :Ni], sines[:, Ni:]
        moved = X[at:].T @ (weights[:, None] * Y[at:]) * self._compliance
        return np.vecdot(X[:at] @ moved, Y[:at])


def _products(factors: Array) -> list[tuple[int, Array, Array]]:
    """Factors (3, Ni, Nj) as sums of products of one in x and one in y, with their component."""
    terms: list[tuple[int, Array, Array]] = []
    for c, (U, s, Vt) in enumerate(np.linalg.svd(one) for one in factors):
        terms += [(c, U[:, r] * s[r], Vt[r]) for r in np.flatnonzero(s > _ROUNDING * s[0])]
    return terms
