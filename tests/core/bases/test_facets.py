"""Thin shells of flat triangles."""

import numpy as np
import pytest

from kappaskin.bases.facets import Facets, Factored, held_freedoms
from kappaskin.bases.mesh import along_normals, factored, pressed
from kappaskin.errors import Refusal
from kappaskin.skin import MeshSkin

D, C, NU = 2.0, 300.0, 0.3
LAW = np.array([[1, NU, 0], [NU, 1, 0], [0, 0, (1 - NU) / 2]])
NONE = np.array([], int)


def grid(n, m, shape=lambda x, y: (x, y, 0 * x)):
    """Nodes, triangles and the nodes of the rim, of n x m squares halved."""
    x, y = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, m + 1), indexing="ij")
    at = np.arange(x.size).reshape(x.shape)
    a, b, c, d = at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]
    triangles = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).reshape(-1, 3)
    rim = np.unique(np.concatenate([at[0], at[-1], at[:, 0], at[:, -1]]))
    return np.stack(shape(x.ravel(), y.ravel()), -1), triangles, rim


def wavy(x, y):
    return x + 0.03 * np.sin(9 * y), y + 0.2 * x, 0.3 * np.sin(3 * x) * y


@pytest.fixture
def irregular():
    """An irregular flat mesh of the unit square, turned in space: nodes in its plane, axes."""
    flat, triangles, rim = grid(5, 4)
    rng = np.random.default_rng(3)
    inner = np.setdiff1d(np.arange(len(flat)), rim)
    flat[inner, :2] += rng.uniform(-0.06, 0.06, (len(inner), 2))
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    axes[2] *= np.linalg.det(axes)
    return flat[:, :2], Facets(flat @ axes, triangles), axes, inner


def in_space(moved, turned, axes):
    return np.hstack([moved @ axes, turned @ axes]).ravel()


@pytest.mark.parametrize("strain", np.eye(3))
def test_constant_strain_balances_inside_and_has_its_energy(irregular, strain):
    flat, facets, axes, inner = irregular
    gradient = np.array([[strain[0], 0], [strain[2], strain[1]]])
    moved, turned = np.zeros((2, len(flat), 3))
    moved[:, :2] = flat @ gradient.T
    turned[:, 2] = strain[2] / 2  # (v_x - u_y) / 2
    u = in_space(moved, turned, axes)

    force = facets.stiffness(D, C, NU) @ u

    assert np.abs(force.reshape(-1, 6)[inner]).max() < 1e-9 * C
    assert u @ force == pytest.approx(C * strain @ LAW @ strain, rel=1e-9)


@pytest.mark.parametrize("curvature", np.eye(3))
def test_constant_curvature_balances_inside_and_has_its_energy(irregular, curvature):
    flat, facets, axes, inner = irregular
    xx, yy, xy = curvature * (1, 1, 0.5)
    x, y = flat.T
    moved, turned = np.zeros((2, len(flat), 3))
    moved[:, 2] = xx * x**2 / 2 + yy * y**2 / 2 + xy * x * y
    turned[:, 0], turned[:, 1] = yy * y + xy * x, -(xx * x + xy * y)
    u = in_space(moved, turned, axes)

    force = facets.stiffness(D, C, NU) @ u

    assert np.abs(force.reshape(-1, 6)[inner]).max() < 1e-9 * D
    assert u @ force == pytest.approx(D * curvature @ LAW @ curvature, rel=1e-9)


def test_rigid_motion_needs_no_force():
    nodes, triangles, _ = grid(5, 4, wavy)
    rng = np.random.default_rng(0)
    move, turn = rng.normal(size=(2, 3))
    u = np.hstack([move + np.cross(turn, nodes), np.tile(turn, (len(nodes), 1))]).ravel()

    assert np.abs(Facets(nodes, triangles).stiffness(D, C, NU) @ u).max() < 1e-11 * C


