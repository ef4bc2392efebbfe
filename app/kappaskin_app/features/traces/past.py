"""What every element read in the last seconds, in every frame that was computed."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SECONDS = 10.0
"""How far back it reaches."""
_LEAST = 0.002  # s between two that are kept
_ROUNDING = 1e-6  # of a step: frames at just that rate are all kept
_LARGEST = 24e6  # bytes: of a large skin they are kept farther apart


class Past:
    """Readings as they come, written round and round."""

    def __init__(self) -> None:
        self.forget(0)

    def forget(self, elements: int) -> None:
        """Begin anew with so many `elements`."""
        self._least = max(_LEAST, SECONDS * 12 * elements / _LARGEST)
        count = round(SECONDS / self._least) + 1
        self._times = np.full(count, np.nan)
        self._read: NDArray[np.float32] = np.empty((count, 3, elements), np.float32)
        self._next, self._last = 0, -np.inf

    def take(self, times: Array, readings: Array) -> None:
        """Keep `readings` (T, 3, P) in 1/m at `times` (T,) in s, those not too near to another."""
        elements = readings.shape[2]
        for time, read in zip(times.tolist(), readings, strict=True):
            if elements != self._read.shape[2] or time < self._last:
                self.forget(elements)  # another sensor, or one that began anew
            if time - self._last >= (1 - _ROUNDING) * self._least:
                self._times[self._next], self._read[self._next] = time, read
                self._next, self._last = (self._next + 1) % len(self._times), time

    def of(self, elements: list[int]) -> tuple[Array, Array]:
        """Times (T,) in s before the newest, upwards, and readings (T, 3, k) of k `elements`."""
        order = np.roll(np.arange(len(self._times)), -self._next)
        order = order[self._times[order] > self._last - SECONDS]
        read = self._read[order[:, None], :, np.asarray(elements, np.intp)]
        return self._times[order] - self._last, read.swapaxes(1, 2).astype(float)
