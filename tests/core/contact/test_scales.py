"""Numbers at the edge: loads and objects in readings of any size."""

import numpy as np
import pytest

from kappaskin import (
    LeastSquares,
    ObjectFinder,
    Patch,
    Plate,
    PointContact,
    PointLoad,
    SensorLayout,
    SineBasis,
    load_scene,
    local_geometry,
)
from kappaskin.contact import LoadDetector

SQUARE = Patch(0.1, 0.1)
TENS = SensorLayout.regular(SQUARE, 10, 10)
LOAD = PointLoad(0.04, 0.06, 0.45)
NOISE = 0.231


def pressed():
    basis = SineBasis(SQUARE, 15, 15)
    M = TENS.operator(basis)
    K = (M @ Plate(SQUARE).deflection([LOAD], basis).ravel()).reshape(3, -1)
    return K + np.random.default_rng(0).normal(0, NOISE, K.shape)


@pytest.mark.parametrize("k", [-1000, -700, -500, -20, 100, 500])
def test_a_load_is_detected_at_every_scale(k):
    detector = LoadDetector(load_scene("centre").sensor())
    variance = NOISE**2

    found = detector(np.ldexp(pressed().ravel(), k), np.ldexp(variance, 2 * k))

    expected = detector(pressed().ravel(), variance)
    np.testing.assert_array_equal(found.position, expected.position)
    assert found.force == pytest.approx(np.ldexp(expected.force, k), rel=1e-9, abs=0)
    assert found.share == pytest.approx(expected.share, rel=1e-9)


@pytest.mark.parametrize("k", [-900, -300, -40, 0, 40, 100, 240])
def test_the_geometry_of_any_shape_is_numbers(k):
    fit = LeastSquares(SineBasis(SQUARE, 8, 8), TENS)(np.ldexp(pressed(), k))

    geometry = local_geometry(fit, np.array([[0.04, 0.06], [0.01, 0.09]]))

    for name in ("position", "frame", "metric", "curvature_form", "torsion_form", "covariance"):
        assert np.isfinite(getattr(geometry, name)).all(), name
    for name in ("mean", "gaussian", "principal", "mean_sd", "gaussian_sd", "principal_sd"):
        assert np.isfinite(getattr(geometry, name)).all(), name


@pytest.mark.slow
@pytest.mark.parametrize("k", [-500, -200, -100, -50, 30, 100, 150, 240])
def test_no_object_is_told_from_a_skin_that_is_moved_by_nothing_or_kilometres(k):
    plate, K = Plate(SQUARE), np.ldexp(pressed(), k)
    fit = LeastSquares(SineBasis(SQUARE, 8, 8), TENS)(K)
    contact = PointContact(plate, TENS)(K, fit)

    found = ObjectFinder(plate, TENS)(K, float(fit.noise), contact)

    assert found.kind == ""
    assert set(found.probability.values()) == {0.25}
    assert found.describe() == "shape unknown"
