"""What happens to bytes under way."""

from dataclasses import dataclass

import numpy as np

from kappaskin.sources import wire
from kappaskin.studies.drills.uart import heard

_BURST = 64  # bytes, the mean of a burst of garbage
_KIND = 3  # where a message says of which kind it is


@dataclass
class Garbage:
    """Bursts of noise in the place of `share` of the bytes, or as many between them, at random."""

    share: float
    rng: np.random.Generator

    def __call__(self, data: bytes) -> bytes:
        spoilt = bytearray(data)
        for _ in range(self.rng.poisson(self.share * len(data) / _BURST)):
            length = int(self.rng.geometric(1 / _BURST))
            at = int(self.rng.integers(len(spoilt) + 1))
            over = length if self.rng.random() < 0.5 else 0
            spoilt[at : at + over] = self.rng.bytes(length)
        return bytes(spoilt)


@dataclass
class Flips:
    """One bit in `every` so many turned over, at random."""

    every: int
    rng: np.random.Generator

    def __call__(self, data: bytes) -> bytes:
        spoilt = bytearray(data)
        for place in self.rng.integers(
            8 * len(data), size=self.rng.poisson(8 * len(data) / self.every)
        ):
            spoilt[place // 8] ^= 1 << (place % 8)
        return bytes(spoilt)


@dataclass
class Cut:
    """Every second scan is broken off, one byte later each time; `cuts` counts them."""

    cuts: int = 0
    length: int = 1
    whole: bool = True

    def __call__(self, data: bytes) -> bytes:
        if data[_KIND] != wire.MessageKind.SAMPLES:
            return data
        self.whole, self.length = not self.whole, len(data)
        if self.whole:
            return data
        self.cuts += 1
        return data[: (self.cuts - 1) % len(data)]


@dataclass
class OtherRate:
    """The line is read at another baud rate than it is sent at."""

    sent_at: float
    read_at: float

    def __call__(self, data: bytes) -> bytes:
        return heard(data, self.sent_at, self.read_at)
