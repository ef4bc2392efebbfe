"""The skin's own coordinates."""

import math

import numpy as np
import pytest

from kappaskin import Patch, Refusal

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
