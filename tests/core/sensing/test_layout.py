"""Where the elements are, and the operator from coefficients to their curvature."""

import math
from dataclasses import replace

import numpy as np
import pytest

from kappaskin import Cap, Disk, Patch, Plate, Refusal, SensorLayout, SineBasis, basis_for
from kappaskin.skin import MeshSkin
from meshes import disk, ellipsoid

PATCH = Patch(0.1, 0.05)


def test_regular_elements_sit_at_cell_centres_with_x_running_fastest():
    layout = SensorLayout.regular(PATCH, 4, 2)

    assert layout.shape == (4, 2)
    np.testing.assert_allclose(layout.positions[3 + 4 * 1], [0.0875, 0.0375])
    np.testing.assert_allclose(layout.positions[:4, 0], [0.0125, 0.0375, 0.0625, 0.0875])
    np.testing.assert_allclose(layout.positions[:4, 1], 0.0125)


def from_the_middle(layout):
    """Distance in m from the middle of a round skin, along it, and azimuth in turns."""
    x, y = (layout.positions - (layout.patch.a / 2, layout.patch.b / 2)).T
    return np.hypot(x, y), np.arctan2(y, x) / (2 * np.pi) % 1


def test_rings_are_evenly_far_apart_and_their_elements_evenly_around():
    far, turns = from_the_middle(SensorLayout.on_rings(Disk(0.07), [1, 4, 2, 8]))

    np.testing.assert_allclose(far, np.repeat([0, 0.02, 0.04, 0.06], [1, 4, 2, 8]), atol=1e-12)
    np.testing.assert_allclose(np.sort(turns[1:5]), [0.125, 0.375, 0.625, 0.875])
    np.testing.assert_allclose(turns[5:7], [0, 0.5], atol=1e-12)
    far, _ = from_the_middle(SensorLayout.on_rings(Disk(0.06), [3, 6, 9]))
    np.testing.assert_allclose(far, np.repeat([0.01, 0.03, 0.05], [3, 6, 9]))


@pytest.mark.parametrize("angle", [0.3, 1.2, np.pi / 2])
def test_a_spiral_on_a_sphere_has_as_many_elements_on_every_equal_area(angle):
    cap, N = Cap(0.008, angle), 400

    far, turns = from_the_middle(SensorLayout.in_spiral(cap, N))

    height = 1 - np.cos(far / 0.008)  # areas of a sphere are proportional to their heights
    np.testing.assert_allclose(np.diff(height), height[-1] / (N - 0.5), rtol=2e-3)
    np.testing.assert_allclose(np.diff(turns) % 1, 0.381966, atol=1e-6)
    spacing = np.sqrt(2 * np.pi * (1 - np.cos(angle)) / N)
    assert 0.4 * spacing < angle - far[-1] / 0.008 < 0.6 * spacing


def test_a_spiral_on_a_flat_disk_is_evenly_dense():
    far, _ = from_the_middle(SensorLayout.in_spiral(Disk(0.05), 100))

    np.testing.assert_allclose(np.diff(far**2), far[-1] ** 2 / 99.5, rtol=1e-3)


@pytest.mark.parametrize(
    ("made", "reason"),
    [
        (lambda: SensorLayout.on_rings(PATCH, [4]), "expected a disk or a cap, got a patch of"),
        (lambda: SensorLayout.in_spiral(PATCH, 4), "expected a disk or a cap, got a patch of"),
        (lambda: SensorLayout.on_rings(Disk(0.05), []), "one element on each ring, got no ring"),
        (
            lambda: SensorLayout.on_rings(Disk(0.05), [3, 0]),
            r"one element on each ring, got \[3, 0",
        ),
        (lambda: SensorLayout.in_spiral(Disk(0.05), 0), "at least one element on a spiral, got 0"),
    ],
)
def test_patterns_that_cannot_be_are_refused(made, reason):
    with pytest.raises(Refusal, match=reason):
        made()


def test_all_three_channels_of_a_dead_element_are_dead():
    layout = SensorLayout.regular(PATCH, 4, 2).without([1, 6])

    assert np.flatnonzero(~layout.live.any(axis=0)).tolist() == [1, 6]
    assert layout.live.sum() == 3 * 6


