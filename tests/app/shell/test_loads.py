"""Where loads press, as lines on the skin."""

import numpy as np
import pytest

from kappaskin import Cap, DiscLoad, GaussianLoad, LineLoad, Patch, PointLoad, RectangleLoad
from kappaskin_app.shell.loads import footprint

FLAT = Patch(0.1, 0.1)
LOADS = [
    LineLoad(0.01, 0.09, 0.09, 0.01),
    DiscLoad(0.03, 0.06, 0.01),
    RectangleLoad(0.03, 0.06, 0.01, 0.04),
    GaussianLoad(0.03, 0.06, 0.005),
]


@pytest.mark.parametrize("load", LOADS, ids=lambda load: type(load).__name__)
def test_every_footprint_has_as_many_points_and_moves_with_its_load(load) -> None:
    line = footprint(load, FLAT)
    assert line.shape == footprint(LOADS[0], FLAT).shape
    np.testing.assert_allclose(
        footprint(load.shifted(0.01, -0.005), FLAT), line + np.array([0.01, -0.005])
    )
    np.testing.assert_allclose((line.min(axis=0) + line.max(axis=0)) / 2, load.centre())


def test_a_point_has_none() -> None:
    assert footprint(PointLoad(0.05, 0.05), FLAT) is None


def test_a_rectangle_is_drawn_with_its_corners_and_a_disc_with_its_radius() -> None:
    rectangle = footprint(RectangleLoad(0.03, 0.06, 0.01, 0.04), FLAT)
    corners = {(0.025, 0.04), (0.035, 0.04), (0.035, 0.08), (0.025, 0.08)}
    assert corners <= {tuple(point) for point in rectangle.round(6).tolist()}
    np.testing.assert_allclose(np.ptp(rectangle, axis=0), [0.01, 0.04])
    disc = footprint(DiscLoad(0.03, 0.06, 0.01), FLAT)
    np.testing.assert_allclose(np.linalg.norm(disc - [0.03, 0.06], axis=1), 0.01)


def test_on_a_cap_a_disc_has_its_radius_along_the_skin() -> None:
    cap = Cap(0.008)
    x, y = cap.rim_radius + 0.005, cap.rim_radius - 0.004
    ((middle, *rim), (normal, *_)) = cap.at_rest(
        np.vstack([[x, y], footprint(DiscLoad(x, y, 0.002), cap)])
    )
    cosines = (np.array(rim) - middle + 0.008 * normal) @ normal / 0.008
    np.testing.assert_allclose(0.008 * np.arccos(cosines), 0.002)
