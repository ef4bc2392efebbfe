"""Meshes of skins whose shape is known in closed form."""

import numpy as np
from scipy.spatial import Delaunay


def disk(rings):
    """Places (n, 2) on a disk of radius 1, and triangles (F, 3) between them."""
    places = [np.zeros((1, 2))]
    for k in range(1, rings + 1):
        turn = 2 * np.pi * np.arange(6 * k) / (6 * k)
        places.append(k / rings * np.column_stack([np.cos(turn), np.sin(turn)]))
    places = np.concatenate(places)
    triangles = Delaunay(places).simplices
    a, b, c = (places[triangles[:, k]] for k in range(3))
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    triangles[area < 0] = triangles[area < 0][:, ::-1]
    return places, triangles[np.abs(area) > 1e-9]


def ellipsoid(rings, axes, angle):
    """Nodes (n, 3) in m and triangles of the part of an ellipsoid around its axis z."""
    places, triangles = disk(rings)
    far, turn = np.hypot(*places.T), np.arctan2(*places.T[::-1])
    t = angle * far
    unit = [np.sin(t) * np.cos(turn), np.sin(t) * np.sin(turn), np.cos(t)]
    return np.column_stack(unit) * axes, triangles


def obj(nodes, triangles):
    """The text of an OBJ file."""
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in np.asarray(nodes).tolist()]
    return "\n".join(lines + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in triangles.tolist()])
