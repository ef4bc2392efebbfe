"""Point-force models of rigid objects on an elastic skin, and their best fit."""

import cmath
import math
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from functools import lru_cache
from typing import cast

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy import linalg

from kappaskin.bases import basis_for
from kappaskin.contact.element_grid import element_grid
from kappaskin.contact.influence import CUBICS, SPLINES, Single, cap_half_wave, cap_table
from kappaskin.errors import Refusal
from kappaskin.frames import Array, Indices, Mask
from kappaskin.mechanics import Plate, layer_compliance
from kappaskin.sensing import SensorLayout
from kappaskin.skin import Cap, Patch

# A thin skin touches a rigid object only where it can press without being bent further than the
# object is: a sphere on a ring, inside which the skin takes the sphere's curvature; a straight edge
# at its two ends, between which the skin arches away from it; a cylinder at its two ends along an
# arc across its axis, where one curvature asks for the pressure 1 / sqrt(1 - (t / a)^2), even in
# the angle. A foam below presses the skin back on to the object in between as well. The last
# parameter of ring and arcs is q, the square of the ring's radius or of the arc's half width: the
# readings are nearly linear in it, so that noise may take it below zero.

ARC = 4
"""Points on an arc."""
_ARC = np.cos((np.arange(ARC) + 0.5) * np.pi / ARC)
_AROUND = 2 * np.pi * np.arange(12) / 12

ROUND = np.stack([np.cos(_AROUND), np.sin(_AROUND), np.full(12, 1 / 12)], axis=-1)
"""The `pattern` (12, 3) of a uniform circle: x, y and share of the force."""
EVEN = (1.0, 1.0)
"""Relative `widths` of two arcs of the same width."""


@dataclass(frozen=True, slots=True, eq=False)
class PointForces:
    """Forces `weights` (k,) in N at `points` (k, 2) in m, and their derivatives.

    `moves` (n, k, 2) are those of the points for n parameters, `growth` (n, k) of the weights.
    """

    points: Array
    weights: Array
    moves: Array
    growth: Array


ForceModel = Callable[[Array], PointForces]
"""From parameters to forces; the centre of force x, y in m and the force in N come first."""


def ring(pattern: Array) -> ForceModel:
    """Parameters x, y, F, q: a `pattern` (k, 3) of x, y and share of force, scaled by sqrt(q)."""
    share = pattern[:, 2]
    unit = pattern[:, :2] - share @ pattern[:, :2]  # x, y is the centre of force

    def forces(parameters: Array) -> PointForces:
        force, c = parameters[2], math.sqrt(parameters[3])
        moves, growth = np.zeros((4, *unit.shape)), np.zeros((4, len(unit)))
        moves[0, :, 0] = moves[1, :, 1] = 1
        moves[3] = unit / (2 * c)
        growth[2] = share
        return PointForces(parameters[:2] + c * unit, force * share, moves, growth)

    return forces


def ends(middle: float) -> ForceModel:
    """Parameters x, y, F, angle, length squared, share: forces at the two ends of an edge.

    The share `middle` of the force acts between them; the ends have (1/2 + share) and
    (1/2 - share) of the rest.
    """
    return _at_ends(np.zeros((2, 1)), middle)


def arcs(widths: tuple[float, float], middle: float) -> ForceModel:
    """Parameters of `ends` and q: forces on arcs across the ends, half width sqrt(q) `widths`."""
    return _at_ends(np.multiply.outer(widths, _ARC), middle)


def _at_ends(across: Array, middle: float) -> ForceModel:
    """Forces beside the axis by `across` (2, k) times the root of the last parameter."""
    k, rest = across.shape[1], 1 - middle
    off = np.append(across, across.mean(axis=0)) if middle else across.ravel()
    end = np.arange(len(off)) // k  # or between them
    sign, even = np.array([[1.0, -1.0, 0.0], [rest / 2, rest / 2, middle]])[:, end]
    even, uneven = even / k, rest * sign / k

    def forces(parameters: Array) -> PointForces:
        n, length, share = len(parameters), math.sqrt(parameters[4]), parameters[5]
        places, moves = np.zeros((len(off), 2)), np.zeros((n, len(off), 2))
        growth, place = np.zeros((n, len(off))), sign / 2 - rest * share
        places[:, 0], moves[5, :, 0] = place * length, -rest * length
        moves[4, :, 0] = place / (2 * length)
        if n > 6:
            a = math.sqrt(parameters[6])
            places[:, 1], moves[6, :, 1] = off * a, off / (2 * a)
        growth[2], growth[5] = even + share * uneven, parameters[2] * uneven
        return _turned(parameters, places, moves, growth)

    return forces


