"""Exploration of an object: how it rolls and slides on the fingers, and a map of its surface."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np
import scipy
from numpy.typing import NDArray

from kappaskin._files import read_file, write_whole
from kappaskin.errors import Refusal
from kappaskin.estimation import propagated_covariance
from kappaskin.frames import Array
from kappaskin.hand.grasp import FingerContact, Grasp
from kappaskin.hand.held_object import ObjectFit
from kappaskin.hand.pose import IDENTITY, Placement

_NIL = 1e-11  # of the largest information: less is none
_HIDDEN = 1e-6  # of what is unknown: as much of it leaves a number unknown
_LEAST = 1e-3  # m, of the distance of the contacts, as a scale
_STILL = 1e-2  # of the error of a velocity along the skin: so still is what does not slide


@dataclass(frozen=True, eq=False)
class ContactMotion:
    """How an object moves on a finger, along the frame of the contact, with covariances.

    `sliding` (2,) in m/s is the velocity of the object's material over the finger's at the contact,
    along the first and the second unit vector; `turning` (3,) in rad/s the angular velocity of the
    object relative to the finger about all three: rolling about the first two, spin about the
    normal. `on_skin` and `on_object` (2,) in m/s are the velocities of the contact along either
    surface. Variances are infinite where the contacts do not tell.
    """

    finger: str
    sliding: Array
    sliding_covariance: Array
    turning: Array
    turning_covariance: Array
    on_skin: Array
    on_skin_covariance: Array
    on_object: Array
    on_object_covariance: Array


# On the frame (t, s, n) of a contact, n into the object, let u be the velocity of the contact along
# the skin, v and w velocity and angular velocity of the object at the contact relative to the
# finger, and K, L the curvature forms of skin and object. The contact moves by u - v on the object,
# and both normals stay opposite where
#     (K + L) u = L v + (w_s, -w_t),
# Montana's equations of contact (doi:10.1177/027836498800700302) in orthonormal frames. The object
# moves inward, v_n < 0, as fast as the depth grows.
class _Pair:
    """Two successive contacts of one finger, and what they tell of the motion between them."""

    def __init__(
        self, before: FingerContact, after: FingerContact, seconds: float, of: ObjectFit
    ) -> None:
        # On the object's fitted surface, or noise would seem to tell how a ball turns.
        self.finger, place = after.finger, (before.position + after.position) / 2
        F, g, _ = (each[0] for each in of.distance(place[None]))
        place, along = place - F * g, before.frame[0] + after.frame[0]
        H = of.distance(place[None])[2][0]
        along = along - (along @ g) * g
        along = along / np.linalg.norm(along)
        t = np.array([along, np.cross(along, g)])
        self.frame = np.vstack([t, -g])
        spread = before.covariance[:3, :3] + after.covariance[:3, :3]
        self.u_covariance = t @ spread @ t.T / seconds**2
        R = (before.placement.rotation + after.placement.rotation) / 2
        self.u = t @ R @ (after.on_skin - before.on_skin) / seconds
        K = (before.skin_curvature + after.skin_curvature) / 2
        L = t @ H @ t.T
        self.both = K + L
        if not np.linalg.eigvalsh(self.both)[0] > 0:
            raise Refusal(
                f"expected finger {self.finger!r} to touch in one place, where its skin and the "
                "object curve apart; got an object that is hollow there"
            )
        # Of (v, w): the three equations, and their right sides with their covariance.
        self.A, self.b, self.C = np.zeros((3, 6)), np.zeros(3), np.zeros((3, 3))
        self.A[:2, :2], self.A[[0, 1, 2], [4, 3, 2]] = L, (1.0, -1.0, -1.0)
        self.b[:2], self.b[2] = self.both @ self.u, (after.depth - before.depth) / seconds
        bent = of.curvature_sd / of.curvature * L @ self.u if of.curvature else 0 * self.u
        self.C[:2, :2] = self.both @ self.u_covariance @ self.both + np.outer(bent, bent)
        self.C[2, 2] = (after.depth_sd**2 + before.depth_sd**2) / seconds**2
        velocity, turning = _motion_between(before.placement, after.placement, seconds)
        arm = place - (before.placement.position + after.placement.position) / 2
        self.own = np.concatenate(
            [self.frame @ (velocity + np.cross(turning, arm)), self.frame @ turning]
        )
        """The finger's own velocity and angular velocity at the contact, along the frame."""
        self.J = np.zeros((6, 6))
        self.J[:3, :3] = self.J[3:, 3:] = self.frame
        self.J[:3, 3:] = -self.frame @ _across(place)
        """What makes such of the object's velocity at the hand's origin, and its angular one."""
        moved = t @ _across(turning)
        self.own_covariance = moved @ spread @ moved.T / 4
        """Of the finger's own velocity along the skin, as the place is uncertain."""

    def motion(self, velocity: Array, covariance: Array, unknown: Array) -> ContactMotion:
        """How the object moves on the finger at a `velocity` (6,) in the hand's frame.

        With its `covariance` (6, 6), and directions (d, 6) of it of which nothing is known.
        """
        relative = cast("Array", self.J @ velocity - self.own)
        C = propagated_covariance(self.J, covariance)
        C[:2, :2] += self.own_covariance
        with_u = cast("Array", np.linalg.inv(self.both) @ (self.A[:2] @ C)[:, :2])
        on_object: Array = self.u_covariance + C[:2, :2] - with_u - with_u.T
        hidden = np.linalg.norm(self.J @ unknown.T, axis=1)
        lost = np.where(hidden > _HIDDEN * np.linalg.norm(unknown), math.inf, 0.0)
        C[np.diag_indices(6)] += lost
        on_object[[0, 1], [0, 1]] += lost[:2]
        return ContactMotion(
            self.finger,
            relative[:2],
            C[:2, :2],
            relative[3:],
            C[3:, 3:],
            self.u,
            self.u_covariance,
            self.u - relative[:2],
            on_object,
        )


