"""Readings at any times to how much of each frequency is in them."""

import numpy as np

from kappaskin.frames import Array

_ROUNDING = 1e-9  # of a wave's mean square: a sine of half the rate is zero at even steps


def amplitudes(times: Array, values: Array, frequencies: Array) -> Array:
    """The amplitude (..., F) of a sine of each of `frequencies` (F,) in Hz that fits best.

    To `values` (..., T) at `times` (T,) in s, less their mean, by least squares: Lomb's and
    Scargle's spectrum (doi:10.1007/BF00648343), which needs no even steps.
    """
    centred = values - values.mean(axis=-1, keepdims=True)
    turn = 2 * np.pi * np.multiply.outer(frequencies, times)
    # At this shift of time sine and cosine are orthogonal over the times there are.
    shift = np.arctan2(np.sin(2 * turn).sum(axis=1), np.cos(2 * turn).sum(axis=1)) / 2
    turn -= shift[:, None]
    return np.hypot(*(_fitted(wave, centred) for wave in (np.cos(turn), np.sin(turn))))


def _fitted(waves: Array, values: Array) -> Array:
    """How much (..., F) of each of `waves` (F, T) is in `values` (..., T); none of a zero one."""
    power = np.vecdot(waves, waves)
    return values @ waves.T / np.where(power > _ROUNDING * waves.shape[1], power, np.inf)
