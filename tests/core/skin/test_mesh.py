"""Meshes: their coordinates, geometry and text, against spheres and ellipsoids in closed form."""

import base64
import io
import math
import pickle
import tracemalloc

import numpy as np
import pytest

from kappaskin.errors import Refusal
from kappaskin.skin import MeshSkin, doubled_area
from meshes import disk, ellipsoid

R = 8e-3
MORE = math.radians(60)


@pytest.fixture(scope="module")
def sphere():
    return MeshSkin(*ellipsoid(26, (R, R, R), MORE), 1e-3)


@pytest.fixture(scope="module")
def places(sphere):
    at = np.random.default_rng(0).uniform(0, 1, (2000, 2)) * [sphere.a, sphere.b]
    return at[sphere.depth(at) > 0.1 * sphere.a]


def test_positions_are_the_projection_on_the_plane_of_the_held_edge(sphere):
    assert sphere.a == pytest.approx(2 * R * math.sin(MORE), rel=1e-3)
    assert sphere.points[:, 2].max() == 0
    back = sphere.origin + sphere.points @ sphere.frame
    assert np.allclose(back, sphere.nodes, atol=1e-12)


def test_a_mesh_that_is_turned_in_space_has_the_same_coordinates(sphere):
    turn, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))
    turn *= np.linalg.det(turn)
    moved = MeshSkin(sphere.nodes @ turn.T + 0.1, sphere.triangles, 1e-3)

    sides = np.linalg.norm(np.diff(moved.points[moved.triangles], axis=1), axis=2)
    same = np.linalg.norm(np.diff(sphere.points[sphere.triangles], axis=1), axis=2)
    assert np.allclose(sides, same, atol=1e-8)
    assert np.ptp(moved.points[:, 2]) == pytest.approx(sphere.rise, rel=1e-4)


def test_a_sphere_has_its_points_normals_and_curvature(sphere, places):
    base, middle = sphere.base(*places.T), sphere.a / 2
    away = np.hypot(*(places - middle).T)

    assert np.allclose(base.point[2], np.sqrt(R**2 - away**2) - R, atol=1e-6)
    assert np.allclose(base.normal[0], (places[:, 0] - middle) / R, atol=5e-3)
    assert np.allclose(base.form, np.array([[1], [1], [0]]) / R, atol=0.015 / R)


def test_an_ellipsoid_has_its_curvature_at_the_top():
    mesh = MeshSkin(*ellipsoid(30, (9e-3, 7e-3, 6e-3), MORE), 1e-3)

    xx, yy, xy = mesh.base(mesh.a / 2, mesh.b / 2).curvature
    assert xx == pytest.approx(6 / 81e-3, rel=0.01)
    assert yy == pytest.approx(6 / 49e-3, rel=0.01)
    assert abs(xy) < 1.0


def test_a_place_and_many_places_have_the_same_base(sphere, places):
    many = sphere.base(*places[:3].T)
    for k, (x, y) in enumerate(places[:3].tolist()):
        one = sphere.base(x, y)
        assert np.allclose(one.covariant, many.covariant[k], rtol=1e-10)
        assert np.allclose(one.form, many.form[:, k], rtol=1e-10)
        assert np.allclose(one.turning, [each[k] for each in many.turning], rtol=1e-10)


def test_derivatives_along_the_skin_are_those_of_space(sphere, places):
    # f = x in space: along the skin its second derivatives are -K n_x (Gauss).
    base, zero = sphere.base(*places.T), np.zeros(len(places))
    jet = np.column_stack([places[:, 0], zero + 1, zero, zero, zero, zero])
    _, f_x, _, xx, xy, yy = np.einsum("pij,pj->ip", base.covariant, jet)

    assert np.allclose(f_x, base.along[0])
    assert np.allclose(xx, -base.curvature[0] * base.normal[0], atol=0.01 / R)
    assert np.allclose(yy, -base.curvature[1] * base.normal[0], atol=0.01 / R)
    assert np.allclose(xy, -base.curvature[2] * base.normal[0], atol=0.01 / R)


def test_ways_along_the_skin_are_as_long_as_they_say(sphere):
    middle, far = sphere.a / 2, 1.5e-3
    turn = np.linspace(0, 2 * np.pi, 13)
    ends = sphere.around(middle + 1e-3, middle, far * np.column_stack([np.cos(turn), np.sin(turn)]))

    points = sphere.at_rest(np.vstack([[[middle + 1e-3, middle]], ends]))[0] - (middle, middle, -R)
    angle = np.arccos(points[1:] @ points[0] / R**2)
    assert np.allclose(R * angle, far, rtol=0.01)


def test_areas_add_up_to_that_of_the_cap(sphere, places):
    assert sphere.areas.sum() == pytest.approx(2 * np.pi * R**2 * (1 - math.cos(MORE)), rel=2e-3)
    away = np.hypot(*(places - sphere.a / 2).T)
    assert np.allclose(sphere.area(places), 1 / np.sqrt(1 - (away / R) ** 2), rtol=5e-3)


def test_a_mesh_comes_back_from_its_text_and_from_another_process(sphere):
    for back in (MeshSkin.of_text(sphere.text), pickle.loads(pickle.dumps(sphere))):
        assert back == sphere
        assert hash(back) == hash(sphere)
        assert np.array_equal(back.points, sphere.points)


@pytest.mark.parametrize("text", ["", "a mesh", "!" * 80, MeshSkin])
def test_another_text_is_refused(text, sphere):
    text = sphere.text[:-40] if text is MeshSkin else text
    with pytest.raises(Refusal, match="expected the text of a mesh"):
        MeshSkin.of_text(text)