def test_dead_elements_add_up_and_leave_the_first_layout_alone():
    whole = SensorLayout.regular(PATCH, 4, 2)

    layout = whole.without([1]).without([6])

    assert np.flatnonzero(~layout.live[0]).tolist() == [1, 6]
    assert whole.live.all()


@pytest.mark.parametrize("element", [-1, 8])
def test_a_dead_element_that_is_not_there_is_refused(element):
    with pytest.raises(Refusal, match=rf"between 0 and 7, got \[{element}\]"):
        SensorLayout.regular(PATCH, 4, 2).without([element])


@pytest.mark.parametrize("outside", [(0.11, 0.02), (0.05, -0.001), (np.nan, 0.02), (0.02, np.inf)])
def test_elements_outside_the_patch_are_refused_by_number_and_position(outside):
    with pytest.raises(Refusal, match=r"1 of 3 elements lie outside .*0\.1 x 0\.05 m: element 1"):
        SensorLayout.scattered(PATCH, [(0.01, 0.01), outside, (0.02, 0.01)])


@pytest.mark.parametrize("positions", [[], [0.01, 0.02], [[0.01, 0.02, 0.0]], [[[0.01, 0.02]]]])
def test_positions_of_another_shape_are_refused(positions):
    got = str(np.shape(positions)).replace("(", r"\(").replace(")", r"\)")
    with pytest.raises(Refusal, match=rf"expected positions of shape \(P, 2\).*got {got}"):
        SensorLayout.scattered(PATCH, positions)


def test_live_channels_of_another_shape_are_refused():
    with pytest.raises(Refusal, match=r"expected live of shape \(3, 2\), got \(2, 3\)"):
        SensorLayout(PATCH, np.full((2, 2), 0.01), np.ones((2, 3), bool))


def test_a_basis_on_another_patch_is_refused():
    with pytest.raises(Refusal, match=r"a=0\.1, b=0\.05.*a=0\.2, b=0\.05"):
        SensorLayout.regular(PATCH, 4, 2).operator(SineBasis(Patch(0.2, 0.05), 2, 2))


def test_the_operator_gives_the_second_differences_of_the_surface():
    basis, layout = SineBasis(PATCH, 3, 2), SensorLayout.regular(PATCH, 4, 3)
    c, h = np.random.default_rng(0).normal(size=basis.size), 1e-5

    xx, yy, xy = (layout.operator(basis) @ c).reshape(3, -1)

    def w(dx, dy):
        return basis.at(layout.positions + np.array([dx, dy]) * h) @ c

    for measured, differences in (
        (xx, w(1, 0) - 2 * w(0, 0) + w(-1, 0)),
        (yy, w(0, 1) - 2 * w(0, 0) + w(0, -1)),
        (xy, (w(1, 1) - w(1, -1) - w(-1, 1) + w(-1, -1)) / 4),
    ):
        np.testing.assert_allclose(measured, differences / h**2, rtol=0, atol=0.1)
        assert np.abs(measured).max() > 500


def squared_norms(m, n, Ni, Nj):
    """d_ij of PHYSICS section 1, the other norms of Ni = m and Nj = n among them."""
    ki, kj = np.meshgrid(*SineBasis(PATCH, Ni, Nj).wavenumbers, indexing="ij")
    i, j = np.meshgrid(np.arange(1, Ni + 1), np.arange(1, Nj + 1), indexing="ij")
    d = m * n / 4 * (ki**4 + kj**4 + ki**2 * kj**2)
    rim = (i == m) | (j == n)
    d[rim] = (m * n / 2 * (ki**4 + kj**4))[rim]
    corner = (i == m) & (j == n)
    d[corner] = (m * n * (ki**4 + kj**4))[corner]
    return d.ravel()


@pytest.mark.parametrize(
    ("m", "n", "Ni", "Nj"),
    [(10, 10, 8, 8), (10, 10, 9, 9), (7, 12, 6, 11), (10, 10, 10, 9), (6, 9, 6, 9), (1, 3, 1, 2)],
)
def test_the_operators_columns_are_orthogonal_with_the_known_norms(m, n, Ni, Nj):
    M = SensorLayout.regular(PATCH, m, n).operator(SineBasis(PATCH, Ni, Nj))

    length = np.sqrt(squared_norms(m, n, Ni, Nj))

    np.testing.assert_allclose(M.T @ M / np.outer(length, length), np.eye(Ni * Nj), atol=1e-12)


