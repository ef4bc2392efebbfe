"""Local geometry of the deflected skin: frame, metric, curvature and torsion forms."""

from collections.abc import Callable
from typing import Any

import numpy as np

from kappaskin.bases import ORDERS, Basis
from kappaskin.errors import Refusal
from kappaskin.estimation import Fit, propagated_covariance
from kappaskin.frames import Array, Contact, LocalGeometry
from kappaskin.skin import Patch

Number = Any  # a float, or an array of P
Jet = list[Number]  # the displacement f and its derivatives f_x, f_y, f_xx, f_xy, f_yy

NO_GEOMETRY = LocalGeometry(
    *(np.full(shape, np.nan) for shape in ((3,), (3, 3), (2, 2), (2, 2), (2,), (3, 3)))
)


def local_geometry(fit: Fit, positions: Array) -> LocalGeometry:
    """Geometry of the skin at `positions` (P, 2) or (2,) in m, for the `fit` of one frame.

    The error bars are of first order and come from the noise of the readings alone: detail finer
    than the basis, as right under a point load, is not in them.
    """
    basis, c = fit.estimator.basis, fit.coefficients
    if c.ndim != 2:
        raise Refusal(f"expected the fit of one frame, got coefficients of shape {c.shape}")
    if positions.shape != (2,):
        return surface_geometry(basis, c, positions, fit.covariance_of)
    jet, covariance = fit.jet(*positions.tolist())
    return _geometry(basis.patch, positions, jet.tolist(), covariance)


def contact_geometry(fit: Fit, contact: Contact) -> LocalGeometry:
    """Geometry of the skin at the contact; NaN when there is none."""
    return local_geometry(fit, contact.position) if contact.present else NO_GEOMETRY


def surface_geometry(
    basis: Basis,
    coefficients: Array,
    positions: Array,
    covariance_of: Callable[[Array], Array],
) -> LocalGeometry:
    """Geometry at `positions` (P, 2) or (2,) in m of the shape with `coefficients` (Ni, Nj) in m.

    `covariance_of` rows (..., 6, N) is that (..., 6, 6) of their products with the flattened
    coefficients: displacement, both slopes and three second derivatives, in the order of `ORDERS`.
    """
    if coefficients.shape != basis.shape or positions.ndim > 2 or positions.shape[-1:] != (2,):
        raise Refusal(
            f"expected coefficients of shape {basis.shape} and positions of shape "
            f"(P, 2) in m, got {coefficients.shape} and {positions.shape}"
        )
    if positions.ndim == 2:
        at = np.stack([basis.at(positions, *order) for order in ORDERS], axis=1)
    else:
        at = basis.jet(*positions.tolist())
    jet: Jet = list((at @ coefficients.ravel()).T)
    return _geometry(basis.patch, positions, jet, covariance_of(at))


class CurvatureFormMap:
    """A map from coefficients to the curvature form on the grid of `x` (nx,), `y` (ny,) in m."""

    def __init__(self, basis: Basis, x: Array, y: Array) -> None:
        self._maps = [basis.on_grid(x, y, *order) for order in ORDERS]
        self._base_curvature = basis.patch.arc_curvature

    def __call__(self, coefficients: Array) -> Array:
        """xx, yy and xy of K (3, ny, nx) in 1/m for `coefficients` (Ni, Nj); NaN off the skin."""
        jet: Jet = [derivative(coefficients) for derivative in self._maps]
        return np.stack(_curvature_form(jet, self._base_curvature))


def _geometry(patch: Patch, positions: Array, jet: Jet, covariance: Array) -> LocalGeometry:
    """The geometry at `positions`, given the jets there with their `covariance` (..., 6, 6).

    One jet as six numbers takes a tenth of the time of arrays of one.
    """
    H = patch.arc_curvature
    xx, yy, xy = _curvature_form(jet, H)
    to_form = _sensitivity(jet, H, (xx, yy, xy))
    return LocalGeometry(
        *_frame(patch, positions, jet),
        _matrix(xx, xy, xy, yy),
        np.array(_torsion_form(jet, H)).T,
        propagated_covariance(to_form, covariance),
    )


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


def _sensitivity(jet: Jet, H: float, form: tuple[Number, Number, Number]) -> Array:
    """How xx, yy and xy of the curvature `form` change with the jet, (..., 3, 6)."""
    f, fx, fy, fxx, fxy, fyy = jet
    (xx, yy, xy), (s, _, m, W) = form, _lengths(jet, H)
    # With b W for b, the form is made of g = L^2, V = W^2, m and b:
    #     xx = bxx / (W g),    yy = (byy - 2 m bxy + m^2 bxx) g / (W V),    xy = (bxy - m bxx) / V.
    g, V, zero = s * s + fx * fx, W * W, 0 * f
    bxx, bxy = 2 * H * fx * fx + s * (fxx + H * s), H * fx * fy + s * fxy
    with_f = -2 * H * s, -2 * H * s * (1 + fy * fy), 2 * H * s * m / g
    with_fx, with_fy = (2 * fx, 2 * fx, (fy - 2 * m * fx) / g), (zero, 2 * s * s * fy, fx / g)
    steps = [  # of g, V, m, bxx, bxy and byy
        (*with_f, -H * (fxx + 2 * H * s), -H * fxy, -H * fyy),
        (*with_fx, 4 * H * fx, H * fy, zero),
        (*with_fy, zero, H * fx, zero),
    ]
    to_xx, to_yy, to_xy = 1 / (W * g), g / (W * V), 1 / V
    columns: list[list[Number]] = []
    for dg, dV, dm, dxx, dxy, dyy in steps:
        dyy = dyy - 2 * m * dxy + m * m * dxx - 2 * dm * (bxy - m * bxx)
        columns.append(
            [
                to_xx * dxx - xx * (dg / g + dV / (2 * V)),
                to_yy * dyy + yy * (dg / g - 3 * dV / (2 * V)),
                to_xy * (dxy - m * dxx - dm * bxx) - xy * dV / V,
            ]
        )
    columns += [  # with f_xx, f_xy and f_yy
        [s * to_xx, m * m * s * to_yy, -m * s * to_xy],
        [zero, -2 * m * s * to_yy, s * to_xy],
        [zero, s * to_yy, zero],
    ]
    return np.array(columns).T


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
    s, L, m, W = _lengths(jet, patch.arc_curvature)
    f, fx, fy = jet[:3]
    zero, k = 0 * f, L / W
    x, n = (s / L, zero, -fx / L), (fx / W, s * fy / W, s / W)
    y = (-m * s * k, k, (m * fx - fy) * k)
    point, (sin, _, cos) = _at_rest(patch, positions)
    rows = [(cos * t + sin * up, e, cos * up - sin * t) for t, e, up in (x, y, n)]
    place = (point[0] - f * sin, point[1], point[2] - f * cos)
    return (
        np.array(place).T,
        _matrix(*rows[0], *rows[1], *rows[2]),
        _matrix(L, m * L, zero, 1 / k),
    )


def _at_rest(patch: Patch, positions: Array) -> tuple[list[Number], list[Number]]:
    """x, y and z of the skin at rest and of its normal: numbers at one place."""
    point, normal = (values.T for values in patch.at_rest(positions))
    return (list(point), list(normal)) if positions.ndim > 1 else (point.tolist(), normal.tolist())
