"""Scenes on meshes: from their file, as a text, and what is refused."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kappaskin import Plate, Refusal, SensorLayout, read_scene, write_scene
from kappaskin.skin import MeshSkin
from meshes import ellipsoid, obj

AXES = 9e-3, 7e-3, 6e-3
NODES, TRIANGLES = ellipsoid(18, AXES, math.radians(70))
SKIN = """format = 1
[skin]
shape = "mesh"
file = "pad.obj"
unit = "mm"
thickness = 0.001
"""
ELEMENTS = "[elements]\nspread = 20\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("scene")
    (made / "pad.obj").write_text(obj(1e3 * NODES, TRIANGLES))
    (made / "pad.txt").write_text("a mesh")
    (made / "hole.obj").write_text(obj(1e3 * NODES, np.delete(TRIANGLES, 200, axis=0)))
    return made


def read(text, folder):
    return read_scene(text, folder / "a.toml")


@pytest.fixture(scope="module")
def scene(folder):
    return read(SKIN + ELEMENTS, folder)


def test_a_mesh_is_read_in_its_unit(scene):
    mesh = scene.plate.patch
    assert isinstance(mesh, MeshSkin)
    assert mesh.a == pytest.approx(2 * AXES[0] * math.sin(math.radians(70)), rel=1e-6)
    assert (mesh.thickness, len(mesh.triangles)) == (1e-3, len(TRIANGLES))
    assert scene.plate.sheet_thickness == 1e-3
    assert len(scene.layout) == 20


def test_a_part_of_the_rim_is_held(folder, scene):
    x, y = (1e3 * side * math.sin(math.radians(70)) for side in AXES[:2])
    ends = f"held = [[{x}, 0, 2.05], [{-x}, 0, 2.05]]\n"
    mesh = read(SKIN + ends + ELEMENTS, folder).plate.patch
    held = mesh.nodes[mesh.held]
    assert 0 < len(mesh.held) < len(mesh.rim)
    assert (held[:, 1] > -1e-6).all()
    assert held[:, 1].max() == pytest.approx(1e-3 * y, rel=1e-3)
    assert mesh != scene.plate.patch


@pytest.mark.parametrize("place", ["file", "moved"])
def test_a_scene_on_a_mesh_is_written_with_the_mesh(scene, folder, tmp_path, place):
    if place == "moved":
        layout = SensorLayout.scattered(scene.plate.patch, scene.layout.positions + 1e-5)
        scene = replace(scene, layout=layout)
    text = write_scene(scene)
    assert "pad.obj" not in text
    back = read(text, tmp_path)  # where the file of the mesh is not
    assert back.plate == scene.plate
    assert np.array_equal(back.plate.patch.points, scene.plate.patch.points)
    assert np.array_equal(back.layout.positions, scene.layout.positions)
    assert write_scene(back) == text


WRONG = {
    "no unit": ('unit = "mm"\n', "", r"skin.file: .*expected its unit.*16.9 x 13.2 x 3.95 mm"),
    "another unit": ('"mm"', '"ell"', "line 5: skin.unit: expected one of m, cm, mm, inch"),
    "no thickness": ("thickness = 0.001\n", "", "line 2: skin: expected a thickness in m"),
    "no file": ("pad.obj", "pod.obj", "line 4: skin.file: .*does not exist"),
    "another folder": ("pad.obj", "/pad.obj", "line 4: skin.file: .*in the folder of the scene"),
    "no mesh": ("pad.obj", "pad.txt", "line 4: skin.file: expected a file named .stl, .obj, .ply"),
    "a hole": ("pad.obj", "hole.obj", r"line 4: skin.file: .*hole.obj: expected one rim, got 1"),
    "a size": ('"mm"', '"m"', "line 4: skin.file: .*expected a skin of 0.5 mm to 1 m"),
    "both": ("thickness", 'mesh = "a"\nthickness', "line 4: skin.file: expected a file or the"),
    "no text": ('file = "pad.obj"', 'mesh = "a"', "line 4: skin.mesh: expected the text of a mesh"),
    "a held line": ("thickness", "held = [[0, 0, 0]]\nthickness", "line 6: skin.held: expected"),
    "held off": (
        "thickness",
        "held = [[0, 0, 6], [9, 0, 0]]\nthickness",
        "line 6: skin.held: expected ends of the held edge on the rim",
    ),
    "tension": ("thickness", "tension = 1.0\nthickness", "expected tension left out of a mesh"),
    "fluid": ("thickness", "fluid = true\nthickness", "expected fluid left out of a mesh"),
    "axial": ("thickness", "axial_stiffness = 1e4\nthickness", "axial_stiffness left out"),
    "in plane": ("thickness", 'inplane = "free"\nthickness', "expected inplane held of a mesh"),
    "an edge": ("thickness", 'edge = "elastic"\nthickness', "among hinged, clamped"),
    "rings": ("spread = 20", "rings = [1, 6]", "expected a disk or a cap, got a mesh"),
    "too many": ("spread = 20", "spread = 2000", r"expected 1 to \d+ elements"),
}


@pytest.mark.parametrize(("was", "now", "said"), WRONG.values(), ids=WRONG)
def test_what_no_mesh_has_is_refused_with_its_line(folder, was, now, said):
    text = SKIN + ELEMENTS
    assert was in text
    with pytest.raises(Refusal, match=said) as refused:
        read(text.replace(was, now, 1), folder)
    assert str(refused.value).count("a.toml") == 1


def test_elements_are_spread_over_meshes_alone():
    text = "format = 1\n[skin]\nsize = [0.1, 0.1]\n[elements]\nspread = 20\n"
    with pytest.raises(Refusal, match="line 4: elements: expected a mesh to spread elements over"):
        read_scene(text, Path("a.toml"))


def test_a_plate_has_the_thickness_of_its_mesh(scene):
    mesh = scene.plate.patch
    assert Plate(mesh, thickness=1e-3).sheet_thickness == Plate(mesh).sheet_thickness == 1e-3
    with pytest.raises(Refusal, match="expected the thickness of the mesh"):
        Plate(mesh, thickness=2e-3)
    with pytest.raises(Refusal, match="expected rigidity above zero"):
        Plate(mesh, rigidity=0.0, tension=1.0)