def test_functions_beyond_the_elements_are_not_orthogonal():
    M = SensorLayout.regular(PATCH, 10, 10).operator(SineBasis(PATCH, 12, 8))
    scaled = M / np.linalg.norm(M, axis=0)

    assert np.abs(scaled.T @ scaled - np.eye(96)).max() > 0.1


# Other readings than curvature

ROUND = Patch(0.03, 0.02, 12.9e-3)


def differences(layout, basis, c):
    """What `layout` reads of a flat shape, by central differences of its displacement."""
    reads, h = layout.reads, 1e-5
    at = layout.positions[reads.element]
    t = np.column_stack([np.cos(reads.direction), np.sin(reads.direction)])

    def w(x=0.0, y=0.0, along=0.0):
        return basis.at(at + h * (np.array([x, y]) + along * t)) @ c

    found = {
        "height": w(),
        "slope": (w(along=1) - w(along=-1)) / (2 * h),
        "curvature": (w(along=1) - 2 * w() + w(along=-1)) / h**2,
        "twist": (w(1, 1) - w(1, -1) - w(-1, 1) + w(-1, -1)) / (4 * h**2),
    }
    return np.choose([list(found).index(q) for q in reads.quantity], list(found.values()))


def any_readings(patch, count=200, **more):
    rng = np.random.default_rng(0)
    layout = replace(SensorLayout.regular(patch, 4, 3), **more)
    quantity = rng.choice(["height", "slope", "curvature", "twist"], count)
    return layout.reading(rng.integers(0, 12, count), quantity, rng.uniform(-7, 7, count))


def test_any_reading_is_the_derivative_that_its_name_says():
    basis, layout = SineBasis(PATCH, 3, 2), any_readings(PATCH)
    c = np.random.default_rng(0).normal(size=basis.size)

    read, expected = layout.operator(basis) @ c, differences(layout, basis, c)

    for quantity, atol in {"height": 1e-12, "slope": 1e-3, "curvature": 0.1, "twist": 0.1}.items():
        own = layout.reads.quantity == quantity
        np.testing.assert_allclose(read[own], expected[own], rtol=0, atol=atol)
        assert np.abs(read[own]).max() > 1e3 * atol


@pytest.mark.parametrize("patch", [PATCH, ROUND], ids=["flat", "bent"])
@pytest.mark.parametrize("length", [0.0, 4e-3])
def test_a_curvature_sensors_readings_by_number_are_its_own(patch, length):
    basis, layout = SineBasis(patch, 4, 3), SensorLayout.regular(patch, 4, 3)
    layout = replace(layout, gage_length=length)
    listed = layout.reading(
        np.tile(np.arange(12), 3),
        np.repeat(["curvature", "curvature", "twist"], 12),
        np.repeat([0, np.pi / 2, 0], 12),
    )

    assert layout.frame_shape == (3, 12)
    assert listed.frame_shape == (36,)
    assert listed.kinds == layout.kinds
    np.testing.assert_array_equal(listed.kind, layout.kind)
    np.testing.assert_array_equal(listed.operator(basis), layout.operator(basis))


@pytest.mark.parametrize("patch", [PATCH, ROUND], ids=["flat", "bent"])
@pytest.mark.parametrize("more", [{"gage_length": 4e-3}, {"cell": (5e-3, 3e-3)}], ids=str)
def test_what_is_averaged_is_the_mean_of_what_points_read(patch, more):
    basis, averaged = SineBasis(patch, 3, 3), any_readings(patch, 60, **more)
    points, cell = any_readings(patch, 60), "cell" in more
    steps = np.linspace(-0.5, 0.5, 13)  # Simpson's rule
    weights = np.array([1, *[4, 2] * 5, 4, 1]) / 36
    t = points.reads.direction
    along = np.column_stack([np.cos(t), np.sin(t)])

    mean = np.zeros((60, basis.size))
    for s, u in zip(steps, weights, strict=True):
        for r, v in zip(steps, weights, strict=True) if cell else [(0.0, 1.0)]:
            shifts = np.tile([s * 5e-3, r * 3e-3], (60, 1)) if cell else 4e-3 * s * along
            there = SensorLayout.scattered(
                patch, points.positions[points.reads.element] + shifts
            ).reading(np.arange(60), points.reads.quantity, points.reads.direction)
            mean += u * v * there.operator(basis)

    which = ("height", "slope") if cell else ("slope", "curvature")
    for quantity in which:
        own = points.reads.quantity == quantity
        scale = np.abs(mean[own]).max()
        found = averaged.operator(basis)[own]
        np.testing.assert_allclose(found, mean[own], rtol=0, atol=1e-5 * scale)
        assert np.abs(found - points.operator(basis)[own]).max() > 1e-3 * scale


