"""Point contact: position and force of the point load that fits the readings best."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol, cast

import numpy as np
from scipy.linalg import blas

from kappaskin.bases import Basis, SineBasis, basis_for
from kappaskin.estimation import Fit, PatternCache
from kappaskin.frames import Array, Contact, Mask
from kappaskin.mechanics import Compliance, Plate
from kappaskin.sensing import SensorLayout, gage_multipliers


class LoadProducts(NamedTuple):
    """Scalar products of T, the readings of a unit load at a place, and of its derivatives.

    `tt`, `tx`, `ty`, `xx`, `xy`, `yy` are those of T, T_x and T_y with each other, `h`, `hx` and
    `hy` those with the readings; `gives` in m/N is the displacement under the load.
    """

    tt: float
    tx: float
    ty: float
    xx: float
    xy: float
    yy: float
    h: float
    hx: float
    hy: float
    gives: float


class LoadResponses(Protocol):
    """Readings of point loads anywhere on the skin, by the same channels."""

    def on_grid(self, x: Array, y: Array) -> Array:
        """T'T (ny, nx) on the grid of `x` (nx,), `y` (ny,) in m."""
        ...

    def at(self, x: float, y: float, h: Array) -> LoadProducts:
        """The products at (x, y) in m; `h` (N,) are those of each function with the readings."""
        ...


def load_responses(basis: Basis, G: Array, C: Array) -> LoadResponses:
    """The responses with G = M'M (N, N) and the compliance C (N, N) in m/N.

    M (R, N) is what the channels read of unit modal forces.
    """
    if isinstance(basis, SineBasis) and not basis.patch.strip:
        return _Sines(basis, G, C)
    return _Dense(basis, G, C)


class _Dense:
    """With F the functions and their slopes along x and y, F G F' holds the products."""

    def __init__(self, basis: Basis, G: Array, C: Array) -> None:
        self._basis, self._G, self._C = basis, np.asfortranarray(G), C

    def on_grid(self, x: Array, y: Array) -> Array:
        points = np.stack(np.meshgrid(x, y), -1).reshape(-1, 2)
        functions = self._basis.at(points)
        return np.vecdot(functions @ self._G, functions).reshape(len(y), len(x))

    def at(self, x: float, y: float, h: Array) -> LoadProducts:
        F = self._basis.jet(x, y)[:3]
        # Faster than one thin product: of a symmetric G in Fortran's order only half is read.
        GF = np.array([blas.dsymv(1.0, self._G, f) for f in F])
        (tt, tx, ty), (_, xx, xy), (_, _, yy) = (GF @ F.T).tolist()
        gives = float(F[0] @ blas.dsymv(1.0, self._C, F[0]))
        hh, hx, hy = (F @ h).tolist()
        return LoadProducts(tt, tx, ty, xx, xy, yy, hh, hx, hy, gives)


# Products of two sines are sums of few waves: with t = pi x/a,
#     sin(i t) sin(k t) = sin(t) (sin((|i - k| + 1) t) + sin((|i - k| + 3) t) + ... ),
#     cos(i t) cos(k t) = (cos((i - k) t) + cos((i + k) t)) / 2,
#     cos(i t) sin(k t) = (sin((i + k) t) - sin((i - k) t)) / 2,
# the first up to i + k - 1, so that T'T is as exact near the rim, where it vanishes, as inside.
# Of G, N^2 numbers for N functions, tables of about 4 N are left, which a cache holds.


