"""Scenes on meshes: from their file, as a text, and what is refused."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kappaskin import Plate, Refusal, SensorLayout, read_scene, write_scene
from kappaskin.skin import MeshSkin
from kappaskin.sources import sensor_from_json, sensor_to_json
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
    "tension": ("thickness", "tension = 1.0\nthickness", "expected no tension of a mesh"),
    "fluid": ("thickness", "fluid = true\nthickness", "expected no fluid of a mesh"),
    "axial": (
        "thickness",
        "axial_stiffness = 1e4\nthickness",
        "expected no axial_stiffness",
    ),
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
    with pytest.raises(Refusal, match="expected a rigidity of a mesh"):
        Plate(mesh, rigidity=0.0, tension=1.0)


MESH = MeshSkin(NODES, TRIANGLES, 1e-3)
OUTWARD = NODES[:200:9] / np.square(AXES)
OUTWARD /= np.linalg.norm(OUTWARD, axis=1)[:, None]
ROWS = NODES[:200:9] + 2e-5 * OUTWARD


def of_file(folder, rows, heading="x,y,z", more=""):
    lines = [",".join(f"{value!r}" for value in row) for row in np.asarray(rows).tolist()]
    (folder / "elements.csv").write_text("\n".join([heading, *lines]))
    return read(f'{SKIN}[elements]\nfile = "elements.csv"\n{more}', folder)


def test_elements_at_places_in_space_are_moved_onto_the_mesh(folder):
    scene = of_file(folder, 1e3 * ROWS)
    mesh = scene.plate.patch
    points = np.stack(mesh.base(*scene.layout.positions.T).point, axis=-1)
    found = points @ mesh.frame + mesh.origin
    assert np.abs(found - NODES[:200:9]).max() < 5e-6
    assert scene.text == ""
    assert "elements.csv" not in write_scene(scene)


def test_elements_that_move_far_are_told(folder):
    scene = of_file(folder, 1e3 * (NODES[:200:9] + 5e-4 * OUTWARD))
    assert "Elements were moved onto the mesh, element" in scene.text
    assert scene.text.endswith("by 0.5 mm.")
    assert read(write_scene(scene), folder).text == scene.text


def along(scene, frame):
    """The cosine of the angle between each element's axis and the tangent e_y or e_x, squared."""
    return np.stack([np.cos(scene.layout.turns), np.sin(scene.layout.turns)])[frame] ** 2


def test_elements_have_their_own_directions(folder):
    mesh = read(SKIN + ELEMENTS, folder).plate.patch
    positions, _ = mesh.projected(NODES[:200:9])
    across = np.stack(mesh.base(*positions.T).across, axis=-1) @ mesh.frame
    rows = np.column_stack([1e3 * ROWS, 3 * across])
    scene = of_file(folder, rows, "x, y, z, dx, dy, dz", "dead = [2]\n")
    assert along(scene, 1) == pytest.approx(np.ones(len(ROWS)), abs=1e-4)
    layout = scene.layout
    assert layout.each_reads == ["curvature@0", "curvature@90", "curvature@45"]
    assert layout.dead == [2]
    basis = scene.basis
    turned = layout.operator(basis).reshape(3, len(ROWS), -1)
    xx, yy, xy = layout.of_curvature.operator(basis).reshape(turned.shape)
    t = layout.turns[:, None]
    c, s = np.cos(t), np.sin(t)
    ways = (c, s), (-s, c), ((c - s) / 2**0.5, (c + s) / 2**0.5)
    for rows, (u, v) in zip(turned, ways, strict=True):
        assert np.allclose(rows, u * u * xx + v * v * yy + 2 * u * v * xy, atol=1e-9 * xx.max())


def test_elements_lie_along_principal_curvatures(folder):
    scene = of_file(folder, 1e3 * ROWS[:1], more='along = "principal"\n')
    assert along(scene, 1) == pytest.approx(1.0, abs=1e-3)  # at the top that is y
    spread = read(SKIN + ELEMENTS + 'along = "principal"\n', folder).layout
    t = spread.turns
    xx, yy, xy = spread.patch.read_at_rest(spread.positions)
    assert np.abs((yy - xx) / 2 * np.sin(2 * t) + xy * np.cos(2 * t)).max() < 1e-9 * xx.max()
    assert (np.cos(2 * t) * (xx - yy) + 2 * np.sin(2 * t) * xy >= 0).all()


def test_elements_of_own_directions_come_back_bit_for_bit(folder):
    scene = read(SKIN + ELEMENTS + 'along = "principal"\n', folder)
    sensor = scene.sensor()
    for layout in (
        read(write_scene(scene), folder).layout,
        sensor_from_json(sensor_to_json(sensor)).layout,
    ):
        assert np.array_equal(layout.reads.direction, scene.layout.reads.direction)
        assert np.array_equal(layout.positions, scene.layout.positions)
        assert layout.kinds == scene.layout.kinds


OFF = {
    "far": (1e3 * ROWS + 30, "x,y,z", "", "line 8: elements.file: .*mm away"),
    "no heading": (ROWS, "1,2,3", "", "a first line x,y,z"),
    "two columns": (ROWS[:, :2], "x,y", "", "a first line x,y,z"),
    "not finite": (np.nan * ROWS, "x,y,z", "", "finite numbers"),
    "across": (
        np.column_stack([1e3 * ROWS, OUTWARD]),
        "x,y,z,dx,dy,dz",
        "",
        "directions along the skin, got one across",
    ),
    "both": (1e3 * ROWS, "x,y,z", "spread = 3", "expected one pattern, got spread and file"),
    "turns": (1e3 * ROWS, "x,y,z", "turns = [1.0]", "a turn in rad of each of 23 elements"),
    "too many ways": (
        1e3 * ROWS,
        "x,y,z",
        'turns = [1.0]\nalong = "principal"',
        "expected one of turns, along",
    ),
    "twist": (1e3 * ROWS, "x,y,z", 'along = "principal"\nreads = ["twist"]', "got a twist"),
    "slope": (1e3 * ROWS, "x,y,z", 'reads = ["slope@10"]', "slopes, which"),
}


@pytest.mark.parametrize(("rows", "heading", "more", "said"), OFF.values(), ids=OFF)
def test_places_that_no_elements_have_are_refused(folder, rows, heading, more, said):
    with pytest.raises(Refusal, match=said):
        of_file(folder, rows, heading, more)


def test_places_in_space_are_of_a_mesh_from_a_file(folder):
    (folder / "elements.csv").write_text("x,y,z\n1,2,3")
    text = 'format = 1\n[skin]\nsize = [0.1, 0.1]\n[elements]\nfile = "elements.csv"\n'
    with pytest.raises(Refusal, match="expected places of elements on a mesh with the unit"):
        read(text, folder)
    with pytest.raises(Refusal, match="expected elements that are turned on a mesh, got a patch"):
        read(text.replace('file = "elements.csv"', 'along = "principal"'), folder)
    with pytest.raises(Refusal, match="expected elements that are turned on a mesh, got a patch"):
        read(text.replace('file = "elements.csv"', "grid = [1, 1]\nturns = [0.1]"), folder)
