"""What a skin reads when nothing touches it, as the zero that every frame is read from."""

from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from typing import Any

import numpy as np

from kappaskin.calibration.calibration import digest, fingerprint
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.sensing import Sensor

_MOST_CHANNELS = 2**16  # whose numbers the engine can tell with every status


@dataclass(frozen=True, eq=False)
class Tare:
    """What each of C channels of one device read at rest: `offset` (C,) in 1/m of Eq. 8.

    It is an offset of the reading, before gain, creep and loops are undone, because what wanders is
    the bridge and the amplifier: the same shift of the voltage whatever the skin does. Loops are
    then entered where they were when they were calibrated; a shift taken off behind them would be
    one that depends on how far the skin is bent. In a calibrated skin it stands in for the
    calibration's own offset, and what the loops still hold of earlier bends is not in it.

    `offset_sd` (C,) are standard errors; both are NaN where a channel read nothing. `layout` is the
    `fingerprint` of the skin, `temperature` in degrees Celsius or None. It was taken at `date` from
    `frames` frames over `seconds`. Tares of the same content are equal.
    """

    name: str
    serial_number: str
    layout: str
    date: datetime
    temperature: float | None
    frames: int
    seconds: float
    offset: Array
    offset_sd: Array

    def __post_init__(self) -> None:
        if self.date.utcoffset() is None:
            raise Refusal(f"expected a date with its time zone, got {self.date}")
        shape = self.offset.shape
        if len(shape) != 1 or self.offset_sd.shape != shape or not 0 < len(self) <= _MOST_CHANNELS:
            raise Refusal(
                f"expected an offset and its error for each of 1 to {_MOST_CHANNELS} channels, got "
                f"shapes {shape} and {self.offset_sd.shape}"
            )
        known = np.isfinite(self.offset)
        if np.isinf(self.offset).any() or not (self.offset_sd[known] >= 0).all() or not known.any():
            raise Refusal("expected finite offsets in 1/m with errors of at least 0, or NaN")
        if not (self.frames > 0 and 0 <= self.seconds < np.inf):
            raise Refusal(f"expected a tare of frames, got {self.frames} over {self.seconds} s")
        if self.temperature is not None and not np.isfinite(self.temperature):
            raise Refusal(f"expected a temperature or none, got {self.temperature}")

    def __len__(self) -> int:
        return len(self.offset)

    @property
    def content(self) -> dict[str, Any]:
        """Everything it says, by key, as text, dates, numbers and lists of numbers."""
        said: dict[str, Any] = {key: getattr(self, key) for key in _PLAIN}
        if self.temperature is None:
            del said["temperature"]
        return said | {key: getattr(self, key).tolist() for key in ("offset", "offset_sd")}

    @cached_property
    def digest(self) -> str:
        return digest({"tare": self.content})

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Tare) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    def check(self, sensor: Sensor) -> None:
        """Refuse a sensor that is not the one that was tared."""
        if sensor.serial_number != self.serial_number:
            raise Refusal(
                f"this tare is of {self.name} {self.serial_number}, the sensor is {sensor.name} "
                f"{sensor.serial_number}; tare this one"
            )
        if (fingerprint(sensor.layout), sensor.channels) != (self.layout, len(self)):
            raise Refusal(
                f"{sensor.name} {sensor.serial_number} has {sensor.layout} in other places than "
                "when it was tared; tare it again"
            )


_PLAIN = ("name", "serial_number", "layout", "date", "temperature", "frames", "seconds")