class _Sines:
    """For sines: each product of T and its slopes is a sum of waves along x times waves along y."""

    def __init__(self, basis: SineBasis, G: Array, C: Array) -> None:
        patch, self._shape = basis.patch, basis.shape
        Ni, Nj = self._shape
        self._kx, self._ky = kx, ky = np.pi / patch.a, np.pi / patch.b
        (ss_x, cc_x, cs_x), (ss_y, cc_y, cs_y) = _waves(Ni, kx), _waves(Nj, ky)
        sc_y = cs_y.swapaxes(1, 2)

        def table(in_x: Array, values: Array, in_y: Array) -> Array:
            """How much of each wave in x (2 Ni + 1) times each in y (2 Nj + 1) there is."""
            pairs = values.reshape(Ni, Nj, Ni, Nj).transpose(0, 2, 1, 3).reshape(Ni * Ni, Nj * Nj)
            return in_x.reshape(-1, Ni * Ni) @ pairs @ in_y.reshape(-1, Nj * Nj).T

        self._squares = tt = table(ss_x, G, ss_y)
        p, q = np.arange(2.0 * Ni + 1)[:, None], np.arange(2.0 * Nj + 1)
        # Times the sines of y, and times its cosines.
        self._of_sines = np.vstack(
            [tt, p * tt, table(cc_x, G, ss_y), table(cs_x, G, sc_y), table(ss_x, C, ss_y)]
        )
        self._of_cosines = np.vstack([q * tt, table(ss_x, G, cc_y)])
        self._turns = np.zeros((2, p.size + q.size), complex)
        self._turns[0, : p.size], self._turns[1, p.size :] = 1j * kx * p.ravel(), 1j * ky * q
        self._jet_x, self._jet_y = (
            np.stack([k * np.arange(1.0, count + 1), np.ones(count)], axis=-1)
            for k, count in ((kx, Ni), (ky, Nj))
        )

    def on_grid(self, x: Array, y: Array) -> Array:
        Ni, Nj = self._shape
        X = np.sin(np.multiply.outer(np.arange(2 * Ni + 1), self._kx * x))
        Y = np.sin(np.multiply.outer(np.arange(2 * Nj + 1), self._ky * y))
        return np.multiply.outer(Y[1], X[1]) * (Y.T @ self._squares.T @ X)

    def at(self, x: float, y: float, h: Array) -> LoadProducts:
        Ni, Nj = self._shape
        # Cosine and sine (..., 2) of each wave.
        waves = np.exp(np.dot((x, y), self._turns)).view(float).reshape(-1, 2)
        X, Y = waves[: 2 * Ni + 1], waves[2 * Ni + 1 :]
        by_sines = self._of_sines.dot(Y[:, 1]).reshape(5, -1).dot(X).tolist()
        by_cosines = self._of_cosines.dot(Y[:, 0]).reshape(2, -1).dot(X).tolist()
        (_, tt), (p_tt, _), (xx, _), (_, xy), (_, gives) = by_sines
        (_, q_tt), (_, yy) = by_cosines
        jet_x, jet_y = X[1 : Ni + 1] * self._jet_x, Y[1 : Nj + 1] * self._jet_y
        (_, hx), (hy, hh) = jet_x.T.dot(h.reshape(Ni, Nj)).dot(jet_y).tolist()
        kx, ky, sx, sy = self._kx, self._ky, math.sin(self._kx * x), math.sin(self._ky * y)
        return LoadProducts(
            sx * sy * tt,
            kx / 2 * sy * (math.cos(kx * x) * tt + sx * p_tt),
            ky / 2 * sx * (math.cos(ky * y) * tt + sy * q_tt),
            sy * xx,
            xy,
            sx * yy,
            hh,
            hx,
            hy,
            sx * sy * gives,
        )


def _waves(count: int, k: float) -> tuple[Array, Array, Array]:
    """Sines times sines, slopes times slopes, and slopes times sines as waves.

    Each (2 count + 1, count, count), for every pair of sines of wave numbers k, 2 k ...; the first
    has the sine of wave number k taken out.
    """
    i, j = np.indices((count, count)) + 1
    n = np.arange(2 * count + 1)[:, None, None]
    difference, both = np.abs(i - j), i + j
    sines = (n > difference) & (n < both) & ((n - difference) % 2 == 1)
    at_difference, at_both = n == difference, n == both
    slopes = k**2 * i * j / 2 * (1.0 * at_difference + at_both)
    mixed = k * i / 2 * (at_both - np.sign(i - j) * at_difference)
    return sines.astype(float), slopes, mixed


