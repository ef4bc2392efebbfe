"""Counts, frame after frame, to what a quarter of a second of them says of every channel."""

import math
from dataclasses import dataclass
from typing import cast

import numpy as np

from kappaskin.frames import Array, Frame
from kappaskin.sensing import Sensor

_LONG = 0.25  # s at least
_AT_ONCE = 3000  # channels that are looked at so often; more as much less often
_MOST = 64  # frames that are kept of it, evenly
_FEWEST = 8  # frames, whose differences tell the noise
_PARTS = 4  # that are averaged, each by itself


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """What C channels read for `seconds` that ended at `time` on the host's clock.

    `means` (T, C) in 1/m of each part of it, of so many `frames`; NaN where a channel was not read
    or on a rail. `noise` (C,) in 1/m from one frame to the next, NaN where it cannot be told;
    `railed` (C,) the share of the readings that were on a rail, NaN where there were none.
    """

    time: float
    seconds: float
    means: Array
    frames: float
    noise: Array
    railed: Array


class Window:
    """Takes every frame, keeps some, and looks at them four times a second at most.

    Of a skin with more than 3000 channels as much less often, so that looking costs no more.
    """

    def __init__(self, sensor: Sensor) -> None:
        self._chain = sensor.transduction
        self._rest = float(self._chain.curvature(np.zeros(1, np.int32))[0])
        self._long = _LONG * max(1.0, sensor.channels / _AT_ONCE)
        # Typed as float64: in float32 counts are exact up to 24 bits.
        counts = np.empty((_MOST, sensor.channels), np.float32)
        self._counts = cast("Array", counts)
        self._taken, self._begun, self._due = 0, -math.inf, -math.inf

    def __call__(self, frame: Frame) -> Look | None:
        """What the last quarter of a second says, where it ends with `frame`."""
        time = frame.device_time
        if time < self._begun:  # the clock of a device that began anew
            self._taken, self._due = 0, time
        if time < self._due:
            if self._taken and len(frame.channels) < self._counts.shape[1]:
                # Or of channels that take turns the same would be passed over every time.
                self._counts[self._taken - 1, frame.channels] = frame.counts
            return None
        if not self._taken:
            self._begun = time
        self._due = time + self._long / _MOST
        row = self._counts[self._taken]
        if len(frame.channels) < len(row):
            row[:] = np.nan
        row[frame.channels] = frame.counts
        self._taken += 1
        seconds = time - self._begun
        if self._taken < _MOST and (self._taken < _FEWEST or seconds < self._long):
            return None
        look = self._looked(self._counts[: self._taken], seconds, frame.host_time)
        self._taken = 0
        return look

    def _looked(self, counts: Array, seconds: float, time: float) -> Look:
        low, high = self._chain.limits
        read, rails = ~np.isnan(counts), (counts <= low) | (counts >= high)
        starts = np.linspace(0, len(counts), _PARTS, endpoint=False).astype(int)

        def summed(values: Array) -> Array:
            return np.add.reduceat(values, starts, axis=0, dtype=float)

        with np.errstate(invalid="ignore", divide="ignore"):  # of none comes NaN
            means = summed(np.where(read, counts, 0.0)) / summed(read.astype(float))
            railed = rails.sum(axis=0) / read.sum(axis=0)
        means[summed(rails.astype(float)) > 0] = np.nan
        curvature = means * self._chain.resolution + self._rest
        noise = _noise(counts) * self._chain.resolution
        return Look(time, seconds, curvature, len(counts) / _PARTS, noise, railed)


def _noise(counts: Array) -> Array:
    """Standard deviations (C,) of white noise with second differences such as `counts` (n, C)."""
    bends = (counts[2:] - 2 * counts[1:-1] + counts[:-2]).astype(float) ** 2
    known = ~np.isnan(bends)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.sqrt(np.where(known, bends, 0.0).sum(axis=0) / known.sum(axis=0) / 6)
