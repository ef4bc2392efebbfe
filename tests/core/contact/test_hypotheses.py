"""How likely each kind of object is, against densities that SciPy tells."""

import math

import numpy as np
import pytest
from scipy import stats

from kappaskin import Patch, Plate, SensorLayout
from kappaskin.contact.elastic_skin import ElasticSkin, Optimum, ends
from kappaskin.contact.hypotheses import (
    SHARE,
    Hypotheses,
    Hypothesis,
    WeightedReadings,
    Width,
    laplace_integral,
    length_prior,
    plane_prior,
    radius_prior,
)

SIDE = 0.1
BENT, FLAT = (
    ElasticSkin(Plate(patch), SensorLayout.regular(patch, 3, 3), "hinged", 5)
    for patch in (Patch(SIDE, 0.12, 10.0), Patch(SIDE, 0.12))
)
WIDTH = Width(q=4e-6, sd=1e-7, measured=1e-7, k0=80.0, q0=4e-6, bend=20.0)


def optimum(
    angle: float = 0.3, length: float = 0.04, share: float = 0.0, squares: float = 90.0
) -> Optimum:
    parameters = np.array([0.05, 0.06, 0.2, angle, length**2, share])
    rng = np.random.default_rng(0)
    root = rng.normal(size=(6, 6)) * np.array([1e-4, 1e-4, 1e-2, 0.05, 2e-5, 0.02])[:, None]
    return Optimum(ends(0.0), parameters, root @ root.T, 100.0, squares, np.zeros(6))


@pytest.mark.parametrize(("length", "share"), [(0.04, 0.0), (0.04, 0.35), (0.07, -0.1)])
def test_length_angle_and_share_are_as_likely_as_their_priors_say(length, share) -> None:
    best = optimum(length=length, share=share)

    told = length_prior(FLAT, Hypothesis(best))

    of_square = stats.uniform.pdf(length, 0, SIDE) / (2 * length)  # the density of its square
    expected = stats.norm.logpdf(share, 0, SHARE) - math.log(math.pi) + math.log(of_square)
    assert told == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize("k0", [10.0, 80.0, 300.0])
def test_a_radius_is_as_likely_as_any_multiple_of_it(k0: float) -> None:
    width = Width(q=4e-6, sd=2e-7, measured=2e-7, k0=k0, q0=4e-6, bend=k0)

    told = radius_prior(FLAT, width)

    by_q = width.bend / (2 * width.q)  # of the curvature
    expected = stats.loguniform.pdf(1 / k0, 0.02 * SIDE, 5 * SIDE) * by_q / k0**2
    assert told == pytest.approx(math.log(expected), abs=0.02)


def all_alike(best: Optimum) -> Hypotheses:
    readings = WeightedReadings(FLAT, np.zeros(27), np.ones(27, dtype=bool))
    return Hypotheses(Hypothesis(best), Hypothesis(best), Hypothesis(best), 0.2, 300, readings)


def test_the_volume_of_a_peak_is_that_of_its_normal_distribution() -> None:
    best = optimum(squares=1.0)
    all_of = all_alike(best)

    at_the_top = stats.multivariate_normal(cov=best.covariance, allow_singular=True).logpdf
    assert laplace_integral(best, all_of) == pytest.approx(-at_the_top(np.zeros(6)))


def test_of_all_but_three_readings_each_halves_the_log_of_what_is_left() -> None:
    one, other = optimum(squares=90.0), optimum(squares=120.0)
    all_of = all_alike(one)

    better = laplace_integral(one, all_of) - laplace_integral(other, all_of)

    assert better == pytest.approx(297 / 2 * math.log(120 / 90))


def test_a_plane_lies_along_the_axis_of_a_bent_skin_and_on_no_flat_one() -> None:
    along, askew, turned = (
        plane_prior(BENT, optimum(angle), WIDTH)
        for angle in (math.pi / 2, math.pi / 2 + 0.3, -math.pi / 2)
    )

    spread = math.hypot(math.sqrt(optimum().covariance[3, 3]), 0.1)
    assert askew - along == pytest.approx(
        stats.norm.logpdf(0.3, 0, spread) - stats.norm.logpdf(0, 0, spread)
    )
    assert turned == pytest.approx(along)
    assert plane_prior(FLAT, optimum(), WIDTH) == -math.inf