def packed(**changed):
    """The text of arrays such as those of a mesh."""
    nodes, triangles = ellipsoid(9, (R, R, R), MORE)
    arrays = {"nodes": nodes.astype("f4"), "steps": np.diff(triangles.ravel(), prepend=0)}
    arrays |= {"held": np.arange(217, 271), "thickness": np.array(1e-3)}
    file = io.BytesIO()
    np.savez_compressed(file, **arrays | changed)
    return base64.b85encode(file.getvalue()).decode()


HOSTILE = {
    "a bomb": ({"nodes": np.zeros((2**20, 3), "f4")}, "the text of a mesh"),
    "another bomb": ({"more": np.zeros(2**21)}, "the text of a mesh"),
    "objects": ({"nodes": np.array([[{}]], object)}, "the text of a mesh"),
    "texts": ({"nodes": np.array([["a"] * 3])}, "the text of a mesh"),
    "sides that are no numbers": ({"held": np.array(["a"])}, "the text of a mesh"),
    "broken nodes": ({"nodes": np.full((300, 3), np.nan, "f4")}, "finite nodes"),
    "far nodes": ({"nodes": np.full((300, 3), [[0], [3e38], [0]] * 100, "f4")}, "nodes of a skin"),
    "one node": ({"nodes": np.ones((300, 3), "f4")}, "nodes of a skin"),
    "no such nodes": ({"steps": np.array([0, 1, 2**40])}, "numbers of the"),
    "many triangles": ({"steps": np.zeros(3 * 2**16, "i4")}, "at most 32,768 triangles"),
    "no area": ({"steps": np.zeros(300, "i4")}, "expected each triangle once"),
    "held nowhere": ({"held": np.array([-1, 10**9])}, "nodes of the rim that are held"),
    "no thickness": ({"thickness": np.array(np.nan)}, "thickness above zero"),
    "many thicknesses": ({"thickness": np.ones(3)}, "the text of a mesh"),
}


@pytest.mark.parametrize(("changed", "match"), HOSTILE.values(), ids=HOSTILE)
def test_a_hostile_text_is_refused_before_it_takes_memory(changed, match):
    assert MeshSkin.of_text(packed()).thickness == 1e-3
    text = packed(**changed)
    tracemalloc.start()
    with pytest.raises(Refusal, match=match):
        MeshSkin.of_text(text)
    taken = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert taken < 2**23


def test_elements_are_spread_evenly(sphere):
    at = sphere.points[sphere.spread(60)]
    apart = np.linalg.norm(at[:, None] - at, axis=2) + np.eye(60)
    assert apart.min() > 0.6 * math.sqrt(sphere.areas.sum() / 60)
    assert sphere.depth(at[:, :2]).min() > 0


def test_a_place_that_is_not_known_is_not_on_the_skin(sphere):
    assert sphere.holds(sphere.a / 2, sphere.b / 2)
    assert not sphere.holds(math.nan, math.nan)


def test_only_what_is_held_is_near_the_rim():
    nodes, triangles = ellipsoid(12, (R, R, R), MORE)
    held = np.flatnonzero(
        (np.hypot(*nodes[:, :2].T) > 0.99 * R * math.sin(MORE)) & (nodes[:, 0] < 0)
    )
    mesh = MeshSkin(nodes, triangles, 1e-3, held)

    middle, edge = mesh.b / 2, 0.3e-3
    assert mesh.near_rim(edge, middle, 0.1)
    assert not mesh.near_rim(mesh.a - edge, middle, 0.1)


def test_a_mesh_holds_its_places_and_no_unknown_one(sphere):
    middle = sphere.a / 2
    assert sphere.holds(middle, middle)
    assert not sphere.holds(0.01 * middle, 0.01 * middle)
    assert not sphere.holds(math.nan, middle)
    assert not sphere.holds(middle, math.inf)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"thickness": 0.0}, "thickness above zero"),
        ({"held": [0]}, "at least two nodes of the rim"),
        ({"nodes": np.full((1261, 3), np.nan)}, "finite nodes"),
        ({"triangles": [[0, 1, 5000]]}, "numbers of the"),
        ({"triangles": np.zeros((0, 3), int)}, "triangles of shape"),
    ],
)
def test_what_is_no_mesh_is_refused(change, match):
    nodes, triangles = ellipsoid(20, (R, R, R), MORE)
    given = {"nodes": nodes, "triangles": triangles, "thickness": 1e-3, **change}
    with pytest.raises(Refusal, match=match):
        MeshSkin(**given)


def test_a_mesh_with_a_hole_is_refused():
    places, triangles = disk(8)
    whole = triangles[~(np.linalg.norm(places[triangles].mean(axis=1), axis=1) < 0.2)]
    with pytest.raises(Refusal, match="one rim, got 1 more"):
        MeshSkin(np.column_stack([places, 0 * places[:, 0]]) * 0.01, whole, 1e-3)


def test_a_skin_that_folds_over_its_plane_is_flattened():
    more = math.radians(110)
    mesh = MeshSkin(*ellipsoid(24, (R, R, R), more), 1e-3)

    assert mesh.is_flattened
    assert mesh.a == pytest.approx(2 * R * more, rel=0.25)  # nearly as long as its arc
    flat = mesh.places[mesh.triangles]
    assert (doubled_area(flat[:, 0], flat[:, 1], flat[:, 2]) > 0).all()
    at = np.random.default_rng(0).uniform(0, 1, (2000, 2)) * [mesh.a, mesh.b]
    base = mesh.base(*at[mesh.depth(at) > 0.1 * mesh.a].T)
    assert np.allclose(base.form, np.array([[1], [1], [0]]) / R, atol=0.02 / R)
    centre = -mesh.origin @ mesh.frame.T
    assert np.allclose(np.linalg.norm(np.stack(base.point, -1) - centre, axis=-1), R, rtol=1e-3)
