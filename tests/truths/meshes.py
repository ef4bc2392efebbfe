"""Meshes of skins whose shape is known in closed form."""

import numpy as np
from scipy.spatial import Delaunay


def disk(rings, fine=()):
    """Places (n, 2) on a disk of radius 1, and triangles (F, 3) between them.

    Ever smaller ones around places of the rim at the turns `fine`.
    """
    places = [np.zeros((1, 2))]
    for k in range(1, rings + 1):
        turn = 2 * np.pi * np.arange(6 * k) / (6 * k)
        places.append(k / rings * np.column_stack([np.cos(turn), np.sin(turn)]))
    places = np.concatenate(places)
    for turn in fine:
        places = _finer(places, np.array([np.cos(turn), np.sin(turn)]), 2.4 / rings)
    triangles = Delaunay(places).simplices
    a, b, c = (places[triangles[:, k]] for k in range(3))
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    triangles[area < 0] = triangles[area < 0][:, ::-1]
    return places, triangles[np.abs(area) > 1e-9]


def _finer(places, end, within):
    """The places with rings around an `end` on the rim, each 0.6 times as large as the last."""
    found = [places[np.linalg.norm(places - end, axis=1) > 1.3 * within], end[None]]
    for far in within * 0.6 ** np.arange(9):
        # Where a circle of the radius `far` around the end meets the rim, and between.
        half = np.arccos(far / 2)
        turn = np.pi + np.arctan2(*end[::-1]) + half * np.linspace(-1, 1, 7)
        ring = end + far * np.column_stack([np.cos(turn), np.sin(turn)])
        ring[[0, -1]] /= np.linalg.norm(ring[[0, -1]], axis=1)[:, None]
        found.append(ring)
    return np.concatenate(found)


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
