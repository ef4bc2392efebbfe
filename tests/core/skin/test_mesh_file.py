"""Mesh files of skins: what is read, refused, found and mended, and places on the surface."""

import struct

import numpy as np
import pytest
import trimesh

from kappaskin import Refusal
from kappaskin.skin.mesh_file import (
    REPAIRS,
    MeshSurface,
    faults,
    held_edges,
    placed,
    principal_directions,
    read_surface,
    repaired,
    spread,
)


def triangles(nx, ny):
    """Two for each square of nx x ny nodes, turning left."""
    k = (np.arange(ny - 1)[:, None] * nx + np.arange(nx - 1)).ravel()
    lower, upper = np.stack([k, k + 1, k + nx + 1]), np.stack([k, k + nx + 1, k + nx])
    return np.stack([lower, upper], axis=1).T.reshape(-1, 3)


def sheet(shape, nx=21, ny=15):
    """The surface of `shape(x, y)` over the square of sides 1, at nx x ny nodes."""
    x, y = np.meshgrid(np.linspace(0, 1, nx), np.linspace(0, 1, ny))
    nodes = np.stack(np.broadcast_arrays(*shape(x.ravel(), y.ravel())), axis=-1)
    return MeshSurface(nodes, triangles(nx, ny))


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
    big = MeshSurface(1e3 * DOME.nodes, DOME.triangles)
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
    with pytest.raises(Refusal, match=rf"{name}.*export the mesh again"):
        read_surface(tmp_path / name, "m")


@pytest.mark.parametrize("name", WRITTEN)
def test_other_contents_and_places_are_refused(tmp_path, name):
    (tmp_path / name).write_bytes(bytes(range(256)) * 20)
    with pytest.raises(Refusal, match=name):
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
    (tmp_path / "skin.obj").write_bytes(obj(MeshSurface(1e3 * DOME.nodes, DOME.triangles)))
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
    s, t = np.meshgrid(np.linspace(0, 1, 16), np.linspace(0, 1, 16))
    s, t = s[s + t <= 1], t[s + t <= 1]
    many = np.einsum("ks,fkx->fsx", [1 - s - t, s, t], DOME.corners).reshape(-1, 3)
    nearest = np.array([np.linalg.norm(many - point, axis=1).min() for point in points])
    assert (distance <= nearest + 1e-12).all()
    assert (nearest - distance).max() < 5e-5


def test_points_of_the_surface_are_their_own_places():
    shares = np.random.default_rng(3).dirichlet(np.ones(3), len(DOME.triangles))
    points = np.einsum("pk,pkx->px", shares, DOME.corners)
    triangle, found, distance = placed(DOME, points)
    assert triangle.tolist() == list(range(len(points)))
    np.testing.assert_allclose(found, shares, atol=1e-9)
    assert distance.max() < 1e-15


def test_the_nearest_triangle_is_found_though_its_centre_is_far():
    small = sheet(lambda x, y: (1e-3 * x, 1e-3 * y, 0 * x), 15, 15)
    far = [[1.2e-3, 0, 0], [1.2e-3, 1e-3, 0], [60e-3, 0, 0]]
    surface = with_triangles(small, (225, 226, 227), nodes=far)
    triangle, _, distance = placed(surface, np.array([[1.15e-3, 0.5e-3, 0]]))
    assert triangle == len(small.triangles)
    np.testing.assert_allclose(distance, 0.05e-3)


def test_triangles_without_area_do_not_disturb_places():
    nodes = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]])
    surface = MeshSurface(nodes, np.array([[0, 1, 2], [0, 0, 0], [0, 2, 3]]))
    _, _, distance = placed(surface, np.array([[0.5, 0.2, 3.0], [3.0, 0, 0], [1.0, -4, 0]]))
    np.testing.assert_allclose(distance, [3, 1, 4])


def kinds(surface, **others):
    return [fault.kind for fault in faults(surface, **others)]


def found(surface, kind, **others):
    (fault,) = (fault for fault in faults(surface, **others) if fault.kind == kind)
    assert fault.places.shape[1] == 3
    return fault


def soup(surface):
    return MeshSurface(
        surface.corners.reshape(-1, 3), np.arange(surface.triangles.size).reshape(-1, 3)
    )


def with_triangles(surface, *more, nodes=()):
    nodes = np.concatenate([surface.nodes, np.reshape(nodes, (-1, 3))])
    return MeshSurface(nodes, np.concatenate([surface.triangles, np.reshape(more, (-1, 3))]))