def test_a_triangle_resists_all_but_rigid_motion():
    facets = Facets(np.array([[0.0, 0, 0], [1, 0.1, 0.2], [0.3, 0.8, 0]]), np.array([[0, 1, 2]]))

    K = facets.stiffness(D, C, 0.5).toarray()

    assert np.abs(K - K.T).max() < 1e-12 * C
    assert (np.linalg.eigvalsh(K)[:7] > 1e-6 * C).tolist() == [False] * 6 + [True]


@pytest.mark.parametrize("n", [4, 8, 16])
def test_a_beam_one_square_high_bends_in_its_plane(n):
    length, couple = 16.0, 2.0
    nodes, triangles, _ = grid(n, 1, lambda x, y: (length * x, y - 0.5, 0 * x))
    held, forces = np.zeros((2, len(nodes), 6))
    begin, end = nodes[:, 0] == 0, nodes[:, 0] == length
    held[begin, 0] = held[0, 1] = held[:, 2] = 1
    forces[end, 0] = -2 * couple * nodes[end, 1]  # a half up and a half down
    K = Facets(nodes, triangles).stiffness(D, C, NU)

    moved = Factored(K, held.ravel() > 0)(forces.reshape(-1, 1)).reshape(-1, 6)

    stiffness = C * (1 - NU**2) / 12  # E I
    deflection = couple * length**2 / (2 * stiffness)
    assert moved[end, 1].mean() == pytest.approx(deflection, rel=0.08)


# Timoshenko and Woinowsky-Krieger, Theory of plates and shells (1959), articles 34 and 44.