def _across(r: Array) -> Array:
    """The matrix (3, 3) of the cross product r x."""
    x, y, z = r
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _motion_between(before: Placement, after: Placement, seconds: float) -> tuple[Array, Array]:
    """The velocity (3,) in m/s of a frame's origin, and the angular velocity (3,) in rad/s."""
    turn = after.rotation @ before.rotation.T
    about = scipy.spatial.transform.Rotation.from_matrix(turn).as_rotvec()
    return (after.position - before.position) / seconds, about / seconds


@dataclass(frozen=True, eq=False)
class ObjectMotion:
    """How a held object moves between two moments, and how it moves on each finger.

    `velocity` (6,) is that of its material at the hand's origin in m/s, then its angular velocity
    in rad/s, with its `covariance` (6, 6); `unknown` (d, 6) are directions of it that the contacts
    do not tell, as the turning of a ball, along which both are zero. The motion leaves
    `chi_squared` of `spare` numbers more than it determines.
    """

    velocity: Array
    covariance: Array
    unknown: Array
    chi_squared: float
    spare: int
    contacts: tuple[ContactMotion, ...]

    @property
    def chance(self) -> float:
        """Probability that noise leaves more; NaN where no number is spare."""
        if self.spare < 1:
            return math.nan
        return float(scipy.special.chdtrc(self.spare, self.chi_squared))


def object_motion(
    before: Grasp, after: Grasp, seconds: float, of: ObjectFit, rolls: bool = False
) -> ObjectMotion:
    """The motion of an object `of` known shape between two grasps `seconds` apart.

    If it `rolls`, it slides on no finger; the chance says whether that may be. Fingers that touch
    in one of the two only are left out.
    """
    pairs = _pairs(before, after, seconds, of)
    extent = max(before.extent, after.extent, _LEAST)
    scale = np.repeat([extent, 1.0], 3)  # so that all of it is in 1/s
    rows, sides = list[Array](), list[Array]()
    for pair in pairs:
        row, side, spread = pair.A @ pair.J, pair.b + pair.A @ pair.own, pair.C
        if rolls:
            row, side = np.vstack([row, pair.J[:2]]), np.concatenate([side, pair.own[:2]])
            still = _STILL**2 * np.trace(spread[:2, :2]) / np.trace(pair.both) ** 2
            spread = scipy.linalg.block_diag(spread, still * np.eye(2))
        whiten = np.linalg.inv(np.linalg.cholesky(spread))
        rows.append(whiten @ row * scale)
        sides.append(cast("Array", whiten @ side))
    A, b = np.concatenate(rows), np.concatenate(sides)
    values, vectors = np.linalg.eigh(A.T @ A)
    told = values > _NIL * values[-1]
    known = vectors[:, told] / np.sqrt(values[told])
    q = known @ (known.T @ (A.T @ b))
    half = scale[:, None] * known
    velocity, covariance, unknown = scale * q, half @ half.T, vectors[:, ~told].T * scale
    chi = float(np.sum((b - A @ q) ** 2))
    motions = tuple(pair.motion(velocity, covariance, unknown) for pair in pairs)
    return ObjectMotion(velocity, covariance, unknown, chi, len(b) - int(told.sum()), motions)


def contact_motions(
    before: Grasp, after: Grasp, seconds: float, of: ObjectFit
) -> tuple[ContactMotion, ...]:
    """How the fingers that touch in both grasps roll and slide over an object that is at rest."""
    rest = np.zeros(6), np.zeros((6, 6)), np.zeros((0, 6))
    return tuple(pair.motion(*rest) for pair in _pairs(before, after, seconds, of))