def _turned(parameters: Array, places: Array, moves: Array, growth: Array) -> PointForces:
    """Forces by their `places` (k, 2) along and across an axis, from the centre of force.

    `moves` (n, k, 2) are those of length, share and q along and across it too.
    """
    c, s = math.cos(parameters[3]), math.sin(parameters[3])
    axes = np.array([[c, s], [-s, c]])
    moves[3, :, 0], moves[3, :, 1] = -places[:, 1], places[:, 0]
    moves[3:] = moves[3:] @ axes
    moves[0, :, 0] = moves[1, :, 1] = 1
    return PointForces(parameters[:2] + places @ axes, parameters[2] * growth[2], moves, growth)


def lengthwise(along: Array, across: Array, share: Array) -> ForceModel:
    """Parameters of `ends`, and q where forces lie beside the axis.

    Each has a `share` (k,) of the force, `along` (k,) half lengths from the middle and `across`
    (k,) times sqrt(q) beside the axis. They are as 1 + 2 share to 1 - 2 share at the two ends, and
    change evenly from one to the other.
    """
    square = float(share @ along**2)

    def forces(parameters: Array) -> PointForces:
        n, length, tilt = len(parameters), math.sqrt(parameters[4]), parameters[5]
        place, places = along / 2 - tilt * square, np.zeros((len(along), 2))
        moves, growth = np.zeros((n, *places.shape)), np.zeros((n, len(along)))
        places[:, 0], moves[4, :, 0] = length * place, place / (2 * length)
        moves[5, :, 0] = -square * length
        if n > 6:
            b = math.sqrt(parameters[6])
            places[:, 1], moves[6, :, 1] = across * b, across / (2 * b)
        growth[2], growth[5] = share * (1 + 2 * tilt * along), 2 * share * along * parameters[2]
        return _turned(parameters, places, moves, growth)

    return forces


oval = lengthwise(np.cos(_AROUND), np.sin(_AROUND), np.full(12, 1 / 12))
"""Forces around an ellipse, as long and 2 sqrt(q) wide."""


_EVEN = 0.1  # of the sum of two curvatures: they differ less
_GRID = 13  # places along each side
_MOST = 2000  # elements: 100 MB
_SEARCHED = np.array([0.025, 0.045, 0.07, 0.1, 0.14, 0.19, 0.26, 0.35])  # of the shorter side
_ANGLES = 16
_SOFT, _HEAVY = 1e-7, 1e3  # of a compliance: keep places apart, and the sum of the forces

_BLUR = 0.11  # of `bend` times the force, one half wave away: measured against 301 x 301 functions
_FALL = 1.6  # the power with which that falls


