"""Rigid objects: the height of their underside, what files make of them, and what is refused."""

import math
import tracemalloc
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from kappaskin import Refusal
from kappaskin.mechanics import Block, Cylinder, HeightMap, Mesh, Punch, Sphere, Wedge
from kappaskin.mechanics import height_maps as meshes


def of_triangles(mesh):
    return Mesh(np.array(mesh.vertices), np.array(mesh.faces))


BALL = trimesh.creation.icosphere(subdivisions=4, radius=4e-3)
SHAPES = {
    "sphere": Sphere(5e-3),
    "cylinder": Cylinder(4e-3, 10e-3),
    "wedge": Wedge(1.6, 10e-3, 6e-3),
    "rounded": Wedge(1.6, 10e-3, 6e-3, 1e-3),
    "punch": Punch(4e-3),
    "block": Block(10e-3, 6e-3),
    "map": HeightMap(np.array([[3.0, 2.5, 4.0], [1.5, 1.0, 2.0]]) * 1e-3, 9e-3, 6e-3),
    "mesh": of_triangles(BALL),
}
each_shape = pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES.keys())


def at(*places):
    return np.array(places) * 1e-3


# Every object alike


@each_shape
@given(st.floats(-2, 2), st.floats(-2, 2))
def test_an_object_is_nowhere_below_its_lowest_point_nor_beyond_its_extent(shape, u, v):
    place = np.array([[u, v]]) * shape.extent

    height = shape.height(place)[0]

    assert height >= 0
    assert (max(abs(u), abs(v)) <= 1 + 1e-9) or height == math.inf


@each_shape
def test_the_keel_holds_the_lowest_point_and_lies_on_the_object(shape):
    height = shape.height(shape.keel())
    on = height[np.isfinite(height)]

    assert on.min() == 0
    assert (np.abs(shape.keel()) <= np.array(shape.extent) * (1 + 1e-12)).all()


# Closed forms


def test_a_sphere_rises_as_its_circle_and_exactly_for_a_slight_step():
    # 3-4-5: 3 mm off the axis a sphere of 5 mm has risen by 5 - 4 = 1 mm.
    heights = Sphere(5e-3).height(at([3, 0], [0, -3], [5, 0], [5.001, 0], [1e-6, 0]))

    expected = [1e-3, 1e-3, 5e-3, math.inf, (1e-9) ** 2 / 10e-3]
    np.testing.assert_allclose(heights, expected, rtol=1e-12)


def test_a_cylinder_rises_across_its_axis_only_and_ends_with_its_length():
    heights = Cylinder(5e-3, 10e-3).height(at([4.9, 0], [4.9, 3], [5.1, 0], [0, 5.1]))

    np.testing.assert_allclose(heights, [0, 1e-3, math.inf, math.inf], rtol=1e-12)


def test_the_flanks_of_a_wedge_enclose_its_angle():
    # Ninety degrees between them: each rises as far as it goes out.
    heights = Wedge(math.pi / 2, 10e-3, 6e-3).height(at([0, 0], [4, 2], [0, -3], [0, 3.1]))

    np.testing.assert_allclose(heights, [0, 2e-3, 3e-3, math.inf], rtol=1e-12)


def test_a_rounded_wedge_goes_smoothly_from_its_tip_into_its_flanks():
    wedge = Wedge(1.0, 10e-3, 6e-3, 1e-3)
    joint = 1e-3 * math.cos(0.5)
    y = joint + np.array([-2, -1, 1, 2]) * 1e-8

    before, last, first, beyond = wedge.height(np.column_stack([np.zeros(4), y]))

    flank = 1 / math.tan(0.5)
    assert (last - before) / 1e-8 == pytest.approx(flank, rel=1e-3)
    assert (first - last) / 2e-8 == pytest.approx(flank, rel=1e-3)
    assert (beyond - first) / 1e-8 == pytest.approx(flank, rel=1e-3)
    # The tip is a circle's: it lies below where the flanks would meet.
    assert wedge.height(at([0, 0.5]))[0] == pytest.approx(1e-3 - math.sqrt(0.75) * 1e-3)


