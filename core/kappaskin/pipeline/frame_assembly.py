"""Partial scans to whole frames: what was not scanned keeps its last reading, for a while."""

import math

import numpy as np

from kappaskin._state import Remembering
from kappaskin.errors import Refusal
from kappaskin.frames import OVERTAKEN, Array, Frame, Mask


class Hold(Remembering):
    """Holds the last reading of each of `channels` until it is `age` s old on the device's clock.

    A channel that was scanned is never filled in: on a rail it has no reading, however fresh the
    last one. A clock that went back, as of a device that restarted, holds nothing from before.
    """

    REMEMBERED = ("_values", "_times")

    def __init__(self, channels: int, age: float) -> None:
        if not (math.isfinite(age) and age >= 0):
            raise Refusal(f"expected readings to be held for at least 0 s, got {age}")
        self._age = age
        self._values = np.full(channels, np.nan)
        self._times = np.full(channels, -np.inf)
        self._listed, self._listed_whole = np.empty(0, np.intp), False

    def is_whole(self, frame: Frame) -> bool:
        """Whether every channel was read; scans of one list share it, so it is seldom counted."""
        if frame.channels is not self._listed:
            counts = np.bincount(frame.channels, minlength=len(self._values))
            self._listed, self._listed_whole = frame.channels, bool((counts == 1).all())
        return self._listed_whole

    def __call__(self, frame: Frame, curvature: Array) -> tuple[Array, Mask]:
        """The `curvature` (3, P) of `frame` with held readings, and which of it is fresh (3, P)."""
        flat = curvature.ravel()
        if self.is_whole(frame):
            np.copyto(self._values, flat)
            self._times.fill(frame.device_time)
            return curvature, np.isfinite(curvature)
        self._times[self._times > frame.device_time + OVERTAKEN] = -np.inf
        self._values[frame.channels] = flat[frame.channels]
        self._times[frame.channels] = frame.device_time
        age = frame.device_time - self._times
        known = (age >= 0) & (age < self._age)
        held = np.where(known, self._values, flat)
        return held.reshape(curvature.shape), np.isfinite(curvature)
