"""Distances on skins whose lengths are known."""

import math

import numpy as np
import pytest

from kappaskin import Patch
from kappaskin.skin import distances

FLAT = Patch(0.1, 0.06)


def test_on_a_flat_skin_both_distances_are_those_of_a_ruler() -> None:
    found = distances(FLAT, np.zeros((9, 9)), np.array([0.01, 0.01]), np.array([0.04, 0.05]))
    assert (found.straight, found.along) == pytest.approx((0.05, 0.05))
    assert found.higher == 0


def test_along_an_arc_the_way_is_its_angle_and_straight_its_chord() -> None:
    R = 0.02
    arc = Patch(math.pi * R, 0.03, R)
    ends = np.array([[0.0, 0.01], [math.pi * R / 2, 0.01]])
    found = distances(arc, np.zeros((5, 5)), *ends)
    assert found.along == pytest.approx(math.pi * R / 2, rel=1e-4)
    assert found.straight == pytest.approx(math.sqrt(2) * R)
    assert found.higher == pytest.approx(R)


def test_pressed_in_everywhere_an_arc_is_a_shorter_one() -> None:
    R = 0.02
    arc = Patch(math.pi * R, 0.03, R)
    found = distances(arc, np.full((5, 5), 0.005), np.array([0.0, 0.0]), np.array([arc.a, 0.0]))
    assert found.along == pytest.approx(math.pi * 0.015, rel=1e-4)
    assert found.straight == pytest.approx(0.03)


def test_a_slope_is_longer_than_what_it_spans_and_down_is_below_zero() -> None:
    x, _ = np.meshgrid(*FLAT.grid(33, 17))
    found = distances(FLAT, 0.2 * x, np.array([0.02, 0.03]), np.array([0.08, 0.03]))
    assert found.higher == pytest.approx(-0.012)
    assert found.straight == pytest.approx(math.hypot(0.06, 0.012))
    assert found.along == pytest.approx(found.straight)


def test_across_a_dent_the_way_along_the_skin_is_the_length_of_its_curve() -> None:
    x, _ = np.meshgrid(*FLAT.grid(401, 5))
    depth = 0.01
    surface = depth * np.sin(np.pi * x / FLAT.a)
    found = distances(FLAT, surface, np.array([0.0, 0.03]), np.array([0.1, 0.03]))
    t = np.linspace(0, FLAT.a, 20001)
    slope = depth * np.pi / FLAT.a * np.cos(np.pi * t / FLAT.a)
    assert found.along == pytest.approx(np.trapezoid(np.sqrt(1 + slope**2), t), rel=1e-4)
    assert found.straight == pytest.approx(0.1)
