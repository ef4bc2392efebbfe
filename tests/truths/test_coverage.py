"""Error bars of a contact cover truths that share nothing with the estimator."""

from dataclasses import replace
from functools import cache
from math import sqrt

import numpy as np
import pytest

import benchmark
from kappaskin import LeastSquares, Patch, Plate, SensorLayout, basis_for
from kappaskin.contact import Contacts
from navier import HingedPlate, Load
from studies import (
    BENT,
    CAP_SHAPES,
    CAPS,
    FLAT,
    GRIDS,
    LINES,
    SHALLOW,
    SHAPES,
    SHARES,
    SINGLE,
    STRETCHED,
    TWO,
    accused,
    coverage,
    depths_on_cap,
    drifted,
    read_as_flat,
    robustness,
    shape_coverage,
    shapes_on_cap,
    told,
)

pytestmark = pytest.mark.truth

FEW, ALL = 200, 1000  # frames, each at a place of its own
frames = pytest.mark.parametrize("frames", [FEW, pytest.param(ALL, marks=pytest.mark.full)])
figures = cache(coverage)


def each(cases):
    return pytest.mark.parametrize("case", cases, ids=lambda case: case.name)


def slack(frames):
    """Two standard errors of a share of 95 % where the frames are few."""
    return 0.0 if frames >= ALL else 2 * sqrt(0.95 * 0.05 / frames)


# A flat skin: points, discs and Gaussians anywhere from 0.2 to 0.8 of a side; a dome, a saddle and
# a trough: discs

HILLS = "dome of 40 mm, disc of 2 mm", "saddle of 40 mm, disc of 2 mm"


@pytest.mark.cases("point", "disc of 3 mm, gages", *HILLS)
@each((*FLAT, *SHALLOW))
@frames
def test_intervals_on_a_flat_or_shallow_skin_cover_the_truth(case, frames):
    found = figures(case, frames)

    low, high = 0.92 - slack(frames), 0.98 + slack(frames)
    of_place = high + 0.01 * (case in SHALLOW)  # which have an error for the theory, of this truth
    assert found.found == 1
    assert low <= found.x <= of_place
    assert low <= found.y <= of_place
    assert low <= found.force <= high


@pytest.mark.cases("flat, point", "gages of 6 mm", "Gaussian of 2 mm")
@each(FLAT)
@frames
def test_the_force_on_a_flat_skin_is_unbiased(case, frames):
    assert abs(figures(case, frames).bias) < 0.01


@pytest.mark.cases("flat, point", "gages of 6 mm", "Gaussian of 2 mm")
@each(FLAT)
@frames
def test_the_place_on_a_flat_skin_is_near_the_cramer_rao_bound(case, frames):
    assert figures(case, frames).place <= 1.15


# A bent skin that stretches, pressed by a disc

UNBOUND = [replace(case, bound=False) for case in BENT]  # no test asks for the bound


@pytest.mark.cases("half round")
@each(UNBOUND)
@frames
def test_the_force_on_a_bent_skin_is_right(case, frames):
    assert abs(figures(case, frames).bias) < 0.03


@pytest.mark.cases("half round")
@each(UNBOUND)
@frames
def test_intervals_on_a_bent_skin_cover_the_truth(case, frames):
    found, least = figures(case, frames), 0.90 - slack(frames)

    assert min(found.x, found.y, found.force) >= least


@cache
def half_round():
    """What is told of loads on the benchmark's bent skin, with a noise in 1/m RMS."""
    skin = benchmark.BENT
    patch = Patch(*skin.sides, skin.radii[0])
    layout = SensorLayout.regular(patch, 10, 10)
    contacts = Contacts(Plate(patch, rigidity=HingedPlate().rigidity), layout)
    fit = LeastSquares(basis_for(patch, "hinged", 8, 8), layout)
    read, _ = benchmark.truth(skin)

    def told(noise, *loads):
        rng = np.random.default_rng(0)
        readings = sum(map(read, loads)) + rng.normal(0, noise, (3, 100))
        return contacts(readings, fit(readings))

    return told