def test_a_slope_on_a_bent_skin_is_how_far_its_tangent_has_turned():
    """By the change of the tangent of the arc itself, f inward and v along it, v' = H f."""
    basis, H = SineBasis(ROUND, 4, 3), ROUND.arc_curvature
    layout = SensorLayout.scattered(ROUND, [(0.008, 0.007), (0.021, 0.011)])
    slopes = layout.reading([0, 1], "slope", 0.0).operator(basis)
    c = 1e-7 * np.random.default_rng(1).normal(size=basis.size)

    def turned(x, y):
        fine = np.linspace(0, ROUND.a, 40001)
        f = basis.at(np.column_stack([fine, np.full_like(fine, y)])) @ c
        rise = np.concatenate([[0], np.cumsum((f[1:] + f[:-1]) / 2 * np.diff(fine))]) * H
        v = rise - (rise[0] + rise[-1]) / 2
        # The arc of radius 1/H, displaced by f towards its middle and by v along it.
        angle = H * (fine - ROUND.a / 2)
        radius = 1 / H - f
        X = radius * np.sin(angle) + v * np.cos(angle)
        Z = radius * np.cos(angle) - v * np.sin(angle)
        k = int(np.argmin(np.abs(fine - x)))
        direction = math.atan2(Z[k + 1] - Z[k - 1], X[k + 1] - X[k - 1])
        return -angle[k] - direction

    expected = [turned(x, y) for x, y in layout.positions]
    np.testing.assert_allclose(slopes @ c, expected, rtol=0, atol=1e-4 * np.abs(expected).max())


BAD_READINGS = {
    "an element beyond": (([0, 12], "height"), r"element from 0 to 11.*got 0 to 12; count from 0"),
    "an element below": (([-1, 2], "height"), "got -1 to 2"),
    "an element of a half": (([0.5], "height"), "element as whole numbers"),
    "no readings": ((np.zeros(0, int), "height"), r"R >= 1.*got int64 of shape \(0,\)"),
    "another quantity": (([0], "depth"), "among height, slope, curvature, twist, got 'depth'"),
    "too few quantities": (([0, 1], ["height"]), r"quantity and direction of shape \(2,\)"),
    "a direction of NaN": (([0, 1], "slope", [0, np.nan]), "got nan for reading 1"),
    "a datum of what is not read": (([0], "height", 0.0, ["slope"]), "only of quantities that are"),
}


@pytest.mark.parametrize("case", BAD_READINGS)
def test_readings_that_cannot_be_are_refused_with_what_was_expected(case):
    arguments, reason = BAD_READINGS[case]
    with pytest.raises(Refusal, match=reason):
        SensorLayout.regular(PATCH, 4, 3).reading(*arguments)


def test_a_height_needs_no_direction():
    layout = SensorLayout.regular(PATCH, 4, 3).reading([0, 1], "height", np.nan)

    assert np.isfinite(layout.operator(SineBasis(PATCH, 2, 2))).all()


@pytest.mark.parametrize("cell", [(-1e-3, 1e-3), (np.nan, 1e-3), (26e-3, 1e-3)])
def test_cells_beyond_the_rim_or_of_no_size_are_refused(cell):
    with pytest.raises(Refusal, match=r"at least 0 m|over the rim"):
        replace(SensorLayout.regular(PATCH, 4, 3), cell=cell)


def test_all_readings_of_a_dead_element_are_dead():
    layout = any_readings(PATCH).without([3])

    np.testing.assert_array_equal(layout.live, layout.element != 3)


