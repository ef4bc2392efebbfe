"""The skin's own coordinates."""

import math

import numpy as np
import pytest

from kappaskin import Cap, Disk, Patch, Polygon, Refusal

PATCH = Patch(0.12, 0.05)


def test_a_grid_includes_the_edges():
    x, y = PATCH.grid(7, 3)

    assert (len(x), x[0], x[-1]) == (7, 0.0, 0.12)
    np.testing.assert_allclose(y, [0.0, 0.025, 0.05])


def test_cell_centres_are_half_a_cell_from_the_edges():
    x, y = PATCH.cell_centres(4, 2)

    np.testing.assert_allclose(x, [0.015, 0.045, 0.075, 0.105], rtol=1e-15)
    np.testing.assert_allclose(y, [0.0125, 0.0375], rtol=1e-15)


def test_edges_and_corners_lie_on_the_patch_and_nan_does_not():
    points = np.array([[0, 0], [0.12, 0.05], [0.06, 0.05], [0.1201, 0.02], [0.06, -1e-9]])

    assert PATCH.contains(points).tolist() == [True, True, True, False, False]
    assert not PATCH.contains(np.array([[math.nan, 0.02]])).any()


@pytest.mark.parametrize("side", [0.0, -0.1, math.nan, math.inf])
def test_a_side_that_is_no_length_is_refused(side):
    with pytest.raises(Refusal, match=r"expected a patch with two sides above zero.*got 0\.1 x"):
        Patch(0.1, side)


def test_grids_and_tilings_that_are_too_small_are_refused():
    with pytest.raises(Refusal, match="at least 2 x 2 points, got 1 x 5"):
        PATCH.grid(1, 5)
    with pytest.raises(Refusal, match="at least 1 x 1 cells, got 3 x 0"):
        PATCH.cell_centres(3, 0)


# Disks and polygons

DISK = Disk(0.05)
ARROW = Polygon([(0, 0), (0.1, 0), (0.1, 0.08), (0.05, 0.03), (0, 0.08)])  # one corner inward
OUTLINES = [DISK, ARROW]


def everywhere(patch, count=400):
    return np.random.default_rng(0).uniform(-0.01, 0.11, (count, 2))


def distance_from_rim(patch, points):
    """The same from many points along the rim, inside and outside alike."""
    if isinstance(patch, Disk):
        angle = np.linspace(0, 2 * np.pi, 20001)
        rim = 0.05 + 0.05 * np.column_stack([np.cos(angle), np.sin(angle)])
    else:
        share, corners = np.linspace(0, 1, 4001)[:, None], np.array(patch.vertices)
        ends = np.roll(corners, -1, axis=0)
        rim = np.vstack([(1 - share) * p + share * q for p, q in zip(corners, ends, strict=True)])
    return np.array([np.hypot(*(rim - point).T).min() for point in points])


@pytest.mark.parametrize("patch", OUTLINES)
def test_depth_is_the_distance_from_the_rim_and_below_zero_outside(patch):
    points = everywhere(patch)

    depth = patch.depth(points)

    np.testing.assert_allclose(np.abs(depth), distance_from_rim(patch, points), atol=2e-5)
    assert np.array_equal(depth > 0, patch.contains(points))
    assert 0.3 < np.mean(depth > 0) < 0.7


def test_a_polygon_contains_what_its_corners_enclose():
    inside = [[0.05, 0.02], [0.01, 0.06], [0.1, 0.08], [0.05, 0.03], [0, 0]]
    outside = [[0.05, 0.031], [0.05, 0.07], [-1e-9, 0.01], [0.1001, 0.01], [math.nan, 0.02]]

    assert ARROW.contains(np.array(inside)).all()
    assert not ARROW.contains(np.array(outside)).any()