def without(surface, *gone):
    return MeshSurface(surface.nodes, np.delete(surface.triangles, gone, axis=0))


def test_a_good_skin_has_no_faults():
    assert faults(DOME) == []
    assert kinds(DOME, outward=np.array([0.1, 0, 1])) == []


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_nodes_that_are_nowhere_are_found_by_their_neighbours(bad):
    nodes = DOME.nodes.copy()
    nodes[50, 1] = bad
    (fault,) = faults(MeshSurface(nodes, DOME.triangles))
    assert fault.kind == "not finite"
    assert "at 1 nodes" in fault.message
    assert 4 < len(fault.places) < 9
    assert np.linalg.norm(fault.places - DOME.nodes[50], axis=1).max() < 3e-3


@pytest.mark.parametrize(
    ("factor", "size"), [(1e3, "30 x 20 x 4 m"), (1e-2, "0.0003 x "), (0, "0 x")]
)
@pytest.mark.filterwarnings("error")
def test_a_wrong_unit_is_found_by_the_size(factor, size):
    assert size in found(MeshSurface(factor * DOME.nodes, DOME.triangles), "size").message


def test_huge_coordinates_are_of_another_size():
    assert kinds(MeshSurface(1e300 * DOME.nodes, DOME.triangles)) == ["size"]


def test_too_few_and_too_many_triangles_are_found():
    assert kinds(sheet(dome, 9, 9)) == ["too few"]
    fault = found(sheet(dome, 120, 90), "too many")
    assert "got 21,182" in fault.message
    assert fault.repair == "decimate"


@pytest.mark.parametrize("shift", [0.0, 1e-8])
def test_soup_is_found_once_and_merged(shift):
    apart = soup(DOME)
    random = np.random.default_rng(4).uniform(-shift, shift, apart.nodes.shape)
    apart = MeshSurface(apart.nodes + random, apart.triangles)
    assert kinds(apart) == ["not merged"]
    fault = found(apart, "not merged")
    assert len(fault.places) == len(apart.nodes) - len(DOME.nodes)
    merged = repaired(apart, fault.repair)
    assert len(merged.nodes) == len(DOME.nodes)
    assert faults(merged) == []


def test_nodes_within_the_skin_are_not_merged_with_others():
    """Two layers that touch in the middle stay two layers."""
    below = MeshSurface(
        DOME.nodes * (1, 1, -1) + (0, 0, 2 * DOME.nodes[:, 2].max()), DOME.triangles
    )
    both = with_triangles(DOME, below.triangles + len(DOME.nodes), nodes=below.nodes)
    assert len(repaired(both, "merge").nodes) == 2 * len(DOME.nodes)


def test_flipped_triangles_are_found_and_oriented():
    flipped = DOME.triangles.copy()
    some = np.random.default_rng(5).choice(len(flipped), 200, replace=False)
    flipped[some] = flipped[some, ::-1]
    fault = found(MeshSurface(DOME.nodes, flipped), "flipped")
    np.testing.assert_allclose(fault.places, DOME.centres[np.sort(some)])
    oriented = repaired(MeshSurface(DOME.nodes, flipped), fault.repair)
    np.testing.assert_allclose(oriented.normals, DOME.normals)


def test_inside_out_goes_by_the_direction_given():
    inverted = MeshSurface(DOME.nodes, DOME.triangles[:, ::-1])
    up = np.array([0, 0, 1.0])
    assert kinds(inverted) == []
    assert kinds(inverted, outward=up) == ["inside out"]
    assert faults(repaired(inverted, "orient", outward=up), up) == []
    assert repaired(inverted, "orient") is inverted


def test_a_moebius_band_has_one_side():
    def band(x, y):
        turn, across = 2 * np.pi * x, 6e-3 * (y - 0.5)
        far = 10e-3 + across * np.cos(turn / 2)
        return far * np.cos(turn), far * np.sin(turn), across * np.sin(turn / 2)

    joined = repaired(sheet(band, 41, 7), "merge")
    assert len(joined.nodes) == 40 * 7
    assert kinds(joined) == ["one-sided"]