def _pairs(before: Grasp, after: Grasp, seconds: float, of: ObjectFit) -> list[_Pair]:
    if not seconds > 0:
        raise Refusal(f"expected the second grasp after the first, got {seconds:g} s between them")
    if of.kind == "edge":
        raise Refusal("expected an object that rolls, got an edge; give a plane, ball or cylinder")
    were = {one.finger: one for one in before.contacts}
    both = [(were[one.finger], one) for one in after.contacts if one.finger in were]
    if not both:
        raise Refusal("expected a finger that touches in both grasps, got none")
    return [_Pair(*pair, seconds, of) for pair in both]


# The map

_NUMBERS = (
    *("x", "y", "z", "nx", "ny", "nz", "sd", "normal_sd"),
    *("covariance_xx", "covariance_yy", "covariance_zz"),
    *("covariance_xy", "covariance_xz", "covariance_yz"),
)
_ROW = np.dtype([*((name, "<f8") for name in _NUMBERS), ("contacts", "<u4")])
_SYMMETRIC = [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]
_LARGEST = 2**30  # bytes of a file
_PLY = (
    "ply\nformat binary_little_endian 1.0\n"
    "comment Kappaskin: surface of an object, in m, with standard deviations\n"
)


class ObjectMap:
    """The surface of an object as fingers have touched it, in the object's own frame.

    Of all contacts in a cube of side `cell` in m it keeps the one that is known best along its
    normal: errors of successive frames have much in common, and a mean would seem too sure.
    """

    def __init__(self, cell: float = 5e-4) -> None:
        if not (math.isfinite(cell) and cell > 0):
            raise Refusal(f"expected a cell with a side above zero in m, got {cell}")
        self.cell = cell
        self.cells: dict[tuple[int, ...], NDArray[np.void]] = {}

    def __len__(self) -> int:
        return len(self.cells)

    def add(self, contact: FingerContact, where: Placement = IDENTITY) -> None:
        """Add a `contact` with the object, whose frame is at `where` in the hand's."""
        R = where.rotation
        C = R.T @ contact.covariance[:3, :3] @ R
        point, normal = R.T @ (contact.position - where.position), -contact.normal @ R
        sd = math.sqrt(normal @ C @ normal)
        if not math.isfinite(sd):
            return
        tilt = math.sqrt(np.trace(contact.covariance[3:5, 3:5]))
        key = tuple(np.floor(point / self.cell).astype(int).tolist())
        before = self.cells.get(key)
        row = np.array((*point, *normal, sd, tilt, *C[_SYMMETRIC], 1), _ROW)[()]
        if before is not None:
            row = row if sd < before["sd"] else before
            row["contacts"] = before["contacts"] + 1
        self.cells[key] = row

    @property
    def rows(self) -> NDArray[np.void]:
        """A row of each cell: point, normal, standard deviations, covariance, how many contacts.

        `x`, `y`, `z` in m and their covariance, the outward normal `nx`, `ny`, `nz`; `sd` in m is
        that along the normal, `normal_sd` in rad that of its tilt.
        """
        return np.array(list(self.cells.values()), _ROW)

    def to_ply(self) -> bytes:
        """A PLY file of points with normals, and all else that `rows` has as further properties."""
        kinds = {"<f8": "double", "<u4": "uint"}
        each = [f"property {kinds[_ROW[name].str]} {name}\n" for name in _ROW.names or ()]
        head = f"{_PLY}comment cell {self.cell!r}\nelement vertex {len(self)}\n{''.join(each)}"
        return f"{head}end_header\n".encode() + self.rows.tobytes()

    def save(self, file: Path) -> None:
        """Write the map as a PLY file, whole or not at all."""
        write_whole(file, self.to_ply())

    @classmethod
    def load(cls, file: Path) -> "ObjectMap":
        """The map in a PLY file that `save` has written."""
        try:
            content = read_file(file, _LARGEST)
        except OSError as error:
            raise Refusal(f"{file}: cannot be read ({error}); check its name") from error
        head, _, body = content.partition(b"end_header\n")
        words = head.decode("ascii", "replace").removeprefix(_PLY).split()
        found = cls(_number(words[2])) if words[:2] == ["comment", "cell"] else cls()
        rows = np.frombuffer(body[: len(body) // _ROW.itemsize * _ROW.itemsize], _ROW)
        for row in rows.copy():
            place = np.array([row["x"], row["y"], row["z"]])
            found.cells[tuple(np.floor(place / found.cell).astype(int).tolist())] = row
        if found.to_ply() != content:
            raise Refusal(f"{file}: expected the surface of an object that kappaskin has written")
        return found


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