def test_a_flat_face_is_level_to_its_rim():
    np.testing.assert_array_equal(
        Punch(4e-3).height(at([0, 0], [2.8, 2.8], [2.9, 2.9])), [0, 0, math.inf]
    )
    np.testing.assert_array_equal(
        Block(10e-3, 6e-3).height(at([0, 0], [4.9, 2.9], [4.9, 3.1])), [0, 0, math.inf]
    )


def test_a_map_is_bilinear_between_the_centres_of_its_pixels():
    map_ = SHAPES["map"]

    # Columns at -3, 0 and 3 mm, rows at -1.5 and 1.5 mm; the lowest is the middle of row 1.
    heights = map_.height(at([0, 1.5], [-3, -1.5], [1.5, 1.5], [0, 0], [4.4, -2.9], [4.6, 0]))

    expected = [0, 2e-3, 0.5e-3, 0.75e-3, 3e-3, math.inf]
    np.testing.assert_allclose(heights, expected, atol=1e-15)


def test_a_hole_in_a_map_swallows_what_lies_next_to_it_and_no_more():
    map_ = HeightMap(np.array([[0.0, np.inf, 0.0, 1e-3]]), 4e-3, 1e-3)

    heights = map_.height(at([-1.5, 0], [-1.4, 0], [0.5, 0], [1.0, 0]))

    np.testing.assert_allclose(heights, [0, math.inf, 0, 0.5e-3])


# Files


def test_a_picture_stands_out_where_it_is_bright_with_its_top_at_the_largest_y(tmp_path):
    path = tmp_path / "stamp.png"
    for pixels in ([[0, 255], [51, 102]], [[0, 65535], [13107, 26214]]):
        kind = np.uint8 if pixels[0][1] == 255 else np.uint16
        Image.fromarray(np.array(pixels, kind)).save(path)

        stamp = HeightMap.read(path, 2e-3, 2e-3, relief=1e-3)

        heights = stamp.height(at([0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5], [0.5, -0.5]))
        np.testing.assert_allclose(heights, [0, 1e-3, 0.8e-3, 0.6e-3], atol=1e-15)


def test_an_array_stands_out_where_it_is_large_with_its_first_row_at_the_least_y(tmp_path):
    path = tmp_path / "stamp.npy"
    np.save(path, np.array([[-3.0, 1.0], [0.0, 1.0]]))

    stamp = HeightMap.read(path, 2e-3, 2e-3, relief=4e-4)

    heights = stamp.height(at([0.5, -0.5], [-0.5, -0.5], [-0.5, 0.5]))
    np.testing.assert_allclose(heights, [0, 4e-4, 1e-4], atol=1e-15)


@pytest.mark.parametrize("kind", ["stl", "ply", "obj"])
def test_a_mesh_of_a_ball_is_the_ball(tmp_path, kind):
    path = tmp_path / f"ball.{kind}"
    BALL.copy().apply_scale(1e3).export(path)  # in millimetres, as most such files

    read = Mesh.read(path, unit=1e-3)

    places = np.random.default_rng(0).uniform(-2e-3, 2e-3, (500, 2))
    # Facets lie inside the ball by edge^2 / (8 R), 5 um; so does the pixels' bilinear surface.
    np.testing.assert_allclose(read.height(places), Sphere(4e-3).height(places), atol=1.5e-5)
    assert read.extent == pytest.approx((4e-3, 4e-3), rel=1e-3)


