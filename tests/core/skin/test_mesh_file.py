"""Mesh files of skins: what is read, refused, found and mended, and places on the surface."""

import struct

import numpy as np
import pytest
import trimesh

from kappaskin import Refusal
from kappaskin.skin.mesh_file import Surface, placed, read_surface


def triangles(nx, ny):
    """Two for each square of nx x ny nodes, turning left."""
    k = (np.arange(ny - 1)[:, None] * nx + np.arange(nx - 1)).ravel()
    lower, upper = np.stack([k, k + 1, k + nx + 1]), np.stack([k, k + nx + 1, k + nx])
    return np.stack([lower, upper], axis=1).T.reshape(-1, 3)


def sheet(shape, nx=21, ny=15):
    """The surface of `shape(x, y)` over the square of sides 1, at nx x ny nodes."""
    x, y = np.meshgrid(np.linspace(0, 1, nx), np.linspace(0, 1, ny))
    nodes = np.stack(np.broadcast_arrays(*shape(x.ravel(), y.ravel())), axis=-1)
    return Surface(nodes, triangles(nx, ny))


def dome(x, y):
    """A shallow dome 30 x 20 mm, 4 mm high, with z up."""
    return 30e-3 * x, 20e-3 * y, 64e-3 * x * (1 - x) * y * (1 - y)


DOME = sheet(dome)


def stl_text(surface):
    corners = "".join(
        "facet normal 0 0 0\n outer loop\n"
        + "".join(f"  vertex {x!r} {y!r} {z!r}\n" for x, y, z in corner.tolist())
        + " endloop\nendfacet\n"
        for corner in surface.corners
    )
    return f"solid of a finger\n{corners}endsolid of a finger\n".encode()


def stl(surface):
    rows = b"".join(struct.pack("<12fH", 0, 0, 0, *corner.ravel(), 7) for corner in surface.corners)
    return b"solid from CAD".ljust(80) + struct.pack("<I", len(surface.triangles)) + rows


def obj(surface):
    lines = ["# a finger", "mtllib finger.mtl", "o finger"]
    lines += [f"v {x!r} {y!r} {z!r} 0.5 0.5 0.5" for x, y, z in surface.nodes.tolist()]
    lines += ["vt 0 0", "vt 1 1", "vn 0 0 1", "usemtl skin", "s 1"]
    lines += [f"f {a}/1/1 {b}/2/1 {c}/1/1" for a, b, c in (surface.triangles + 1).tolist()]
    return "\n".join(lines).encode()


def ply(surface, encoding="binary"):
    mesh = trimesh.Trimesh(surface.nodes, surface.triangles, process=False)
    mesh.visual.vertex_colors = np.full((len(surface.nodes), 4), 200, np.uint8)
    return mesh.export(file_type="ply", encoding=encoding)


def ply_text(surface):
    return ply(surface, "ascii")


WRITTEN = {
    "skin.STL": stl,
    "text.stl": stl_text,
    "skin.OBJ": obj,
    "skin.ply": ply,
    "text.PLY": ply_text,
}


@pytest.mark.parametrize("name", WRITTEN)
def test_a_surface_is_read_from_every_format(tmp_path, name):
    big = Surface(1e3 * DOME.nodes, DOME.triangles)
    (tmp_path / name).write_bytes(WRITTEN[name](big))
    surface = read_surface(tmp_path / name, "mm")
    assert len(surface.nodes) == len(DOME.nodes)
    np.testing.assert_allclose(surface.corners, DOME.corners, atol=1e-8)


@pytest.mark.parametrize("name", WRITTEN)
@pytest.mark.parametrize("share", [0.0, 0.01, 0.4, 0.9])
def test_a_file_that_is_cut_is_refused_or_its_part_is_whole(tmp_path, name, share):
    content = WRITTEN[name](DOME)
    (tmp_path / name).write_bytes(content[: int(share * len(content))])
    if name.endswith("OBJ") and share > 0.5:  # has no count, nor an end
        assert len(read_surface(tmp_path / name, "m").triangles) < len(DOME.triangles)
        return
    with pytest.raises(Refusal, match=rf"{name}: .*export the mesh again"):
        read_surface(tmp_path / name, "m")


@pytest.mark.parametrize("name", WRITTEN)
def test_other_contents_and_places_are_refused(tmp_path, name):
    (tmp_path / name).write_bytes(bytes(range(256)) * 20)
    with pytest.raises(Refusal, match=f"{name}: "):
        read_surface(tmp_path / name, "m")
    (tmp_path / f"folder {name}").mkdir()
    with pytest.raises(Refusal, match=r"\(Is a directory\)"):
        read_surface(tmp_path / f"folder {name}", "m")
    with pytest.raises(Refusal, match="No such file"):
        read_surface(tmp_path / f"none {name}", "m")


def test_another_name_is_refused(tmp_path):
    with pytest.raises(Refusal, match=r"named \.stl, \.obj, \.ply, got .*skin\.step"):
        read_surface(tmp_path / "skin.step", "mm")


