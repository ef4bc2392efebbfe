"""From the shape fitted to the readings to the skin's local geometry, anywhere on it."""

from collections.abc import Callable
from typing import Any

import numpy as np

from kappaskin.bases import ORDERS, Basis
from kappaskin.errors import Refusal
from kappaskin.fit import Fit
from kappaskin.frames import Array, LocalGeometry, Touch
from kappaskin.patch import Patch

Number = Any  # a float, or an array of P real or, to be differentiated, complex numbers
Jet = list[Number]  # the displacement f and its derivatives f_x, f_y, f_xx, f_xy, f_yy

_TINY = 1e-100  # an imaginary step whose square vanishes: derivatives exact to rounding

NO_GEOMETRY = LocalGeometry(
    *(np.full(shape, np.nan) for shape in ((3,), (3, 3), (2, 2), (2, 2), (2,), (3, 3)))
)


def local_geometry(fit: Fit, positions: Array) -> LocalGeometry:
    """The geometry at `positions` (P, 2) or (2,) in m of the skin that `fit` found in one frame.

    The error bars are of first order and come from the noise of the readings alone: what is finer
    than the fit's functions, as right under a point load, is not in them.
    """
    if fit.coefficients.ndim != 2:
        raise Refusal(
            f"expected the fit of one frame, got coefficients of shape {fit.coefficients.shape}"
        )
    return surface_geometry(fit.estimator.basis, fit.coefficients, positions, fit.covariance_of)


def contact_geometry(fit: Fit, touch: Touch) -> LocalGeometry:
    """The geometry of the skin at the contact; NaN when there is none."""
    return local_geometry(fit, touch.position) if touch.present else NO_GEOMETRY


def surface_geometry(
    basis: Basis,
    coefficients: Array,
    positions: Array,
    covariance_of: Callable[[Array], Array],
) -> LocalGeometry:
    """The geometry at `positions` (P, 2) or (2,) in m of the shape with `coefficients` (Ni, Nj).

    `covariance_of` rows (..., 3, N) is that of their products with the flattened coefficients.
    """
    if coefficients.shape != basis.shape or positions.ndim > 2 or positions.shape[-1:] != (2,):
        raise Refusal(
            f"expected coefficients of shape {basis.shape} and positions of shape "
            f"(P, 2) in m, got {coefficients.shape} and {positions.shape}"
        )
    if positions.ndim == 2:
        at = np.stack([basis.at(positions, *order) for order in ORDERS], axis=1)
        jet: Jet = list((at @ coefficients.ravel()).T)
    else:  # numbers, in a tenth of the time of arrays of one
        at = basis.jet(*positions.tolist())
        jet = (at @ coefficients.ravel()).tolist()
    H = basis.patch.base_curvature
    xx, yy, xy = _curvature_form(jet, H)
    to_form = _sensitivity(jet, H) @ at
    return LocalGeometry(
        *_frame(basis.patch, positions, jet),
        _matrix(xx, xy, xy, yy),
        np.array(_torsion_form(jet, H)).T,
        covariance_of(to_form),
    )


def _sensitivity(jet: Jet, H: float) -> Array:
    """How xx, yy and xy of the curvature form change with the jet, (..., 3, 6)."""
    columns: list[list[Number]] = []
    for k in range(6):
        moved = [*jet[:k], jet[k] + 1j * _TINY, *jet[k + 1 :]]
        columns.append([part.imag / _TINY for part in _curvature_form(moved, H)])
    return np.array(columns).T


def _matrix(*rows: Number) -> Array:
    """(..., k, k) from its entries, numbers or arrays (P,), row by row."""
    entries = np.array(rows).T
    k = 3 if len(rows) == 9 else 2
    return entries.reshape(*entries.shape[:-1], k, k)


# The skin is r = r0 - f n0: the base, an arc of curvature H along x, less f times its outward
# normal n0. In the base's own frame, t along x, e along y and n0, with s = 1 - H f:
#     r_x = (s, 0, -f_x),   r_y = (0, 1, -f_y),   r_x x r_y = (f_x, s f_y, s) = W n,
#     r_xx = (-2 H f_x, 0, -f_xx - H s),   r_xy = (-H f_y, 0, -f_xy),   r_yy = (0, 0, -f_yy).
# The first form g has g_xx = |r_x|^2 = L^2 and det g = W^2. Coordinates on a bent surface are not
# orthogonal; Gram and Schmidt along x give the Gauss frame: r_x = L x, r_y = m r_x + (W/L) y.


def _lengths(jet: Jet, H: float) -> tuple[Number, Number, Number, Number]:
    """s, L, m and W of the formulas above."""
    f, fx, fy = jet[:3]
    s = 1 - H * f
    LL = s * s + fx * fx
    return s, LL**0.5, fx * fy / LL, (fx * fx + s * s * (1 + fy * fy)) ** 0.5


def _curvature_form(jet: Jet, H: float) -> tuple[Number, Number, Number]:
    """xx, yy and xy of K = [x y]' [n_x n_y] [metric]^-1, where n_x . r_y = -n . r_xy."""
    s, L, m, W = _lengths(jet, H)
    _, fx, fy, fxx, fxy, fyy = jet
    bxx = (2 * H * fx * fx + s * (fxx + H * s)) / W
    bxy, byy = (H * fx * fy + s * fxy) / W, s * fyy / W
    k = L / W
    return bxx / (L * L), (byy - 2 * m * bxy + m * m * bxx) * k * k, (bxy - m * bxx) / W


def _torsion_form(jet: Jet, H: float) -> tuple[Number, Number]:
    """T = y' [x_x x_y] [metric]^-1."""
    s, L, m, W = _lengths(jet, H)
    _, fx, fy, fxx, fxy, _ = jet
    # y . r_xx / L and y . r_xy / L, with y = (r_y - m r_x) L / W.
    turn_x = (fy * (fxx + H * s) - m * fx * (fxx - H * s)) / W
    turn_y = (fy * fxy - m * (fx * fxy - H * s * fy)) / W
    return turn_x / L, (turn_y - m * turn_x) * L / W


def _frame(patch: Patch, positions: Array, jet: Jet) -> tuple[Array, Array, Array]:
    """Position (..., 3), Gauss frame (..., 3, 3) and metric (..., 2, 2)."""
    s, L, m, W = _lengths(jet, patch.base_curvature)
    f, fx, fy = jet[:3]
    zero, k = 0 * f, L / W
    x, n = (s / L, zero, -fx / L), (fx / W, s * fy / W, s / W)
    y = (-m * s * k, k, (m * fx - fy) * k)
    point, n0 = patch.at_rest(positions)
    cos, sin, one = n0[..., 2], n0[..., 0], zero + 1
    base = _matrix(cos, zero, -sin, zero, one, zero, sin, zero, cos)
    metric = _matrix(L, m * L, zero, 1 / k)
    return point - np.multiply(n0.T, f).T, _matrix(*x, *y, *n) @ base, metric
