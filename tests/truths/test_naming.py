"""Objects are named right on a plate that owes the library nothing, or are not named."""

import numpy as np
import pytest

from navier import HingedPlate, Load
from objects import SHAPES, SKINS, Naming, Press, naming, on_plate, punch, sphere, torus
from rigid import Compliance, ball

pytestmark = [pytest.mark.truth, pytest.mark.slow]

FEW, ALL = 4, 100  # frames of each shape


def test_the_compliance_is_that_of_the_sum_over_all_waves():
    places, radius = np.array([[0.05, 0.05], [0.051, 0.05], [0.08, 0.03]]), 0.5e-3

    G = on_plate().compliance(places, radius)

    for place, row in zip(places, G, strict=True):
        load = Load(*place, radius=radius)
        np.testing.assert_allclose(row, HingedPlate().displacement(load, places), rtol=1e-3)


@pytest.mark.parametrize(("radius", "depth"), [(0.02, 4e-3), (0.1, 2e-3), (0.3, 3e-3)])
def test_a_ball_bears_as_on_an_even_grid(radius, depth):
    even = Compliance(HingedPlate(), 0.05, 0.05, 1e-3, 31).press(ball(radius), depth)

    places, F, _ = on_plate().forces(Press(sphere(radius), 0.05, 0.05, depth))

    assert F.sum() == pytest.approx(even.force, rel=2e-3)
    away = np.hypot(*(places - 0.05).T) @ F / F.sum()
    on_grid = np.hypot(*(even.places - 0.05).T) @ even.forces / even.force
    assert away == pytest.approx(on_grid, abs=1e-4)


def test_a_flat_face_bears_on_its_rim_like_a_ring():
    face, ring = (
        on_plate().forces(Press(shape, 0.045, 0.052, 3e-3, 0.3, 0.01))
        for shape in (punch(0.01), torus(0.01, 3e-3))
    )

    np.testing.assert_allclose(np.hypot(*(face[0] - (0.045, 0.052)).T), 0.01, rtol=1e-9)
    assert face[1].sum() == pytest.approx(ring[1].sum(), rel=1e-3)


def total(frames, noise, elements):
    return sum((naming(name, frames, noise, elements) for name in SHAPES), Naming())


@pytest.mark.parametrize(
    ("frames", "skin"),
    [(FEW, SKINS[0]), *(pytest.param(ALL, skin, marks=pytest.mark.full) for skin in SKINS)],
)
def test_names_are_right_or_say_what_reads_the_same(frames, skin):
    told = total(frames, *skin)

    assert told.named > 0.6 * told.frames
    assert told.alike >= 0.90 * told.named


@pytest.mark.parametrize(
    ("frames", "skin"),
    [(FEW, SKINS[0]), *(pytest.param(ALL, skin, marks=pytest.mark.full) for skin in SKINS)],
)
def test_radii_are_covered(frames, skin):
    told = total(frames, *skin)

    assert told.radii > 0
    assert told.covered >= 0.90 * told.radii


@pytest.mark.parametrize("frames", [3 * FEW, pytest.param(ALL, marks=pytest.mark.full)])
@pytest.mark.parametrize("name", ["flat round face", "ring"])
def test_a_rim_that_bears_in_part_is_mostly_not_named(name, frames):
    told = naming(name, frames)

    assert told.named < 0.6 * frames


@pytest.mark.cases("sphere", "rounded edge")
@pytest.mark.parametrize("frames", [FEW, pytest.param(ALL, marks=pytest.mark.full)])
@pytest.mark.parametrize("name", ["sphere", "cylinder", "edge", "rounded edge"])
def test_what_is_of_a_kind_mostly_fits_one(name, frames):
    told = naming(name, frames)

    assert told.nothing <= 0.1 * frames + 1