@pytest.mark.parametrize("patch", OUTLINES)
def test_what_is_drawn_inward_moves_and_is_next_to_where_it_was(patch):
    for x, y in everywhere(patch).tolist():
        depth = float(patch.depth(np.array([[x, y]]))[0])

        u, v = patch.inward(x, y)

        assert patch.moves(np.array([[u, v]])).all()
        near = 4e-3 if isinstance(patch, Disk) else 0.025  # no place is next to a corner
        assert math.hypot(u - x, v - y) <= max(-depth, 0) + near * patch.a
        assert depth < 1e-3 * patch.a or (u, v) == pytest.approx((x, y), abs=2e-3 * patch.a)


@pytest.mark.parametrize("patch", OUTLINES)
def test_places_near_the_rim_are_just_inside_it_and_no_farther_than_asked(patch):
    shorter, found = min(patch.a, patch.b), 0
    for x, y in everywhere(patch).tolist():
        if (depth := patch.depth(np.array([[x, y]]))[0]) < 0:
            continue
        for u, v, share in patch.near_rim(x, y, 0.15):
            found += 1
            assert share <= 0.15
            assert math.hypot(u - x, v - y) == pytest.approx(share * shorter, abs=3e-3 * shorter)
            assert 0 < patch.depth(np.array([[u, v]]))[0] < 3e-3 * shorter
        assert depth > 0.15 * shorter or patch.near_rim(x, y, 0.16)
    assert found > 50


def test_corners_either_way_round_make_the_same_polygon():
    corners = [(0, 0), (0.1, 0), (0.02, 0.05)]

    assert Polygon(corners) == Polygon(corners[:1] + corners[:0:-1])


SQUARE = [(0, 0), (0.1, 0), (0.1, 0.1), (0, 0.1)]
NO_OUTLINE = {
    "two corners": (SQUARE[:2], r"V from 3 to 256, got \(2, 2\)"),
    "too many": (np.zeros((257, 2)), r"V from 3 to 256, got \(257, 2\)"),
    "nothing": ([], r"shape \(V, 2\)"),
    "texts": (["ab", "cd", "ef"], r"shape \(V, 2\)"),
    "three numbers each": (np.ones((4, 3)), r"got \(4, 3\)"),
    "NaN": ([(0, 0), (0.1, 0), (0, math.nan)], "finite vertices"),
    "not at zero": ([(0.1, 0), (0.2, 0), (0.1, 0.1)], "lowest x and y are 0, got 0.1 and 0 m"),
    "on one line": ([(0, 0), (0.1, 0), (0.2, 0)], "encloses an area"),
    "crossed": ([SQUARE[0], SQUARE[1], SQUARE[3], SQUARE[2]], "edges 1 and 3 of the outline cross"),
    "closed twice": ([*SQUARE, SQUARE[0]], "vertices 4 and 0 .* the same .* need not repeat"),
    "touching itself": (
        [(0, 0), (0.1, 0), (0.1, 0.1), (0.05, 0.0), (0, 0.1)],
        "vertex 3 of the outline is on its edge 0",
    ),
    "sharp": ([(0, 0), (0.1, 0.005), (0.1, 0.01)], "vertex 0 .* sharper than 10 degrees"),
}


@pytest.mark.parametrize("case", NO_OUTLINE)
def test_corners_that_are_no_outline_are_refused(case):
    corners, reason = NO_OUTLINE[case]
    with pytest.raises(Refusal, match=reason):
        Polygon(corners)


@pytest.mark.parametrize("radius", [0.0, -1.0, math.nan, math.inf])
def test_a_disk_without_a_radius_is_refused(radius):
    with pytest.raises(Refusal, match="expected a disk with a radius above zero"):
        Disk(radius)


def test_a_right_angle_in_four_decimals_is_a_hemisphere():
    assert Cap(0.008, 1.5708).is_hemisphere
    assert Cap(0.008, 1.5707).is_hemisphere
    assert not Cap(0.008, 1.57).is_hemisphere
    with pytest.raises(Refusal, match="got 75 rad; multiply degrees by pi/180"):
        Cap(0.008, 75)


def test_radii_too_small_for_numbers_are_refused():
    with pytest.raises(Refusal, match="two radii of at least 1e-09 m"):
        Patch(0.02, 0.02, (1e-308, -1e-308))
