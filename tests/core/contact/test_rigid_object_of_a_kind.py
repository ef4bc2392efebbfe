"""A named object stands as the rigid object of its kind."""

import math
from dataclasses import replace

import numpy as np
import pytest

from kappaskin import Patch
from kappaskin.contact import NO_OBJECT, placed_object

FLAT, PLACE = Patch(0.1, 0.1), np.array([0.05, 0.04])


def _found(kind: str, **known: float):
    return replace(NO_OBJECT, kind=kind, **known)


@pytest.mark.parametrize("kind", ["sphere", "cylinder"])
def test_a_round_object_rises_across_its_axis_as_its_curvature_says(kind: str) -> None:
    angle, radius, far = 0.6, 0.03, 2e-4
    stands = placed_object(_found(kind, radius=radius, axis=angle, length=0.04), PLACE, 0.1)
    assert stands is not None
    across, along = (
        np.array([-math.sin(angle), math.cos(angle)]),
        np.array([math.cos(angle), math.sin(angle)]),
    )
    (lowest, beside, ahead), _ = stands.over(
        FLAT, PLACE + np.array([[0, 0], far * across, far * along])
    )
    assert lowest == 0
    assert 2 * beside / far**2 == pytest.approx(1 / radius, rel=1e-3)
    assert 2 * ahead / far**2 == pytest.approx(0 if kind == "cylinder" else 1 / radius, rel=1e-3)


def test_a_radius_with_an_upper_bound_only_is_drawn_at_it() -> None:
    stands = placed_object(_found("sphere", radius_95=(0.0, 0.02)), PLACE, 0.1)
    assert stands is not None
    assert stands.object_.extent == (0.02, 0.02)


@pytest.mark.parametrize("radius_95", [(0.1, math.inf), (math.inf, math.inf)])
def test_what_may_be_flat_is_flat(radius_95: tuple[float, float]) -> None:
    stands = placed_object(_found("sphere", radius_95=radius_95), PLACE, 0.1)
    assert stands is not None
    height, _ = stands.over(FLAT, PLACE + np.array([[0.01, 0.02]]))
    assert height == pytest.approx([0.0])


def test_an_edge_is_lowest_along_its_axis() -> None:
    stands = placed_object(_found("edge", axis=math.pi / 2, length=0.03), PLACE, 0.1)
    assert stands is not None
    ends = PLACE + np.array([[0, 0.014], [0, -0.014], [0, 0.016], [0.005, 0.0]])
    on, on_too, beside, flank = stands.over(FLAT, ends)[0]
    assert (on, on_too, beside) == pytest.approx((0, 0, math.inf), abs=1e-12)
    assert flank > 0.005


def test_what_is_not_named_stands_nowhere() -> None:
    assert placed_object(NO_OBJECT, PLACE, 0.1) is None
