"""A spectrum tells the waves that readings were made of, at whatever times they came."""

import numpy as np
import pytest

from kappaskin_app.features.traces.selected_element import amplitude_spectrum

FREQUENCIES = np.arange(1, 200) * 0.25


@pytest.mark.parametrize("even", [True, False])
def test_a_wave_has_its_amplitude_at_its_frequency_and_none_far_from_it(even: bool) -> None:
    random = np.random.default_rng(3)
    times = np.linspace(0, 10, 1000, endpoint=False)
    times = times if even else np.sort(random.uniform(0, 10, 1000))
    values = 5.0 + np.stack([0.7 * np.sin(2 * np.pi * 12 * times + 0.3), 0 * times])
    found = amplitude_spectrum(times, values, FREQUENCIES)
    assert found.shape == (2, len(FREQUENCIES))
    assert FREQUENCIES[np.argmax(found[0])] == 12
    assert found[0].max() == pytest.approx(0.7, rel=0.05)
    assert np.median(found[0]) < 0.05
    assert found[1].max() < 1e-12


def test_noise_is_spread_over_all_frequencies() -> None:
    random = np.random.default_rng(4)
    times = np.sort(random.uniform(0, 10, 2000))
    found = amplitude_spectrum(times, random.normal(0, 0.3, 2000), FREQUENCIES)
    # Of white noise the squared amplitudes are 4 sd^2 / T in the mean.
    assert np.mean(found**2) == pytest.approx(4 * 0.3**2 / 2000, rel=0.25)


def test_each_amplitude_is_that_of_the_sine_that_least_squares_fits() -> None:
    random = np.random.default_rng(5)
    times, frequencies = np.sort(random.uniform(0, 10, 300)), np.array([0.07, 1.3, 9.0])
    values = random.normal(0, 1.0, (2, 300))

    found = amplitude_spectrum(times, values, frequencies)

    for number, frequency in enumerate(frequencies):
        turn = 2 * np.pi * frequency * times
        waves = np.stack([np.cos(turn), np.sin(turn)], axis=1)
        fitted, *_ = np.linalg.lstsq(waves, (values - values.mean(axis=1, keepdims=True)).T)
        np.testing.assert_allclose(found[:, number], np.hypot(*fitted), rtol=1e-9)


def test_a_sine_of_half_the_rate_that_is_zero_at_every_step_is_none() -> None:
    times, values = np.arange(64.0), np.cos(np.pi * np.arange(64.0))
    assert amplitude_spectrum(times, values, np.array([0.5])) == pytest.approx([1.0])