@pytest.mark.parametrize("unit", ["", "km", "MM"])
def test_a_unit_is_never_guessed(tmp_path, unit):
    (tmp_path / "skin.obj").write_bytes(obj(Surface(1e3 * DOME.nodes, DOME.triangles)))
    sizes = "30 x 20 x 4 m or 30 x 20 x 4 cm or 30 x 20 x 4 mm or 30 x 20 x 4 inch"
    with pytest.raises(Refusal, match=sizes):
        read_surface(tmp_path / "skin.obj", unit)


def read_obj(tmp_path, *lines):
    (tmp_path / "skin.obj").write_text("\n".join(lines))
    return read_surface(tmp_path / "skin.obj", "m")


SQUARE = ("v 0 0 0", "v 1 0 0", "v 1 1 0", "v 0 1 0")


def test_polygons_are_cut_into_triangles(tmp_path):
    surface = read_obj(tmp_path, *SQUARE, "v -1 0.5 0", "v 9 9 9", "f 1 2 3 4 5", "f 1/7 3//8 2")
    assert surface.triangles.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 2, 1]]
    assert len(surface.nodes) == 5


def test_nodes_counted_backwards_are_those_before_the_line(tmp_path):
    surface = read_obj(tmp_path, *SQUARE, "f -4 -3 -2", "v 0 0 1", "f -5 -3 \\", " -1")
    assert surface.corners[:, :, :2].tolist() == [
        [[0, 0], [1, 0], [1, 1]],
        [[0, 0], [1, 1], [0, 0]],
    ]
    assert surface.corners[1, 2, 2] == 1


def test_an_obj_of_lines_alone_is_refused(tmp_path):
    with pytest.raises(Refusal, match="expected 1 to 2,000,000 triangles, got 0"):
        read_obj(tmp_path, *SQUARE, "l 1 2 3 4")
    with pytest.raises(Refusal, match="expected triangles of its 4 nodes"):
        read_obj(tmp_path, *SQUARE, "f 1 2 7")
    with pytest.raises(Refusal, match="expected triangles of its 4 nodes"):
        read_obj(tmp_path, *SQUARE, "f 0 1 2")


def test_a_ply_of_quads_is_cut_into_triangles(tmp_path):
    header = "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\n"
    header += "property float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header"
    nodes = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n2 0 0"
    for last, count in (("4 1 4 2 0", 4), ("3 1 4 2", 3)):
        (tmp_path / "q.ply").write_text(f"{header}\n{nodes}\n4 0 1 2 3\n{last}\n")
        assert len(read_surface(tmp_path / "q.ply", "m").triangles) == count


def test_the_rim_runs_with_the_skin_on_its_left():
    (loop,) = DOME.loops
    x, y, _ = DOME.nodes[loop].T
    assert len(loop) == 2 * (20 + 14)
    assert np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) / 2 == pytest.approx(30e-3 * 20e-3)


def test_places_are_the_nearest_of_many_on_the_surface():
    rng = np.random.default_rng(2)
    points = rng.uniform((-5e-3, -5e-3, -5e-3), (35e-3, 25e-3, 10e-3), (60, 3))
    triangle, shares, distance = placed(DOME, points)
    assert shares.min() >= 0
    np.testing.assert_allclose(shares.sum(axis=1), 1)
    on = np.einsum("pk,pkx->px", shares, DOME.corners[triangle])
    np.testing.assert_allclose(np.linalg.norm(on - points, axis=1), distance)
    s, t = np.meshgrid(np.linspace(0, 1, 41), np.linspace(0, 1, 41))
    s, t = s[s + t <= 1], t[s + t <= 1]
    many = np.einsum("ks,fkx->fsx", [1 - s - t, s, t], DOME.corners).reshape(-1, 3)
    nearest = np.min(
        [np.linalg.norm(many[i::7] - points[:, None], axis=-1).min(axis=1) for i in range(7)],
        axis=0,
    )
    assert (distance <= nearest + 1e-12).all()
    assert (nearest - distance).max() < 1e-4


def test_points_of_the_surface_are_their_own_places():
    shares = np.random.default_rng(3).dirichlet(np.ones(3), len(DOME.triangles))
    points = np.einsum("pk,pkx->px", shares, DOME.corners)
    triangle, found, distance = placed(DOME, points)
    assert triangle.tolist() == list(range(len(points)))
    np.testing.assert_allclose(found, shares, atol=1e-9)
    assert distance.max() < 1e-15


def test_triangles_without_area_do_not_disturb_places():
    nodes = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]])
    surface = Surface(nodes, np.array([[0, 1, 2], [0, 0, 0], [0, 2, 3]]))
    _, _, distance = placed(surface, np.array([[0.5, 0.2, 3.0], [3.0, 0, 0], [1.0, -4, 0]]))
    np.testing.assert_allclose(distance, [3, 1, 4])