def test_a_mesh_is_seen_from_below_whatever_it_carries_on_top():
    body = trimesh.creation.box((10e-3, 6e-3, 2e-3))
    knob = trimesh.creation.box((2e-3, 2e-3, 8e-3))
    knob.apply_translation((2e-3, 0, 3e-3))  # out of the top, 0 to 1 mm below the body's middle
    foot = trimesh.creation.box((2e-3, 2e-3, 2e-3))
    foot.apply_translation((-3e-3, 0, -1.5e-3))

    mesh = of_triangles(trimesh.util.concatenate([body, knob, foot]))

    heights = mesh.height(at([-3, 0], [0, 0], [2, 0], [4.9, 2.9], [5.1, 0]))
    np.testing.assert_allclose(heights, [0, 1.5e-3, 1.5e-3, 1.5e-3, math.inf], atol=1e-12)


def test_a_mesh_is_the_same_raster_in_one_batch_as_in_many(monkeypatch):
    whole = of_triangles(BALL).height(at([1, 1], [-2, 0.3], [0, 3]))
    monkeypatch.setattr(meshes, "_AT_ONCE", 1000)

    np.testing.assert_array_equal(of_triangles(BALL).height(at([1, 1], [-2, 0.3], [0, 3])), whole)


def test_a_mesh_that_is_seen_edge_on_only_is_refused_when_pressed():
    corners = np.array([[0, 0, 0], [5e-3, 0, 0], [0, 0, 5e-3], [5e-3, 0, 5e-3], [0, 1e-3, 0]])
    leaf = np.array([[0, 1, 2], [1, 3, 2], [0, 2, 1], [1, 2, 3]])  # its last vertex is no face's

    with pytest.raises(Refusal, match="nothing in it"):
        Mesh(corners, leaf).height(np.zeros((1, 2)))


# What is refused


@pytest.mark.parametrize("size", [0.0, -1e-3, math.nan, math.inf])
@pytest.mark.parametrize(
    "make",
    [
        Sphere,
        Punch,
        lambda size: Cylinder(size, 1e-3),
        lambda size: Cylinder(1e-3, size),
        lambda size: Block(size, 1e-3),
        lambda size: Block(1e-3, size),
        lambda size: Wedge(1.0, size, 1e-3),
        lambda size: Wedge(1.0, 1e-3, size),
        lambda size: HeightMap(np.zeros((2, 2)), size, 1e-3),
        lambda size: HeightMap(np.zeros((2, 2)), 1e-3, size),
    ],
)
def test_a_size_that_cannot_be_is_refused(make, size):
    with pytest.raises(Refusal, match="sizes above zero in metres"):
        make(size)


@pytest.mark.parametrize("angle", [0.0, -1.0, math.pi, 90.0, math.nan])
def test_an_angle_that_no_wedge_has_is_refused(angle):
    with pytest.raises(Refusal, match="below pi rad"):
        Wedge(angle, 1e-2, 1e-2)


@pytest.mark.parametrize("radius", [-1e-3, 1.0, math.nan, math.inf])
def test_a_tip_that_no_wedge_has_is_refused(radius):
    with pytest.raises(Refusal, match="tip no wider than the wedge"):
        Wedge(1.0, 1e-2, 1e-2, radius)


@pytest.mark.parametrize(
    ("heights", "said"),
    [
        (np.zeros(3), r"shape \(ny, nx\).*\(3,\)"),
        (np.zeros((0, 3)), r"shape \(ny, nx\).*\(0, 3\)"),
        (np.array([[0.0, np.nan]]), "NaN"),
        (np.array([[0.0, -np.inf]]), "-inf"),
        (np.full((2, 2), np.inf), "nothing in it"),
    ],
)
def test_heights_that_are_no_map_are_refused(heights, said):
    with pytest.raises(Refusal, match=said):
        HeightMap(heights, 1e-2, 1e-2)


