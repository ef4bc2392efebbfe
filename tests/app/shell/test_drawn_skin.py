"""A drawn skin, by the laws of the surface it is: no display is needed."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin import Cap, Patch
from kappaskin.skin import MeshSkin
from kappaskin_app.shell.drawn_skin import DrawnSkin
from meshes import ellipsoid

FLAT = Patch(0.1, 0.06)
ARC = Patch(0.04, 0.03, 0.0129)
DOME, SADDLE = Patch(0.05, 0.04, (0.15, 0.12)), Patch(0.05, 0.04, (0.15, -0.12))
CAP, LONG = Cap(0.008), Cap(0.008, 1.3, 1.4)
PATCHES = pytest.mark.parametrize(
    "patch", [FLAT, ARC, DOME, SADDLE], ids=["flat", "arc", "dome", "saddle"]
)


class Disk(Patch):
    """A skin that ends at the circle inside its square."""

    def contains(self, positions):
        return np.linalg.norm(positions - self.a / 2, axis=-1) <= self.a / 2 * (1 + 1e-12)


def drawn(patch: Patch, nx: int = 33, ny: int = 21) -> DrawnSkin:
    """A skin pushed in along a hill with two slopes."""
    skin = DrawnSkin(patch, nx, ny)
    x, y = np.meshgrid(*patch.grid(nx, ny))
    skin.height = -1e2 * patch.b * np.sin(np.pi * x / patch.a) * np.sin(4 * y / patch.b)
    return skin


def test_a_flat_skin_is_drawn_as_its_height_over_x_and_y() -> None:
    skin = drawn(FLAT)
    x, y = np.meshgrid(*FLAT.grid(33, 21))
    expected = np.column_stack([1e3 * x.ravel(), 1e3 * y.ravel(), skin.height.ravel()])
    np.testing.assert_allclose(skin.points(), expected, atol=1e-12)


def test_an_arc_moved_in_everywhere_is_an_arc_of_a_smaller_radius() -> None:
    skin = DrawnSkin(ARC, 33, 21)
    skin.height = np.full((21, 33), -2.0)
    x, _, z = skin.points().T
    np.testing.assert_allclose(np.hypot(x - 20, z + 12.9), 10.9)


@PATCHES
def test_the_shading_is_normal_to_the_drawn_surface(patch: Patch) -> None:
    skin = drawn(patch, 201, 151)
    points = skin.points().reshape(151, 201, 3)
    expected = np.cross(np.gradient(points, axis=1), np.gradient(points, axis=0))
    expected /= np.linalg.norm(expected, axis=-1, keepdims=True)
    shading = skin.shading().reshape(151, 201, 3)
    inside = np.s_[1:-1, 1:-1]
    np.testing.assert_allclose(shading[inside], expected[inside], atol=3e-3)
    assert np.abs(shading[..., :2]).max() > 0.1


@PATCHES
def test_the_whole_of_a_rectangle_is_covered_by_squares(patch: Patch) -> None:
    skin = DrawnSkin(patch, 5, 4)
    faces = skin.faces()
    assert len(faces) == 12
    assert (faces[:, 0] == 4).all()
    assert set(faces[:, 1:].ravel()) == set(range(20))
    assert [len(line) for line in skin.lines(2)] == [5] * 2 + [4] * 3
    values = np.arange(20.0).reshape(4, 5)
    np.testing.assert_array_equal(skin.values(values), values.ravel())


@pytest.mark.parametrize("cap", [CAP, LONG], ids=["sphere", "spheroid"])
def test_a_cap_is_drawn_to_its_rim_and_shaded_along_its_normals(cap: Cap) -> None:
    at_rest = DrawnSkin(cap, 101, 101)
    lowest = at_rest.points()[np.unique(at_rest.faces()[:, 1:]), 2].min()
    assert lowest == pytest.approx(-1e3 * cap.rise, rel=1e-5)
    assert at_rest.bounds[0][2] == pytest.approx(lowest - at_rest.deepest)
    skin = drawn(cap, 101, 101)
    skin.height *= skin.on
    points = skin.points().reshape(101, 101, 3)
    normal = np.cross(np.gradient(points, axis=1), np.gradient(points, axis=0))
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    inside = cap.depth(np.stack(np.meshgrid(*cap.grid(101, 101)), -1).reshape(-1, 2)) > 0.02 * cap.a
    shading = skin.shading()[inside]
    np.testing.assert_allclose(shading, normal.reshape(-1, 3)[inside], atol=0.02)
    assert np.abs(shading - cap.at_rest(skin.shares * cap.a)[1][inside]).max() > 0.1


@pytest.mark.cases("sphere")
@pytest.mark.parametrize("cap", [CAP, LONG], ids=["sphere", "spheroid"])
@given(st.floats(0, 0.98), st.floats(-np.pi, np.pi), st.floats(-0.5, 1))
def test_the_line_of_sight_on_to_a_cap_meets_it_where_it_is_nearest(
    cap: Cap, far: float, azimuth: float, height: float
) -> None:
    skin = DrawnSkin(cap, 33, 33)
    position = cap.rim_radius * (1 + far * np.array([np.cos(azimuth), np.sin(azimuth)]))
    (point,), (out,) = skin.at_rest(position[None])
    near, away = point + (height + 50) * out, point - 50 * out
    seen = skin.seen_at(near, away, height, beside=position)
    np.testing.assert_allclose(seen, position, atol=1e-8)
    np.testing.assert_allclose(skin.hit(near, away), position, atol=2e-4)


def area_of(skin: DrawnSkin) -> float:
    """Signed area in mm^2 of the faces, above zero where they are seen from outside."""
    x, y, _ = np.moveaxis(skin.points()[skin.faces()[:, 1:]], -1, 0)
    x_next, y_next = np.roll(x, -1, axis=1), np.roll(y, -1, axis=1)
    return float(np.sum(x * y_next - y * x_next) / 2)


def test_a_round_skin_is_drawn_up_to_its_rim_and_no_further() -> None:
    skin = DrawnSkin(Disk(0.1, 0.1), 41, 41)
    used = skin.points()[np.unique(skin.faces()[:, 1:])]
    far = np.linalg.norm(used[:, :2] - 50, axis=1)
    assert far.max() <= 50 * (1 + 1e-9)
    assert np.sum(far > 50 * (1 - 1e-5)) > 100  # all around
    assert area_of(skin) == pytest.approx(np.pi * 50**2, rel=3e-3)
    for line in skin.lines(8):
        ends = skin.points()[line[[0, -1]]]
        np.testing.assert_allclose(np.linalg.norm(ends[:, :2] - 50, axis=1), 50, rtol=1e-5)
        assert set(np.diff(line)) <= {1, 41}  # neighbours only: no line across a gap


def test_the_rim_has_the_colour_of_what_lies_beside_it() -> None:
    skin = DrawnSkin(Disk(0.1, 0.1), 41, 41)
    values = np.where(skin.on, 7.0, np.nan)
    shown = skin.values(values)
    assert (shown[skin.faces()[:, 1:]] == 7.0).all()


def test_a_line_is_cut_where_the_skin_has_a_gap() -> None:
    class Split(Patch):
        def contains(self, positions):
            return np.abs(positions[:, 0] - 0.05) > 0.02

    skin = DrawnSkin(Split(0.1, 0.1), 11, 11)
    along_x = [line for line in skin.lines(10) if np.diff(line)[0] == 1]
    assert [len(line) for line in along_x] == [5, 5] * 2  # up to both rims
    assert area_of(skin) == pytest.approx(6000, rel=1e-5)


@PATCHES
def test_what_lies_on_the_skin_is_placed_on_it(patch: Patch) -> None:
    skin = drawn(patch)
    positions = np.array([[patch.a / 4, patch.b / 2], [patch.a / 2, patch.b / 4]])
    points, out = skin.place(positions)
    np.testing.assert_allclose(points, skin.points(skin.nearest(positions)))
    above, _ = skin.place(positions, 1.5)
    np.testing.assert_allclose(above - points, 1.5 * out)


@given(
    st.sampled_from([FLAT, ARC, Patch(0.05, 0.02, 0.2), DOME, SADDLE]),
    st.tuples(st.floats(0, 1), st.floats(0, 1)),
    st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(0.1, 1)),
    st.floats(-2, 2),
)
def test_the_line_of_sight_through_a_point_of_the_skin_meets_it_there(
    patch: Patch, shares: tuple[float, float], towards: tuple[float, ...], height: float
) -> None:
    skin = DrawnSkin(patch, 9, 9)
    position = np.array(shares) * (patch.a, patch.b)
    points, out = skin.at_rest(position[None])
    point = points[0] + height * out[0]
    near, far = point + 300 * np.array(towards), point - 700 * np.array(towards)
    seen = skin.seen_at(near, far, height, beside=position)
    np.testing.assert_allclose(seen, position, atol=1e-7)


def test_a_line_of_sight_beside_an_arc_sees_its_outline() -> None:
    skin = DrawnSkin(ARC, 9, 9)
    near, far = np.array([50.0, 10.0, 100.0]), np.array([50.0, 10.0, -100.0])
    x, y = skin.seen_at(near, far, 0.0, beside=np.array([0.03, 0.01]))
    assert x == pytest.approx(0.02 + 0.0129 * np.pi / 2)  # straight down past the right
    assert y == pytest.approx(0.01)


def test_no_skin_may_be_drawn_deeper_than_it_is_wide_or_through_its_axis() -> None:
    assert DrawnSkin(Patch(0.1, 0.2), 9, 9).deepest == pytest.approx(45)
    assert DrawnSkin(ARC, 9, 9).deepest == pytest.approx(0.7 * 12.9)


def test_between_its_points_the_skin_is_drawn_evenly() -> None:
    skin = DrawnSkin(FLAT, 33, 21)
    x, y = np.meshgrid(*FLAT.grid(33, 21))
    skin.height = 3 + 40 * x - 20 * y
    positions = np.array([[0.0123, 0.0456], [0.1, 0.06], [0.0, 0.0]])
    expected = 3 + 40 * positions[:, 0] - 20 * positions[:, 1]
    np.testing.assert_allclose(skin.height_at(positions), expected)


@PATCHES
def test_tangents_follow_the_drawn_surface(patch: Patch) -> None:
    skin = drawn(patch, 201, 151)
    position = np.array([0.3 * patch.a, 0.4 * patch.b])
    for axis, tangent in enumerate(skin.tangents(position)):
        step = np.zeros(2)
        step[axis] = 2 * skin.cell[axis]
        (before, after), _ = skin.place(np.array([position - step, position + step]))
        np.testing.assert_allclose(tangent, (after - before) / (2e3 * step[axis]), atol=0.02)


@PATCHES
def test_the_place_that_is_seen_is_the_one_that_is_hit(patch: Patch) -> None:
    skin = drawn(patch)
    position = np.array([[0.41 * patch.a, 0.37 * patch.b]])
    points, out = skin.place(position)
    near, far = points[0] + 300 * out[0], points[0] - 300 * out[0]
    np.testing.assert_allclose(skin.hit(near, far), position[0], atol=0.01 * patch.b)


def test_a_line_of_sight_beside_the_skin_hits_nothing() -> None:
    skin = drawn(FLAT)
    beside = np.array([-5.0, 30.0, 100.0])
    assert skin.hit(beside, beside - (0, 0, 200)) is None


def test_of_two_sides_of_an_arc_the_near_one_is_hit() -> None:
    skin = DrawnSkin(ARC, 65, 33)
    near, far = np.array([-100.0, 15.0, -5.0]), np.array([200.0, 15.0, -5.0])
    x, _ = skin.hit(near, far)
    assert x < ARC.a / 2
    x, _ = skin.hit(far, near)
    assert x > ARC.a / 2


def test_a_mesh_moves_at_its_rim_where_that_is_free_and_rests_where_it_is_held() -> None:
    nodes, triangles = ellipsoid(14, (9e-3, 7e-3, 6e-3), 1.2)
    rim = np.flatnonzero(np.hypot(nodes[:, 0] / 9, nodes[:, 1] / 7) > 0.99e-3 * np.sin(1.2))
    mesh = MeshSkin(nodes, triangles, 1e-3, rim[nodes[rim, 0] > 0])
    skin = DrawnSkin(mesh, 33, 33)
    x, _ = np.meshgrid(*mesh.grid(33, 33))
    surface = np.where(skin.on, 2e-4 - 1e-2 * x, np.nan)

    skin.show_displacement(surface, 3.0)

    on_rim = np.setdiff1d(np.unique(skin.faces()[:, 1:]), np.flatnonzero(skin.on))
    x = skin.shares[on_rim, 0]
    moved = skin.height.ravel()[on_rim]
    free = x < 0.45
    np.testing.assert_allclose(moved[free], 30 * x[free] * mesh.a - 0.6, atol=1e-6)
    np.testing.assert_array_equal(moved[x > 0.55], 0.0)
    x = skin.rim[:, 0] / mesh.a
    free = x < 0.45
    np.testing.assert_allclose(skin.rim_height()[free], 30 * x[free] * mesh.a - 0.6, atol=1e-6)
    np.testing.assert_array_equal(skin.rim_height()[x > 0.55], 0.0)
    for axis, side in enumerate((mesh.a, mesh.b)):
        assert np.ptp(skin.rim[:, axis]) == pytest.approx(side)
