"""A spectrum tells the waves that readings were made of, at whatever times they came."""

import numpy as np
import pytest

from kappaskin import amplitudes

FREQUENCIES = np.arange(1, 200) * 0.25


@pytest.mark.parametrize("even", [True, False])
def test_a_wave_has_its_amplitude_at_its_frequency_and_none_far_from_it(even: bool) -> None:
    random = np.random.default_rng(3)
    times = np.linspace(0, 10, 1000, endpoint=False)
    times = times if even else np.sort(random.uniform(0, 10, 1000))
    values = 5.0 + np.stack([0.7 * np.sin(2 * np.pi * 12 * times + 0.3), 0 * times])
    found = amplitudes(times, values, FREQUENCIES)
    assert found.shape == (2, len(FREQUENCIES))
    assert FREQUENCIES[np.argmax(found[0])] == 12
    assert found[0].max() == pytest.approx(0.7, rel=0.05)
    assert np.median(found[0]) < 0.05
    assert found[1].max() < 1e-12


def test_noise_is_spread_over_all_frequencies() -> None:
    random = np.random.default_rng(4)
    times = np.sort(random.uniform(0, 10, 2000))
    found = amplitudes(times, random.normal(0, 0.3, 2000), FREQUENCIES)
    # Of white noise the squared amplitudes are 4 sd^2 / T in the mean.
    assert np.mean(found**2) == pytest.approx(4 * 0.3**2 / 2000, rel=0.25)
