"""Point contact: position and force of the point load that fits the readings best."""

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple, cast

import numpy as np
import scipy
from numpy.typing import ArrayLike
from scipy.linalg import lapack

from kappaskin.bases import Basis, SineBasis, held_near
from kappaskin.contact.element_grid import modal_projection
from kappaskin.contact.influence import BY_PROFILE, influence_of, read_of_modes, sizes_on
from kappaskin.contact.stretched import StretchedSkin
from kappaskin.estimation import Fit, PatternCache
from kappaskin.frames import Array, Contact, Mask
from kappaskin.mechanics import Plate
from kappaskin.sensing import SensorLayout
from kappaskin.skin import MeshSkin


def _squares_on_grid(basis: Basis, G: Array, x: Array, y: Array) -> Array:
    """T'T (ny, nx) of what the channels read of a unit load on the grid of `x` (nx,), `y` (ny,).

    G = M'M (N, N), where M (R, N) is what they read of unit modal forces.
    """
    if not isinstance(basis, SineBasis) or basis.patch.strip:
        functions = basis.at(np.stack(np.meshgrid(x, y), -1).reshape(-1, 2))
        return np.vecdot(functions @ G, functions).reshape(len(y), len(x))
    # A product of two sines is a sum of few waves: with t = pi x/a, sin(i t) sin(k t) =
    #     sin(t) (sin((|i - k| + 1) t) + sin((|i - k| + 3) t) + ... ), up to i + k - 1,
    # so that T'T is as exact near the rim, where it vanishes, as inside.
    Ni, Nj = basis.shape
    pairs = G.reshape(Ni, Nj, Ni, Nj).transpose(0, 2, 1, 3).reshape(Ni * Ni, Nj * Nj)
    squares = _waves(Ni).reshape(-1, Ni * Ni) @ pairs @ _waves(Nj).reshape(-1, Nj * Nj).T
    X, Y = (
        np.sin(np.multiply.outer(np.arange(2 * count + 1), np.pi * at / side))
        for count, at, side in ((Ni, x, basis.patch.a), (Nj, y, basis.patch.b))
    )
    return np.multiply.outer(Y[1], X[1]) * (Y.T @ squares.T @ X)


def _waves(count: int) -> Array:
    """Products of the first sines, over the first, as waves (2 count + 1, count, count)."""
    i, j = np.indices((count, count)) + 1
    n = np.arange(2 * count + 1)[:, None, None]
    difference = np.abs(i - j)
    return ((n > difference) & (n < i + j) & ((n - difference) % 2 == 1)).astype(float)


_SIGNIFICANT = 30.0  # drop of chi-squared below which a contact may be noise found by searching
_SEARCHED = 33  # points searched along each side
_NODES = 64  # of them whose normal equations are kept
_TRIED = 3  # loads on a cap that a step is taken from, before one is refined
_FUNCTIONS = 15  # along each side, of the shape searched for
_STEPS = 20  # of Gauss-Newton at most; 1 or 2 do but for the last millimetres at the rim
_WORTH = 2.0  # variances of the noise: after a step that gains less, another one is not worth it
_CAREFUL = 0.1  # of a side: within it a strong load may be taken for a weak one further in,
_WORTH_AT_RIM = 0.1  # and small steps in this many variances lead to it
_HOPE = 10.0  # times what a step gains: more is not to be gained by all that follow
_NO_GAIN = 1e-13  # of the readings' squares
_FURTHEST = 0.05  # of a side, in one step
_RIDGE = 1e-12  # keeps a load on the rim, which moves nothing, solvable
_HARDLY = 1e-9  # of the largest: a direction with no more left is none
_DOUBTFUL = 0.15  # of a side: within it, a contact may be one on the rim
_RIM = 1 / 15  # of a side: within it, a load moves the skin too little to be told
_TO_GAUSSIAN = 0.5  # of the way from a disc: the profile of a load, whose standard deviation is as
_FURTHER = -1.0, 2.0  # much; and how far along that way slopes are followed

