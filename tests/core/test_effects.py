"""What every effect promises, noise of a given root mean square, and fixed errors."""

import math
import pickle

import numpy as np
import pytest

from kappaskin import (
    FIRST_GENERATION_LOOPS,
    SECOND_GENERATION_LOOPS,
    Creep,
    GaussianNoise,
    Refusal,
    Tolerance,
    UniformNoise,
)

DRAWS = 200_000
EFFECTS = [
    UniformNoise(0.3),
    GaussianNoise(0.3),
    Tolerance(0.05, 3.0),
    SECOND_GENERATION_LOOPS,
    FIRST_GENERATION_LOOPS,
    Creep(0.03, 20.0),
]


def played(running, frames=30):
    """What a running effect makes of a skin (3, 4) that moves, (frames, 3, 4)."""
    phase = np.arange(12).reshape(3, 4)
    return np.array([running(60 * np.sin(k / 3 + phase), k / 50) for k in range(frames)])


@pytest.mark.parametrize("effect", EFFECTS)
def test_an_effect_leaves_what_it_is_given_and_what_it_gave_alone(effect):
    running = effect.start((3, 4), np.random.default_rng(1))
    given = np.linspace(-70, 70, 12).reshape(3, 4)
    kept = given.copy()

    first = running(given, 0.0)
    answered = first.copy()
    then = running(given, 10.0)

    np.testing.assert_array_equal(given, kept)
    np.testing.assert_array_equal(first, answered)
    assert first.shape == (3, 4)
    assert (then != given).any()


@pytest.mark.parametrize("effect", EFFECTS)
def test_an_effect_started_twice_has_two_states(effect):
    one = effect.start((3, 4), np.random.default_rng(1))
    begun = played(one)

    np.testing.assert_array_equal(played(effect.start((3, 4), np.random.default_rng(1))), begun)
    assert (played(one) != begun).any() == (not isinstance(effect, Tolerance))


@pytest.mark.parametrize("effect", EFFECTS)
def test_effects_that_spoil_alike_are_equal_also_after_a_way_through_a_pipe(effect):
    assert pickle.loads(pickle.dumps(effect)) == effect
    assert [other == effect for other in EFFECTS].count(True) == 1


def noise(effect, seed=0, shape=(DRAWS,)):
    return effect.start(shape, np.random.default_rng(seed))(np.zeros(shape), 0.0)


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

    read = effect.start((30,), np.random.default_rng(7))(true, 0.0)

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


def test_tolerances_are_the_same_in_every_frame_and_have_the_spread_asked_for():
    gain, offset = Tolerance(0.05, 3.0).errors((DRAWS,))
    running = Tolerance(0.05, 3.0).start((DRAWS,), np.random.default_rng(9))

    for true in (0.0, 10.0, -40.0):
        np.testing.assert_allclose(running(np.full(DRAWS, true), 0.0), gain * true + offset)
    assert [gain.mean(), offset.mean()] == pytest.approx([1.0, 0.0], abs=4 * 3 / math.sqrt(DRAWS))
    assert [gain.std(), offset.std()] == pytest.approx([0.05, 3.0], rel=4 / math.sqrt(2 * DRAWS))


def test_tolerances_belong_to_the_skin_and_not_to_the_noise():
    skin, other = Tolerance(0.05, 3.0, seed=1), Tolerance(0.05, 3.0, seed=2)

    np.testing.assert_array_equal(noise(skin, seed=1), noise(skin, seed=2))
    assert (noise(skin) != noise(other)).all()


@pytest.mark.parametrize("sd", [-0.1, math.nan, math.inf])
def test_a_tolerance_that_is_none_is_refused(sd):
    for pair in ((sd, 1.0), (0.1, sd)):
        with pytest.raises(Refusal, match="sd of at least 0"):
            Tolerance(*pair)
