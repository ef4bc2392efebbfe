"""Rigid objects pressed into an elastic half-space: the closed forms of Hertz and Sneddon.

They share no code with the library that they test (I. N. Sneddon 1965,
doi:10.1016/0020-7225(65)90019-4; K. L. Johnson, Contact Mechanics, 1985, 3.42 and 5.2).
Displacement is positive inward; r is the distance from the axis, a the contact's radius.
"""

import numpy as np


def sphere(r, a, radius):
    """Displacement in m under a sphere of `radius`, all in m."""
    inside = (2 * a**2 - r**2) / (2 * radius)
    s = np.maximum(r, a)
    outside = ((2 * a**2 - s**2) * np.arcsin(a / s) + a * np.sqrt((s - a) * (s + a))) / (
        np.pi * radius
    )
    return np.where(r < a, inside, outside)


def punch(r, a, depth):
    """Displacement in m under a flat punch of radius `a` in m."""
    return np.where(r < a, depth, 2 * depth / np.pi * np.arcsin(a / np.maximum(r, a)))


def cone(r, a, slope):
    """Displacement in m under a cone that rises by `slope`."""
    s = np.maximum(r, a)
    outside = slope * (a * np.arcsin(a / s) - s + np.sqrt((s - a) * (s + a)))
    return np.where(r < a, slope * (np.pi / 2 * a - r), outside)


def slopes(surface, places, step=1e-6):
    """Slopes along x and along y (2 P,) of `surface` (P,) in m of places (P, 2) in m."""
    both = [surface(places + d) - surface(places - d) for d in step * np.eye(2)]
    return np.concatenate(both) / (2 * step)


def curvature(surface, places, step=2e-5):
    """Second differences xx, yy, xy (3, P) in 1/m of `surface` (P,) in m of places (P, 2) in m."""
    x, y = np.array([step, 0.0]), np.array([0.0, step])
    middle = 2 * surface(places)
    xx, yy = (surface(places + d) + surface(places - d) - middle for d in (x, y))
    diagonals = surface(places + x + y) + surface(places - x - y)
    xy = (diagonals - surface(places + x - y) - surface(places - x + y)) / 4
    return np.stack([xx, yy, xy]) / step**2
