"""What every element read in the last seconds, as often as the window took it."""

import numpy as np
from numpy.typing import NDArray

from kappaskin import Estimate

Array = NDArray[np.float64]

SECONDS = 10.0
"""How far back it reaches."""
_LEAST = 0.01  # s between two that are kept


class Past:
    """The readings of the newest estimates, written round and round."""

    def __init__(self) -> None:
        count = round(SECONDS / _LEAST) + 1
        self._times = np.full(count, np.nan)
        self._read: NDArray[np.float32] = np.empty((count, 3, 0), np.float32)
        self._next, self._last = 0, -np.inf

    def take(self, estimate: Estimate) -> None:
        """Keep the readings of one estimate, unless the last one was only just kept."""
        now, elements = estimate.device_time, estimate.curvature.shape[1]
        if self._read.shape[2] != elements or now < self._last:
            self.forget(elements)  # another sensor, or one that began anew
        if now - self._last >= _LEAST:
            self._times[self._next], self._read[self._next] = now, estimate.curvature
            self._next, self._last = (self._next + 1) % len(self._times), now

    def forget(self, elements: int) -> None:
        """Begin anew with so many `elements`."""
        self._times[:] = np.nan
        self._read = np.full((len(self._times), 3, elements), np.nan, np.float32)
        self._next, self._last = 0, -np.inf

    def of(self, elements: list[int]) -> tuple[Array, Array]:
        """Times (T,) in s before the newest, upwards, and readings (T, 3, k) of k `elements`."""
        order = np.roll(np.arange(len(self._times)), -self._next)
        order = order[self._times[order] > self._last - SECONDS]
        return self._times[order] - self._last, self._read[order][:, :, elements].astype(float)
