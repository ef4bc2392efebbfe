"""Local geometry of the deflected skin: frame, metric, curvature and torsion forms."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from kappaskin.bases import ORDERS, Basis, covariant_maps
from kappaskin.errors import Refusal
from kappaskin.estimation import Fit, propagated_covariance
from kappaskin.frames import Array, Contact, LocalGeometry
from kappaskin.skin import Base, Patch

Number = Any  # a float, or an array of P
Jet = list[Number]  # the displacement f and its derivatives f_x, f_y, f_xx, f_xy, f_yy
Components = tuple[Number, Number, Number]  # xx, yy and xy

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
        self._maps = covariant_maps(basis, x, y)
        self._base = basis.patch.base(*np.meshgrid(x, y)).curvature

    def __call__(self, coefficients: Array) -> Array:
        """xx, yy and xy of K (3, ny, nx) in 1/m for `coefficients` (Ni, Nj); NaN off the skin."""
        jet: Jet = [derivative(coefficients) for derivative in self._maps]
        return np.stack(_curvature_form(_surface(jet, self._base)))

    @property
    def at_rest(self) -> Array:
        """xx, yy and xy (3, 1, 1) or (3, ny, nx) in 1/m of the skin at rest."""
        at_rest = np.stack(np.broadcast_arrays(*self._base))
        return at_rest if at_rest.ndim > 1 else at_rest[:, None, None]


def _geometry(patch: Patch, positions: Array, jet: Jet, covariance: Array) -> LocalGeometry:
    """The geometry at `positions`, given the jets there with their `covariance` (..., 6, 6).

    One jet as six numbers takes a tenth of the time of arrays of one.
    """
    x, y = positions.tolist() if positions.ndim == 1 else positions.T
    base = patch.base(x, y)
    if base.slopes:
        to_local = base.covariant
        along = np.vecdot(to_local, np.array(jet).T[..., None, :]).T
        jet = along.tolist() if positions.ndim == 1 else list(along)
        covariance = propagated_covariance(to_local, covariance)
    b, surface = base.curvature, _surface(jet, base.curvature)
    xx, yy, xy = form = _curvature_form(surface)
    to_form = _sensitivity(jet, b, surface, form)
    return LocalGeometry(
        *_frame(base, jet, surface),
        _matrix(xx, xy, xy, yy),
        np.array(_torsion_form(jet, base, surface)).T,
        propagated_covariance(to_form, covariance),
    )


def _matrix(*rows: Number) -> Array:
    """(..., k, k) from its entries, numbers or arrays (P,), row by row."""
    entries = np.array(rows).T
    k = 3 if len(rows) == 9 else 2
    return entries.reshape(*entries.shape[:-1], k, k)


# The skin is r = r0 - f n0: the base, less f times its outward normal n0. In the base's own frame,
# the tangents e_1, e_2 along x and y and n0, n0_i = b_ij e_j and e_i,j = -b_ij n0 with the base's
# curvature b, which hardly changes from place to place. With S = 1 - f b and h_ij = f_ij + (b S)_ij
#     r_i = S_ij e_j - f_i n0,     r_ij = -h_ij n0 - (f_j b_ik + f_i b_jk) e_k,
#     r_1 x r_2 = N = W n = (S_yy f_x - S_xy f_y, S_xx f_y - S_xy f_x, det S),
#     -N . r_ij = det S h_ij + f_i u_j + f_j u_i,   u_i = b_ik N_k, k = 1, 2.
# The first form g has g_xx = |r_1|^2 = L^2 and det g = W^2. Coordinates on a bent surface are not
# orthogonal; Gram and Schmidt along x give the Gauss frame: r_1 = L x, r_2 = m r_1 + (W/L) y.


class _Surface(NamedTuple):
    """What all forms are made of: xx, yy and xy of S, b S, h and -N . r_ij, u, g_xx and W^2."""

    S: Components
    bS: Components
    h: Components
    N: Components
    u: tuple[Number, Number]
    second: Components
    g: Number
    m: Number
    V: Number
    W: Number

    @property
    def L(self) -> Number:
        return self.g**0.5


def _surface(jet: Jet, b: Components) -> _Surface:
    f, fx, fy, fxx, fxy, fyy = jet
    bx, by, bxy = b
    s, t, c = 1 - f * bx, 1 - f * by, 0.0
    sxx, syy, sxy, hxy = bx * s, by * t, 0.0, fxy
    nx, ny, nz = t * fx, s * fy, s * t
    ux, uy = bx * nx, by * ny
    g, gm = s * s + fx * fx, fx * fy
    if np.ndim(bxy) or bxy:
        c = -f * bxy
        sxx, syy, sxy = sxx + bxy * c, syy + bxy * c, bx * c + bxy * t
        nx, ny, nz = nx - c * fy, ny - c * fx, nz - c * c
        ux, uy = bx * nx + bxy * ny, bxy * nx + by * ny
        g, gm, hxy = g + c * c, gm + c * (s + t), fxy + sxy
    h = fxx + sxx, fyy + syy, hxy
    second = nz * h[0] + 2 * fx * ux, nz * h[1] + 2 * fy * uy, nz * h[2] + fx * uy + fy * ux
    V = nx * nx + ny * ny + nz * nz
    bS, N = (sxx, syy, sxy), (nx, ny, nz)
    return _Surface((s, t, c), bS, h, N, (ux, uy), second, g, gm / g, V, V**0.5)


def _curvature_form(of: _Surface) -> Components:
    """xx, yy and xy of K = [x y]' [n_x n_y] [metric]^-1, where n_x . r_y = -n . r_xy."""
    xx, yy, xy = of.second
    g, m, V, W = of.g, of.m, of.V, of.W
    rest = xy - m * xx
    return xx / (W * g), (yy - m * (xy + rest)) * g / (V * W), rest / V