_SECOND = (2, 0), (0, 2), (1, 1)  # orders of the derivatives that flat skins read (Eqs. 3-5)
_ROUNDING = 1e-15  # of the largest: a part as small is none

ModalProjection = Callable[[Array], Array]
"""From readings K (3 P,) in 1/m, zero where missing, to M'K (N,)."""


def modal_projection(
    layout: SensorLayout, basis: Basis, compliance: Compliance, M: Array
) -> ModalProjection:
    """The map from readings K to M'K, where M (3 P, N) are the readings of unit modal forces.

    Where the elements stand on a grid, and the functions are sines that a load does not mix, M is
    for each component a matrix for x times one for y: a hundredth of the numbers.
    """
    unmixed = compliance.values.ndim == 1 and compliance.volume is None
    if isinstance(basis, SineBasis) and unmixed and _is_grid(layout):
        return _OnGrid(layout, basis, compliance.values)
    return lambda K: K @ M


def _sides(layout: SensorLayout) -> tuple[Array, Array]:
    """x of the columns and y of the rows of elements, for a grid."""
    m = layout.shape[0] if layout.shape else 1
    return layout.positions[:m, 0], layout.positions[::m, 1]


def _is_grid(layout: SensorLayout) -> bool:
    x, y = _sides(layout)
    grid = np.stack(np.meshgrid(x, y), -1).reshape(-1, 2)
    return layout.shape is not None and np.array_equal(grid, layout.positions)


class _OnGrid:
    def __init__(self, layout: SensorLayout, basis: SineBasis, compliance: Array) -> None:
        maps = [basis.on_grid(*_sides(layout), *order) for order in _SECOND]
        terms = _products(gage_multipliers(basis, layout.gage_length))
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


_SIGNIFICANT = 30.0  # drop of chi-squared below which a contact may be noise found by searching
_SEARCHED = 49  # points searched along each side
_FUNCTIONS = 15  # along each side, of the shape a point load makes: Table 1's definition
_STEPS = 20  # of Gauss-Newton at most; 2 or 3 do but for the last millimetres at the rim
_CONVERGED = 1e-4  # of a side: the step after one as short is shorter than 1e-6
_RIDGE = 1e-12  # keeps a load on the rim, which moves nothing, solvable
_DOUBTFUL = 0.15  # of a side: within it, a contact may be one on the rim

_AS_WELL = 1.2  # times the residual of the fitted shape that a single point load may leave
_REACH = 1.96  # standard deviations to either side in a 95 % interval

NO_CONTACT = Contact(
    np.full(2, np.nan), np.full(2, np.nan), math.nan, math.nan, math.nan, math.nan, 0, False, False
)


@dataclass(frozen=True, slots=True, eq=False)
class _Readings:
    """Readings K as M'K (N,) and K'K, with the degrees of freedom `spare`."""

    h: Array
    power: float
    spare: int


@dataclass(frozen=True, slots=True, eq=False)
class _ContactTables:
    """What depends on which readings are used: the responses, and T'T on the grid (ny, nx)."""

    loads: LoadResponses
    norm: Array
    spare: int


