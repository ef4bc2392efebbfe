"""Placements: where a frame is in another."""

import math
from typing import NamedTuple

import numpy as np

from kappaskin.frames import Array

Triple = tuple[float, float, float]


class Placement(NamedTuple):
    """Where a frame is in another: points x of it are at `rotation` x + `position`.

    `rotation` (3, 3) is orthonormal, `position` (3,) in m.
    """

    rotation: Array
    position: Array

    def of(self, inner: "Placement") -> "Placement":
        """Where a frame is that is at `inner` in this one."""
        return Placement(
            self.rotation @ inner.rotation, self.rotation @ inner.position + self.position
        )


IDENTITY = Placement(np.eye(3), np.zeros(3))


def placement(position: Triple, rotation: Triple) -> Placement:
    """The placement at `position` in m, turned by `rotation` in rad: roll, pitch and yaw.

    About the fixed axes x, then y, then z, as URDF has it.
    """
    (a, b, c), (d, e, f) = np.cos(rotation), np.sin(rotation)
    R = [
        [c * b, c * e * d - f * a, c * e * a + f * d],
        [f * b, f * e * d + c * a, f * e * a - c * d],
        [-e, b * d, b * a],
    ]
    return Placement(np.array(R), np.array(position, float))


def rotation_about(axis: Array, angle: float) -> Array:
    """The rotation (3, 3) by `angle` in rad about the unit vector `axis` (3,)."""
    x, y, z = axis
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle) * across + 2 * math.sin(angle / 2) ** 2 * across @ across