def test_a_wall_on_the_skin_is_found():
    a, b = DOME.triangles[200, :2]
    top = DOME.nodes[[a, b]].mean(axis=0) + np.array([0, 0, 2e-3])
    fault = found(with_triangles(DOME, (b, a, len(DOME.nodes)), nodes=top), "wall")
    np.testing.assert_allclose(fault.places, [DOME.nodes[[a, b]].mean(axis=0)])
    assert fault.repair is None


def test_parts_that_meet_at_a_node_are_found_and_the_largest_kept():
    small = sheet(lambda x, y: (-8e-3 * x, -5e-3 * y, 0 * x), 5, 5)
    both = with_triangles(DOME, small.triangles + len(DOME.nodes), nodes=small.nodes)
    assert kinds(both) == ["not merged", "parts"]
    merged = repaired(both, "merge")
    fault = found(merged, "parts")
    assert len(fault.places) == len(small.triangles)
    assert "got 2, with 32 of 592 triangles" in fault.message
    assert faults(repaired(merged, fault.repair)) == []


def test_a_node_where_the_skin_is_pinched_is_found():
    """Two sheets joined by a bridge and by one node."""
    at = np.flatnonzero(np.isin(DOME.triangles, 150).any(axis=1))
    fan = DOME.triangles[at]
    around = [np.argsort(np.arctan2(*(DOME.centres[at] - DOME.nodes[150])[:, :2].T))]
    pinched = without(DOME, *at[around[0][[0, 1, 3, 4]]])
    assert len(fan) == 6
    fault = found(pinched, "pinched")
    np.testing.assert_allclose(fault.places, [DOME.nodes[150]])


def test_duplicates_are_found_and_removed():
    doubled = with_triangles(DOME, DOME.triangles[7, [1, 2, 0]], DOME.triangles[9, ::-1])
    fault = found(doubled, "duplicate")
    assert kinds(doubled) == ["duplicate"]
    np.testing.assert_allclose(fault.places, DOME.centres[[7, 9]])
    assert repaired(doubled, fault.repair).triangles.tolist() == DOME.triangles.tolist()


def test_triangles_without_area_are_found_and_collapsed():
    """A cap with its third node on an edge, a needle of two equal nodes, and one twice."""
    a, b, c = DOME.triangles[200]
    middle, near = DOME.nodes[[a, b]].mean(axis=0), DOME.nodes[b] + 1e-12
    rest = without(DOME, 200)
    n = len(DOME.nodes)
    flat = with_triangles(
        rest,
        (a, b, n),
        (n, b, n + 1),
        (n, n + 1, c),
        (n + 1, b, c),
        (a, n, c),
        (5, 5, 6),
        (b, n, a),
        nodes=[middle, near],
    )
    fault = found(flat, "no area")
    assert len(fault.places) == 4
    mended = repaired(flat, fault.repair)
    assert faults(mended) == []
    assert np.linalg.norm(mended.normals, axis=1).sum() == pytest.approx(
        np.linalg.norm(DOME.normals, axis=1).sum(), rel=1e-3
    )


def test_a_mesh_without_any_area_is_found():
    line = sheet(lambda x, y: (30e-3 * x + 1e-3 * y, 0 * x, 0 * x))
    assert "no area" in kinds(line)


def test_slivers_are_found():
    thin = sheet(lambda x, y: (30e-3 * x, 0.5e-3 * y, 0 * x), 21, 15)
    fault = found(thin, "sliver")
    assert len(fault.places) == len(thin.triangles)
    assert fault.repair is None


def test_a_ball_has_no_rim():
    ball = trimesh.creation.icosphere(radius=8e-3)
    fault = found(MeshSurface(np.array(ball.vertices), np.array(ball.faces)), "closed")
    assert "cut it" in fault.message


def test_holes_are_found_and_the_outer_rim_is_none():
    holed = without(DOME, 100, 101, 300)
    fault = found(holed, "hole")
    assert "got 2 more" in fault.message or "got 3 more" in fault.message
    assert len(fault.places) == len(holed.rim) - len(DOME.rim)
    assert np.ptp(fault.places[:, 0]) < 30e-3
    assert len(holed.loops[0]) == len(DOME.rim)
    assert len(holed.loops) == 1 + int(fault.message.split("got ")[1].split()[0])


def test_a_rim_with_branches_has_no_loops():
    with pytest.raises(Refusal, match="that do not touch"):
        _ = with_triangles(DOME, (0, 5, 9)).loops