@pytest.mark.parametrize("radius", [1e-3, 2e-3, 3e-3, 4e-3])
@pytest.mark.parametrize("place", [(0.013, 0.015), (0.02, 0.022), (0.03, 0.012)])
def test_discs_of_any_size_on_a_half_round_skin_have_their_force(place, radius):
    first, second = half_round()(0.02, Load(*place, 1.5, radius))

    assert not second.present
    assert first.force == pytest.approx(1.5, rel=8e-3)


@pytest.mark.parametrize("radius", [1e-3, 3e-3])
@pytest.mark.parametrize("apart", [12e-3, 16e-3, 20e-3])
def test_two_discs_across_a_half_round_skin_are_told_as_two(apart, radius):
    middle = benchmark.BENT.sides[0] / 2
    across = [middle - apart / 2, middle + apart / 2]

    both = half_round()(0.231, *(Load(x, 0.02, 2.0, radius) for x in across))

    assert [one.force for one in both] == pytest.approx([2.0, 2.0], rel=0.05)
    assert sorted(one.position[0] for one in both) == pytest.approx(across, abs=2e-4)


@pytest.mark.cases(*HILLS)
@each(SHALLOW)
@frames
def test_the_force_on_a_shallow_skin_is_right(case, frames):
    assert abs(figures(case, frames).bias) < 0.03


def test_a_dome_read_as_flat_tells_a_twentieth_of_the_force():
    assert 0.04 < read_as_flat(SHALLOW[1]) < 0.07


# A cap, pressed by discs, and by a Gaussian load that is as far from them as a profile may be

OF_DISCS = [case for case in CAPS if "disc" in case.name]


@pytest.mark.cases("fingertip, disc of 3 mm", "Gaussian")
@each(CAPS)
@frames
def test_the_force_on_a_cap_is_right(case, frames):
    found, low, high = figures(case, frames), 0.92 - slack(frames), 0.98 + slack(frames)

    assert found.found == 1
    assert abs(found.bias) < 0.03
    assert low <= found.force <= high


@pytest.mark.cases("fingertip, disc of 3 mm")
@each(OF_DISCS)
@frames
def test_the_place_on_a_cap_is_covered(case, frames):
    found, low, high = figures(case, frames), 0.92 - slack(frames), 0.98 + slack(frames)

    assert low <= found.x <= high
    assert low <= found.y <= high


@pytest.mark.cases("fingertip of 1 mm, disc of 2.5 mm", "fingertip, disc of 1 mm")
@each(CAP_SHAPES)
@pytest.mark.parametrize("frames", [60, pytest.param(FEW, marks=pytest.mark.full)])
def test_the_depth_on_a_cap_is_covered(case, frames):
    covered, mean, rms = depths_on_cap(case, frames)

    assert covered >= 0.92
    # How a load is spread over its area is told only in part: a Gaussian load is the worst.
    assert (abs(mean) < 0.08 and rms < 0.1) or ("Gaussian" in case.name and rms < 0.2)


# A flat skin that stretches, of known thickness, pressed in by up to more than twice of it

HELD, OTHERS = STRETCHED[:2], STRETCHED[2:]
EACH_STRETCHED = [*HELD, *(pytest.param(case, marks=pytest.mark.full) for case in OTHERS)]


@pytest.mark.cases("1.7 thicknesses")
@each(EACH_STRETCHED)
@frames
def test_the_force_on_a_stretched_skin_is_right(case, frames):
    assert abs(figures(case, frames).bias) < 0.05


@pytest.mark.cases("1.7 thicknesses")
@each(EACH_STRETCHED)
@frames
def test_intervals_on_a_stretched_skin_cover_the_truth(case, frames):
    found, least = figures(case, frames), 0.85 - slack(frames)

    assert min(found.x, found.y, found.force) >= least


# Shapes: the functions end where the truth does not, and nothing promises 95 %


SLOW = ("robust", "tracking")


@pytest.mark.cases("least-squares-8-flat, point", "bayes-15-flat, disc of 5 mm")
@pytest.mark.parametrize("case", FLAT[:3], ids=lambda case: case.name)
@pytest.mark.parametrize(
    ("method", "functions"),
    [pytest.param(*one, marks=pytest.mark.full if one[0] in SLOW else ()) for one in SHAPES],
)
@frames
def test_bands_of_the_surface_cover_nine_tenths_of_it(case, method, functions, frames):
    covered, rms = shape_coverage(case, method, functions, frames)

    assert 0.90 <= covered <= 0.98
    assert rms < 30e-6