_SHAPE = b"{'descr': '<f8', 'fortran_order': False, 'shape': (5, True), }".ljust(117) + b"\n"
ODD_SHAPE = b"\x93NUMPY\x01\x00\x76\x00" + _SHAPE + bytes(40)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("map.txt", b"1 2", r"named \.npy or \.png"),
        ("map.npy", b"1 2", "numpy.save"),
        ("map.npy", b"", "numpy.save"),
        ("map.png", b"no picture", "PNG picture"),
        ("map.png", b"", "PNG picture"),
        ("map.npy", b"\x93NUMPY\x01\x00\x0c\x00{'descr': '(\n", "numpy.save"),
        ("map.npy", ODD_SHAPE, "numpy.save"),
        ("map.npy", None, "numpy.save"),
        ("map.png", None, "PNG picture"),
    ],
)
def test_a_map_that_cannot_be_read_is_refused(tmp_path, name, content, said):
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)

    with pytest.raises(Refusal, match=said):
        HeightMap.read(path, 1e-2, 1e-2, 1e-3)


def test_the_least_difference_there_is_makes_a_relief(tmp_path):
    path = tmp_path / "map.npy"
    np.save(path, np.array([[0.0, 5e-324]]))

    read = HeightMap.read(path, 1e-2, 1e-2, 1e-3)

    assert read.heights == pytest.approx(np.array([[1e-3, 0.0]]))


def test_a_picture_cut_short_is_refused(tmp_path):
    path = tmp_path / "map.png"
    Image.fromarray(np.random.default_rng(0).integers(0, 255, (64, 64), np.uint8)).save(path)
    path.write_bytes(path.read_bytes()[:1000])

    with pytest.raises(Refusal, match="PNG picture"):
        HeightMap.read(path, 1e-2, 1e-2, 1e-3)


def test_no_memory_is_taken_for_what_a_picture_only_says_it_holds(tmp_path):
    path = tmp_path / "map.png"
    Image.fromarray(np.random.default_rng(0).integers(0, 255, (64, 64), np.uint8)).save(path)
    picture = path.read_bytes()
    at = picture.index(b"IDAT") - 4
    path.write_bytes(picture[:at] + (2**31 - 100).to_bytes(4, "big") + picture[at + 4 :])

    tracemalloc.start()
    with suppress(Refusal):
        HeightMap.read(path, 1e-2, 1e-2, 1e-3)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()

    assert most < 2**25


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="has no device that never ends")
def test_a_picture_without_end_or_too_large_is_refused(tmp_path):
    endless, large = tmp_path / "endless.png", tmp_path / "large.png"
    endless.symlink_to("/dev/zero")
    with large.open("wb") as file:
        file.truncate(2**26 + 1)

    for path, why in ((endless, "it is not a file"), (large, "it has more than 67108864 bytes")):
        with pytest.raises(Refusal, match=why):
            HeightMap.read(path, 1e-2, 1e-2, 1e-3)


def test_a_picture_in_colour_is_refused(tmp_path):
    path = tmp_path / "map.png"
    Image.fromarray(np.zeros((4, 4, 3), np.uint8)).save(path)

    with pytest.raises(Refusal, match="grey picture of 8 or 16 bits, got mode RGB"):
        HeightMap.read(path, 1e-2, 1e-2, 1e-3)


@pytest.mark.parametrize(
    ("array", "said"),
    [
        (np.array([[1.0, np.nan]]), "NaN or infinity"),
        (np.array([[1.0, np.inf]]), "NaN or infinity"),
        (np.array([[1e308, -1e308]]), "pixels of one size"),
        (np.zeros(4), r"\(ny, nx\) pixels"),
        (np.zeros((2, 2, 3)), r"\(ny, nx\) pixels"),
        (np.zeros((0, 4)), r"\(ny, nx\) pixels"),
        (np.ones((2, 2), complex), "real numbers"),
        (np.ones((2, 2)), "has no relief: all its pixels are 1"),
    ],
)
def test_an_array_that_is_no_map_is_refused(tmp_path, array, said):
    path = tmp_path / "map.npy"
    np.save(path, array)

    with pytest.raises(Refusal, match=said):
        HeightMap.read(path, 1e-2, 1e-2, 1e-3)