_OF_PROFILE = 0.1  # of what its width takes off the displacement under a load: it may be no disc
_OF_PLACE = 0.06  # of the shorter side: error of a place on a mesh, times that of a force
_AS_WELL = 1.2  # times the residual of the fitted shape that a single load may leave
_REGION = 7.81  # variances: drop of chi-squared in the 95 % region of x, y and size

NO_CONTACT = Contact(
    np.full(2, np.nan), np.full(2, np.nan), math.nan, math.nan, math.nan, math.nan, 0, False, False
)


@dataclass(frozen=True, slots=True, eq=False)
class _Tables:
    """What depends on which readings are used: T'T (S,), their weights, and `spare` ones.

    The weights (3 P,) are 1 where used, else 0; None where all are used. `free` (d, 3 P) are
    orthonormal directions of them that may be anything.
    """

    norm: Array
    weights: Array | None
    spare: int
    free: Array


class _Linearised(NamedTuple):
    """The load at a place: the best step from there, and the error bars.

    `steps` are the force after the step, in units of the influence, and that force times the steps
    in x, y and s; `profile` is that times how far the profile is from the usual one; `inverse`
    (4, 4) or (3, 3) their covariance for unit noise. `left` is the sum of squares of the readings
    after the step, `gain` what the step takes off it, `power` that of the readings; `weights` (R,)
    are those of all these, None where all are 1.
    """

    steps: list[float]
    profile: float
    inverse: Array
    left: float
    gain: float
    power: float
    weights: Array | None