# A cap stretches, by a thickness that the prior does not know


@pytest.mark.cases("fingertip of 1 mm")
@each([case for case in CAP_SHAPES if "disc" in case.name])
@pytest.mark.parametrize("frames", [60, pytest.param(FEW, marks=pytest.mark.full)])
def test_bands_of_the_surface_of_a_cap_cover_it_and_are_no_worse_than_of_least_squares(
    case, frames
):
    (_, least), *others = shapes_on_cap(case, frames).values()

    for covered, rms in others:
        assert 0.92 - slack(frames) <= covered <= 0.98 + slack(frames)
        assert rms <= least


# Bad elements, up to a quarter of them, off by 20 to 40 noises

SOME, MORE = 12, 72  # frames of no load, one and two in turn
by_grid = pytest.mark.parametrize("grid", GRIDS, ids=lambda grid: "{} elements, {}".format(*grid))
draws = pytest.mark.parametrize("draws", [SOME, pytest.param(MORE, marks=pytest.mark.full)])


@pytest.mark.cases(
    "True-0.1-6 elements, 4",
    "True-0.25-8 elements, 6",
    "False-0.1-10 elements, 8",
    "False-0.25-12 elements, 8",
)
@by_grid
@pytest.mark.parametrize("share", SHARES)
@pytest.mark.parametrize("equal", [True, False])
@draws
def test_bad_elements_cost_robust_little_more_than_to_know_them(grid, share, equal, draws):
    found = robustness(*grid, share, draws, equal=equal)

    assert np.median(found.error) <= 1.6 * np.median(found.knew)
    assert found.error.max() <= 4 * found.knew.max()
    assert not (found.converged & found.broken).any()
    assert found.converged.mean() >= 0.75


@pytest.mark.parametrize("share", [0.35, 0.4])
def test_robust_with_too_many_bad_elements_mostly_says_so(share):
    found = robustness(10, 8, share, 3 * SOME)

    assert found.broken.any()
    assert (found.converged & found.broken).mean() <= 0.05


@pytest.mark.parametrize("frames", [1000, pytest.param(10000, marks=pytest.mark.full)])
def test_the_health_monitor_accuses_no_healthy_element_under_a_small_contact(frames):
    assert accused(frames) < 0.01 * frames


# One contact or two, and loads that are neither

figures_told = cache(told)
MANY = 10_000
many = pytest.mark.parametrize("frames", [FEW, pytest.param(MANY, marks=pytest.mark.full)])
LONG = [line for line in LINES if line.name in ("a line of 30 mm", "a line of 40 mm")]
CLEAR = [
    two for two in TWO if two.name.startswith(("two, 30", "two, 40")) and "0.1" not in two.name
]


@pytest.mark.cases("one point", "one disc")
@each(SINGLE)
@many
def test_no_second_contact_is_invented_beside_a_single_one(case, frames):
    found = figures_told(case, frames)

    assert found.two < 0.005
    assert found.single > 0.99


@pytest.mark.cases("30 mm")
@each(LONG)
@frames
def test_a_line_is_neither_one_contact_nor_two(case, frames):
    found = figures_told(case, frames)

    assert found.two <= 0.02 + slack(frames)
    assert found.single < 0.05


@pytest.mark.cases("40 mm apart, forces as 1 to 0.3")
@each(CLEAR)
@frames
def test_two_contacts_are_told_as_two(case, frames):
    found, least = figures_told(case, frames), 0.90 - slack(frames)

    assert found.two > 0.95
    assert found.single < 0.05
    assert min(found.covered) >= least


# Drifts of all readings


@pytest.mark.cases("200-2")
@pytest.mark.parametrize("noises", [2, 3, 4, 6])
@frames
def test_a_drift_is_told_as_one_and_contacts_are_found_beside_it(noises, frames):
    found = drifted(noises, frames)

    assert found.present[0] <= 0.02
    assert found.present[1] >= 0.95
    assert min(found.told) >= 0.95
    assert min(found.covered) >= 0.90
    assert min(found.surface) >= 0.90
    assert abs(found.size - 1) < 0.05


@frames
def test_no_drift_is_told_where_there_is_none(frames):
    found = drifted(0, frames)

    assert max(found.told) <= 0.005
    assert found.present == (0.0, 1.0)
