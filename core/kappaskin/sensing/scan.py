"""Which channels a frame converts, in which order, and when each is read."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from kappaskin.errors import Refusal
from kappaskin.frames import Array


@dataclass(frozen=True, eq=False)
class Scan:
    """One frame's work: `channels` (C,) one after the other, times in s.

    Each takes `settling_time` for what the multiplexer switched to settle, then `conversion_time`;
    the converter holds its input when the conversion begins, so that is when a channel is read.
    """

    channels: NDArray[np.intp]
    settling_time: float
    conversion_time: float

    def __post_init__(self) -> None:
        channels = self.channels
        if channels.ndim != 1 or not channels.size:
            raise Refusal(
                f"expected at least one channel in a row, got an array of shape {channels.shape}; "
                "choose what to scan"
            )
        in_order = np.sort(channels)
        if in_order[0] < 0 or (np.diff(in_order) == 0).any():
            raise Refusal(
                "expected every channel once, counted from 0; got a channel twice or below 0"
            )

    @property
    def interval(self) -> float:
        """Seconds from one channel to the next."""
        return self.settling_time + self.conversion_time

    @cached_property
    def times(self) -> Array:
        """Seconds (C,) from the start of the frame to each channel's reading: the skew."""
        places = np.arange(len(self.channels), dtype=np.float64)
        return self.settling_time + places * self.interval

    @property
    def duration(self) -> float:
        """Seconds from the start of the frame to the end of its last conversion."""
        return len(self.channels) * self.interval

    @property
    def rate(self) -> float:
        """Frames/s when one scan follows the other."""
        return 1 / self.duration