class PointContact:
    """The load on a small area of the skin that explains the readings best, by maximum likelihood.

    A load P at (x, y), spread over a disc of radius sqrt(s), makes the readings P T(x, y, s). The
    best P for readings K is T'K / T'T, and what it explains of their sum of squares is
    (T'K)^2 / T'T. In every frame a point load is searched for on a grid, so that no jump of the
    contact is missed: T = M t there, with t = compliance times what each function of `basis` feels
    (Eqs. 2, 9), and T'K is one map from M'K; on a cap, where a skin bends close around a load
    only, at `Influence.nodes`, of several sizes. Gauss-Newton steps in x, y, s and P refine it with
    the `Influence`, which no number of functions cuts short. How the load is spread over its size
    is unknown. On a cap, where it is read all around, it is fitted: T is that of a disc and a share
    of what a Gaussian as wide differs from it by, 1/2 with a standard deviation of 1/2. Elsewhere
    it is read right under the load alone; that is added to the variance there. Along the `free`
    directions (d, R), as those of a drift, the readings may be anything: they are fitted beside the
    load. So are, unless others are given, the offsets of quantities of an unknown zero. Readings
    are weighted by `sigma`, that of each.
    """

    def __init__(
        self,
        plate: Plate,
        layout: SensorLayout,
        edge: str = "hinged",
        sigma: Array | None = None,
        free: Array | None = None,
    ) -> None:
        self._scale = None if sigma is None else 1 / sigma.ravel()
        layout = replace(layout, scale=self._scale)
        self.patch, strip = plate.patch, plate.patch.strip
        self.basis, compliance, self._M = read_of_modes(plate, layout, edge, _FUNCTIONS)
        self._modal = modal_projection(layout, self.basis, compliance, self._M)
        self._free = layout.offsets.T if free is None else free
        if self._scale is not None:
            self._free = self._free * self._scale
        # The readings of a load, their derivatives by x, y and s, what the elements read, how a
        # Gaussian load differs, and the directions along which what is read may be anything.
        self._rows = np.zeros((6 + len(self._free), len(self._M)))
        self._influence = influence_of(plate, layout, edge, _FUNCTIONS, self._rows[:4])
        self._unknowns = 4 if self._influence.sized else 3
        self._theory_error = plate.theory_error
        self._stretched = StretchedSkin(plate, layout, edge) if plate.stretches else None
        self._live, self._element = layout.live.ravel(), layout.element
        self._readings = self._none = np.zeros(len(self._M))
        x, y = self.patch.grid(_SEARCHED + 2, 3 if strip else _SEARCHED + 2)
        self._x, self._y = x[1:-1], y[1:-1]
        self._side = self.patch.a if strip else min(self.patch.a, self.patch.b)
        self._start, self._least, self._largest = sizes_on(self.patch)
        self._nodes = self._influence.nodes
        self._fits_profile = self._nodes is not None
        if self._nodes is None:
            points = np.stack(np.meshgrid(self._x, self._y), -1).reshape(-1, 2)
            self._places = np.column_stack([points, np.full(len(points), self._start)])
            self._map = self.basis.on_grid(self._x, self._y)
        else:
            self._places = self._nodes[0]
            self._searched_T = np.ascontiguousarray(self._nodes[1].T)
        self._still = np.flatnonzero(~self.patch.moves(self._places[:, :2]))
        self._at_node = lru_cache(_NODES)(self._node)
        self._cache = PatternCache[_Tables]()
        self._whole = self._cache(self._live, self._tables)
        self._all_live = bool(self._live.all())
        self.misfit = math.nan
        """Variance that the last contact leaves of the readings, over that of the fit."""
        self.rest = self._readings
        """What the last contact leaves (R,) of the readings, 0 where one is missing.

        Without what it leaves `along` the free directions. Over `sigma`, as all of these.
        """
        self.along = self._readings
        """What the last contact leaves along the free directions (R,)."""
        self.linear = self._rows[:0]
        """Readings of the last contact for a unit force, and their derivatives, (n, R)."""

    def covariance(self, x: float, y: float, s: float, force: float, noise: float) -> Array:
        """Covariance (3, 3) of force in N, x and y in m, due to a `noise` of the readings.

        Of a load of this `force` in N at (x, y) in m, over a disc of radius sqrt(s) in m, whose
        size is unknown too, on a cap its profile as well. The noise is in the readings' unit, or in
        units of `sigma`. That a skin stretches is left out.
        """
        weights, strength = self._look(x, y, s, force, noise)
        n, rows = self._unknowns, self._rows * weights
        free = rows[6:]
        if len(free):
            rows -= rows @ free.T @ np.linalg.pinv(free @ free.T) @ free
        T, q, known = rows[:n], rows[5], (noise / (_TO_GAUSSIAN * strength)) ** 2 or math.inf
        share = T @ q / (q @ q + known)
        # What noise n, and a profile p off the usual one, do: H^-1 (T - share q)' (w n + p q).
        T_left = T - np.multiply.outer(share, q)
        by_reading = _inverse(T_left @ T.T) @ T_left
        of_noise, of_profile = by_reading * weights, by_reading @ q
        covariance = of_noise @ of_noise.T + np.multiply.outer(of_profile, of_profile) / known
        unit = np.array([self._influence.unit, 1 / strength, 1 / strength])
        return noise**2 * np.multiply.outer(unit, unit) * covariance[:3, :3]

    def information(self, x: float, y: float, s: float, force: float, noise: float) -> Array:
        """The Fisher information (P, n, n) of the readings of each element on such a load.

        On all that is unknown: the force as a share, x and y in m, the size, what is free, and as
        the last the profile, which is 0 with a variance of 1.
        """
        weights, strength = self._look(x, y, s, force, noise)
        n, unit = self._unknowns, strength / noise
        profile = _TO_GAUSSIAN * unit * self._rows[5:6]
        rows = np.concatenate([unit * self._rows[:n], self._free, profile])
        found = np.zeros((self._element.max() + 1, *2 * (len(rows),)))
        np.add.at(found, self._element, np.einsum("ir,jr,r->rij", rows, rows, weights))
        return found

    def _look(
        self, x: float, y: float, s: float, force: float, noise: float
    ) -> tuple[Array, float]:
        """Write what is read of a load into the rows; weights (R,), and its strength."""
        tables, s = self._used(self._none)[1], max(s, self._least)
        strength = force / self._influence.unit
        self._influence.at(x, y, s)
        profile = self._influence.profile(s)
        self._rows[5] = 0.0 if profile is None else profile[0]
        weights = self._weights(s, strength, tables, noise**2)
        return np.ones(len(self._M)) if weights is None else weights, strength

    def _tables(self, used: Mask) -> _Tables:
        """The tables for the readings `used` (3 P,)."""
        M, free = self._M[used], orthonormal(np.where(used, self._free, 0.0))
        if self._nodes is None:
            hidden = free[:, used] @ M
            norm = _squares_on_grid(
                self.basis, M.T @ M - hidden.T @ hidden, self._x, self._y
            ).ravel()
        else:
            T = self._nodes[1][:, used]
            norm = np.sum(T**2, axis=1) - np.sum((T @ free[:, used].T) ** 2, axis=1)
        norm[norm <= 0] = math.inf  # a load that these readings do not see explains nothing
        weights = None if used.all() else used.astype(float)
        return _Tables(norm, weights, max(len(M) - len(free) - self._unknowns, 1), free)

    def __call__(self, curvature: Array, fit: Fit, most: float = math.inf) -> Contact:
        """The contact for the readings of a frame, NaN where missing, and the `fit` to them.

        `NO_CONTACT` too where no load comes near leaving at `most` that sum of squares.
        """
        read = curvature.ravel()
        K, tables = self._used(read if self._scale is None else read * self._scale)
        explained = self._searched(K)
        explained *= explained
        explained /= tables.norm
        explained.put(self._still, 0.0)
        node = int(explained.argmax())
        variance, self.rest, self.along = float(fit.noise) ** 2, K, self._none
        if not explained[node] > _threshold(float(cast("float", fit.spare))) * variance:
            return NO_CONTACT
        self._rows[4] = self._readings = K
        if tables.weights is None and self._stretched is None and not len(self._free):
            if self._nodes is not None:  # what explains most may lead to less
                best = explained.argpartition(-_TRIED)[-_TRIED:].tolist()
                node = min(best, key=lambda each: self._first(each).left)
            (x, y, s), here = self._places[node].tolist(), self._first(node)
        else:
            x, y, s = self._peak(explained, node)
            if self._stretched is not None:
                self._stretched.begin(x, y, float(fit.jet(x, y)[0][0]))
            here = self._linearised(x, y, s, None, tables, variance)
        return self._refined(x, y, s, here, tables, variance, fit, most)

    def _searched(self, K: Array) -> Array:
        """T'K (S,) of the loads searched for."""
        if self._nodes is None:
            return self._map(self._modal(K).reshape(self.basis.shape)).ravel()
        return K.astype(np.float32).dot(self._searched_T).astype(float)

    def _peak(self, explained: Array, node: int) -> tuple[float, float, float]:
        """x, y and s of the load that explains most: between the points, where they are a grid."""
        x, y, s = self._places[node].tolist()
        if self._nodes is None:
            row, column = divmod(node, len(self._x))
            on_grid = explained.reshape(len(self._y), -1)
            x = _parabola_peak(self._x, on_grid[row], column)
            y = _parabola_peak(self._y, on_grid[:, column], row)
        return *self.patch.inward(x, y), s

    def _used(self, K: Array) -> tuple[Array, _Tables]:
        """The readings, 0 where missing, less their part along `free`, and the tables."""
        if self._all_live and math.isfinite(float(K.dot(K))):
            known, tables = K, self._whole
        else:
            used = self._live & np.isfinite(K)
            known, tables = np.where(used, K, 0.0), self._cache(used, self._tables)
        if len(tables.free):
            known = known - (tables.free @ known) @ tables.free
            self._rows[6:] = 0.0
            self._rows[6 : 6 + len(tables.free)] = tables.free
        return known, tables

    def _first(self, node: int) -> _Linearised:
        """As `_linearised`, where all readings are used, at a load searched for."""
        rows, first, inverse = self._at_node(node)
        K, self.linear = self._readings, rows
        s: float = self._places.item(node, 2)
        return self._step(s, first, inverse, rows.dot(K), float(K.dot(K)), None)

    def _node(self, node: int) -> tuple[Array, float, Array]:
        x, y, s = self._places[node].tolist()
        self._influence.at(x, y, s)
        if (profile := self._influence.profile(s)) is not None:
            self._rows[:4] += _TO_GAUSSIAN * profile
        rows = self._rows[: self._unknowns].copy()
        H = rows.dot(rows.T)
        return rows, H.item(0, 0), _inverse(H)

    def _refined(
        self,
        x: float,
        y: float,
        s: float,
        here: _Linearised,
        tables: _Tables,
        variance: float,
        fit: Fit,
        most: float,
    ) -> Contact:
        a, b, force = _FURTHEST * self.patch.a, _FURTHEST * self.patch.b, 0.0
        hopeless, there, cost = False, (x, y, s), math.inf
        for _ in range(_STEPS):
            if hopeless := here.left - _HOPE * here.gain > most:
                break
            worse = here.left + here.gain - cost
            if self._fits_profile and worse > 0 and worse > self._worth(x, y) * variance:
                x, y, s = (x + there[0]) / 2, (y + there[1]) / 2, (s + there[2]) / 2
            else:
                there, cost = (x, y, s), here.left + here.gain
                before, (force, dx, dy, ds) = force, here.steps
                x, y = self.patch.inward(
                    x + _clamped(-a, dx / force, a), y + _clamped(-b, dy / force, b)
                )
                s = _clamped(self._least, _resized(s, ds / force), self._largest)
                variance, gain = here.left / tables.spare, here.gain
                if self._stretched is not None:  # the readings are not linear in the force
                    self._stretched.move(force, dx, dy)
                    gain += (force - before) ** 2 / here.inverse.item(0, 0)
                left = gain - _NO_GAIN * here.power
                if left <= _WORTH * variance and left <= self._worth(x, y) * variance:
                    break
            here = self._linearised(x, y, s, here, tables, variance)
        self.rest = self._rows[4] - np.dot(here.steps[: self._unknowns], self.linear)
        if here.profile:
            self.rest -= here.profile * self._rows[5]
        if tables.weights is not None:
            self.rest *= tables.weights
        if len(tables.free):
            self.along = (tables.free @ self.rest) @ tables.free
            self.rest -= self.along
        return NO_CONTACT if hopeless else self._contact(x, y, s, here, tables, fit)

    def _worth(self, x: float, y: float) -> float:
        """Variances of the noise that a step must gain to be worth another one."""
        return _WORTH_AT_RIM if self.patch.near_rim(x, y, _CAREFUL) else _WORTH

    def _linearised(
        self,
        x: float,
        y: float,
        s: float,
        last: _Linearised | None,
        tables: _Tables,
        variance: float,
    ) -> _Linearised:
        """The best step from a load at (x, y) of size s, where the `last` one led."""
        self._influence.at(x, y, s)
        profile = self._influence.profile(s) if last and variance else None
        force = last.steps[0] if last else 0.0
        if last and profile is not None:
            self._rows[5] = profile[0]
            self._rows[0] += _TO_GAUSSIAN * profile[0]
            least, most = _FURTHER
            along = _clamped(least, _TO_GAUSSIAN + last.profile / force, most)
            self._rows[1:4] += along * profile[1:]
        weights = self._weights(s, force, tables, variance)
        if self._stretched is not None:
            self._rows[4] = self._readings
            self._stretched.stretch(x, y, s, self._influence.unit, self._rows)
        rows = self._rows if weights is None else self._rows * weights
        products, n = _without_free(rows.dot(self._rows.T)), self._unknowns
        self.linear = self._rows[:n]
        H, g, power = products[:n, :n], products[:n, 4], products.item(4, 4)
        if profile is None:
            return self._step(s, H.item(0, 0), _inverse(H), g, power, weights)
        # The profile is eliminated: it is determined by what the elements read and beforehand.
        beside, known = products[5, :5], variance / (_TO_GAUSSIAN * force) ** 2
        share = beside / (products.item(5, 5) + known)
        np.subtract(H, np.multiply.outer(beside[:n], share[:n]), H)
        g -= share.item(4) * beside[:n]
        explained = share.item(4) * beside.item(4)
        here = self._step(s, H.item(0, 0), _inverse(H), g, power, weights, explained)
        return here._replace(profile=share.item(4) - float(share[:n].dot(here.steps[:n])))

    def _step(
        self,
        s: float,
        first: float,
        inverse: Array,
        g: Array,
        power: float,
        weights: Array | None,
        by_profile: float = 0.0,
    ) -> _Linearised:
        """The best step of a load of size `s`, from the normal equations and their `inverse`.

        The profile explains `by_profile` of the `power` alone.
        """
        at_place, best = g.item(0) ** 2 / first, inverse.dot(g)
        if self._unknowns == 4 and s + best[3] / best[0] < self._least:
            # As small as can be: the best of those that are no smaller.
            shrinks = best[0] * (self._least - s)
            best -= inverse[3] * ((best[3] - shrinks) / inverse[3, 3])
        steps, explained = best.tolist(), float(best.dot(g))
        if self._unknowns == 3:
            steps.append(0.0)
        left = max(power - by_profile - explained, 0.0)
        return _Linearised(steps, 0.0, inverse, left, explained - at_place, power, weights)

    def _weights(self, s: float, force: float, tables: _Tables, variance: float) -> Array | None:
        """Weights (3 P,) of the readings; None where all are 1."""
        share = (BY_PROFILE * force) ** 2 / variance if variance else 0.0
        trust = self._influence.trust(s, share) if share else None
        if trust is None:
            return tables.weights
        of_all = trust[self._element]
        return of_all if tables.weights is None else of_all * tables.weights

    def _contact(
        self, x: float, y: float, s: float, here: _Linearised, tables: _Tables, fit: Fit
    ) -> Contact:
        # What the load leaves of the readings: the noise, or more where it is no single load.
        spread, unit = math.sqrt(here.left / tables.spare), self._influence.unit
        strength, force = abs(here.steps[0]), here.steps[0] * unit
        sd: list[float] = (spread * np.sqrt(here.inverse.diagonal())).tolist()
        theory = self._theory_error
        of_place = theory if self.patch.is_shallow else 0.0
        on_mesh = _OF_PLACE * theory * self._side if isinstance(self.patch, MeshSkin) else 0.0
        self.misfit = (spread / float(fit.noise)) ** 2 if fit.noise else math.inf
        sd_x = math.hypot(sd[1] / strength, of_place * (x - self.patch.a / 2), on_mesh)
        sd_y = math.hypot(sd[2] / strength, of_place * (y - self.patch.b / 2), on_mesh)
        size = (s, sd[3] / strength) if self._influence.sized else (math.nan, math.nan)
        single, near_rim = (
            spread < _AS_WELL * float(fit.noise),
            self._near_rim(x, y, s, here, tables),
        )
        if self._nodes is not None and single and not near_rim:
            under = self._under_load(x, y, s, here, spread)
        else:
            under = self._under_fit(fit, x, y, force)
        return Contact(
            np.array([x, y]),
            np.array([sd_x, sd_y]),
            force,
            math.hypot(sd[0] * unit, theory * force),
            *under,
            tables.spare,
            single,
            near_rim,
            *size,
        )

    def _near_rim(self, x: float, y: float, s: float, here: _Linearised, tables: _Tables) -> bool:
        """Whether the contact may lie on the rim, where its force is not determined.

        It is so near a held edge that a load hardly moves the skin, or a load on the rim beside it
        explains as much of the readings.
        """
        if self.basis.unobservable is not None:
            return False
        least = here.power - here.left * (1 + _REGION / tables.spare)
        for x_rim, y_rim, share in held_near(self.basis, x, y, _DOUBTFUL):
            if share < _RIM:
                return True
            K = self._rows[4]
            self._influence.at(x_rim, y_rim, s)
            T = self._rows[0] - (tables.free @ self._rows[0]) @ tables.free
            read = T if here.weights is None else T * here.weights
            if float(read.dot(K)) ** 2 > least * float(read.dot(T)):
                return True
        return False

    def _under_load(
        self, x: float, y: float, s: float, here: _Linearised, spread: float
    ) -> tuple[float, float]:
        """Displacement in m under the load, on a cap or a mesh, and its standard deviation.

        Where a point load P moves a shallow sphere of bending stiffness D by w0 = P l^2 / (8 D), a
        disc of radius mu l that bears as much moves it by 8 w0 (1 + mu ker' mu) / (pi mu^2) (E.
        Reissner, Stresses and small displacements of shallow spherical shells II, 1946).
        """
        unit, most = self._influence.unit, self._influence.gives(x, y)
        length = math.sqrt(unit * most / math.pi)
        mu = math.sqrt(s) / length
        held = 1 + mu * float(scipy.special.kerp(mu))
        share = 8 * held / (math.pi * mu**2)
        by_mu = -8 * (float(scipy.special.kei(mu)) / mu + 2 * held / mu**3) / math.pi
        # Of the force, and of force times size.
        gradient = unit * most * np.array([share, by_mu / (2 * length * math.sqrt(s))])
        of_noise = spread**2 * float(gradient @ here.inverse[::3, ::3] @ gradient)
        under = here.steps[0] * unit * most
        theory, profile = self._theory_error * share, _OF_PROFILE * (1 - share)
        inexact = under * math.hypot(theory, profile)
        return under * share, math.hypot(math.sqrt(of_noise), inexact)

    def _under_fit(self, fit: Fit, x: float, y: float, force: float) -> tuple[float, float]:
        """Displacement in m of the fitted shape at (x, y), and its standard deviation.

        Besides the noise it includes the difference to the displacement under the load, which is
        finer than the fit's functions.
        """
        under = force * self._influence.gives(x, y)
        if self._stretched is not None:
            under += self._stretched.more(x, y, force)
        shape, covariance = fit.jet(x, y)
        fitted, observed = float(shape[0]), float(covariance[0, 0])
        observed = math.sqrt(observed) if observed >= 0 else math.nan
        return fitted, math.hypot(observed, fitted - under)


