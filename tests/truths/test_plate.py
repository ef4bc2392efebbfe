"""A plate under a pulse, by a finite-element program of others: slopes tell heights, and back.

Its nodes have rotations for slopes. They lack what the plate shears, 1 % here, and do so most near
its clamped edges; no error bar has that.
"""

from functools import cache

import numpy as np
import pytest

from kappaskin import LeastSquares, basis_for
from measured import measured

pytestmark = pytest.mark.truth

SLOPES, ROTATION = measured("plate/slopes")
HEIGHTS, HEIGHT = measured("plate/heights")
BASIS = basis_for(SLOPES.patch, "clamped", 16, 16)
TO_HEIGHT, TO_SLOPE = HEIGHTS.operator(BASIS), SLOPES.operator(BASIS)
REACH = 1.96


@cache
def fits(layout):
    return LeastSquares(BASIS, layout)


def predicted(layout, readings, operator):
    fit = fits(layout)(readings)
    return operator @ fit.coefficients.ravel(), np.sqrt(np.diag(fit.covariance_of(operator)))


def covered(layout, readings, operator, truth, noise):
    """The share of the `truth` in 95 % bands, with noise of that share of the largest reading."""
    rng, found = np.random.default_rng(0), []
    for _ in range(30):
        noisy = readings + rng.normal(0, noise * np.abs(readings).max(), readings.shape)
        told, sd = predicted(layout, noisy, operator)
        found.append(np.abs(told - truth) <= REACH * sd)
    return np.mean(found)


def rms(a):
    return np.sqrt(np.mean(a**2))


def test_slopes_tell_heights_but_for_shear():
    told, _ = predicted(SLOPES, ROTATION, TO_HEIGHT)

    assert np.abs(told - HEIGHT).max() < 0.02 * HEIGHT.max()
    assert 0.98 < told @ HEIGHT / (HEIGHT @ HEIGHT) < 1.0  # 0.987: shear is not seen


def test_heights_tell_slopes_but_for_shear():
    told, _ = predicted(HEIGHTS, HEIGHT, TO_SLOPE)
    off, peak = told - ROTATION, np.abs(ROTATION).max()
    places = SLOPES.positions[SLOPES.element]
    inner = SLOPES.patch.depth(places) > 0.02

    assert rms(off) < 0.02 * peak
    assert np.abs(off[inner]).max() < 0.02 * peak
    assert np.abs(off[~inner]).max() > 0.03 * peak  # the rotation of a clamped edge is none
    assert ROTATION @ told / (told @ told) == pytest.approx(0.99, abs=0.005)


@pytest.mark.parametrize("noise", [0.02, 0.05])
def test_error_bars_cover_slopes_told_by_heights(noise):
    assert 0.93 < covered(HEIGHTS, HEIGHT, TO_SLOPE, ROTATION, noise) < 0.97


@pytest.mark.parametrize("noise", [0.02, 0.05])
def test_error_bars_cover_heights_told_by_slopes_but_for_shear(noise):
    without_noise, _ = predicted(SLOPES, ROTATION, TO_HEIGHT)

    assert 0.92 < covered(SLOPES, ROTATION, TO_HEIGHT, without_noise, noise) < 0.98
    assert covered(SLOPES, ROTATION, TO_HEIGHT, HEIGHT, noise) < 0.6