class ElasticSkin:
    """A plate with elements on it: its displacement and readings under point forces."""

    def __init__(self, plate: Plate, layout: SensorLayout, edge: str, functions: int) -> None:
        patch = plate.patch
        if patch.strip:
            raise Refusal("object recognition needs a 2-D skin; this one is a strip")
        if not plate.rigidity:
            raise Refusal("object recognition needs a rigidity above zero; this skin has none")
        layout.check_curvature_sensor("objects")
        if len(layout) > _MOST:
            raise Refusal(f"object recognition takes at most {_MOST} elements, got {len(layout)}")
        self.patch, self.side, self._elements = patch, min(patch.a, patch.b), layout.positions
        Hx, Hy = patch.curvatures
        self.form = np.array([Hx, Hy, 0.0])
        """Curvature (3,) in 1/m at rest: xx, yy and xy."""
        self.bend = 1 / (4 * math.pi * plate.rigidity)
        """Curvature in 1/m lost inside a ring or an arc per N and e-fold of its size."""
        self.layer = layer_compliance(plate)
        """By how much the skin's thickness gives under a pressure, in m^3/N."""
        self._take(plate, layout, edge, functions)

    def _take(self, plate: Plate, layout: SensorLayout, edge: str, functions: int) -> None:
        """Compute what the skin reads and how it gives."""
        patch = plate.patch
        self._corners = None
        if type(patch) is Patch:
            self._corners = patch.inward(-math.inf, -math.inf), patch.inward(math.inf, math.inf)
        self._basis = basis_for(patch, edge, functions, functions)
        self._compliance = plate.compliance(self._basis)
        self._grid = element_grid(layout, self._basis, self._compliance)
        if self._grid is None:  # most of the time goes into reading it: half of the memory
            M = self._compliance.after(layout.operator(self._basis, plate))
            self._M: NDArray[np.float32] = M.astype(np.float32)
        self.half_wave = max(patch.a, patch.b) / functions
        steps = (np.arange(_GRID) + 0.5) / _GRID
        x, y = np.meshgrid(patch.a * steps, patch.b * steps)
        self.grid = np.stack([x.ravel(), y.ravel()], axis=-1)
        """Places (k, 2) in m all over the skin."""
        self.under = self._per_newton(self.grid)
        """Curvature (k, R) in 1/m of all channels for 1 N at each of them."""

    @property
    def is_dome(self) -> bool:
        """Whether it bulges outward along x and y."""
        return bool(self.form[:2].min() > 0)

    @property
    def is_even(self) -> bool:
        """Whether it curves alike along all directions, or nearly so."""
        xx, yy, xy = self.form.tolist()
        return math.hypot(xx - yy, 2 * xy) <= _EVEN * (xx + yy)

    def near(self, place: Array) -> "ElasticSkin":
        """The skin around a `place` (2,) in m, with the coordinates of `local`."""
        return self

    def local(self, place: Array) -> Array:
        """A place (2,) in m on the skin in the coordinates of forces."""
        return place

    def on_patch(self, place: Array) -> Array:
        """The reverse of `local`."""
        return place

    def sag(self, offsets: Array) -> Array:
        """By how much in m the skin at rest falls at `offsets` (..., 2) in m from a place."""
        return offsets**2 @ self.form[:2] / 2 + self.form[2] * offsets[..., 0] * offsets[..., 1]

    def _per_newton(self, points: Array) -> Array:
        """Readings (k, R) in 1/m for 1 N at each of `points` (k, 2)."""
        return self._read(self._felt(points))

    def _given(self, points: Array) -> Array:
        """Displacement (k, k) in m at each of `points` (k, 2) per N at each."""
        felt = self._felt(points)
        return self._compliance.after(felt) @ felt.T

    def _on_skin(self, points: Array) -> Array:
        if self._corners is not None:
            return np.minimum(np.maximum(points, self._corners[0]), self._corners[1])
        return np.array([self.patch.inward(x, y) for x, y in points.tolist()])

    def _felt(self, points: Array) -> Array:
        return self._basis.at(self._on_skin(points))

    def _read(self, modal: Array) -> Array:
        """Readings (n, R) in 1/m under modal forces (n, N) in N."""
        return modal @ self._M.T if self._grid is None else self._grid.read(modal)

    def readings(self, forces: PointForces) -> tuple[Array, Array]:
        """Curvature (R,) in 1/m of all channels, and its derivatives (R, n)."""
        points, (n, k) = self._on_skin(forces.points), forces.growth.shape
        moved = forces.weights * forces.moves.transpose(2, 0, 1)
        if self._grid is not None:
            adds = np.zeros((2, k, 1 + n, 2))
            adds[0, :, 0, 0], adds[0, :, 1:, 0] = forces.weights, forces.growth.T
            adds[1, :, 1:, 0], adds[0, :, 1:, 1] = moved.mT
            answer = self._grid.under(points, adds)
            return answer[0], answer[1:].T
        f, fx, fy = (self._basis.at(points, *order) for order in ((0, 0), (1, 0), (0, 1)))
        modal = np.vstack([forces.weights @ f, forces.growth @ f + moved[0] @ fx + moved[1] @ fy])
        answer = (self._M @ modal.T.astype(np.float32)).astype(float)
        return answer[:, 0], answer[:, 1:]

    def gives(self, forces: PointForces, points: Array) -> Array:
        """Displacement (k,) in m at `points` (k, 2)."""
        if self._grid is not None:
            places = self._on_skin(points)
            return self._grid.gives(self._on_skin(forces.points), forces.weights, places)
        modal = forces.weights @ self._felt(forces.points)
        return self._felt(points) @ self._compliance.after(modal[None])[0]

    def pressed(self, points: Array, gap: Array, force: float) -> Array:
        """Contact forces (k,) in N, none below zero, of a rigid object under `force` in N.

        Its surface lies `gap` (k,) in m behind its tip at `points` (k, 2) in m.
        """
        from scipy.optimize import nnls  # slow to import, and seldom needed

        G = self._given(points)
        # By eigenvalues: those of a table, or of places on the rim, may be none above zero.
        values, V = linalg.eigh(G)
        root = np.sqrt(np.maximum(values, _SOFT * values[-1]))
        # The least p'Gp / 2 + p'gap with a given sum: the sum as one more, heavy row.
        heavy = _HEAVY * math.sqrt(G.max())
        A = np.vstack([root[:, None] * V.T, np.full(len(gap), heavy)])
        b = np.append(gap @ V / -root, heavy * force)
        return nnls(A, b)[0]

    def unresolved(self, forces: PointForces) -> Array:
        """Variance (R,) in 1/m^2 of the readings due to detail finer than the functions.

        It matters only for elements within a half wave or two of a force.
        """
        away = self._elements[:, None] - forces.points
        waves = np.hypot(away[..., 0], away[..., 1]) / self.half_wave
        blur = (_BLUR * self.bend * forces.weights) ** 2 * np.maximum(waves, 0.2) ** (-2 * _FALL)
        return np.tile(blur.sum(axis=1), 3)

    def best_pair(self, around: Array, readings: Array, used: Mask) -> tuple[Array, Array]:
        """The two point forces near `around` (2,) in m that explain the readings best.

        Points (2, 2) in m, and forces (2,) in N of one sign. `readings` (R,) are zero where not
        `used` (R,).
        """
        angles = 2 * np.pi * np.arange(_ANGLES) / _ANGLES
        out = np.stack([np.multiply.outer(_SEARCHED, f(angles)).ravel() for f in (np.cos, np.sin)])
        points = self._on_skin(around + self.side * np.vstack([np.zeros(2), out.T]))
        T = self._per_newton(points) * used
        G, h = T @ T.T, T @ readings
        own = np.diag(G)
        squares = np.multiply.outer(own, own)
        det = squares - G**2
        det[det <= 1e-6 * squares] = np.inf  # one and the same point
        # Both forces of every pair at once, by Cramer's rule.
        one = (np.multiply.outer(h, own) - h * G) / det
        two = one.T
        explained = np.where(one * two > 0, one * h[:, None] + two * h, -np.inf)
        i, j = np.unravel_index(int(np.argmax(explained)), explained.shape)
        return points[[i, j]], np.array([one[i, j], two[i, j]])


