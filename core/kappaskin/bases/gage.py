"""What gages of some length read: the mean of the curvature along each of them."""

import math

import numpy as np

from kappaskin.bases.basis import Basis, curvature_at
from kappaskin.bases.product import gauss
from kappaskin.bases.sine import SineBasis
from kappaskin.frames import Array

_POINTS = 12  # exact to rounding for waves as short as the gage

# A gage along the unit vector e reads the mean of the normal curvature e'Ke over its length L. One
# lies along x and one along y. The twist is half of what two along the diagonals differ by, which
# in the limit of short ones is f_xy. Each alone mixes the modes: it sees sin(k x) sin(l y) as
# waves of k + l and of k - l. What they differ by does not: with h = L / sqrt(8) it is the twist
#     k l cos(k x) cos(l y)   times   (cos(k h) sinc(l h) + sinc(k h) cos(l h)) / 2.
_DIAGONAL = 1 / math.sqrt(2)


def multipliers(sines: SineBasis, gage_length: float) -> Array:
    """By what gages of `gage_length` in m read sines on a flat skin, (3, Ni, Nj).

    xx: sinc(k_i L / 2) and yy: sinc(k_j L / 2), with sinc(t) = sin(t) / t; xy as derived above.
    """
    ki, kj = np.meshgrid(*sines.wavenumbers, indexing="ij")
    L, h = gage_length, gage_length * _DIAGONAL / 2
    twist = np.cos(ki * h) * _sinc(kj * h) + _sinc(ki * h) * np.cos(kj * h)
    return np.stack([_sinc(ki * L / 2), _sinc(kj * L / 2), twist / 2])


def _sinc(t: Array) -> Array:
    return np.sinc(t / np.pi)


def mean_curvature_at(basis: Basis, positions: Array, gage_length: float) -> Array:
    """What gages of `gage_length` in m, their middles at `positions`, read of each function.

    xx, yy, xy (3, P, N) in 1/m per m, as `curvature_at` has it of gages without a length.
    """
    if not gage_length:
        return curvature_at(basis, positions)
    mean = _over_points if basis.patch.base_curvature else _between_ends

    def along(x: float, y: float) -> Array:
        return mean(basis, positions, gage_length, x, y)

    rising, falling = along(_DIAGONAL, _DIAGONAL), along(_DIAGONAL, -_DIAGONAL)
    return np.stack([along(1.0, 0.0), along(0.0, 1.0), (rising - falling) / 2])


def _between_ends(basis: Basis, positions: Array, L: float, x: float, y: float) -> Array:
    """The mean curvature along (x, y): by how much the slope differs between the gages' ends.

    It is exact also for functions whose curvature jumps between triangles.
    """
    half = L / 2 * np.array([x, y])

    def slope(places: Array) -> Array:
        return x * basis.at(places, 1, 0) + y * basis.at(places, 0, 1)

    return (slope(positions + half) - slope(positions - half)) / L


def _over_points(basis: Basis, positions: Array, L: float, x: float, y: float) -> Array:
    """The mean curvature along (x, y) by Gauss: on a bent skin it is more than a derivative."""
    along, weights = gauss(L, _POINTS)
    steps = np.multiply.outer(along - L / 2, (x, y))
    xx, yy, xy = curvature_at(basis, (positions + steps[:, None]).reshape(-1, 2))
    normal = (x * x * xx + y * y * yy + 2 * x * y * xy).reshape(_POINTS, len(positions), -1)
    return np.einsum("q,qpn->pn", weights / L, normal)
