"""Intrinsic contact sensing: the contact from a force and a moment at the fingertip's base.

An object that touches a fingertip exerts a force p there and, when it is soft, a torque q about
the normal. Their wrench at the base and the known surface give the position (Bicchi, Salisbury and
Brock 1993, doi:10.1177/027836499301200306). Axes are those of `Patch`: x along the skin, z along
the outward normal at its middle, where z = 0. Of several contacts it finds a centroid.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.mechanics import LineLoad, Load
from kappaskin.skin import Base, Cap, Patch

_SIGNIFICANT = 10.0  # times its noise that a force must have, or first-order error bars fail
_LEAST = 1e-6  # N: less is no force, even to a sensor without noise
_VAGUE = 0.25  # of the skin's side: an error bar beyond which a contact has no place
_BESIDE = 3.0  # standard deviations that a contact may seem to lie beside the skin
_STEPS = 40  # of Newton's method
_SETTLED = 1e-12  # of a side
_PIECES = 24  # of a line load, at the points of Gauss: exact to rounding


@dataclass(frozen=True, eq=False)
class Wrench:
    """A reading of a force/torque sensor: `force` (3,) in N, `moment` (3,) in N m about itself."""

    force: Array
    moment: Array


@dataclass(frozen=True)
class ForceTorqueSensor:
    """A six-axis sensor at `origin` in m that carries the skin.

    Its axes are parallel to the skin's; `force_noise` in N and `moment_noise` in N m are the
    standard deviations of each axis.
    """

    origin: tuple[float, float, float]
    force_noise: float = 3e-3
    moment_noise: float = 2e-5

    def __post_init__(self) -> None:
        if len(self.origin) != 3 or not np.isfinite(self.origin).all():
            raise Refusal(f"expected an origin of three lengths in m, got {self.origin}")
        for name in ("force_noise", "moment_noise"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise Refusal(f"expected ForceTorqueSensor.{name} of at least zero, got {value}")

    def read(self, patch: Patch, loads: Iterable[Load], rng: np.random.Generator) -> Wrench:
        """The reading, with noise from `rng`, for `loads` on the skin at rest."""
        force, moment = rng.normal(0, self.force_noise, 3), rng.normal(0, self.moment_noise, 3)
        for load in loads:
            points, shares = _pieces(load)
            at, normal = patch.at_rest(points)
            pressed = -load.force * shares[:, None] * normal
            force = force + pressed.sum(axis=0)
            moment = moment + np.cross(at - self.origin, pressed).sum(axis=0)
        return Wrench(force, moment)


def _pieces(load: Load) -> tuple[Array, Array]:
    """Points (Q, 2) in m and shares (Q,) of the force that replace `load`."""
    if not isinstance(load, LineLoad):
        return load.centre()[None], np.ones(1)
    t, w = (np.asarray(v, float) for v in np.polynomial.legendre.leggauss(_PIECES))
    ends = np.array([[load.x0, load.y0], [load.x1, load.y1]])
    return np.outer(1 - t, ends[0]) / 2 + np.outer(1 + t, ends[1]) / 2, w / 2


@dataclass(frozen=True, slots=True, eq=False)
class IntrinsicEstimate:
    """A contact found from the base: its position, and the force and torque on the skin.

    `position` (2,) in m on the patch; `pressure` in N, the normal force, inward; `traction` (2,) in
    N, the tangential one along x and y; `torque` in N m about the outward normal; each with its
    standard deviation. Every number is NaN when there is no contact, and `reason` says why.
    """

    position: Array
    position_sd: Array
    pressure: float
    pressure_sd: float
    traction: Array
    traction_sd: Array
    torque: float
    torque_sd: float
    reason: str = ""

    @property
    def present(self) -> bool:
        return not self.reason


def _no_touch(reason: str) -> IntrinsicEstimate:
    nowhere, nan = np.full(2, np.nan), math.nan
    return IntrinsicEstimate(nowhere, nowhere, nan, nan, nowhere, nowhere, nan, nan, reason)


def _across(r: Array | tuple[float, float, float]) -> Array:
    """The matrix (3, 3) of the cross product r x; much faster than `np.cross` for one vector."""
    x, y, z = r
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


class IntrinsicContact:
    """Finds the contact on a skin, flat or bent, that explains a wrench: `find(wrench)`.

    With the contact at c, the outward normal n and the torque q n, F = p and M = c x p + q n.

    On the plane, z = 0, the three components of M are y p_z, -x p_z and x p_y - y p_x + q. On the
    cylinder, about a point of its axis, c = R n + y e_y, and with the tangent t across the axis
        M.e_y = R p.t,    M.t = y p.n - R p_y,    M.n = -y p.t + q.
    The first has two solutions on opposite sides of the cylinder, of which one presses and the
    other pulls. On a skin that bends both ways, Newton's method begins where the axis of the wrench
    meets the plane z = 0, or the sphere that a cap has at its pole.
    """

    def __init__(self, patch: Patch, sensor: ForceTorqueSensor) -> None:
        self.patch, self.sensor = patch, sensor
        self._side = np.array([patch.a, patch.b])
        self._bent = any(patch.curvatures) and not patch.arc_curvature
        noise = (sensor.force_noise, sensor.moment_noise)
        self._variance = np.repeat(np.square(noise), 3)
        self._least = max(_LEAST, _SIGNIFICANT * sensor.force_noise)

    def __call__(self, wrench: Wrench) -> IntrinsicEstimate:
        """The contact; NaN and a reason when the wrench is not that of one on the skin."""
        F = np.asarray(wrench.force, float)
        M = np.asarray(wrench.moment, float)
        if F.shape != (3,) or M.shape != (3,):
            raise Refusal(f"expected force and moment of shape (3,), got {F.shape} and {M.shape}")
        if not (np.isfinite(F).all() and np.isfinite(M).all()):
            return _no_touch("the force/torque sensor reports NaN or infinity")
        arc = self.patch.arc_curvature
        most = math.hypot(F[0], F[2]) if arc else math.sqrt(F @ F) if self._bent else -float(F[2])
        if not most > self._least:
            return self._no_press(most)
        place = self._place(F, M + _across(self.sensor.origin) @ F, most)
        if place is None:
            what = "cylinder" if arc else "surface"
            return _no_touch(f"the force passes beside the skin's {what}")
        return self._judged(place, F, M)

    def _no_press(self, pressure: float) -> IntrinsicEstimate:
        return _no_touch(f"expected a normal force above {self._least:.3g} N, got {pressure:.3g} N")

    def _place(self, F: Array, M: Array, most: float) -> Array | None:
        """Position (2,) in m on the extended surface for the wrench about the patch's origin.

        None where there is none. `most` in N is the largest normal force.
        """
        if self._bent:
            return self._found(F, M)
        if not (H := self.patch.arc_curvature):
            return np.array([-M[1], M[0]]) / F[2]
        R, middle = 1 / H, self.patch.a / 2
        about_axis = M - _across((middle, 0.0, -R)) @ F
        # p.t = p_x cos - p_z sin = M_y / R, on the side where p.n = p_x sin + p_z cos < 0.
        across = about_axis[1] / (R * most)
        if not abs(across) < 1:
            return None
        angle = math.atan2(-F[0], -F[2]) + math.asin(across)
        angle = math.remainder(angle, 2 * math.pi)
        t = np.array([math.cos(angle), 0.0, -math.sin(angle)])
        n = np.array([math.sin(angle), 0.0, math.cos(angle)])
        return np.array([middle + R * angle, (about_axis @ t + R * F[1]) / (F @ n)])

    def _found(self, F: Array, M: Array) -> Array | None:
        """As `_place`, on a skin that bends both ways."""
        along, axis = F / math.sqrt(F @ F), _across(F) @ M / (F @ F)
        if isinstance(self.patch, Cap):
            middle = np.array([self.patch.rim_radius, self.patch.rim_radius, -self.patch.radii[0]])
            axis = axis + (middle - axis) @ along * along
            beside = np.sum((axis - middle) ** 2)
            axis = axis - math.sqrt(max(middle[2] ** 2 - beside, 0.0)) * along
            place = self.patch.places(axis)
        else:
            place = (axis - axis[2] / (F[2] or math.inf) * F)[:2]
        for _ in range(_STEPS):
            place = np.clip(place, -self._side / 2, 1.5 * self._side)
            base = self.patch.base(*place.tolist())
            c, n = np.array(base.point), np.array(base.normal)
            torque = float((M - _across(c) @ F) @ n)
            left = M - _across(c) @ F - torque * n
            J = np.column_stack([*_moves(base, F, torque), n])
            try:
                step = np.linalg.solve(J, left)[:2]
            except np.linalg.LinAlgError:
                return None
            place = place + np.clip(step, -self._side / 4, self._side / 4)
            if (np.abs(step) < _SETTLED * self._side).all():
                return place
        return None

    def _judged(self, place: Array, F: Array, M: Array) -> IntrinsicEstimate:
        """The contact at `place` (2,) in m, or the reason why it is none."""
        base = self.patch.base(*place.tolist())
        arm, n = np.array(base.point) - self.sensor.origin, np.array(base.normal)
        pressure, traction = -float(F @ n), np.array([base.along, base.across]) @ F
        if not pressure > self._least:
            return self._no_press(pressure)
        torque = float((M - _across(arm) @ F) @ n)
        sd = self._spread(arm, base, F, torque)
        if (sd[:2] > _VAGUE * self._side).any():
            x, y = 1e3 * sd[:2]
            return _no_touch(
                f"{pressure:.3g} N determine the position only to +-{x:.3g} and {y:.3g} mm"
            )
        inside = np.clip(place, 0, self._side)
        if type(self.patch) is not Patch and not self.patch.contains(place[None])[0]:
            inside = np.array(self.patch.inward(*place.tolist()))
        # A rounding error beside the skin is none, even of a sensor without noise.
        if (np.abs(place - inside) > _BESIDE * sd[:2] + 1e-9 * self._side).any():
            x, y = 1e3 * place
            return _no_touch(f"the force passes beside the skin, through ({x:.3g}, {y:.3g}) mm")
        return IntrinsicEstimate(
            inside, sd[:2], pressure, float(sd[2]), traction, sd[3:5], torque, float(sd[5])
        )

    def _spread(self, arm: Array, base: Base, F: Array, torque: float) -> Array:
        """Standard deviations (6,) of x, y, pressure, traction and torque, to first order.

        d(F, M) = J d(x, y, p, q), and what is told changes by L d(x, y, p, q).
        """
        J, L = np.zeros((6, 6)), np.eye(6)
        along, n, (xx, yy, xy) = np.array([base.along, base.across]), base.normal, base.curvature
        J[:3, 2:5] = np.eye(3)
        J[3:, :2] = np.column_stack(_moves(base, F, torque))
        J[3:, 2:5], J[3:, 5] = _across(arm), n
        # The frame turns by the base's curvature b and, on a cap, around its normal:
        # n_i = b_ij e_j and e_j,i = -b_ij n +- turning_i e_k.
        b, tangential, u = (
            np.array([[xx, xy], [xy, yy]]),
            along @ F,
            np.array(base.turning or (0, 0)),
        )
        turned = -b * (F @ n) + np.multiply.outer((tangential[1], -tangential[0]), u)
        L[2:5, :2] = np.vstack([-b @ tangential, turned]) @ _steps(base)
        L[2:5, 2:5] = -np.array(n), *along
        return np.sqrt(np.square(L @ np.linalg.inv(J)) @ self._variance)


def _steps(base: Base) -> Array:
    """What steps in x and y are along e_x and e_y, (2, 2)."""
    return np.linalg.inv(base.slopes).T if base.slopes else np.eye(2)


def _moves(base: Base, F: Array, torque: float) -> tuple[Array, Array]:
    """How the moment of a force and of a `torque` in N m changes with x and y, in N."""
    along, (xx, yy, xy) = np.array([base.along, base.across]), base.curvature
    turned = np.array([[xx, xy], [xy, yy]]) @ along
    moves = [_across(e) @ F + torque * n for e, n in zip(along, turned, strict=True)]
    both: Array = _steps(base).T @ np.array(moves)
    return both[0], both[1]
