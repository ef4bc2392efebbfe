"""Noise of a given root mean square."""

import math

import numpy as np
import pytest

from kappaskin import GaussianNoise, Refusal, UniformNoise

DRAWS = 200_000


def noise(effect, seed=0, shape=(DRAWS,)):
    return effect.apply(np.zeros(shape), np.random.default_rng(seed))


@pytest.mark.parametrize("effect", [UniformNoise(0.3), GaussianNoise(0.3)])
def test_noise_has_the_rms_asked_for_and_no_mean(effect):
    drawn = noise(effect)

    # Standard errors: rms / sqrt(2 n) at most for the rms, rms / sqrt(n) for the mean.
    assert drawn.std() == pytest.approx(0.3, abs=4 * 0.3 / math.sqrt(2 * DRAWS))
    assert abs(drawn.mean()) < 4 * 0.3 / math.sqrt(DRAWS)


def test_table_1s_noise_fills_its_limits_of_0_40_evenly():
    drawn = noise(UniformNoise(0.40 / math.sqrt(3)))

    assert 0.3999 < np.abs(drawn).max() <= 0.40 + 1e-12
    share = np.histogram(drawn, bins=10, range=(-0.4, 0.4))[0] / DRAWS
    np.testing.assert_allclose(share, 0.1, atol=5 * math.sqrt(0.09 / DRAWS))


def test_gaussian_noise_has_gaussian_tails():
    drawn = np.abs(noise(GaussianNoise(0.3))) / 0.3

    for limit, inside in ((1, 0.6827), (2, 0.9545), (3, 0.9973)):
        error = 4 * math.sqrt(inside * (1 - inside) / DRAWS)
        assert np.mean(drawn < limit) == pytest.approx(inside, abs=error)


@pytest.mark.parametrize("effect", [UniformNoise(0.3), GaussianNoise(0.3)])
def test_noise_repeats_with_its_seed_and_differs_with_another(effect):
    first = noise(effect, seed=7, shape=(3, 100))

    np.testing.assert_array_equal(first, noise(effect, seed=7, shape=(3, 100)))
    assert not np.any(first == noise(effect, seed=8, shape=(3, 100)))


@pytest.mark.parametrize("effect", [UniformNoise(0.3), GaussianNoise(0.3)])
def test_noise_adds_to_a_reading_and_leaves_the_true_one_alone(effect):
    true = np.linspace(-1, 1, 30)
    kept = true.copy()

    read = effect.apply(true, np.random.default_rng(7))

    np.testing.assert_allclose(read - true, noise(effect, seed=7, shape=(30,)), atol=1e-15)
    np.testing.assert_array_equal(true, kept)


@pytest.mark.parametrize("effect", [UniformNoise(0.0), GaussianNoise(0.0)])
def test_noise_of_rms_zero_changes_nothing(effect):
    assert not noise(effect).any()


@pytest.mark.parametrize("rms", [-0.1, math.nan, math.inf])
@pytest.mark.parametrize("effect", [UniformNoise, GaussianNoise])
def test_an_rms_that_is_none_is_refused(effect, rms):
    with pytest.raises(Refusal, match=f"at least 0 1/m, got {rms}"):
        effect(rms)
