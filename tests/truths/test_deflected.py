"""The deflected skin in space against differences of its points and first-order theory."""

import numpy as np
import pytest

from deflected import DeflectedSkin, sines

A, B, RADIUS = 0.04, 0.03, 12.9e-3
X, Y = np.array([0.007, 0.019, 0.031]), np.array([0.022, 0.011, 0.004])
SHAPE = np.array([[0.0, 0.0, 0.0], [1.0, -0.4, 0.2], [0.0, 0.0, 0.0], [0.3, 0.1, 0.0]])


@pytest.mark.parametrize("radius", [RADIUS, 0.05, np.inf])
def test_derivatives_are_those_of_the_points(radius):
    skin, h = DeflectedSkin(A, sines(A, B, 2e-3 * SHAPE), radius), 2e-5

    def at(i, j):
        return skin.points(X + i * h, Y + j * h)

    found = (
        (at(1, 0) - at(-1, 0)) / (2 * h),
        (at(0, 1) - at(0, -1)) / (2 * h),
        (at(1, 0) - 2 * at(0, 0) + at(-1, 0)) / h**2,
        (at(0, 1) - 2 * at(0, 0) + at(0, -1)) / h**2,
        (at(1, 1) - at(1, -1) - at(-1, 1) + at(-1, -1)) / (4 * h**2),
    )

    for one, other in zip(skin.derivatives(X, Y), found, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-5, atol=1e-5 * np.abs(other).max())


def test_a_flat_skin_pressed_onto_a_ball_reads_its_curvature():
    ball = 0.05

    def f(x, y, dx=0, dy=0):
        x, y = x - A / 2, y - B / 2
        z = np.sqrt(ball**2 - x**2 - y**2)
        return {
            (0, 0): -z, (1, 0): x / z, (0, 1): y / z, (1, 1): x * y / z**3,
            (2, 0): (z**2 + x**2) / z**3, (0, 2): (z**2 + y**2) / z**3,
        }[dx, dy]  # fmt: skip

    xx, yy, _ = DeflectedSkin(A, f).readings(X, Y)

    np.testing.assert_allclose(xx, 1 / ball, rtol=1e-12)
    np.testing.assert_allclose(yy, 1 / ball, rtol=1e-12)


def test_an_arc_that_is_moved_as_a_whole_reads_nothing():
    def f(x, y, dx=0, dy=0):
        turn = (x - A / 2) / RADIUS + dx * np.pi / 2
        return 5e-3 * RADIUS**-dx * np.cos(turn) * (dy == 0)

    readings = DeflectedSkin(A, f, RADIUS).readings(X, Y)

    np.testing.assert_allclose(readings, 0, atol=1e-10)


@pytest.mark.parametrize("radius", [RADIUS, np.inf])
def test_the_twist_of_slight_slopes_is_half_of_what_the_diagonals_differ_by(radius):
    off = []
    for size in (1e-5, 1e-6):
        skin = DeflectedSkin(A, sines(A, B, size * SHAPE), radius)
        off.append(np.abs(skin.readings(X, Y)[2] - skin.diagonal_difference(X, Y)).max() / size)
    assert off[1] < 0.2 * off[0]  # less than of first order