def _sensitivity(jet: Jet, b: Components, of: _Surface, form: Components) -> Array:
    """How xx, yy and xy of the curvature `form` change with the jet, (..., 3, 6)."""
    (_, fx, fy, *_), (bx, by, bxy), (xx, yy, xy) = jet, b, form
    (s, t, c), (hx, hy, hxy), (nx, ny, nz), (ux, uy) = of.S, of.h, of.N, of.u
    (nxx, _, nxy), (sxx, _, sxy), g, m, W = of.second, of.bS, of.g, of.m, of.W
    V, zero = of.V, 0 * fx
    # With V = W^2 and B = -N . r_ij the form is
    #     xx = Bxx / (W g),    yy = (Byy - 2 m Bxy + m^2 Bxx) g / (W V),    xy = (Bxy - m Bxx) / V.
    shrinks = bx * t + by * s - 2 * bxy * c
    steps = [  # of g, g m and N with f, f_x and f_y, and what of B changes besides u
        (
            (-2 * sxx, -2 * sxy, bxy * fy - by * fx, bxy * fx - bx * fy, -shrinks),
            (
                -shrinks * hx - nz * (bx * bx + bxy * bxy),
                -shrinks * hy - nz * (by * by + bxy * bxy),
                -shrinks * hxy - nz * bxy * (bx + by),
            ),
        ),
        ((2 * fx, fy, t, -c, zero), (2 * ux, zero, uy)),
        ((zero, fx, -c, s, zero), (zero, 2 * uy, ux)),
    ]
    to_xx, to_yy, to_xy = 1 / (W * g), g / (W * V), 1 / V
    columns: list[list[Number]] = []
    for (dg, dgm, dnx, dny, dnz), (dxx, dyy, dxy) in steps:
        dm, dV = (dgm - m * dg) / g, 2 * (nx * dnx + ny * dny + nz * dnz)
        dux, duy = bx * dnx + bxy * dny, bxy * dnx + by * dny
        dxx = dxx + 2 * fx * dux
        dxy = dxy + fx * duy + fy * dux - m * dxx - dm * nxx
        dyy = dyy + 2 * fy * duy - m * (2 * dxy + m * dxx) - 2 * dm * nxy
        columns.append(
            [
                to_xx * dxx - xx * (dg / g + dV / (2 * V)),
                to_yy * dyy + yy * (dg / g - 3 * dV / (2 * V)),
                to_xy * dxy - xy * dV / V,
            ]
        )
    columns += [  # with f_xx, f_xy and f_yy
        [nz * to_xx, m * m * nz * to_yy, -m * nz * to_xy],
        [zero, -2 * m * nz * to_yy, nz * to_xy],
        [zero, nz * to_yy, zero],
    ]
    return np.array(columns).T


def _torsion_form(jet: Jet, base: Base, of: _Surface) -> tuple[Number, Number]:
    """T = y' [x_x x_y] [metric]^-1."""
    _, fx, fy, *_, fxy, _ = jet
    (sxx, syy, sxy), (hx, *_), m, L, W = of.bS, of.h, of.m, of.L, of.W
    # y . r_11 / L and y . r_12 / L, with y = (r_2 - m r_1) L / W.
    turn_x = (fy * hx - 2 * fx * sxy - m * fx * (hx - 2 * sxx)) / W
    turn_y = (fy * fxy - fx * syy - m * (fx * fxy - fy * sxx)) / W
    if base.turning:
        turn_x, turn_y = (
            turned + W / of.g * own
            for turned, own in zip((turn_x, turn_y), base.turning, strict=True)
        )
    return turn_x / L, (turn_y - m * turn_x) * L / W


def _frame(base: Base, jet: Jet, of: _Surface) -> tuple[Array, Array, Array]:
    """Position (..., 3), Gauss frame (..., 3, 3) and metric (..., 2, 2)."""
    (f, fx, fy, *_), (s, t, c), m, L, W = jet, of.S, of.m, of.L, of.W
    (nx, ny, nz), k = of.N, L / W
    in_base = (
        (s / L, c / L, -fx / L),
        ((c - m * s) * k, (t - m * c) * k, (m * fx - fy) * k),
        (nx / W, ny / W, nz / W),
    )
    axes = list(zip(*base[1:4], strict=True))
    rows = [u * e + v * d + w * n for u, v, w in in_base for e, d, n in axes]
    place = [p - f * n for p, n in zip(base.point, base.normal, strict=True)]
    metric = L, m * L, 0 * f, 1 / k
    if base.slopes:  # of steps along e_1 and e_2: the inverse of these has x and y
        (axx, axy), (ayx, ayy) = base.slopes
        det = axx * ayy - axy * ayx
        xx, xy, yx, yy = ayy / det, -ayx / det, -axy / det, axx / det
        metric = L * (xx + m * yx), L * (xy + m * yy), yx / k, yy / k
    return np.array(place).T, _matrix(*rows), _matrix(*metric)