def left_by_chance(share: float, spare: int, of_fit: ArrayLike) -> float:
    """Variance left by a load, over that of a fit, which this share of single loads exceeds.

    They leave `spare` readings, and the fit `of_fit`.
    """
    fewer = max(float(cast("float", of_fit)), 1.0)
    more = max(spare - fewer, 1.0)
    return (fewer + more * _quantile(more, fewer, 1 - share)) / (fewer + more)


@lru_cache(64)
def _quantile(more: float, fewer: float, share: float) -> float:
    """Quantile of F for these degrees of freedom."""
    return float(scipy.special.fdtri(more, fewer, share))


def orthonormal(rows: Array) -> Array:
    """Orthonormal rows (k, C) that span `rows` (d, C): those of which nothing is left are none."""
    _, s, Vt = np.linalg.svd(rows, full_matrices=False)
    return Vt[s > _HARDLY * s.max(initial=0.0)]


def _without_free(products: Array) -> Array:
    """The first 6 of `products` (6 + d, 6 + d) of rows, without their parts along the others."""
    if len(products) == 6:
        return products
    own, beside, free = products[:6, :6], products[:6, 6:], products[6:, 6:]
    free.flat[:: len(free) + 1] += _HARDLY  # a direction that these readings lack is a zero row
    return own - beside.dot(np.linalg.solve(free, beside.T))


def _inverse(H: Array) -> Array:
    """Inverse of a positive definite matrix; what it does not determine is vast."""
    if not H.item(2, 2):  # a strip is alike along y: no step, no error
        H[2, 2] = math.inf
    H.flat[:: len(H) + 1] *= 1 + _RIDGE
    root, _ = lapack.dtrtri(lapack.dpotrf(H)[0])
    return root.dot(root.T)


def _resized(s: float, step: float) -> float:
    """The size after a step. One to a larger size is taken in the radius, sqrt(s).

    What is read under a load goes with the logarithm of its radius, beside it with its square.
    """
    return s * (1 + step / (2 * s)) ** 2 if step > 0 else s + step


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