@pytest.mark.parametrize("relief", [-1e-3, math.nan, math.inf])
def test_a_relief_that_cannot_be_is_refused(tmp_path, relief):
    path = tmp_path / "map.npy"
    np.save(path, np.arange(4.0).reshape(2, 2))

    with pytest.raises(Refusal, match="relief of at least zero"):
        HeightMap.read(path, 1e-2, 1e-2, relief)


def test_a_mesh_in_millimetres_read_as_metres_is_refused_with_its_size(tmp_path):
    path = tmp_path / "box.stl"
    trimesh.creation.box((30, 20, 10)).export(path)

    with pytest.raises(Refusal, match=r"30 x 20 x 10 m: .*in millimetres needs a unit of 1e-3"):
        Mesh.read(path)

    assert Mesh.read(path, unit=1e-3).extent == pytest.approx((15e-3, 10e-3))


def test_a_mesh_that_is_not_closed_is_refused():
    box = trimesh.creation.box((30e-3, 20e-3, 10e-3))

    with pytest.raises(Refusal, match=r"not closed: 3 of its edges .*fill its holes"):
        Mesh(np.array(box.vertices), np.array(box.faces)[1:])


def test_a_mesh_of_many_layers_is_refused_before_they_are_all_tried():
    flat = np.array([[0, 0, 0], [0.02, 0, 0], [0, 0.02, 0], [0, 0, 0.02]])
    faces = np.tile([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], (5000, 1))

    with pytest.raises(Refusal, match=r"too many layers: .* 10000 times the map.*simplify it"):
        Mesh(flat, faces).height(np.zeros((1, 2)))


TRIANGLE = (
    b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
    b"property float z\nelement face 1\nproperty list uchar int %s\nend_header\n"
    b"0 0 0\n1 0 0\n0 1 0\n%s 0 1 2\n"
)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("thing.step", b"", r"named \.stl, \.obj, \.ply"),
        ("thing.stl", b"", "begins with `solid`"),
        ("thing.stl", b"hello", "begins with `solid`"),
        ("thing.ply", b"ply\nformat ascii 1.0\nelement vertex 3\n", "cannot read"),
        ("thing.ply", b"hello", "cannot read"),
        ("thing.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "triangles of its 3 nodes"),
        ("thing.obj", b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "found none|4 to"),
        ("thing.ply", TRIANGLE % (b"vertex_indices", b"1e400"), "cannot read"),
        ("thing.ply", TRIANGLE % (b"others", b"3"), "cannot read"),
        ("thing.obj", b"v 1e300 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "cannot read|4 to"),
        ("thing.stl", None, "cannot read"),
    ],
)
def test_a_mesh_that_cannot_be_read_is_refused(tmp_path, name, content, said):
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)

    with pytest.raises(Refusal, match=said):
        Mesh.read(path)


@pytest.mark.parametrize("unit", [0.0, -1.0, math.nan, math.inf])
def test_a_unit_that_cannot_be_is_refused(unit):
    with pytest.raises(Refusal, match="unit above zero"):
        Mesh.read("thing.stl", unit)


@pytest.mark.parametrize(
    ("vertices", "faces", "said"),
    [
        (np.zeros((4, 2)), np.zeros((4, 3), int), r"vertices \(V, 3\)"),
        (np.zeros((4, 3)), np.zeros((4, 4), int), r"faces \(F, 3\)"),
        (np.zeros((4, 3)), np.zeros((0, 3), int), "4 to .* triangles, got 0"),
        (np.zeros((4, 3)), np.full((4, 3), 7), "of 4 vertices"),
        (np.full((4, 3), np.nan), np.zeros((4, 3), int), "finite vertices"),
    ],
)
def test_triangles_that_are_no_mesh_are_refused(vertices, faces, said):
    with pytest.raises(Refusal, match=said):
        Mesh(vertices, faces)