_AROUND_CONTACT = 10  # steps of the table of a cap: as far around a contact forces are looked for
_ROUGH = 1.75  # times a half wave of a cap's table: what that lacks of a point is as much
_BLOCK = (np.arange(4)[:, None] * (2 * _AROUND_CONTACT + 1) + np.arange(4)).ravel()
_GIVES = 256  # distances at which the displacement beside a force is known


class SkinOnCap(ElasticSkin):
    """A cap with elements on it, in coordinates from a contact: lengths along the skin."""

    def _take(self, plate: Plate, layout: SensorLayout, edge: str, functions: int) -> None:
        places, length = layout.positions.tobytes(), layout.gage_length
        table, self._steps, _ = cap_table(plate, edge, places, length)
        # As under a point: even in the radius, 9/8 of the spline at 0.5 steps less 1/8 at 1.5.
        shares = np.array([9, 36, 8, -4, -1]) / (48 * 8 * math.pi * plate.rigidity)
        self._table = np.tensordot(shares.astype(np.float32), table[:, :, :5], (0, 2))
        self._plate, self._positions = plate, layout.positions
        self._reach = _AROUND_CONTACT * self._steps[0]
        self.side = 2 * self._reach
        self.half_wave = _ROUGH * cap_half_wave(cast("Cap", plate.patch))
        self.move_to(np.array([plate.patch.a, plate.patch.b]) / 2)

    def near(self, place: Array) -> "SkinOnCap":
        made = copy(self)
        made.move_to(place)
        return made

    def move_to(self, place: Array) -> None:
        """Count lengths from a `place` (2,) in m, and compute what loads around it make."""
        cap, (step, turns, _), (x, y) = cast("Cap", self.patch), self._steps, place.tolist()
        base = cap.base(x, y)
        self._place, self.form = place, base.form
        self._elements = (self._positions - place) @ np.linalg.inv(np.array(base.slopes))
        nodes = step * np.arange(-_AROUND_CONTACT, _AROUND_CONTACT + 1.0)
        at = cap.around(x, y, np.stack(np.meshgrid(nodes, nodes), -1).reshape(-1, 2))
        dx, dy = (at - cap.rim_radius).T
        away = np.minimum(np.hypot(dx, dy), cap.rim_radius)
        i, turn, _ = _cubic(
            np.arctan2(dy, dx) % (2 * np.pi) / turns + 1, self._table.shape[1], SPLINES
        )
        j, along, _ = _cubic(away / step + 1, len(self._table), SPLINES)
        self._local = np.zeros((len(at), self._table.shape[2]), np.float32)
        for k, m in np.ndindex(4, 4):
            share = (turn[:, k] * along[:, m]).astype(np.float32)
            self._local += share[:, None] * self._table[j + m, i + k]
        xx, yy, xy = base.form.tolist()
        square = (3 * xx**2 + 3 * yy**2 + 2 * xx * yy + 4 * xy**2) / 8
        self._green = _green(self._plate, square, 3 * self.side)

    def local(self, place: Array) -> Array:
        return np.zeros(2)

    def on_patch(self, place: Array) -> Array:
        x, y = self._place.tolist()
        return cast("Cap", self.patch).around(x, y, place[None])[0]

    def _on_skin(self, points: Array) -> Array:
        return np.minimum(np.maximum(points, -self._reach), self._reach)

    def _weights(self, points: Array) -> tuple[Array, Single]:
        """Weights (3, k, 16) of nodes around `points` (k, 2), and of slopes; what is read there."""
        n, step = 2 * _AROUND_CONTACT + 1, self._steps[0]
        (i, j), (X, Y), (X1, Y1) = _cubic((self._on_skin(points).T + self._reach) / step, n)
        both = np.empty((3, len(points), 4, 4))
        np.multiply(Y[:, :, None], X[:, None], out=both[0])
        np.multiply(Y[:, :, None], (X1 / step)[:, None], out=both[1])
        np.multiply((Y1 / step)[:, :, None], X[:, None], out=both[2])
        return both.reshape(3, -1, 16), self._local[(j * n + i)[:, None] + _BLOCK]

    def _per_newton(self, points: Array) -> Array:
        weights, read = self._weights(points)
        return np.einsum("kn,knc->kc", weights[0].astype(np.float32), read).astype(float)

    def readings(self, forces: PointForces) -> tuple[Array, Array]:
        (f, fx, fy), read = self._weights(forces.points)
        moved = forces.weights * forces.moves.transpose(2, 0, 1)
        rows = forces.growth[..., None] * f + moved[0][..., None] * fx + moved[1][..., None] * fy
        rows = np.concatenate([(forces.weights[:, None] * f)[None], rows])
        answer = rows.reshape(len(rows), -1).astype(np.float32) @ read.reshape(-1, read.shape[2])
        return answer[0].astype(float), answer[1:].T.astype(float)

    def _between(self, places: Array, others: Array) -> Array:
        """Displacement (k, m) in m at `places` (k, 2) per N at `others` (m, 2)."""
        away = np.linalg.norm(places[:, None] - others, axis=-1)
        i, weights, _ = _cubic(away.ravel() / (3 * self.side) * (_GIVES - 1), _GIVES)
        rest = np.vecdot(weights, self._green[i[:, None] + np.arange(4)]).reshape(away.shape)
        return rest + self.bend / 2 * away**2 * np.log(np.maximum(away, 1e-300) / self.side)

    def gives(self, forces: PointForces, points: Array) -> Array:
        return self._between(points, forces.points) @ forces.weights

    def _given(self, points: Array) -> Array:
        return self._between(points, points)


