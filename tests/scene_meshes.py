"""The mesh files of the ready scenes, of shapes in closed form.

Run `python tests/scene_meshes.py` when one changes; `tests/core/scenes/test_scene_meshes.py`
compares.
"""

import math
import sys
from pathlib import Path

import numpy as np

from kappaskin.scenes import scene_file

sys.path.insert(0, str(Path(__file__).parent / "truths"))
from meshes import ellipsoid

SIDES, HEIGHT = (18.0, 14.0), 6.0
"""Of the thumb's pad in mm: the axes of its rim, and how far it rises from there."""
_ANGLE = math.radians(75)  # from the top of the ellipsoid to the rim, as its parameter
_RINGS = 28


def thumb_pad() -> bytes:
    """A binary STL file in mm: the upper part of an ellipsoid, as a finger's pad."""
    axes = *(side / 2 / math.sin(_ANGLE) for side in SIDES), HEIGHT / (1 - math.cos(_ANGLE))
    nodes, triangles = ellipsoid(_RINGS, axes, _ANGLE)
    nodes = nodes - (0, 0, nodes[:, 2].min())
    corners = nodes[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    kind = [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")]
    rows = np.zeros(len(triangles), kind)
    rows["normal"], rows["corners"] = normals, corners
    head = b"The pad of a thumb in mm: x along the finger, z outward".ljust(80)
    return head + np.array(len(rows), "<u4").tobytes() + rows.tobytes()


if __name__ == "__main__":
    scene_file("thumb-pad").with_name("thumb-pad.stl").write_bytes(thumb_pad())