class PointContact:
    """The point load on a skin that explains the readings best, by maximum likelihood.

    A load P at (x, y) makes the readings P T(x, y), T = M t with t = compliance times what each
    function feels there (Eqs. 2, 9). The best P for readings K is T'K / T'T, and what it explains
    of their sum of squares is (T'K)^2 / T'T: searched on a grid in every frame, where T'K is one
    map from M'K, so that no jump of the contact is missed; then refined by Gauss-Newton steps in
    x and y, with P at its best for each (variable projection, doi:10.1137/0710036). All of it
    needs the readings only as M'K and M'M.
    """

    def __init__(self, plate: Plate, layout: SensorLayout, edge: str = "hinged") -> None:
        self.patch, strip = plate.patch, plate.patch.strip
        self.basis = basis_for(self.patch, edge, _FUNCTIONS, 1 if strip else _FUNCTIONS)
        compliance = plate.compliance(self.basis)
        self._gives = compliance.after(np.eye(self.basis.size))
        self._M = compliance.after(layout.curvature_operator(self.basis))
        self._modal = modal_projection(layout, self.basis, compliance, self._M)
        self._live = layout.live.ravel()
        x, y = self.patch.grid(_SEARCHED + 2, 3 if strip else _SEARCHED + 2)
        self._x, self._y = x[1:-1], y[1:-1]
        self._map = self.basis.on_grid(self._x, self._y)
        points = np.stack(np.meshgrid(self._x, self._y), -1).reshape(-1, 2)
        self._still = np.flatnonzero(~self.patch.moves(points))
        self._cache = PatternCache[_ContactTables]()
        self._whole = self._cache(self._live, self._tables)
        self._all_live = bool(self._live.all())

    def _tables(self, used: Mask) -> _ContactTables:
        """The tables for the readings `used` (3 P,)."""
        M = self._M[used]
        loads = load_responses(self.basis, M.T @ M, self._gives)
        norm = loads.on_grid(self._x, self._y)
        norm[norm <= 0] = math.inf  # a load that these readings do not see explains nothing
        return _ContactTables(loads, norm, max(len(M) - 3, 1))

    def __call__(self, curvature: Array, fit: Fit) -> Contact:
        """The contact for `curvature` (3, P) in 1/m, NaN where missing, and the `fit` to it."""
        K, tables, power = self._used(curvature.ravel())
        readings = _Readings(self._modal(K), power, tables.spare)
        explained = self._map(readings.h.reshape(self.basis.shape))
        explained *= explained
        explained /= tables.norm
        explained.put(self._still, 0.0)
        row, column = divmod(int(explained.argmax()), len(self._x))
        least = _threshold(float(cast("float", fit.spare))) * float(fit.noise) ** 2
        if not explained[row, column] > least:
            return NO_CONTACT
        x = _parabola_peak(self._x, explained[row], column)
        y = _parabola_peak(self._y, explained[:, column], row)
        return self._refined(*self.patch.inward(x, y), readings, tables.loads, fit)

    def _used(self, K: Array) -> tuple[Array, _ContactTables, float]:
        """The readings with zeros for missing ones, their tables, and their sum of squares."""
        power = float(K.dot(K))
        if self._all_live and math.isfinite(power):
            return K, self._whole, power
        used = self._live & np.isfinite(K)
        known = np.where(used, K, 0.0)
        return known, self._cache(used, self._tables), float(known.dot(known))

    def _refined(
        self, x: float, y: float, readings: _Readings, loads: LoadResponses, fit: Fit
    ) -> Contact:
        x, y, place = self._optimised(x, y, readings.h, loads)
        # What a point load leaves of the readings: the noise, or more where it is no point load.
        spread = math.sqrt(max(readings.power - place.explained, 0.0) / readings.spare)
        sd_x, sd_y, sd_force = place.unit_sd
        return Contact(
            np.array([x, y]),
            np.array([spread * sd_x, spread * sd_y]),
            place.force,
            spread * sd_force,
            *self._displacement(fit, x, y, place),
            readings.spare,
            spread < _AS_WELL * float(fit.noise),
            self._near_rim(x, y, readings.h, loads, place.explained - (_REACH * spread) ** 2),
        )

    def _optimised(
        self, x: float, y: float, h: Array, loads: LoadResponses
    ) -> "tuple[float, float, _NewtonStep]":
        """The best position near (x, y), and the last step to it."""
        a, b = self.patch.a, self.patch.b
        place = _NewtonStep(loads.at(x, y, h))
        for _ in range(_STEPS):
            dx, dy = place.step
            x, y = x + _clamped(-a / 50, dx, a / 50), y + _clamped(-b / 50, dy, b / 50)
            x, y = self.patch.inward(x, y)
            if abs(dx) < _CONVERGED * a and abs(dy) < _CONVERGED * b:
                break
            place = _NewtonStep(loads.at(x, y, h))
        return x, y, place

    def _near_rim(self, x: float, y: float, h: Array, loads: LoadResponses, least: float) -> bool:
        """Whether the contact may lie on the rim, where its force is not determined.

        It is within the shortest half wave of the functions from a held edge, or a load on the rim
        beside it explains as much of the readings, `least` or more.
        """
        if self.basis.unobservable is not None:
            return False
        for x_rim, y_rim, share in self.patch.near_rim(x, y, _DOUBTFUL):
            if share < 1 / _FUNCTIONS:
                return True
            there = loads.at(x_rim, y_rim, h)
            if there.h**2 > least * there.tt:
                return True
        return False

    def _displacement(
        self, fit: Fit, x: float, y: float, place: "_NewtonStep"
    ) -> tuple[float, float]:
        """Displacement in m of the fitted shape at (x, y), and its standard deviation.

        Besides the noise it includes the difference to the displacement under the point load,
        which is finer than the fit's functions.
        """
        shape, covariance = fit.jet(x, y)
        fitted, observed = float(shape[0]), float(covariance[0, 0])
        observed = math.sqrt(observed) if observed >= 0 else math.nan
        return fitted, math.hypot(observed, fitted - place.force * place.gives)


