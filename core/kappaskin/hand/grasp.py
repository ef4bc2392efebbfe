"""Contacts of several fingers in the hand's frame, and the sum of their forces and moments."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import cast

import numpy as np

from kappaskin.errors import Refusal
from kappaskin.estimation import Fit, propagated_covariance
from kappaskin.frames import Array, Estimate
from kappaskin.hand.description import Finger
from kappaskin.hand.pose import Placement

_AXES = np.eye(3)


@dataclass(frozen=True, slots=True, eq=False)
class FingerContact:
    """What a finger tells of the object that it touches, in the hand's frame.

    `position` (3,) in m, on the deflected skin and the object; `frame` (3, 3), whose rows are the
    skin's unit vectors along x, across it, and its outward normal, into the object; `curvature`
    (3,) in 1/m, xx, yy and xy of the object along that frame, positive where it is convex; NaN
    unless the skin conforms. `covariance` (8, 8) is that of the position along the hand's axes in
    m, of the normal along the two unit vectors, and of the curvature.

    `force` +- `force_sd` in N is the normal force; NaN where it is unknown. Friction is not told.
    `placement` is where the finger's skin was, and `skin_curvature` (2, 2) in 1/m that of the skin
    at rest, moved inward to the contact: with `depth` +- `depth_sd` in m, they tell rolling from
    sliding.
    """

    finger: str
    position: Array
    frame: Array
    curvature: Array
    covariance: Array
    force: float
    force_sd: float
    placement: Placement
    skin_curvature: Array
    depth: float
    depth_sd: float

    @property
    def normal(self) -> Array:
        """The skin's outward unit normal (3,): the object's is opposite."""
        return self.frame[2]

    @property
    def on_skin(self) -> Array:
        """The position (3,) in m in the frame of the finger's skin."""
        return (self.position - self.placement.position) @ self.placement.rotation


# The contact lies at r = r0(x, y) - f n0, where the outward normal n tilts by the slopes of f:
#     dr = [t s] [metric] (dx, dy) - n0 df,    [t s] . dn = K [metric] (dx, dy) + d(f_x, f_y).
# Its place, its depth f and the slopes have independent errors. Where the skin is, is uncertain by
# a shift and a small turn a, which moves all of it: dr = a x (r - r_skin), dn = a x n.
def finger_contact(
    finger: Finger, where: Placement, estimate: Estimate, fit: Fit
) -> FingerContact | None:
    """The contact of a `finger` whose skin is at `where`; None without one, or too near the rim.

    From the `estimate` of a frame and the `fit` that the pipeline made it of. The depth is that of
    the contact. The error bar of the normal has what the normals of the skin deflected and at rest
    differ by: under a small load the slopes of the fit may be as far off.
    """
    contact, geometry = estimate.contact, estimate.geometry
    if not contact.present or contact.near_rim:
        return None
    x, y = contact.position.tolist()
    base, (jet, covariance) = fit.estimator.basis.patch.base(x, y), fit.jet(x, y)
    leaning = (base.covariant @ jet)[1:3]
    slopes = propagated_covariance(base.covariant, covariance)[1:3, 1:3]
    slopes = slopes + leaning @ leaning / 2 * np.eye(2)
    n0, metric, K = np.array(base.normal), geometry.metric, geometry.curvature_form
    J = np.zeros((8, 8))
    J[:3, :2], J[:3, 2] = geometry.frame[:2].T @ metric, -n0
    J[3:5, :2], J[3:5, 3:5] = K @ metric, np.eye(2)
    J[5:, 5:] = -np.eye(3)
    own = np.zeros((8, 8))
    own[[0, 1, 2], [0, 1, 2]] = (*contact.position_sd**2, contact.displacement_sd**2)
    own[3:5, 3:5], own[5:, 5:] = slopes, geometry.covariance
    R = where.rotation
    to_hand = np.eye(8)
    to_hand[:3, :3] = R
    frame = geometry.frame @ R.T
    arm = R @ (geometry.position + (jet[0] - contact.displacement) * n0)
    cov = propagated_covariance(to_hand @ J, own) + _of_placement(finger, frame, arm)
    xx, yy, xy = base.form.tolist()
    rest = np.array([[xx, xy], [xy, yy]])
    moved_in = cast("Array", np.linalg.inv(np.eye(2) - contact.displacement * rest) @ rest)
    curvature = -K[[0, 1, 0], [0, 1, 1]]
    if not finger.conforms:
        curvature = np.full(3, np.nan)
        cov[5:], cov[:, 5:] = np.nan, np.nan
    return FingerContact(
        finger.name,
        where.position + arm,
        frame,
        curvature,
        cov,
        contact.force,
        contact.force_sd,
        where,
        moved_in,
        contact.displacement,
        contact.displacement_sd,
    )


def _of_placement(finger: Finger, frame: Array, arm: Array) -> Array:
    """The covariance (8, 8) that the uncertain placement of a finger makes."""
    turned = np.zeros((8, 3))
    turned[:3] = np.cross(_AXES, arm).T
    turned[3:5] = frame[:2] @ np.cross(_AXES, frame[2]).T
    found = finger.rotation_sd**2 * turned @ turned.T
    found[:3, :3] += finger.position_sd**2 * _AXES
    return found


@dataclass(frozen=True, eq=False)
class Grasp:
    """The `contacts` of a hand's fingers with one object at one moment."""

    contacts: Sequence[FingerContact]

    def __post_init__(self) -> None:
        names = [one.finger for one in self.contacts]
        if len({*names}) != len(names):
            raise Refusal(f"expected one contact of each finger, got {names!r:.200}")

    @property
    def force(self) -> Array:
        """The sum (3,) in N of the normal forces on the object."""
        return self._wrench[0][:3]

    @property
    def moment(self) -> Array:
        """The sum (3,) in N m of their moments about the origin of the hand's frame."""
        return self._wrench[0][3:]

    @property
    def covariance(self) -> Array:
        """The covariance (6, 6) of force and moment; NaN where a force is unknown."""
        return self._wrench[1]

    @cached_property
    def _wrench(self) -> tuple[Array, Array]:
        whole, covariance = np.zeros(6), np.zeros((6, 6))
        for one in self.contacts:
            n, p, F = one.normal, one.position, one.force
            line = np.concatenate([n, np.cross(p, n)])
            by = np.zeros((6, 5))  # per position and tilt, at a force of 1 N
            by[3:, :3], by[:3, 3:] = np.cross(_AXES, n).T, one.frame[:2].T
            by[3:, 3:] = np.cross(p, one.frame[:2]).T
            moved = propagated_covariance(by, one.covariance[:5, :5])
            whole += F * line
            # Of the product of independent force and line, to the second order.
            covariance += one.force_sd**2 * (np.outer(line, line) + moved) + F**2 * moved
        return whole, covariance

    @property
    def extent(self) -> float:
        """The largest distance in m between two of its contacts, of the fingers that touch."""
        if not self.contacts:
            return math.nan
        places = np.array([one.position for one in self.contacts])
        return float(np.linalg.norm(places[:, None] - places, axis=-1).max())
