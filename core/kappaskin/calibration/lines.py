"""Readings of many channels on known curvatures to the line through each, with error bars."""

from dataclasses import dataclass

import numpy as np

from kappaskin.frames import Array


@dataclass(frozen=True, eq=False)
class Lines:
    """How well reading = gain * curvature + offset holds, for C channels.

    `gain` has no unit (1 is nominal), `offset` is in 1/m of reading; `gain_sd` and `offset_sd` are
    their standard errors. `rms` is what the fit leaves, and `left_out` what it would leave of a
    reading that it had not seen, both as curvature in 1/m.
    """

    gain: Array
    offset: Array
    gain_sd: Array
    offset_sd: Array
    rms: Array
    left_out: Array


def lines(x: Array, y: Array) -> Lines:
    """The least-squares line through readings `y` (S, C) on curvatures `x` (S,), both in 1/m.

    The reading is fitted to the curvature and the line then read backwards: the cylinders are
    known, the noise is in the reading, and least squares the other way would turn it into a gain
    too small. What is left of an unseen reading is e_i / (1 - h_i), h_i its leverage.
    """
    n = len(x)
    d = x - x.mean()
    Sxx = float(d @ d) or np.nan  # never bent: no line
    gain = d @ y / Sxx
    offset = y.mean(axis=0) - gain * x.mean()
    e = y - offset - np.outer(x, gain)
    sigma = np.sqrt((e**2).sum(axis=0) / (n - 2))
    h = 1 / n + d**2 / Sxx
    scale = np.abs(np.where(gain == 0, np.nan, gain))  # a dead channel has no curvature to tell
    return Lines(
        gain,
        offset,
        sigma / np.sqrt(Sxx),
        sigma * np.sqrt(1 / n + x.mean() ** 2 / Sxx),
        np.sqrt((e**2).mean(axis=0)) / scale,
        np.sqrt(((e / (1 - h[:, None])) ** 2).mean(axis=0)) / scale,
    )