def test_decimation_keeps_the_shape_and_the_rim():
    fine = sheet(dome, 61, 61)
    coarse = repaired(fine, "decimate", most=600)
    assert 590 <= len(coarse.triangles) <= 600
    assert faults(coarse, np.array([0, 0, 1.0])) == []
    assert np.degrees(coarse.smallest.min()) > 10
    assert placed(fine, coarse.nodes)[2].max() < 20e-6
    assert placed(coarse, fine.nodes)[2].max() < 70e-6
    corners = fine.nodes[[0, 60, -61, -1]]
    assert placed(coarse, corners)[2].max() < 20e-6
    assert coarse.normals.sum(axis=0)[2] == pytest.approx(30e-3 * 20e-3, rel=1e-3)


@pytest.mark.parametrize("most", [100, 500])
def test_decimation_moves_the_rim_along_itself(most):
    """Waves that reach the rim do not draw it inward from the four planes that it lies in."""
    waves = sheet(
        lambda x, y: (30e-3 * x, 20e-3 * y, 1.5e-3 * np.sin(20 * x + 40 * y)), nx=41, ny=41
    )
    coarse = repaired(waves, "decimate", most=most)
    x, y, _ = coarse.nodes[coarse.rim[:, 0]].T
    assert np.abs(x * (x - 30e-3) * y * (y - 20e-3)).max() < 1e-20
    assert placed(coarse, waves.nodes[[0, 40, -41, -1]])[2].max() < 1e-12
    assert set(kinds(coarse)) <= {"too few"}


def test_decimation_joins_nothing_that_is_apart():
    """A thin tube stays open at both ends, and a strip of two rows keeps its width."""
    tube = sheet(
        lambda x, y: (2e-3 * np.cos(6.2832 * x), 30e-3 * y, 2e-3 * np.sin(6.2832 * x)), 13, 61
    )
    tube = repaired(repaired(tube, "merge"), "decimate", most=1)
    assert kinds(tube) == ["too few", "hole"]
    assert len(tube.loops) == 2
    strip = sheet(lambda x, y: (30e-3 * x, 1e-3 * y, 2e-3 * np.sin(9 * x)), 61, 2)
    strip = repaired(strip, "decimate", most=1)
    assert kinds(strip) == ["too few"]
    assert np.ptp(strip.nodes[:, 1]) == 1e-3


def test_a_repair_of_another_name_is_refused():
    with pytest.raises(Refusal, match=r"expected a repair, one of merge, .*, got polish"):
        repaired(DOME, "polish")


@pytest.mark.parametrize("repair", REPAIRS)
def test_no_repair_changes_a_good_skin(repair):
    mended = repaired(DOME, repair)
    assert mended.nodes.tolist() == DOME.nodes.tolist()
    assert mended.triangles.tolist() == DOME.triangles.tolist()


def test_what_is_held_is_the_rim_or_an_arc_of_it():
    assert held_edges(DOME, "all").tolist() == DOME.rim.tolist()
    arc = held_edges(DOME, [[0, -1e-4, 0], [30e-3, 0, 0]])
    assert arc.tolist() == [[k, k + 1] for k in range(20)]
    rest = held_edges(DOME, [[30e-3, 0, 0], [0, 0, 0]])
    assert {*map(tuple, arc.tolist())} | {*map(tuple, rest.tolist())} == {
        *map(tuple, DOME.rim.tolist())
    }
    both = held_edges(DOME, [[[0, 0, 0], [30e-3, 0, 0]], [[30e-3, 20e-3, 0], [0, 20e-3, 0]]])
    assert len(both) == 40


@pytest.mark.parametrize(
    ("held", "message"),
    [
        ([], "got none"),
        ([[0, 0, 0], [np.nan, 0, 0]], "got none"),
        ("some", '"all" or arcs'),
        ([[0, 0, 0], [1, 1]], '"all" or arcs'),
        ([[0, 0, 0], [30, 0, 0]], "give points of the rim in the unit of the mesh"),
        ([[0, 0, 0], [1e-4, 0, 0]], "points further apart"),
    ],
)
def test_nothing_held_is_refused(held, message):
    with pytest.raises(Refusal, match=message):
        held_edges(DOME, held)


