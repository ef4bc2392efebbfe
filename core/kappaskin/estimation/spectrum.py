"""Amplitude spectrum of readings at any times."""

import numpy as np

from kappaskin.frames import Array

_VANISHING = 1e-9  # of a wave's mean square: a sine of half the rate is zero at even steps


def amplitude_spectrum(times: Array, values: Array, frequencies: Array) -> Array:
    """Amplitudes (..., F) of sines of `frequencies` (F,) in Hz in `values` (..., T), in their unit.

    By least squares at the `times` (T,) in s, after subtraction of the mean: the Lomb-Scargle
    spectrum (doi:10.1007/BF00648343), which needs no even steps.
    """
    centred = values - values.mean(axis=-1, keepdims=True)
    turn = 2 * np.pi * np.multiply.outer(frequencies, times)
    waves = np.cos(turn) + 1j * np.sin(turn)
    # At this shift of time sine and cosine are orthogonal over the times there are.
    twice = np.einsum("ft,ft->f", waves, waves)
    shifted = centred @ waves.T * np.exp(-0.5j * np.angle(twice))
    squares = (len(times) + np.abs(twice)) / 2, (len(times) - np.abs(twice)) / 2
    cosine, sine = (np.where(s > _VANISHING * len(times), s, np.inf) for s in squares)
    return np.hypot(shifted.real / cosine, shifted.imag / sine)