@lru_cache(4)
def _green(plate: Plate, square: float, far: float) -> Array:
    """Displacement in m per N at `_GIVES` even distances up to `far` in m from a force.

    Less r^2 ln r / (8 pi D), on a shallow shell without edges whose curvature has the mean square
    `square` in 1/m^2 over its directions: a plate over a foam.
    """
    D, T = plate.rigidity, plate.tension
    below = plate.foundation + (1 - plate.poisson**2) * plate.membrane_stiffness * square
    # D k^4 + T k^2 + below = D (k^2 + p) (k^2 + q)
    root = cmath.sqrt(T**2 - 4 * D * below) or 1e-6j * T
    p, q = (T - root) / (2 * D), (T + root) / (2 * D)
    r: Array = np.linspace(0, far, _GIVES)
    r[0] = 1e-6 * r[1]
    one, other = (cast("Array", scipy.special.kv(0, cmath.sqrt(k2) * r)) for k2 in (p, q))
    whole: Array = np.real((one - other) / (2 * np.pi * D * (q - p)))
    return whole - r**2 * np.log(r / far * 3) / (8 * np.pi * D)


def _cubic(at: Array, nodes: int, of: Array = CUBICS) -> tuple[Indices, Array, Array]:
    """The first (...) of four even nodes around `at` (...), their weights (..., 4), and slopes."""
    i = np.minimum(np.maximum(at.astype(int) - 1, 0), nodes - 4)
    u, powers = at - i, np.zeros((2, *at.shape, 4))
    value, slope = powers
    value[..., 0] = slope[..., 1] = 1.0
    value[..., 1] = u
    np.multiply(u, 2, out=slope[..., 2])
    np.multiply(u, u, out=value[..., 2])
    np.multiply(value[..., 2], u, out=value[..., 3])
    np.multiply(value[..., 2], 3, out=slope[..., 3])
    values, slopes = powers @ of
    return i, values, slopes


