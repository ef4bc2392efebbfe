"""Where a rigid object presses on a thin skin: point forces, and how they move."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from kappaskin.frames import Array

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
"""The `pattern` (12, 3) of an even circle: x, y and share of the force."""
EVEN = (1.0, 1.0)
"""The `narrow` of two arcs of the same width."""


@dataclass(frozen=True, slots=True, eq=False)
class PointForces:
    """Forces `weights` (k,) in N at `points` (k, 2) in m, with derivatives for n parameters.

    `moves` (n, k, 2) are those of the points, `growth` (n, k) those of the weights.
    """

    points: Array
    weights: Array
    moves: Array
    growth: Array


Contact = Callable[[Array], PointForces]
"""Parameters to forces: x, y of the centre of force in m and the force in N come first."""


def ring(pattern: Array) -> Contact:
    """x, y, F, q: the force in a `pattern` (k, 3) of x, y and share, sqrt(q) times as large."""
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


def ends(middle: float) -> Contact:
    """x, y, F, angle, length squared, share: forces at two ends, and the share `middle` between.

    The ends have (1/2 + share) and (1/2 - share) of the rest.
    """
    return lambda parameters: _at_ends(parameters, np.zeros((2, 1)), middle)


def arcs(narrow: tuple[float, float], middle: float) -> Contact:
    """The same and q: each end's force on an arc across, of half width sqrt(q) times `narrow`."""
    return lambda parameters: _at_ends(parameters, np.multiply.outer(narrow, _ARC), middle)


def _at_ends(parameters: Array, across: Array, middle: float) -> PointForces:
    """Forces off the axis by `across` (2, k) times the root of the last parameter."""
    force, angle, length, share = *parameters[2:4], math.sqrt(parameters[4]), parameters[5]
    axis = np.array([math.cos(angle), math.sin(angle)])
    beside = np.array([-axis[1], axis[0]])
    k, n, rest, sign = across.shape[1], len(parameters), 1 - middle, np.array([1.0, -1.0])
    of_end = rest * (0.5 + sign * share)
    if middle:
        across = np.vstack([across, across.mean(axis=0)])
        sign, of_end = np.append(sign, 0.0), np.append(of_end, middle)
    sign, growth, off = np.repeat(sign, k), np.zeros((n, across.size)), across.ravel()
    place, a = sign / 2 - rest * share, math.sqrt(parameters[6]) if n > 6 else 0.0
    u, v = place * length, off * a
    moves = np.zeros((n, across.size, 2))
    moves[0, :, 0] = moves[1, :, 1] = 1
    moves[3] = np.multiply.outer(u, beside) - np.multiply.outer(v, axis)
    moves[4] = np.multiply.outer(place / (2 * length), axis)
    moves[5] = -rest * length * axis
    if n > 6:
        moves[6] = np.multiply.outer(off / (2 * a), beside)
    growth[2], growth[5] = np.repeat(of_end, k) / k, rest * sign * force / k
    points = parameters[:2] + np.multiply.outer(u, axis) + np.multiply.outer(v, beside)
    return PointForces(points, force * growth[2], moves, growth)