@pytest.mark.parametrize(("edge", "expected"), [("hinged", 0.01160), ("clamped", 0.00560)])
def test_a_square_plate_gives_under_a_force_in_its_middle(edge, expected):
    n = 24
    nodes, triangles, rim = grid(n, n)
    middle = 6 * (len(nodes) // 2) + 2
    factored = Factored(
        Facets(nodes, triangles).stiffness(D, C, NU), held_freedoms(rim, edge, len(nodes))
    )
    forces = np.zeros((6 * len(nodes), 1))
    forces[middle] = 1

    assert factored(forces)[middle, 0] * D == pytest.approx(expected, rel=0.01)


def test_many_forces_are_solved_for_at_once_and_held_freedoms_stay():
    nodes, triangles, rim = grid(5, 4, wavy)
    K, held = Facets(nodes, triangles).stiffness(D, C, NU), held_freedoms(rim, "hinged", len(nodes))
    forces = np.random.default_rng(0).normal(size=(6 * len(nodes), 60))

    moved = Factored(K, held)(forces)

    assert not moved[held].any()
    np.testing.assert_allclose((K @ moved)[~held], forces[~held], atol=1e-9)


def test_a_skin_that_is_held_everywhere_does_not_move():
    nodes, triangles, rim = grid(1, 1)
    held = held_freedoms(rim, "clamped", len(nodes))

    moved = Factored(Facets(nodes, triangles).stiffness(D, C, NU), held)(np.ones((24, 2)))

    assert moved.tolist() == np.zeros((24, 2)).tolist()


def test_edges_hold_displacements_and_clamped_rotations_too():
    hinged, clamped = (held_freedoms(np.array([1]), e, 2) for e in ("hinged", "clamped"))

    assert hinged.tolist() == [False] * 6 + [True] * 3 + [False] * 3
    assert clamped.tolist() == [False] * 6 + [True] * 6


def sphere(n):
    """A patch of a sphere of radius 2 and its exact normals."""
    nodes, triangles, _ = grid(n, n, lambda x, y: (x - 0.5, y - 0.5, np.ones(x.shape)))
    out = nodes / np.linalg.norm(nodes, axis=1)[:, None]
    return 2 * out, triangles, out


def test_normals_point_outward_and_areas_fill_the_surface():
    nodes, triangles, out = sphere(40)
    facets = Facets(nodes, triangles)

    assert np.abs(facets.normals - out).max() < 0.03  # at the rim from one side only
    assert np.linalg.norm(facets.normals, axis=1) == pytest.approx(1)
    solid_angle = 4 * np.arcsin(0.2)  # of a pyramid with a square base of 1 and height 1
    assert facets.areas.sum() == pytest.approx(4 * solid_angle, rel=1e-3)


def test_a_foundation_pushes_back_along_the_normal():
    nodes, triangles, _ = sphere(8)
    facets = Facets(nodes, triangles)
    u = np.zeros((len(nodes), 6))
    u[:, :3] = 0.01 * facets.normals + np.cross(facets.normals, (1, 2, 3))

    force = (facets.foundation(5.0) @ u.ravel()).reshape(-1, 6)

    np.testing.assert_allclose(force[:, :3], 0.05 * facets.areas[:, None] * facets.normals)
    assert not force[:, 3:].any()


@pytest.mark.parametrize("held", [NONE, np.array([0]), np.array([0, 29])])
def test_a_skin_that_is_free_to_move_is_refused(held):
    nodes, triangles, _ = grid(5, 4, wavy)  # held at two points it turns about their line

    with pytest.raises(Refusal, match=r"moves as a whole.*hold more of the edge"):
        Factored(
            Facets(nodes, triangles).stiffness(D, C, NU), held_freedoms(held, "hinged", len(nodes))
        )


def test_a_second_part_that_is_not_held_is_refused():
    nodes, triangles, rim = grid(5, 4, wavy)
    twice = np.vstack([nodes, nodes + 3]), np.vstack([triangles, triangles + len(nodes)])

    with pytest.raises(Refusal, match="a part of it"):
        Factored(Facets(*twice).stiffness(D, C, NU), held_freedoms(rim, "clamped", 2 * len(nodes)))


def test_a_long_thin_strip_held_at_its_end_is_not_taken_to_be_free():
    nodes, triangles, _ = grid(40, 4, lambda x, y: (0.2 * x, 0.002 * y, 0 * x))
    end = np.flatnonzero(nodes[:, 0] == 0)
    C, D = 10.0, 10.0 * 1e-5**2 / 12

    Factored(
        Facets(nodes, triangles).stiffness(D, C, NU), held_freedoms(end, "clamped", len(nodes))
    )


def test_a_triangle_without_area_is_refused_by_number():
    nodes, triangles, _ = grid(3, 3)
    triangles[4, 2] = triangles[4, 0]
    with pytest.raises(Refusal, match=r"1 with none.*number 4"):
        Facets(nodes, triangles)
    nodes[5] = np.nan
    with pytest.raises(Refusal, match="with none"):
        Facets(nodes, triangles)


def test_a_node_without_a_triangle_is_refused_by_number():
    nodes, triangles, _ = grid(3, 3)
    with pytest.raises(Refusal, match=r"1 that are at none.*number 16"):
        Facets(np.vstack([nodes, [[5.0, 5, 5]]]), triangles)


def _gives(count, edge):
    """Of a square plate held along a side and half of another, of `count` nodes each way."""
    line, number = np.linspace(0, 0.02, count), np.arange(count**2).reshape(count, count)
    x, y = (each.ravel() for each in np.meshgrid(line, line))
    below, above = number[:-1], number[1:]
    a, b, c, d = (
        each.ravel() for each in (below[:, :-1], below[:, 1:], above[:, 1:], above[:, :-1])
    )
    triangles = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
    nodes, held = np.column_stack([x, y, 0 * x]), number[0, : (count + 1) // 2]
    mesh = MeshSkin(nodes, triangles, 1e-3, np.append(held, number[-1]))
    force = np.exp(-np.sum((mesh.places - [0.014, 0.006]) ** 2, 1) / (2 * 0.002**2)) * mesh.areas
    moved = factored(mesh, edge, 1e-3**2 / 12, 0.3)(pressed(mesh, force[:, None]))
    return along_normals(mesh, moved)[:, 0] @ force / force.sum() ** 2


@pytest.mark.parametrize("edge", ["clamped", "hinged"])
def test_where_a_held_part_of_a_rim_ends_coarse_triangles_give_as_fine_ones(edge):
    assert _gives(21, edge) == pytest.approx(_gives(61, edge), rel=0.01)
