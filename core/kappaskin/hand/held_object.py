"""The object that several fingers hold: plane, sphere, cylinder or edge, or none of these."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple, cast

import numpy as np
import scipy

from kappaskin.frames import Array
from kappaskin.hand.grasp import FingerContact

HELD = ("plane", "sphere", "cylinder", "edge")
"""Kinds of object that several contacts are compared with."""

LEVEL = 0.01
"""Probability that contacts of an object of a kind are taken for none of it."""

_SURE = 0.9  # probability from which a kind is named
_FLAT = 0.1  # of the distance of the contacts, over the radius: below, it is a plane
_SHARP = 10.0  # the same: above, a cylinder is an edge
_STEP = 1e-5  # of a scale, for derivatives
_STEPS, _SETTLED, _MOST = 40, 1e-4, 1e9  # of Levenberg and Marquardt: gain and damping
_STARTS, _TRIED = 48, 2  # axes of a cylinder or an edge that are looked at, and refined
_LEAST = 1e-3  # m, of the distance of the contacts, as a scale
_NIL = 1e-12  # of the information that a scale has: less is none
_FLOOR = np.diag(np.repeat([1e-9, 1e-7, 1e-6], [3, 2, 3]) ** 2)  # m, rad, 1/m: none is surer
_REACH = 1.959964  # standard deviations to either side in a 95 % interval


@dataclass(frozen=True, eq=False)
class ObjectFit:
    """The plane, sphere, cylinder or edge that fits contacts best.

    `frame` (3, 3) has unit vectors as rows: of a cylinder and an edge the first is the axis; the
    third is the outward normal at `point` (3,) in m of the surface. An edge goes through its
    `point`. `curvature` in 1/m is 1 / radius, zero of a plane, negative of what is touched from
    inside, infinite of an edge.

    `covariance` (k, k) is that of what is fitted: small rotations in rad about the first and second
    unit vector, the shift in m along the third; then of a sphere and a cylinder the curvature, of a
    cylinder the rotation about the third. Of an edge those are the shift along the second and the
    third unit vector, and the rotation about these two. What the contacts do not determine has
    variances beyond all scales.
    `chi_squared` is what the fit leaves, of `spare` observations more than it determines.
    """

    kind: str
    point: Array
    frame: Array
    curvature: float
    covariance: Array
    chi_squared: float
    spare: int

    @property
    def chance(self) -> float:
        """Probability that contacts of such an object leave more; NaN where none are spare."""
        if self.spare < 1:
            return math.nan
        return float(scipy.special.chdtrc(self.spare, self.chi_squared))

    @property
    def normal(self) -> Array:
        """The outward unit normal (3,) at the point."""
        return self.frame[2]

    @property
    def axis(self) -> Array:
        """The unit vector (3,) along the axis of a cylinder or along an edge."""
        return self.frame[0] if self.kind in ("cylinder", "edge") else np.full(3, np.nan)

    @property
    def axis_sd(self) -> float:
        """Standard deviation in rad of the axis, in the direction in which it is largest."""
        turns = {"cylinder": [1, 4], "edge": [2, 3]}.get(self.kind)
        if turns is None:
            return math.nan
        return math.sqrt(np.linalg.eigvalsh(self.covariance[np.ix_(turns, turns)])[-1])

    @property
    def curvature_sd(self) -> float:
        """Standard deviation in 1/m of the curvature of a sphere or a cylinder."""
        return math.sqrt(self.covariance[3, 3]) if self.kind in ("sphere", "cylinder") else 0.0

    @property
    def radius(self) -> float:
        """Radius in m; infinite of a plane, zero of an edge, negative if touched from inside."""
        return 1 / self.curvature if self.curvature else math.inf

    @property
    def radius_95(self) -> tuple[float, float]:
        """The 95 % interval of the radius in m; it ends at infinity where it may be flat."""
        off = _REACH * self.curvature_sd
        low, high = self.curvature - off, self.curvature + off
        if low <= 0 <= high:
            return 1 / max(high, -low, 1e-300), math.inf
        return min(1 / low, 1 / high), max(1 / low, 1 / high)

    @property
    def centre(self) -> Array:
        """The centre (3,) in m of a sphere; of a cylinder that of the circle at the point."""
        return self.point - self.radius * self.normal

    @property
    def centre_covariance(self) -> Array:
        """The covariance (3, 3) of the centre in m^2, of first order; of a cylinder across it."""
        a, b, u = self.frame
        R = self.radius
        J = np.zeros((3, len(self.covariance)))
        # A rotation about a moves u by -b, one about b moves it by a.
        J[:, 0], J[:, 1], J[:, 2], J[:, 3] = R * b, -R * a, u, R * R * u
        if self.kind == "cylinder":
            J[:, 1] = 0.0
        return J @ self.covariance @ J.T

    def distance(self, points: Array) -> tuple[Array, Array, Array]:
        """Signed distances (P,) in m of `points` (P, 3), and the gradient (P, 3) of that.

        With its second derivatives (P, 3, 3) in 1/m, which along a surface are its curvature form.
        """
        k = np.array([self.curvature])
        F, g, H = _distance(self.frame[None], self.point[None], k, self.kind, points)
        return F[0], g[0], H[0]


# With the outward normal u at the point q, z = y - q, across the axis for a cylinder, and the
# curvature k, the distance from a sphere is
#     F = |z + u / k| - 1 / k = (k z.z + 2 z.u) / (1 + |u + k z|),   dF = (u + k z) / |u + k z|,
# which has a plane at k = 0 and what is touched from inside at k < 0.
def _distance(
    frame: Array, point: Array, k: Array, kind: str, points: Array
) -> tuple[Array, Array, Array]:
    """As `ObjectFit.distance`, (S, P, ...), of S objects."""
    u, across = frame[:, None, 2], np.eye(3)
    if kind == "cylinder":
        across = across - frame[:, 0, :, None] * frame[:, 0, None]
    z = (points - point[:, None]) @ across
    out = u + k[:, None, None] * z
    far = np.maximum(np.sqrt(np.vecdot(out, out)), _NIL)
    g = out / far[..., None]
    F = (k[:, None] * np.vecdot(z, z) + 2 * np.vecdot(z, u)) / (1 + far)
    across = np.broadcast_to(across, (len(k), 3, 3))[:, None]
    H = (across - g[..., None] * g[..., None, :]) * (k[:, None] / far)[..., None, None]
    return F, g, H


class _Contacts:
    """What is observed: positions, frames, curvatures with their covariances, and their scale."""

    def __init__(self, contacts: Sequence[FingerContact]) -> None:
        self.p = np.array([one.position for one in contacts])
        self.frames = np.array([one.frame for one in contacts])
        self.m = -self.frames[:, 2]
        covariance = np.array([one.covariance for one in contacts])
        self.curved = np.isfinite(covariance[:, 5, 5])
        self.covariance = np.nan_to_num(covariance, nan=0.0) + _FLOOR
        self.curvature = np.array([one.curvature for one in contacts])
        apart = np.linalg.norm(self.p[:, None] - self.p, axis=-1)
        self.extent = float(max(apart.max(), _LEAST))

    def roots(self, J: Array) -> Array:
        """Roots (S, P, k, k) of the covariances of what changes by `J` (S, P, k, 8).

        From the fourth row on of curvatures, which have unit variance where there are none.
        """
        C = J @ self.covariance @ J.mT
        for row in range(3, J.shape[-2]):
            C[..., row, row] += ~self.curved
        return cast("Array", np.linalg.cholesky(C))


def _tangential(E: Array, m: Array, g: Array) -> Array:
    """By what angles (S, P, 2) in rad `g` (S, P, 3) is turned from `m` (P, 3), along `E`."""
    w: Array = (E @ g[..., None])[..., 0]
    sine = np.hypot(w[..., 0], w[..., 1])
    angle = np.arctan2(sine, np.vecdot(m, g))
    return w * np.where(sine > 0, angle / np.where(sine > 0, sine, 1.0), 1.0)[..., None]


class _States(NamedTuple):
    """S objects of a kind: points (S, 3), frames (S, 3, 3), curvatures (S,)."""

    kind: str
    point: Array
    frame: Array
    curvature: Array

    def moved(self, by: Array) -> "_States":
        """Those that parameters `by` (S, k) off are."""
        a, b, u = self.frame.swapaxes(0, 1)
        by = by[..., None]
        if self.kind == "edge":
            turn, shift = by[:, 2] * b + by[:, 3] * u, by[:, 0] * b + by[:, 1] * u
            k = np.broadcast_to(self.curvature, len(by))
            return _States("edge", self.point + shift, _turned(self.frame, turn), k)
        turn = by[:, 0] * a + by[:, 1] * b + (by[:, 4] * u if self.kind == "cylinder" else 0.0)
        k = self.curvature + (by[:, 3, 0] if self.kind != "plane" else np.zeros(len(by)))
        return _States(self.kind, self.point + by[:, 2] * u, _turned(self.frame, turn), k)

    def residuals(self, of: _Contacts) -> tuple[Array, Array]:
        """What each contact leaves (S, P, k), and its derivatives (S, P, k, 8) by what is observed.

        At first three numbers, then those of curvatures, which are zero where there are none.
        """
        E, curved = of.frames[:, :2], of.curved[:, None]
        shape = len(self.point), len(E)
        if self.kind == "edge":
            a, b, u = self.frame.swapaxes(0, 1)[:, :, None]
            z, along = of.p - self.point[:, None], (E @ a[..., None])[..., 0]
            w0, w1 = along[..., 0], along[..., 1]
            slant = np.arcsin(np.clip(np.vecdot(of.m, a), -1.0, 1.0))
            J = np.zeros((*shape, 4, 8))
            J[..., 0, :3], J[..., 1, :3], J[..., 2, 3:5] = b, u, -along
            J[..., 3, 5:] = curved * np.stack([w0 * w0, w1 * w1, 2 * w0 * w1], axis=-1)
            bent = np.vecdot(J[..., 3, 5:], np.where(curved, of.curvature, 0.0))
            left = np.stack([np.vecdot(z, b), np.vecdot(z, u), slant, bent], axis=-1)
            return left, J
        F, g, H = _distance(self.frame, self.point, self.curvature, self.kind, of.p)
        form = E @ H @ E.mT
        bent = np.where(curved, form[..., [0, 1, 0], [0, 1, 1]] - of.curvature, 0.0)
        to_all = np.zeros((*shape, 6, 8))
        to_all[..., 0, :3], to_all[..., 1:3, :3], to_all[..., 1:3, 3:5] = g, E @ H, np.eye(2)
        to_all[..., 3:, 5:] = -np.eye(3) * curved[:, None]
        left = np.concatenate([F[..., None], _tangential(E, of.m, g), bent], axis=-1)
        return left, to_all

    def chi_squared(self, of: _Contacts, roots: Array | None = None) -> Array:
        """The sums (S,) of squares that they leave, by their own `roots` or those of another."""
        left, J = self.residuals(of)
        return np.sum(_whitened(left, of.roots(J) if roots is None else roots) ** 2, axis=1)

    def one(self, n: int) -> "_States":
        return _States(
            self.kind, self.point[n : n + 1], self.frame[n : n + 1], self.curvature[n : n + 1]
        )


def _whitened(left: Array, roots: Array) -> Array:
    """Residuals (S, P, k) in standard deviations, (S, P k)."""
    return cast("Array", np.linalg.solve(roots, left[..., None])).reshape(len(left), -1)


def _turned(frame: Array, turn: Array) -> Array:
    """Each `frame` (S, 3, 3), whose rows are orthonormal, turned by `turn` (S, 3) in rad."""
    angle = np.sqrt(np.vecdot(turn, turn))
    axis = (turn / np.where(angle > 0, angle, 1.0)[:, None])[:, None]
    c, s = np.cos(angle)[:, None, None], np.sin(angle)[:, None, None]
    x, y, z = np.moveaxis(axis, -1, 0)
    across = np.stack([0 * x, z, -y, -z, 0 * x, x, y, -x, 0 * x], axis=-1).reshape(-1, 3, 3)
    return c * frame + s * (frame @ across) + (1 - c) * np.vecdot(frame, axis)[..., None] * axis


def _scales(kind: str, L: float) -> Array:
    """How far each parameter may reasonably be off: a radian, the extent `L`, and one over it."""
    return {
        "plane": np.array([1.0, 1.0, L]),
        "sphere": np.array([1.0, 1.0, L, 1 / L]),
        "cylinder": np.array([1.0, 1.0, L, 1 / L, 1.0]),
        "edge": np.array([L, L, 1.0, 1.0]),
    }[kind]


def _linearised(state: _States, of: _Contacts, scales: Array) -> tuple[Array, Array, Array]:
    """Whitened residuals (R,), their derivatives (R, k) by the parameters over their `scales`.

    And the roots of the covariances there.
    """
    steps = np.diag(scales * _STEP)
    left, J = state.moved(np.concatenate([0 * steps[:1], steps, -steps])).residuals(of)
    roots, k = of.roots(J[:1]), len(scales)
    r = _whitened(left, roots)
    return r[0], (r[1 : k + 1] - r[k + 1 :]).T / (2 * _STEP), roots


def _refined(state: _States, of: _Contacts) -> tuple[_States, float, Array]:
    """The best object near `state` by Levenberg and Marquardt, what it leaves, and J."""
    scales, damping = _scales(state.kind, of.extent), 1e-3
    for _ in range(_STEPS):
        r, J, roots = _linearised(state, of, scales)
        A, now, gain = J.T @ J, float(r @ r), 0.0
        weigh = np.diag(A) + _NIL * np.trace(A)
        while damping < _MOST:
            step = -np.linalg.solve(A + damping * np.diag(weigh), J.T @ r)
            step = step / max(1.0, float(np.abs(step).max()))  # no further than the scales
            tried = state.moved((scales * step)[None])
            gain = now - float(tried.chi_squared(of, roots)[0])
            if gain >= 0:
                state, damping = tried, max(damping / 10, 1e-9)
                break
            damping *= 10
        if gain <= _SETTLED * (1 + now):
            break
    left, by_parameters, _ = _linearised(state, of, scales)
    return state, float(left @ left), by_parameters


def _frames(axes: Array, normal: Array) -> Array:
    """Frames (S, 3, 3) whose first rows are the unit `axes` (S, 3), the third near `normal`."""
    u: Array = normal - (axes @ normal)[:, None] * axes
    u = np.where((np.vecdot(u, u) > _NIL)[:, None], u, _beside(axes))
    u = u / np.linalg.norm(u, axis=1, keepdims=True)
    return np.stack([axes, np.cross(u, axes), u], axis=1)


def _beside(axes: Array) -> Array:
    """A vector (S, 3) at a right angle to each of the `axes` (S, 3)."""
    return np.cross(axes, np.eye(3)[np.argmin(np.abs(axes), axis=1)])


def _curvatures(of: _Contacts, across: Array) -> Array:
    """The curvatures (S,) in 1/m by which normals turn with positions, `across` (S, 3, 3)."""
    p, m = ((each - each.mean(axis=0)) @ across for each in (of.p, of.m))
    moment = np.sum(p * p, axis=(1, 2))
    return np.sum(p * m, axis=(1, 2)) / np.maximum(moment, (_LEAST * of.extent) ** 2)


def _starts(kind: str, of: _Contacts) -> _States:
    """Objects to begin with: at the best-placed contact, along axes all around."""
    first = int(np.argmin(np.trace(of.covariance[:, :3, :3], axis1=1, axis2=2)))
    p, m = of.p[first], of.m[first]
    mean = of.m.mean(axis=0)
    mean = mean if mean @ mean > _LEAST else m
    axes, middle = of.frames[first, :1], of.p.mean(axis=0)
    if kind in ("cylinder", "edge"):  # those of positions and of normals often are the ones
        own = [np.linalg.eigh(each.T @ each)[1].T for each in (of.p - middle, of.m)]
        axes = np.concatenate([_axes_around(), *own])
    flat = np.zeros(len(axes))
    if kind in ("plane", "edge"):
        if kind == "plane":
            axes = _beside(mean[None])
            axes = axes / np.linalg.norm(axes)
        k = flat if kind == "plane" else flat + math.inf
        return _States(kind, np.tile(middle, (len(axes), 1)), _frames(axes, mean), k)
    across = np.eye(3) - (axes[:, :, None] * axes[:, None] if kind == "cylinder" else 0.0)
    across = np.broadcast_to(across, (len(axes), 3, 3))
    return _States(kind, np.tile(p, (len(axes), 1)), _frames(axes, m), _curvatures(of, across))


def _axes_around() -> Array:
    """Unit vectors (`_STARTS`, 3), evenly over half of the sphere."""
    n = np.arange(_STARTS) + 0.5
    z, turn = n / _STARTS, math.pi * (1 + math.sqrt(5)) * n
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=-1)


def fit_object(kind: str, contacts: Sequence[FingerContact]) -> ObjectFit:
    """The object of this `kind` among `HELD` that fits one or more `contacts` best."""
    of = _Contacts(contacts)
    starts = _starts(kind, of)
    left = starts.chi_squared(of)
    tried = [_refined(starts.one(n), of) for n in np.argsort(left)[:_TRIED].tolist()]
    state, chi, J = min(tried, key=lambda found: found[1])
    values, vectors = np.linalg.eigh(J.T @ J)
    scaled = vectors * _scales(kind, of.extent)[:, None]
    covariance = scaled / np.maximum(values, _NIL) @ scaled.T
    told = 3 * len(of.p) + (1 if kind == "edge" else 3) * int(of.curved.sum())
    spare = told - int(np.count_nonzero(values >= 1))
    k = float(state.curvature[0])
    return ObjectFit(kind, state.point[0], state.frame[0], k, covariance, chi, spare)


@dataclass(frozen=True, eq=False)
class HeldObject:
    """What several fingers hold: the best `fits` of each kind to the same contacts.

    `observations` is how many numbers the contacts have, `extent` in m how far apart they are.
    """

    fits: dict[str, ObjectFit]
    observations: int
    extent: float
    reason: str = field(default="", kw_only=True)
    """Why nothing can be told; empty where something can."""

    @property
    def possible(self) -> list[ObjectFit]:
        """The kinds that leave no more than noise does, the likeliest first."""
        fitting = [one for one in self.fits.values() if not one.chance < LEVEL]
        return sorted(fitting, key=lambda one: -self.probability[one.kind])

    @cached_property
    def probability(self) -> dict[str, float]:
        """How likely each kind is, by Bayes' information criterion; all kinds alike beforehand."""
        price = math.log(max(self.observations, 2))
        cost = {kind: one.chi_squared - one.spare * price for kind, one in self.fits.items()}
        least = min(cost.values(), default=0.0)
        weights = {kind: math.exp((least - each) / 2) for kind, each in cost.items()}
        return {kind: each / sum(weights.values()) for kind, each in weights.items()}

    @property
    def is_none(self) -> bool:
        """Whether it is none of the kinds: each of them leaves more than noise does."""
        return bool(self.fits) and not self.possible

    @property
    def kind(self) -> str:
        """The kind where it is known, else empty.

        A plane is known where a ball or a cylinder would be flat over the contacts, an edge where a
        cylinder would be thin.
        """
        if not (possible := self.possible) or min(one.spare for one in possible) < 1:
            return ""
        others = {one.kind: one for one in possible}
        for kind in ("plane", "edge"):
            if kind in others and not self._rivals(kind, others):
                return kind
        best, *rest = possible
        weight = self.probability[best.kind]
        sure = weight >= _SURE * (weight + sum(self.probability[one.kind] for one in rest))
        return best.kind if sure and best.kind in ("sphere", "cylinder") else ""

    def _rivals(self, kind: str, others: dict[str, ObjectFit]) -> list[str]:
        """The kinds that are no limit of a plane or an edge, as far as they are determined."""

        def rival(one: ObjectFit) -> bool:
            low, high = one.radius_95
            if kind == "plane":
                return one.kind == "edge" or abs(low) * _FLAT < self.extent
            return one.kind != "cylinder" or not abs(high) * _SHARP < self.extent

        return [name for name, one in others.items() if name != kind and rival(one)]

    def describe(self) -> str:
        """One line in millimetres: the kind, or what it may be, or what cannot be told."""
        if self.reason:
            return self.reason
        if self.is_none:
            return f"not one of {', '.join(HELD)}"
        if kind := self.kind:
            others = [self._said(one) for one in self.possible if one.kind != kind]
            return ", or a ".join([self._said(self.fits[kind]), *others])
        return f"not determined: {' or '.join(map(self._said, self.possible))}"

    def _said(self, one: ObjectFit) -> str:
        if one.kind in ("plane", "edge"):
            return one.kind
        low, high = one.radius_95
        if math.isinf(high):
            return f"{one.kind} of radius above {1e3 * low:.4g} mm"
        return (
            f"{one.kind} of radius {1e3 * one.radius:.3g} mm ({1e3 * low:.3g} to {1e3 * high:.3g})"
        )


def find_held_object(contacts: Sequence[FingerContact]) -> HeldObject:
    """What the `contacts` of different fingers, or of one at several moments, tell of an object.

    Raises nothing for too few: its `reason` says what is missing.
    """
    known = [one for one in contacts if np.isfinite(one.covariance[:5, :5]).all()]
    if len(known) < 2:
        return HeldObject(
            {}, 0, math.nan, reason=f"expected two contacts or more, got {len(known)}"
        )
    of = _Contacts(known)
    fits = {kind: fit_object(kind, known) for kind in HELD}
    return HeldObject(fits, 3 * len(known) + 3 * int(of.curved.sum()), of.extent)
