"""Bad elements: found among good ones, left out, named with the reason; good ones kept."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from kappaskin import (
    LeastSquares,
    Patch,
    Plate,
    PointLoad,
    RankDeficient,
    Refusal,
    Robust,
    SensorLayout,
    SineBasis,
    load_scene,
)
from kappaskin.estimation import FAULTS

pytestmark = pytest.mark.slow

SQUARE = Patch(0.1, 0.1)
TENS = SensorLayout.regular(SQUARE, 10, 10)
EIGHT, TRUE = SineBasis(SQUARE, 8, 8), SineBasis(SQUARE, 15, 15)
NOISE = 0.231
CASES = ("centre", "off-centre", "line")


@cache
def truth(name):
    scene = load_scene(name)
    return scene.plate.deflection(scene.loads, TRUE)


@cache
def exact(name):
    return (TENS.operator(TRUE) @ truth(name).ravel()).reshape(3, -1)


@cache
def robust():
    return Robust(EIGHT, TENS)


def frames(name, count, seed=0):
    return exact(name) + np.random.default_rng(seed).normal(0, NOISE, (count, 3, 100))


def spike(K, bad, rng):
    K[:, bad] += rng.normal(0, 30, (3, len(bad)))


def far_off(K, bad, rng):
    K[:, bad] = rng.choice([-1e6, 1e6], (3, len(bad)))


def stuck(K, bad, rng):
    K[:, bad] = rng.normal(0, 3, (3, len(bad)))


def noisy(K, bad, rng):
    K[:, bad] += rng.normal(0, 10 * NOISE, (3, len(bad)))


def swapped(K, bad, rng):
    K[:, bad[:4]] = K[:, bad[[1, 0, 3, 2]]]


def rms(answer, name):
    off = EIGHT.on_grid(*SQUARE.grid(51, 51))(answer.coefficients)
    off -= TRUE.on_grid(*SQUARE.grid(51, 51))(truth(name))
    return np.sqrt(np.mean(off**2))


@pytest.mark.cases("spike-centre", "swapped-line")
@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("spoil", [spike, far_off, stuck, noisy, swapped])
def test_one_element_in_twenty_bad_costs_no_more_than_one_in_twenty_dead(name, spoil):
    rng = np.random.default_rng(4)
    K = frames(name, 60)
    dead = K.copy()
    for frame, without in zip(K, dead, strict=True):
        bad = rng.choice(100, 5, replace=False)
        spoil(frame, bad, rng)
        without[:, bad[:4] if spoil is swapped else bad] = np.nan

    answer, known = robust()(K), LeastSquares(EIGHT, TENS)(dead)

    assert rms(answer, name) <= 1.2 * rms(known, name)


@pytest.mark.cases("line")
@pytest.mark.parametrize("name", CASES)
def test_good_frames_are_answered_by_plain_least_squares(name):
    K = frames(name, 300)

    answer = robust()(K)

    # One frame in a thousand may have a false alarm.
    assert (answer.suspect > 0).any(axis=1).mean() <= 0.01
    clean = ~(answer.suspect > 0).any(axis=1)
    plain = LeastSquares(EIGHT, TENS)(K[clean])
    np.testing.assert_array_equal(answer.coefficients[clean], plain.coefficients)


def test_the_fine_structure_under_a_load_anywhere_is_no_failure():
    rng, plate = np.random.default_rng(1), Plate(SQUARE)
    M, alarms = TENS.operator(TRUE), 0
    for _ in range(60):
        x, y = rng.uniform(0.008, 0.092, 2)
        c = plate.deflection([PointLoad(x, y, rng.uniform(0.1, 0.5))], TRUE)
        K = (M @ c.ravel()).reshape(3, -1) + rng.normal(0, NOISE, (3, 100))
        alarms += (robust()(K).suspect > 0).any()

    assert alarms <= 2


def test_two_loads_are_no_failure():
    c = Plate(SQUARE).deflection([PointLoad(0.03, 0.03, 0.2), PointLoad(0.07, 0.06, 0.3)], TRUE)
    K = (TENS.operator(TRUE) @ c.ravel()).reshape(3, -1)
    K = K + np.random.default_rng(0).normal(0, NOISE, (60, 3, 100))

    assert (robust()(K).suspect > 0).any(axis=1).mean() <= 0.05


def history_of(spoil, count=40, name="centre"):
    """What a fresh estimator says at last of a load that grows, with elements spoilt by `spoil`."""
    fit = Robust(EIGHT, TENS)
    for t in range(count):
        K = exact(name) * (0.5 + t / count)
        K = K + np.random.default_rng(t).normal(0, NOISE, K.shape)
        spoil(K, t)
        answer = fit(K)
    return answer.suspect


def test_an_element_that_stands_still_while_others_move_is_stuck():
    def spoil(K, t):
        K[:, 44] = 3.0, -2.0, 1.0

    assert FAULTS[history_of(spoil)[44]] == "stuck"


def test_an_element_that_is_off_now_and_then_has_spikes():
    def spoil(K, t):
        if t % 13 == 0:
            K[:, 71] += 20.0

    assert FAULTS[history_of(spoil)[71]] == "spike"


def test_an_element_that_is_off_every_which_way_is_noisy():
    def spoil(K, t):
        K[:, 23] += np.random.default_rng(1000 + t).normal(0, 20, 3)

    assert FAULTS[history_of(spoil)[23]] == "noisy"


def test_an_element_that_is_off_by_the_same_has_an_offset():
    def spoil(K, t):
        K[:, 23] += 6.0

    assert FAULTS[history_of(spoil)[23]] == "offset"


def test_elements_with_their_cables_swapped_are_named_in_the_first_frame():
    K = frames("centre", 1)[0]
    K[:, [44, 12]] = K[:, [12, 44]]

    suspect = Robust(EIGHT, TENS)(K).suspect

    assert np.flatnonzero(suspect).tolist() == [12, 44]
    assert {FAULTS[suspect[12]], FAULTS[suspect[44]]} == {"swapped"}


def test_a_dead_channel_keeps_no_element_from_being_named_stuck_or_swapped():
    live = np.ones((3, 100), bool)
    live[2, [12, 30]] = False
    fit = Robust(EIGHT, replace(TENS, live=live))

    for K in frames("centre", 12):
        K[:, 30] = 3.0, -2.0, 1.0
        K[:, [44, 12]] = K[:, [12, 44]]
        suspect = fit(K).suspect

    assert [FAULTS[suspect[p]] for p in (12, 30, 44)] == ["swapped", "stuck", "swapped"]


def test_on_a_strip_which_has_one_channel_an_element_is_named_stuck():
    strip = Patch(0.1, 0.02, strip=True)
    fit = Robust(SineBasis(strip, 6, 1), SensorLayout.regular(strip, 20, 1))

    for K in np.random.default_rng(0).normal(0, 0.05, (12, 3, 20)):
        K[:, 8] = 7.0
        suspect = fit(K).suspect

    assert FAULTS[suspect[8]] == "stuck"


def test_two_halves_of_a_skin_may_be_read_in_turn():
    fit = Robust(SineBasis(SQUARE, 3, 3), TENS)

    for t, K in enumerate(frames("centre", 12)):
        K[:, 20] = 30.0
        K[:, slice(50) if t % 2 else slice(50, 100)] = np.nan
        assert bool(fit(K).suspect[20]) == (t % 2 == 0)


def test_the_frames_of_a_batch_are_told_of_in_the_order_of_time():
    K = frames("centre", 18)
    K[4:, :, 44] = 3.0, -2.0, 1.0
    K[::8, :, 71] += 20.0
    K[1::3, :, 3] = np.nan
    fit = Robust(EIGHT, TENS)

    batch = Robust(EIGHT, TENS)(K)

    np.testing.assert_array_equal(batch.suspect, [fit(frame).suspect for frame in K])


def test_a_frame_of_a_batch_that_decides_no_shape_is_named():
    K = frames("centre", 3)
    K[0, 0, 0] = K[2, :, 20:] = np.nan

    with pytest.raises(RankDeficient, match=r"^frame 2: .* 60 readings"):
        Robust(EIGHT, TENS)(K)


def test_a_skin_at_rest_is_no_frame_of_the_past():
    fit, other = Robust(EIGHT, TENS), Robust(EIGHT, TENS)
    fit.at_rest()

    for K in frames("centre", 6):
        K[:, 23] += 6.0
        told, same = fit(K).suspect[23], other(K).suspect[23]

        assert told == same


def test_a_past_of_other_elements_is_refused():
    with pytest.raises(Refusal, match=r"_history.frames of shape \(T, 7, 100\) to go on from"):
        Robust(EIGHT, TENS).restore({"_history.frames": np.zeros((3, 7, 99))})


def test_a_suspect_is_missing_from_what_the_fit_rests_on():
    K = frames("centre", 1)[0]
    K[:, 30] = 40.0

    answer = Robust(EIGHT, TENS)(K)

    assert np.isnan(answer.residual[:, 30]).all()
    assert np.isfinite(np.delete(answer.residual, 30, axis=1)).all()
    assert answer.steps > 0


def test_where_few_elements_are_read_a_bad_one_is_found_among_them():
    few = np.arange(0, 100, 5)
    K = np.full((3, 100), np.nan)
    K[:, few] = frames("centre", 1)[0][:, few]
    fit = Robust(SineBasis(SQUARE, 3, 3), TENS)

    assert not fit(K).suspect.any()
    K[:, 45] = 60.0
    assert np.flatnonzero(fit(K).suspect).tolist() == [45]


def test_where_most_contradict_each_other_none_is_left_out_and_it_says_so():
    K = exact("centre").copy()
    wrong = np.random.default_rng(0).permutation(100)[:60]
    K[:, wrong] = K[:, np.random.default_rng(1).permutation(wrong)] * 20

    answer = Robust(EIGHT, TENS, NOISE)(K)

    assert not answer.converged
    assert not answer.suspect.any()
    np.testing.assert_array_equal(
        answer.coefficients, LeastSquares(EIGHT, TENS, NOISE)(K).coefficients
    )


def test_readings_that_are_missing_are_not_suspected():
    K = frames("off-centre", 1)[0]
    K[:, [3, 4]] = np.nan
    K[1, 60] = np.inf
    K[:, 44] = 25.0

    suspect = Robust(EIGHT, TENS)(K).suspect

    assert np.flatnonzero(suspect).tolist() == [44]


FEW = ["flat-hinged", "flat-clamped", "long-clamped", "bent-hinged", "disk-clamped", "L-hinged"]


@pytest.mark.where(which=lambda held: str(held) in FEW)
def test_a_bad_element_is_found_on_every_skin(held_skin):
    patch, basis = held_skin.patch, held_skin.basis(6, 5)
    layout = SensorLayout.regular(patch, 10, 10)
    c = Plate(patch).deflection([PointLoad(*patch.inward(0.4 * patch.a, 0.45 * patch.b))], basis)
    K = (layout.operator(basis) @ c.ravel()).reshape(3, -1)
    K = 5 * K / np.abs(K).max() + np.random.default_rng(0).normal(0, 0.05, K.shape)
    fit, bad = Robust(basis, layout), len(layout) // 3

    assert not fit(K).suspect.any()
    K[:, bad] += 3.0
    assert np.flatnonzero(fit(K).suspect).tolist() == [bad]