_GAIN = 0.05  # of chi-squared: less is not worth a step
_DAMPING = 1e-3  # of the diagonal, at first
_RIDGE = 1e-12  # of the diagonal, always


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """Prior of n parameters: normal with `mean` and `sd`, within the bounds `low` and `high`."""

    mean: Array
    sd: Array
    low: Array
    high: Array


@dataclass(frozen=True, slots=True, eq=False)
class Optimum:
    """The best parameters (n,) of a contact, and their covariance (n, n).

    `cost` is chi-squared with the prior, `squares` that of the readings alone; `prevented` (n,) is
    the step that a bound prevented.
    """

    contact: ForceModel
    parameters: Array
    covariance: Array
    cost: float
    squares: float
    prevented: Array


def optimise(
    skin: ElasticSkin,
    contact: ForceModel,
    start: Array,
    prior: Prior,
    readings: Array,
    weight: Array,
    steps: int,
) -> Optimum:
    """The most likely parameters near `start` (n,), by damped Gauss-Newton steps.

    `readings` (R,) in 1/m have the `weight` (R,), 1 / sd, or 0 where missing.
    """
    p, damping = start, _DAMPING
    here = _linearised(skin, contact, p, prior, readings, weight)
    for _ in range(steps):
        q = np.minimum(np.maximum(p + here.step(damping), prior.low), prior.high)
        there = _linearised(skin, contact, q, prior, readings, weight)
        if not there.cost < here.cost:
            damping = max(10 * damping, 0.01)
            continue
        gain, p, here, damping = here.cost - there.cost, q, there, damping / 10
        if gain < _GAIN:
            break
    return Optimum(contact, p, here.covariance, here.cost, here.squares, here.step(0.0))


@dataclass(frozen=True, slots=True, eq=False)
class _NormalEquations:
    """Normal equations at some parameters, scaled to a diagonal of ones, and the cost there."""

    cost: float
    squares: float
    normal: Array
    gradient: Array
    scale: Array

    def step(self, damping: float) -> Array:
        held = self.normal + (damping + _RIDGE) * np.eye(len(self.scale))
        return np.linalg.solve(held, self.gradient) / self.scale

    @property
    def covariance(self) -> Array:
        inverse = np.linalg.inv(self.normal + _RIDGE * np.eye(len(self.scale)))
        return inverse / np.multiply.outer(self.scale, self.scale)


def _linearised(
    skin: ElasticSkin, contact: ForceModel, p: Array, prior: Prior, readings: Array, weight: Array
) -> _NormalEquations:
    K, slopes = skin.readings(contact(p))
    left, J, off = weight * (readings - K), slopes.T * weight, (p - prior.mean) / prior.sd
    squares, normal = float(left @ left), J @ J.T
    normal.flat[:: len(p) + 1] += prior.sd**-2
    scale = np.sqrt(np.diag(normal))
    scale[scale == 0] = 1.0  # a parameter that nothing feels, as on the rim
    gradient = (J @ left - off / prior.sd) / scale
    return _NormalEquations(
        squares + float(off @ off),
        squares,
        normal / np.multiply.outer(scale, scale),
        gradient,
        scale,
    )
