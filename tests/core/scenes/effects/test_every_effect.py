"""What every effect promises, noise of a given root mean square, and fixed errors."""

import math
import pickle
from dataclasses import fields

import numpy as np
import pytest

from kappaskin import Refusal, Transduction
from kappaskin._schema import Within, parameters
from kappaskin.scenes.effects import (
    EFFECTS,
    FIRST_GENERATION_LOOPS,
    SECOND_GENERATION_LOOPS,
    Creep,
    GageLength,
    GaussianNoise,
    Hysteresis,
    IntermittentElements,
    Quantisation,
    ReadingEffect,
    Saturation,
    StrainLimit,
    StuckElements,
    Temperature,
    Tolerance,
    UniformNoise,
)
from kappaskin.scenes.effects.electronics import CrossTalk, FlickerNoise, MainsHum
from kappaskin.sensing import Amplifier, HalfBridge

DRAWS = 200_000
EFFECTS_AT_WORK = [
    UniformNoise(0.3),
    GaussianNoise(0.3),
    Tolerance(0.05, 3.0),
    SECOND_GENERATION_LOOPS,
    FIRST_GENERATION_LOOPS,
    Creep(0.03, 20.0),
    CrossTalk(0.02),
    Temperature(15.0, 0.5, 0.3, spread=0.2, gain=2e-4),
    FlickerNoise(0.3),
    MainsHum(0.3),
    Quantisation(Transduction()),
    Saturation(Transduction(amplifier=Amplifier(gain=400.0))),
    StrainLimit(Transduction(HalfBridge(substrate_thickness=1e-3)), 0.2),
    StuckElements((1, 3), since=0.3),
    IntermittentElements((0, 2), on=0.2, off=0.1),
]
ALIKE = (Tolerance, Temperature, MainsHum, Quantisation, Saturation)  # whatever came before
SOMETIMES = (StuckElements, IntermittentElements, Saturation)


def test_what_is_listed_here_is_every_effect_on_readings() -> None:
    every = {effect for effect in EFFECTS.values() if issubclass(effect, ReadingEffect)}

    assert {type(effect) for effect in EFFECTS_AT_WORK} == every


def played(running, frames=30):
    """What a running effect makes of a skin (3, 4) that moves, (frames, 3, 4)."""
    phase = np.arange(12).reshape(3, 4)
    return np.array([running(60 * np.sin(k / 3 + phase), k / 50) for k in range(frames)])


@pytest.mark.parametrize("effect", EFFECTS_AT_WORK)
def test_an_effect_leaves_what_it_is_given_and_what_it_gave_alone(effect):
    running = effect.start((3, 4), np.random.default_rng(1))
    given = np.linspace(-70, 70, 12).reshape(3, 4)
    kept = given.copy()

    first = running(given, 0.0)
    answered = first.copy()
    then = running(-given / 2, 10.0)

    np.testing.assert_array_equal(given, kept)
    np.testing.assert_array_equal(first, answered)
    assert first.shape == (3, 4)
    assert (then != -given / 2).any() or isinstance(effect, SOMETIMES)


@pytest.mark.parametrize("effect", EFFECTS_AT_WORK)
def test_an_effect_started_twice_has_two_states(effect):
    one = effect.start((3, 4), np.random.default_rng(1))
    begun = played(one)

    np.testing.assert_array_equal(played(effect.start((3, 4), np.random.default_rng(1))), begun)
    assert (played(one) != begun).any() == (not isinstance(effect, ALIKE))


@pytest.mark.parametrize("effect", EFFECTS_AT_WORK)
def test_effects_that_spoil_alike_are_equal_also_after_a_way_through_a_pipe(effect):
    assert pickle.loads(pickle.dumps(effect)) == effect
    assert [other == effect for other in EFFECTS_AT_WORK].count(True) == 1


NONE = [
    UniformNoise(0.0),
    GaussianNoise(0.0),
    Tolerance(0.0, 0.0),
    Hysteresis((2.0,), (0.0,)),
    Creep(0.0, 20.0),
    CrossTalk(0.0),
    Temperature(0.0, 0.5, 0.3, spread=0.2, gain=2e-4),
    Temperature(15.0, 0.5, 0.0, spread=0.2),
    FlickerNoise(0.0),
    MainsHum(0.0),
    StrainLimit(Transduction(HalfBridge(substrate_thickness=1e-3)), 0.0),
    StuckElements(()),
    IntermittentElements(()),
]


@pytest.mark.parametrize("effect", NONE)
def test_an_effect_of_no_size_changes_nothing(effect):
    unspoilt = played(lambda curvature, _: curvature)

    spoilt = played(effect.start((3, 4), np.random.default_rng(1)))

    np.testing.assert_allclose(spoilt, unspoilt, rtol=1e-15)


@pytest.mark.parametrize("effect", EFFECTS_AT_WORK)
def test_another_stream_of_random_numbers_changes_only_what_is_drawn_from_it(effect):
    one, other = (played(effect.start((3, 4), np.random.default_rng(n))) for n in (1, 2))

    random = (UniformNoise, GaussianNoise, FlickerNoise, MainsHum, IntermittentElements)
    assert (one != other).any() == isinstance(effect, random)


def test_every_effect_has_a_name_and_a_formula_of_its_own_kind():
    for name, effect in EFFECTS.items():
        assert effect.name == name
        assert effect.formula


NUMBERS = [(kind, name) for kind in EFFECTS.values() for name in parameters(kind)]


@pytest.mark.parametrize(("kind", "parameter"), NUMBERS)
@pytest.mark.parametrize("value", [math.nan, math.inf, -1e300, "1", None, True, 1j, [0.1]])
def test_a_number_out_of_its_range_is_refused_with_range_and_unit(kind, parameter, value):
    told = {name: note.least for name, note in parameters(kind).items()}
    for field in fields(kind):
        if field.name in ("transduction", "elements"):
            told[field.name] = Transduction() if field.name == "transduction" else (0,)
    if kind is FlickerNoise:
        told["high"] = 1.0
    kind(**told)

    with pytest.raises(Refusal) as refused:
        kind(**{**told, parameter: value})

    for part in (kind.name, parameter, str(parameters(kind)[parameter]), f"got {value!r}"):
        assert part in str(refused.value)


def test_a_range_tells_itself_in_words():
    assert str(Within(0, unit="1/m")) == "at least 0 1/m"
    assert str(Within(-200, 200, "K")) == "-200 to 200 K"
    assert str(Within(0, 0.5)) == "0 to 0.5"
    assert str(Within(0, 9, whole=True)) == "0 to 9, a whole number"
    assert 1.5 not in Within(0, 9, whole=True)
    assert np.int32(3) in Within(0, 9, whole=True)
    assert np.float32(3) in Within(0, 9)
    assert 10**400 not in Within(0)
    assert [value in Within(0, 0.5) for value in (0, 0.5, 0.500001, -1e-9)] == [1, 1, 0, 0]


@pytest.mark.parametrize("length", [-1e-3, 11.0, math.nan])
def test_a_length_that_is_none_is_refused_in_metres(length):
    with pytest.raises(Refusal, match=f"gage-length with length of 0 to 10 m, got {length}"):
        GageLength(length)


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
    with pytest.raises(Refusal, match=f"0 to 10000 1/m, got {rms}"):
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
        with pytest.raises(Refusal, match="sd of 0 to"):
            Tolerance(*pair)
