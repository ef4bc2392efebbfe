"""A fibre held at one end, by the motion capture of others: 15 of its markers predict the others.

Markers seem to stand off the fibre's axis, each by a vector of its own, which is most of the noise:
how well the others are predicted depends on which they are.
"""

from functools import cache

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from kappaskin import SensorLayout, basis_for, estimator_for
from kappaskin.sources import load_description
from measured import FOLDER, measured

pytestmark = pytest.mark.truth

LAYOUT, READ = measured("fibre/fibre")
HEIGHTS = 1e-6 * np.loadtxt(FOLDER / "fibre" / "fibre.csv", delimiter=",")
OTHERS = (2, 6, 10, 14, 18)
ALONG = np.insert(
    LAYOUT.positions[:, 0], (2, 5, 8, 11, 14), (0.036199, 0.102769, 0.167319, 0.229922, 0.288241)
)
BASIS = basis_for(LAYOUT.patch, "cantilever", 20, 1)
PLACES = np.column_stack([ALONG, np.full(20, 0.01)])
AT_ALL = BASIS.at(PLACES)


@cache
def predicted(others, pooled=True):
    """Errors of the heights of markers and their sd, with noise and without, and the noise, in m.

    That of the noise is of each shape by itself, or of all together.
    """
    read = np.delete(np.arange(20), others)
    layout = SensorLayout.scattered(LAYOUT.patch, PLACES[read])
    layout = layout.reading(np.arange(len(read)), "height", free=["height"])
    fits, rows = estimator_for("bayes", BASIS, layout)(HEIGHTS[:, read]), AT_ALL[list(others)]
    noise = fits.noise[:, None]
    if pooled:
        noise = np.sqrt(np.average(fits.noise**2, weights=fits.spare))
        sigma = np.full(len(read), noise)
        fits = estimator_for("bayes", BASIS, layout, sigma)(HEIGHTS[:, read])
    error = fits.coefficients.reshape(100, -1) @ rows.T - HEIGHTS[:, others]
    sd = np.sqrt(np.diagonal(fits.covariance_of(rows), axis1=1, axis2=2))
    return error, np.hypot(sd, noise), sd, noise


def splined(others):
    read = np.delete(np.arange(20), others)
    spline = CubicSpline(ALONG[read], HEIGHTS[:, read], axis=1)
    return spline(ALONG[list(others)]) - HEIGHTS[:, others]


def choices():
    rng = np.random.default_rng(0)
    return [tuple(np.sort(rng.choice(np.arange(1, 20), 5, replace=False))) for _ in range(30)]


def within(errors, sd):
    return np.mean(np.abs(errors) < 2 * np.asarray(sd))


def test_the_line_is_what_is_described():
    sensor = load_description(FOLDER / "fibre" / "fibre.toml").sensor

    np.testing.assert_allclose(READ, np.delete(HEIGHTS, OTHERS, axis=1), atol=1e-12)
    assert sensor.edge == "cantilever"
    assert (np.diff(ALONG) > 0.01).all()
    # How far markers are apart along the fibre is at least how far their heights are.
    assert (np.abs(np.diff(HEIGHTS, axis=1)) < np.diff(ALONG)).all()
    assert sensor.noise == pytest.approx(predicted(OTHERS)[3], rel=0.05)


def test_heights_of_15_markers_predict_the_other_five_within_their_error_bars():
    error, sd, of_shape, _ = predicted(OTHERS)

    assert within(error, sd) == pytest.approx(0.97, abs=0.005)
    assert within(error, of_shape) == pytest.approx(0.92, abs=0.01)
    assert np.median(np.abs(error)) == pytest.approx(0.12e-3, abs=0.01e-3)
    assert np.sqrt(np.mean(error**2)) == pytest.approx(0.23e-3, abs=0.01e-3)


def test_a_spline_errs_as_little():
    found = splined(OTHERS)

    assert np.median(np.abs(found)) == pytest.approx(0.13e-3, abs=0.01e-3)
    assert np.sqrt(np.mean(found**2)) == pytest.approx(0.19e-3, abs=0.01e-3)


def test_whichever_five_are_left_out_error_bars_hold_in_the_mean():
    each = [predicted(others) for others in choices()]
    shares = [within(error, sd) for error, sd, _, _ in each]
    error, spline = np.array([one[0] for one in each]), np.array([*map(splined, choices())])

    assert np.mean(shares) == pytest.approx(0.97, abs=0.01)
    assert min(shares) == pytest.approx(0.87, abs=0.02)
    assert np.mean([within(one[0], one[2]) for one in each]) == pytest.approx(0.90, abs=0.01)
    assert np.median(np.abs(error)) == pytest.approx(0.16e-3, abs=0.01e-3)
    assert np.median(np.abs(spline)) == pytest.approx(0.14e-3, abs=0.01e-3)
    assert np.sqrt(np.mean(error**2)) == pytest.approx(0.33e-3, abs=0.02e-3)
    assert np.sqrt(np.mean(spline**2)) == pytest.approx(0.46e-3, abs=0.02e-3)


def test_the_noise_of_one_shape_is_less_certain_than_that_of_all():
    alone = [within(*predicted(others, pooled=False)[:2]) for others in choices()]

    assert np.mean(alone) == pytest.approx(0.92, abs=0.01)
    assert within(*predicted(OTHERS, pooled=False)[:2]) == pytest.approx(0.97, abs=0.005)
