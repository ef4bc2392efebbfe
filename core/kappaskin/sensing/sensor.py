"""Sensor description: skin, elements, electronics, and the scan of its channels."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kappaskin.errors import Refusal
from kappaskin.frames import Array, Frame, Mask
from kappaskin.mechanics import Plate
from kappaskin.sensing.layout import SHOWN_UNITS, SensorLayout
from kappaskin.sensing.transduction import DigitalReadings, Transduction


@dataclass(frozen=True, eq=False)
class Scan:
    """The scan of one frame: `channels` (C,) one after the other, times in s.

    Each channel takes `settling_time` after the multiplexer has switched, then `conversion_time`;
    the converter holds its input when the conversion begins: that is when the channel is read.
    """

    channels: NDArray[np.intp]
    settling_time: float
    conversion_time: float

    def __post_init__(self) -> None:
        channels = self.channels
        if channels.ndim != 1 or not channels.size:
            raise Refusal(
                f"expected at least one channel in a row, got an array of shape {channels.shape}; "
                "select channels to scan"
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
        """Frame rate in 1/s when one scan follows the other; infinite where none takes time."""
        return 1 / self.duration if self.duration else math.inf


@dataclass(frozen=True, eq=False)
class Sensor:
    """A sensor, real or simulated: skin, boundary condition `edge`, elements and electronics.

    `rate` in frames/s, infinite where the device decides it. One with a line format of its own has
    the text of its `description`. Channel c of the device is number `channel_map[c]` of the
    readings of a frame, flattened, a permutation (C,); None means the same order.
    """

    layout: SensorLayout
    transduction: Transduction | DigitalReadings
    plate: Plate
    edge: str
    rate: float
    name: str
    serial_number: str
    firmware: str
    simulated: bool
    channel_map: NDArray[np.intp] | None = None
    description: str = ""

    def __post_init__(self) -> None:
        self.transduction.check(self.layout)
        if self.plate.patch != self.layout.patch:
            raise Refusal(
                f"the elements are on {self.layout.patch}, the plate on {self.plate.patch}; use one"
            )
        wired = self.channel_map
        if wired is not None and not np.array_equal(np.sort(wired), np.arange(self.channels)):
            raise Refusal(
                f"expected a channel map with each number from 0 to {self.channels - 1} "
                f"once, got {len(wired)} numbers"
            )
        scan_time = self.transduction.scan_time(self.channels)
        if scan_time and not 0 < self.rate <= 1 / scan_time * (1 + 1e-9):
            raise Refusal(
                f"{self.channels} channels at {self.transduction.channel_time * 1e6:g} us take "
                f"{scan_time * 1e3:.3g} ms: expected a rate of at most {1 / scan_time:.1f} "
                f"frames/s, got {self.rate:g}; lower the rate or the conversion time"
            )

    @property
    def channels(self) -> int:
        return self.layout.channels

    def scan(self, channels: ArrayLike | None = None) -> Scan:
        """The scan of `channels` (C,) in this order; None means all of them."""
        every = np.arange(self.channels)
        chosen = every if channels is None else np.asarray(channels)
        if chosen.size and not (chosen.dtype.kind in "iu" and chosen.max() < self.channels):
            raise Refusal(
                f"expected channels from 0 to {self.channels - 1}, got {channels!s:.80}; channel "
                "kind * P + element is one reading"
            )
        electronics = self.transduction
        return Scan(
            chosen.astype(np.intp),
            electronics.settling_time,
            electronics.conversion_time,
        )

    @property
    def noise(self) -> float:
        """Given standard deviation of readings that are alike in it; NaN where none is given."""
        given = {noise for _, noise in self.transduction.noise}
        return given.pop() if len(given) == 1 and self.sigma is None and all(given) else math.nan

    @property
    def sigma(self) -> Array | None:
        """Standard deviation of each reading (R,), where they differ in unit or in noise.

        Else None, and the noise is estimated. A `Refusal` where the sensor does not state it.
        """
        return self.layout.sigma(self.transduction.noise)

    @property
    def noise_unit(self) -> tuple[float, str]:
        """How the noise of a reading is shown: by how many times a unit, and its name."""
        if self.sigma is None:
            return SHOWN_UNITS[self.layout.kind_units[0]]
        return 1.0, "times that stated"

    @cached_property
    def _dead(self) -> Mask | None:
        return None if self.layout.live.all() else ~self.layout.live.ravel()

    def nominal(self, frame: Frame) -> Array:
        """Readings (C,), curvature by Eq. 8; NaN where dead, not scanned or on a rail."""
        flat = np.empty(self.channels)
        flat.fill(np.nan)
        flat[frame.channels] = self.transduction.curvature(frame.counts)
        if self._dead is not None:
            flat[self._dead] = np.nan
        return flat