class _NewtonStep:
    """The best force at a place, the Gauss-Newton step from there, and the error bars.

    `force` in N is that after the step, `gives` the compliance of the skin there in m/N.
    """

    def __init__(self, of: LoadProducts) -> None:
        tt, tx, ty, xx, xy, yy, h, hx, hy, self.gives = of
        force, u, v = h / tt, tx / tt, ty / tt
        # The slopes without what T itself explains of them: S, with the gradient g.
        Sxx, Sxy = xx - u * tx, xy - u * ty
        Syy = yy - v * ty if yy else math.inf  # a strip is alike along y: no step, no error
        gx, gy = hx - u * h, hy - v * h
        Cx = max(Sxx - Sxy**2 / Syy, _RIDGE * xx)
        Cy = max(Syy - Sxy**2 / max(Sxx, _RIDGE * xx), _RIDGE * yy)
        dx, dy = (gx - gy * Sxy / Syy) / (Cx * force), (gy - gx * Sxy / Sxx) / (Cy * force)
        self.step, self.explained = (dx, dy), h * force
        self.force = force * (1 - u * dx - v * dy)
        of_force = math.sqrt(1 / tt + (u - v * Sxy / Syy) ** 2 / Cx + v**2 / Syy)
        strength = abs(force)
        self.unit_sd = 1 / math.sqrt(Cx) / strength, 1 / math.sqrt(Cy) / strength, of_force


def _clamped(low: float, value: float, high: float) -> float:
    return min(max(value, low), high)


def _parabola_peak(x: Array, values: Array, i: int) -> float:
    """Maximum of the parabola through `values` at `x` around the largest, number `i`."""
    if not 0 < i < len(x) - 1:
        return float(x[i])
    before, here, after = values[i - 1 : i + 2].tolist()
    bend = before - 2 * here + after
    return float(x[i] + (x[1] - x[0]) * (before - after) / (2 * bend)) if bend else float(x[i])


def _threshold(spare: float) -> float:
    """What a contact must explain, in units of the noise variance estimated from `spare` readings.

    The likelihood ratio spare ln(1 + F / spare) must exceed `_SIGNIFICANT`.
    """
    return spare * math.expm1(_SIGNIFICANT / spare) if spare > 1 else math.inf
