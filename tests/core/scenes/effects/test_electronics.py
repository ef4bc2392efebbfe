"""What gages and electronics do to readings: closed forms, spectra, steps and rails."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter, welch

from kappaskin import Refusal, Transduction
from kappaskin.scenes.effects import Quantisation, Saturation, StrainLimit, Temperature
from kappaskin.scenes.effects.electronics import CrossTalk, FlickerNoise, MainsHum
from kappaskin.sensing import Amplifier, Converter, HalfBridge


def started(effect, shape=(12,), seed=0):
    return effect.start(shape, np.random.default_rng(seed))


def read(effect, times, shape=(12,), seed=0, curvature=0.0):
    """What a skin that stays as it is reads at `times` (T,), (T, *shape)."""
    running = started(effect, shape, seed)
    return np.array([running(np.full(shape, curvature), float(t)) for t in times])


# Cross-talk


@given(st.floats(0, 0.5), st.integers(1, 60), st.integers(0, 2**32 - 1))
def test_cross_talk_is_one_capacitor_that_goes_round_all_channels_of_all_frames(share, C, seed):
    frames = np.random.default_rng(seed).uniform(-80, 80, (5, C))
    running = started(CrossTalk(share), (C,))

    spoilt = np.array([running(frame, 0.0) for frame in frames])

    # In a row: y_c - s y_(c-1) = (1 - s) x_c, from rest.
    expected = lfilter([1 - share], [1, -share], frames.ravel()).reshape(5, C)
    np.testing.assert_allclose(spoilt, expected, atol=1e-12)


def test_a_channel_keeps_a_share_of_the_one_before_it_and_hands_on_the_share_of_that():
    x = np.zeros(12)
    x[3], running = 50.0, started(CrossTalk(0.1))
    np.testing.assert_allclose(running(x, 0.0)[2:6], [0, 45, 4.5, 0.45], atol=1e-12)


def test_the_first_channel_keeps_of_the_last_one_of_the_frame_before():
    running = started(CrossTalk(0.1), (3, 4))
    x = np.zeros((3, 4))
    x[2, 3] = 50.0
    running(x, 0.0)

    then = running(np.zeros((3, 4)), 0.1)

    np.testing.assert_allclose(then.ravel()[:3], [4.5, 0.45, 0.045])


# Temperature

WARMING = Temperature(20.0, 5.0, 0.4, spread=0.25, gain=3e-4, seed=2)


def test_a_skin_that_warms_reads_apparent_curvature_that_approaches_its_end():
    warmer = 20 * (1 - np.exp(-np.array([0.0, 1.0, 5.0, 1e9]) / 5))
    o = 0.4 * (1 + 0.25 * np.random.default_rng(2).normal(size=12))

    spoilt = read(WARMING, [0.0, 1.0, 5.0, 1e9], curvature=30.0)

    expected = 30 * (1 + 3e-4 * warmer[:, None]) + np.outer(warmer, o)
    np.testing.assert_allclose(spoilt, expected, rtol=1e-12)


def test_before_a_scene_begins_nothing_is_warm():
    np.testing.assert_array_equal(read(WARMING, [-3.0, 0.0], curvature=30.0), 30.0)


def test_the_spread_belongs_to_the_skin():
    one, same, other = (
        read(replace(WARMING, seed=skin), [9.0], seed=run) for skin, run in ((2, 0), (2, 1), (3, 0))
    )
    np.testing.assert_array_equal(one, same)
    assert (one != other).all()
    assert WARMING.offsets((100_000,)).std() == pytest.approx(0.1, rel=0.02)


# Noise with a spectrum

RATE, FRAMES = 200.0, 2**16
FLICKER = FlickerNoise(0.3, low=0.02, high=50.0)


def drawn(effect, shape, frames=FRAMES, rate=RATE, seed=3):
    running, rest = started(effect, shape, seed), np.zeros(shape)
    return np.array([running(rest, n / rate) for n in range(frames)])


@pytest.fixture(scope="module")
def flicker():
    """(T, 12)."""
    return drawn(FLICKER, (12,))


def spectrum(noise, bands):
    """Power per Hz at geometric means of `bands` in Hz, of all channels."""
    f, power = welch(noise, RATE, nperseg=2**14, axis=0)
    mean = power.mean(axis=1)
    return np.array([mean[(f >= low) & (f < high)].mean() for low, high in bands])


OCTAVES = [(0.1 * 2**k, 0.2 * 2**k) for k in range(8)]


def test_flicker_noise_falls_as_1_over_f_inside_its_band(flicker):
    f = np.sqrt([low * high for low, high in OCTAVES])
    power = spectrum(flicker, OCTAVES)

    slope = np.polyfit(np.log(f), np.log(power), 1)[0]

    assert slope == pytest.approx(-1.0, abs=0.05)
    # A mean of 1/f over an octave from f/sqrt(2) to f sqrt(2) is 0.98 of that in its middle.
    level = 0.3**2 / math.log(50.0 / 0.02)
    np.testing.assert_allclose(power * f, level, rtol=0.2)


def test_the_rms_of_flicker_noise_is_that_of_all_of_its_band():
    # Of independent channels: one moment is enough.
    at_once = read(FLICKER, [0.0, 3.0], shape=(40_000,), seed=5)
    np.testing.assert_allclose(at_once.std(axis=1), 0.3, rtol=0.02)
    np.testing.assert_allclose(at_once.mean(axis=1), 0.0, atol=0.01)


def test_flicker_noise_keeps_its_power_at_any_pace_of_frames():
    running, x = started(FLICKER, (20_000,), 6), np.zeros(20_000)
    time = 0.0
    for pause in (1e-4, 1e-4, 0.02, 7.0, 1e-3, 1e6, 0.0, -5.0, 0.01):
        time += pause
        assert running(x, time).std() == pytest.approx(0.3, rel=0.03)


def test_frames_one_after_the_other_share_most_of_the_noise():
    running, x = started(FLICKER, (20_000,), 7), np.zeros(20_000)
    now, next_one = running(x, 0.0), running(x, 1e-4)

    # The autocorrelation of the parts: each keeps exp(-2 pi f_k t).
    kept = np.mean(np.exp(-2 * math.pi * np.array(FLICKER.corners[:1]) * 1e-4))
    shared = np.corrcoef(now, next_one)[0, 1]
    assert 1 - shared < 1 - kept
    assert now.std() > 10 * (next_one - now).std()


def test_corners_are_spread_evenly_over_the_band():
    corners = np.array(FLICKER.corners)
    ratio = corners[:-1] / corners[1:]
    np.testing.assert_allclose(ratio, ratio[0])
    assert 2 <= ratio[0] <= 4
    assert corners[0] * corners[-1] == pytest.approx(0.02 * 50)
    assert len(FlickerNoise(0.3, 1.0, 2.0).corners) == 1


@pytest.mark.parametrize("band", [(1.0, 1.0), (2.0, 1.0)])
def test_a_band_that_is_none_is_refused(band):
    with pytest.raises(Refusal, match=r"from a low to a higher frequency, got \d to 1 Hz"):
        FlickerNoise(0.3, *band)


# Hum


def test_hum_is_one_line_in_the_spectrum_of_the_amplitude_asked_for():
    rate = 500.0
    hum = drawn(MainsHum(0.4, 60.0), (3, 4), 500, rate)

    lines = np.abs(np.fft.rfft(hum, axis=0)) * 2 / 500

    np.testing.assert_allclose(lines[60], 0.4, rtol=1e-9)
    assert np.delete(lines, 60, axis=0).max() < 1e-9
    assert np.ptp(hum, axis=(1, 2)).max() == 0


def test_the_phase_of_hum_is_drawn_evenly_for_each_seed():
    first = np.array([read(MainsHum(1.0), [0.0], (1,), seed)[0, 0] for seed in range(400)])
    assert first.mean() == pytest.approx(0, abs=4 * math.sqrt(0.5 / 400))
    assert (first**2).mean() == pytest.approx(0.5, abs=4 * math.sqrt(1 / 8 / 400))


# Steps and rails

CONVERTERS = [
    Transduction(),
    Transduction(HalfBridge(gage_mismatch=1e-3), converter=Converter(bits=8, offset=0.3)),
    Transduction(amplifier=Amplifier(gain=400.0, rail=1.2), converter=Converter(12, 2.0, -0.2)),
]
CURVATURE = np.concatenate(
    [np.linspace(-200, 200, 30_001), np.random.default_rng(0).normal(0, 5, 30_000)]
)
every_converter = pytest.mark.parametrize("electronics", CONVERTERS)


def middles(electronics):
    """Curvature in the middle between two counts, as nearly as it can be told."""
    counts = np.arange(-100, 100) + 0.5
    return counts * electronics.resolution - electronics.offset / electronics.sensitivity


@every_converter
def test_counts_are_the_same_of_what_was_quantised_before(electronics):
    x = np.concatenate([CURVATURE, middles(electronics)])
    quantised = started(Quantisation(electronics), x.shape)(x, 0.0)

    counts = electronics.counts(x)
    np.testing.assert_array_equal(electronics.counts(quantised), counts)
    assert np.abs(quantised - x).max() <= electronics.resolution / 2 * (1 + 1e-6)
    inside = ~electronics.saturated(counts)
    np.testing.assert_array_equal(quantised[inside], electronics.curvature(counts)[inside])


@every_converter
def test_counts_are_the_same_of_what_was_clipped_before(electronics):
    clipped = started(Saturation(electronics), CURVATURE.shape)(CURVATURE, 0.0)

    counts = electronics.counts(CURVATURE)
    low, high = electronics.limits
    np.testing.assert_array_equal(electronics.counts(clipped), counts)
    inside = ~electronics.saturated(counts)
    np.testing.assert_array_equal(clipped[inside], CURVATURE[inside])
    volts = electronics.sensitivity * np.array([clipped.min(), clipped.max()]) + electronics.offset
    assert volts / electronics.converter.step == pytest.approx([low, high], abs=1e-6)
    assert not inside.all()


# Strain limit

LIMIT = StrainLimit(Transduction(HalfBridge(substrate_thickness=975e-6)), 0.3)


def way(*curvature):
    running = started(LIMIT, (1,))
    return [running(np.array([float(x)]), 0.0)[0] for x in curvature]


def test_the_limit_is_that_of_one_percent_strain():
    assert LIMIT.limit == pytest.approx(20.0)
    assert StrainLimit(Transduction(), 0.3).limit == pytest.approx(80.0)


def test_below_the_limit_nothing_shifts():
    assert way(0, 20, -20, 20, 0) == pytest.approx([0, 20, -20, 20, 0])


def test_beyond_the_limit_the_zero_shifts_by_a_share_of_the_excess_and_stays():
    assert way(0, 35, 0, 20, 30, 0) == pytest.approx([0, 35 + 4.5, 4.5, 24.5, 34.5, 4.5])


def test_further_bending_shifts_it_further_and_bending_back_beyond_the_limit_less():
    assert way(35, 38, 0) == pytest.approx([39.5, 38 + 5.4, 5.4])
    # 35 left an excess of 15; -10 is farther than the limit below it.
    assert way(35, -10, 0) == pytest.approx([39.5, -10 + 3, 3])
    assert way(35, -35, 0) == pytest.approx([39.5, -39.5, -4.5])