@pytest.mark.parametrize("of", [lambda L: {"gage_length": L}, lambda L: {"cell": (L, L / 2)}])
@pytest.mark.parametrize("stretch", [1.0, 1.3])
def test_gages_and_cells_on_a_cap_differ_from_a_point_by_their_size_squared(stretch, of):
    cap = Cap(0.008, 1.2, stretch)
    basis, layout = basis_for(cap, "clamped", 5, 7), SensorLayout.on_rings(cap, [1, 6, 12])
    plate, c = Plate(cap), np.random.default_rng(0).normal(size=35)
    if "cell" in of(1):
        layout = layout.reading_each(["height"])

    point, short, long = (
        replace(layout, **of(L)).operator(basis, plate) @ c for L in (0.0, 1e-4, 2e-4)
    )

    least = 5e-3 * np.abs(long - point).max()
    np.testing.assert_allclose(long - point, 4 * (short - point), rtol=0.02, atol=least)
    assert least > 1e-9 * np.abs(point).max()


def test_a_gage_on_a_cap_turns_with_the_skin():
    cap, L = Cap(0.008), 2e-3
    layout = replace(SensorLayout.scattered(cap, [[0.0165, 0.0165]]), gage_length=L)
    basis = basis_for(cap, "clamped", 4, 1)  # alike all around: along a meridian and a parallel
    turned = replace(layout, positions=np.array([[cap.rim_radius, cap.rim_radius + 0.0055]]))
    xx, yy, xy = layout.operator(basis)
    away = math.hypot(*(layout.positions[0] - cap.rim_radius)) - 0.0055

    there = np.add(turned.positions, (0.0, away))
    other = replace(turned, positions=there).operator(basis)

    # The diagonal of the one is the meridian of the other.
    np.testing.assert_allclose(xx, yy, rtol=1e-9)
    np.testing.assert_allclose(2 * xy, other[1] - other[0], rtol=1e-6)


def test_slopes_on_a_cap_are_refused():
    with pytest.raises(Refusal, match=r"got slopes, .*; read curvature instead"):
        SensorLayout.on_rings(Cap(0.008), [1, 6]).reading_each(["slope@0"])


def test_a_cell_over_the_rim_of_a_cap_is_refused():
    cap = Cap(0.008)
    heights = SensorLayout.scattered(cap, [[2 * cap.rim_radius - 1e-3, cap.rim_radius]])

    assert replace(heights.reading_each(["height"]), cell=(1.9e-3, 0.0)).cell[0]
    with pytest.raises(Refusal, match="over the rim of the cap"):
        replace(heights.reading_each(["height"]), cell=(2.1e-3, 0.0))


def test_gages_on_a_mesh_may_be_as_long_as_the_skin_around_them():
    mesh = MeshSkin(*ellipsoid(14, (8e-3, 8e-3, 16e-3), 1.0), 1e-3)
    layout = SensorLayout.scattered(mesh, mesh.places[0] + [[0.8 * mesh.a / 2, 0.0]])

    long = replace(layout, gage_length=5e-3)

    assert long.gage_length / 2 > mesh.depth(layout.positions)[0]
    assert long.has_room(layout.positions).all()
    with pytest.raises(
        Refusal, match=r"gages of 0.02 m go over the rim .* at element 0; use short"
    ):
        replace(layout, gage_length=20e-3)


def test_a_cell_on_a_mesh_lies_along_the_axis_of_its_element():
    places, triangles = disk(14)
    mesh = MeshSkin(np.column_stack([10e-3 * places, np.zeros(len(places))]), triangles, 1e-3)
    basis, turn = basis_for(mesh, "clamped", 6, 6), 0.7
    layout = SensorLayout.scattered(mesh, [[13e-3, 9e-3]]).reading_each(["height"]).turned([turn])
    layout = replace(layout, cell=(6e-3, 1e-3))
    u, v = (each.ravel() for each in np.meshgrid(np.arange(-19.5, 20), np.arange(-19.5, 20)))
    c, s = 6e-3 * u / 40, 1e-3 * v / 40
    way, across = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])

    mean = basis.at(layout.positions + np.outer(c, way) + np.outer(s, across)).mean(axis=0)

    scale = np.abs(mean).max()
    np.testing.assert_allclose(layout.operator(basis)[0], mean, atol=2e-3 * scale, rtol=0)
    unturned = layout.turned([0.0]).operator(basis)[0]
    assert np.abs(unturned - mean).max() > 0.05 * scale
