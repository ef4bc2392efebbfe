"""What is said beforehand agrees with truths: scatter, errors of a setting, a given sigma."""

from math import sqrt

import numpy as np
import pytest

from kappaskin import Refusal, SensorLayout, basis_for, estimator_for, load_scene, predicted_sd
from kappaskin.studies.paper import table_1
from navier import HingedPlate, Load
from studies import (
    NOISE,
    PATCH,
    PLANNED,
    SETTINGS,
    SIGMA_FITS,
    SMALL,
    promised,
    scatter,
    sigma_said,
)

pytestmark = pytest.mark.truth

FEW, ALL = 200, 1000
frames = pytest.mark.parametrize("frames", [FEW, pytest.param(ALL, marks=pytest.mark.full)])


# The scatter of estimates


@pytest.mark.cases("6 x 6 elements", "8 x 8 functions")
@pytest.mark.parametrize("planned", PLANNED, ids=str)
@frames
def test_bayes_scatters_as_predicted_within_a_tenth(planned, frames):
    ratios, _ = scatter(planned, frames)

    assert 0.9 <= ratios.mean() <= 1.1


def test_bayes_needs_the_readings_of_a_load():
    fit = estimator_for(
        "bayes", basis_for(PATCH, "hinged", 8, 8), SensorLayout.regular(PATCH, 6, 6)
    )

    with pytest.raises(Refusal, match="expected the readings of a load as well"):
        predicted_sd(fit, 0.2, np.array([[0.05, 0.05]]))


def test_the_scatter_of_an_estimator_with_memory_is_not_predicted():
    layout = SensorLayout.regular(PATCH, 6, 6)
    fit = estimator_for("tracking", basis_for(PATCH, "hinged", 6, 6), layout)

    with pytest.raises(Refusal, match="expected an estimator without memory"):
        predicted_sd(fit, 0.2, np.array([[0.05, 0.05]]))


# What `cost --within` and Table 1 promise of small contacts


# Each load once, each setting twice.
@pytest.mark.cases(
    "least-squares-10-(0.0, 0.15, 0.2",
    "least-squares-10-(0.001, 0.005, 0.2",
    "bayes-10-(0.001, 0.15, 0.2",
    "bayes-10-(0.001, 0.15, 0.03",
    "least-squares-16-(0.003, 0.15, 0.2",
    "least-squares-16-(0.003, 0.15, 0.03",
)
@pytest.mark.parametrize("load", SMALL, ids=str)
@pytest.mark.parametrize("setting", SETTINGS, ids=lambda one: f"{one.method}-{one.elements[0]}")
@frames
def test_the_error_of_a_setting_is_that_of_the_truth(setting, load, frames):
    exact, noisy = promised(setting, *load, frames)

    # A point on an element bends it without bound, in waves that never end.
    assert exact == pytest.approx(1, abs=0.05 if load[0] else 0.1)
    assert noisy == pytest.approx(1, abs=0.1 if frames >= ALL else 0.15)


@pytest.mark.parametrize("name", ["centre", "off-centre"])
def test_table_1_gives_the_errors_beside_a_plate_too(name):
    scene = load_scene(name)
    (load,), layout = scene.loads, scene.layout
    plate = HingedPlate(rigidity=scene.plate.rigidity)
    c = plate.coefficients(Load(load.x, load.y, load.force))
    fit = estimator_for("least-squares", basis_for(PATCH, "hinged", 8, 8), layout)

    fitted = fit(plate.curvature(c, layout.positions)).coefficients.ravel()

    (row,) = (row for row in table_1() if (row["case"], row["noise"]) == (name, False))
    at = np.array([[load.x, load.y]])
    e = 1e3 * (fit.basis.at(at) @ fitted - plate.surface(c, at))
    assert row["summed_e_max_mm"] == pytest.approx(e[0], rel=0.02)
    assert abs(row["summed_e_max_mm"]) > 2 * abs(row["e_max_mm"])


# A sigma that is given


@pytest.mark.cases("bayes-15-2.0", "least-squares-8-0.5")
@pytest.mark.parametrize("given", [0.5, 2.0])
@pytest.mark.parametrize(("method", "functions"), SIGMA_FITS)
@frames
def test_a_sigma_that_is_off_by_two_is_said(method, functions, given, frames):
    each, recordings = sigma_said(method, functions, given, frames)

    assert each >= 0.85
    assert recordings == 1


@pytest.mark.cases("bayes-15", "least-squares-6")
@pytest.mark.parametrize(("method", "functions"), SIGMA_FITS[:3])
@pytest.mark.parametrize("frames", [500, pytest.param(10_000, marks=pytest.mark.full)])
def test_a_sigma_that_is_right_is_never_said_to_be_off(method, functions, frames):
    assert sigma_said(method, functions, 1.0, frames) == (0, 0)


@pytest.mark.cases("0.23094", "0.02]")
@pytest.mark.parametrize("noise", [NOISE / sqrt(3), 0.05, 0.02])
def test_a_contact_that_is_held_is_not_taken_for_a_wrong_sigma(noise):
    rng, layout = np.random.default_rng(0), SensorLayout.regular(PATCH, 10, 10)
    fit = estimator_for("least-squares", basis_for(PATCH, "hinged", 8, 8), layout, noise)
    exact = HingedPlate().readings(Load(0.034, 0.057, 0.15, radius=1e-3), layout.positions)
    read = exact + rng.normal(0, noise, (20, 3, 100))

    assert fit(read).sigma_ratio == 1
    assert fit(read).residual.std() > (1.1 if noise > 0.1 else 3) * noise
