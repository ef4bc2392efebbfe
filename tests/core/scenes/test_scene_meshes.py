"""The mesh files of ready scenes are what their script makes."""

import runpy
from pathlib import Path

import numpy as np
import pytest

from kappaskin.scenes import load_scene, scene_file

SCRIPT = Path(__file__).parents[2] / "scene_meshes.py"


def test_the_pad_of_the_thumb_is_the_ellipsoid_of_its_script():
    kept = scene_file("thumb-pad").with_name("thumb-pad.stl").read_bytes()
    made = runpy.run_path(str(SCRIPT))["thumb_pad"]()
    triangle = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])

    assert kept[:84] == made[:84]
    was, now = (np.frombuffer(content, triangle, offset=84) for content in (kept, made))
    np.testing.assert_allclose(was["corners"], now["corners"], atol=1e-5)  # mm


def test_a_third_of_the_rim_of_the_thumb_is_held_under_its_nail():
    patch = load_scene("thumb-pad").plate.patch

    assert len(patch.held) == pytest.approx(len(patch.rim) / 3, abs=2)
    assert patch.points[patch.held, 0].min() == pytest.approx(13.5e-3, rel=1e-6)
    np.testing.assert_allclose([patch.a, patch.b, patch.rise], [0.018, 0.014, 0.006], rtol=1e-3)
