"""Coefficients to the true normal curvature of the deflected surface, however steep it is."""

import numpy as np
from numpy.typing import DTypeLike

from kappaskin.bases import Basis
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.sensing.layout import SensorLayout


def steepness(slope_x: Array, slope_y: Array) -> Array:
    """How many times too large Eqs. 3-5 are on slopes (..., P) along x and y, (..., 3, P).

    With W^2 = 1 + f_x^2 + f_y^2 it is xx: W (1 + f_x^2), yy: W (1 + f_y^2),
    xy: W sqrt((1 + f_x^2) (1 + f_y^2)).
    """
    along_x, along_y = 1 + slope_x**2, 1 + slope_y**2
    W = np.sqrt(along_x + along_y - 1)
    times = np.empty((*W.shape[:-1], 3, W.shape[-1]), W.dtype)
    times[..., 0, :] = W * along_x
    times[..., 1, :] = W * along_y
    times[..., 2, :] = W * np.sqrt(along_x * along_y)
    return times


class NormalCurvature:
    """Coefficients to the true normal curvature of the deflected surface along the gages.

    It is that of Eqs. 3-5, its first order, over the `steepness`. Gages of some length read the
    mean of Eqs. 3-5 along them on the slope in their middle.
    """

    def __init__(self, basis: Basis, layout: SensorLayout, dtype: DTypeLike = np.float64) -> None:
        if basis.patch.base_curvature:
            raise Refusal(
                f"expected a flat skin for finite slopes, got a {basis.patch.name}: on a bent one "
                "the tangential displacement matters as much as the slope; use least-squares"
            )
        places = layout.positions
        self._size = basis.size
        self._second = layout.curvature_operator(basis).T.astype(dtype)
        self._first = [basis.at(places, *order).T.astype(dtype) for order in ((1, 0), (0, 1))]

    def __call__(self, coefficients: Array) -> Array:
        """Curvature (..., 3, P) in 1/m for `coefficients` (..., Ni, Nj)."""
        flat = coefficients.reshape(*coefficients.shape[:-2], self._size)
        times = steepness(*(np.dot(flat, slope) for slope in self._first))
        return np.dot(flat, self._second).reshape(times.shape) / times