@pytest.mark.parametrize("count", [1, 7, 120])
def test_places_are_spread_evenly(count):
    surface = sheet(lambda x, y: dome(x**1.5, y), 41, 31)
    places = spread(surface, count)
    assert placed(surface, places)[2].max() < 1e-12
    assert places.tolist() == spread(surface, count).tolist()
    if count > 2:
        apart = np.linalg.norm(places[:, None] - places, axis=-1)
        np.fill_diagonal(apart, np.inf)
        nearest = apart.min(axis=1)
        assert nearest.min() > 0.75 * nearest.mean()
        assert nearest.max() < 1.25 * nearest.mean()
        # Half a step from the rim, as near as to the border of their own share.
        edge = np.minimum.reduce(
            [places[:, 0], 30e-3 - places[:, 0], places[:, 1], 20e-3 - places[:, 1]]
        )
        assert edge.min() > 0.3 * nearest.mean()


def test_more_places_than_triangles_are_refused():
    with pytest.raises(Refusal, match="expected 1 to 560 places, got 561"):
        spread(DOME, 561)


def on_ellipsoid(axes, count=65, most=0.8):
    """A patch of an ellipsoid around its pole at z, by two angles of equal steps."""

    def shape(x, y):
        u, v = most * (2 * x - 1), most * (2 * y - 1)
        points = np.stack([np.tan(u), np.tan(v), np.ones_like(u)])  # as the sides of a cube
        return np.reshape(axes, (3, 1)) * points / np.linalg.norm(points, axis=0)

    return sheet(shape, count, count)


def ellipsoid_curvatures(nodes, axes):
    """Principal curvatures (n, 2) and directions (n, 2, 3) of (x/a)^2 + (y/b)^2 + (z/c)^2 = 1."""
    gradient = nodes / np.square(axes)
    length = np.linalg.norm(gradient, axis=1)[:, None, None]
    normal = gradient[:, :, None] / length
    along = np.eye(3) - normal @ normal.transpose(0, 2, 1)
    values, vectors = np.linalg.eigh(along @ np.diag(1 / np.square(axes)) @ along / length)
    return values[:, :0:-1], vectors.transpose(0, 2, 1)[:, :0:-1]


@pytest.mark.parametrize("axes", [(8e-3, 8e-3, 8e-3), (9e-3, 7e-3, 6e-3), (7e-3, 12e-3, 5e-3)])
def test_principal_curvatures_of_ellipsoids(axes):
    surface = on_ellipsoid(axes)
    directions, curvatures = principal_directions(surface)
    true, along = ellipsoid_curvatures(surface.nodes, axes)
    rim = np.isin(np.arange(len(true)), surface.rim)
    np.testing.assert_allclose(curvatures[~rim], true[~rim], rtol=0.02)
    np.testing.assert_allclose(curvatures[rim], true[rim], rtol=0.05)
    np.testing.assert_allclose(
        directions @ directions.transpose(0, 2, 1),
        np.broadcast_to(np.eye(2), (len(true), 2, 2)),
        atol=2e-3,
    )
    tilt = np.sum(directions * (surface.nodes / np.square(axes))[:, None], axis=-1)
    assert np.abs(tilt).max() < 2e-3 / min(axes)
    clear = true[:, 0] > 1.3 * true[:, 1]
    cosine = np.abs(np.sum(directions[clear, 0] * along[clear, 0], axis=1))
    assert (cosine > np.cos(np.radians(3))).all()


def test_principal_curvatures_of_a_cylinder_and_of_a_saddle():
    R = 9e-3
    outside = sheet(lambda x, y: (R * np.sin(2 * x - 1), 20e-3 * y, R * np.cos(2 * x - 1)), 31, 31)
    directions, curvatures = principal_directions(outside)
    np.testing.assert_allclose(curvatures * R, np.broadcast_to([1, 0], curvatures.shape), atol=0.02)
    assert np.abs(directions[:, 0, 1]).max() < 0.02
    inside = MeshSurface(outside.nodes, outside.triangles[:, ::-1])
    assert principal_directions(inside)[1] * R == pytest.approx(
        np.broadcast_to([0, -1], curvatures.shape), abs=0.02
    )
    saddle = sheet(
        lambda x, y: (0.02 * (x - 0.5), 0.02 * (y - 0.5), 0.004 * (x - 0.5) * (y - 0.5)), 21, 21
    )
    directions, curvatures = principal_directions(saddle)
    np.testing.assert_allclose(curvatures[220], [10, -10], rtol=1e-3)
    np.testing.assert_allclose(np.abs(directions[220, :, :2]), np.sqrt(0.5), rtol=1e-3)
