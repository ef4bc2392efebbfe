"""One port to what is on it and how well it does, or why nothing can be read from it."""

import math
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any

from kappaskin.errors import SourceError
from kappaskin.frames import Event, Frame
from kappaskin.sources.accounting import Accounting
from kappaskin.sources.ports import port_called
from kappaskin.sources.serial_line import SerialSource

_FEW = 3  # frames that tell no rate
_SOON = 0.02  # s that a read may wait
_SEARCH = 10.0  # s in which every baud rate has been tried
_LISTEN = 2.0  # s that a device which is known is listened to


@dataclass(frozen=True)
class Diagnosis:
    """What was found on `port`, which its plug describes as `plug`; `why` is empty if all is well.

    `device` says its name, serial number and firmware, empty where it did not say. `rate` in
    frames/s is measured, `said_rate` what it says; `clock_sd` in s is how well the time of a
    reading is known on this machine's clock, infinite where the device does not tell; NaN where
    nothing was measured.
    """

    port: str
    plug: str
    why: str = ""
    device: str = ""
    rate: float = math.nan
    said_rate: float = math.nan
    clock_sd: float = math.inf
    temperature: float = math.nan
    accounting: Accounting = field(default_factory=Accounting)
    events: tuple[Event, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Everything as JSON values; null for what is not known."""
        found = asdict(self) | {"well": not self.why}
        return {
            key: None if isinstance(value, float) and not math.isfinite(value) else value
            for key, value in found.items()
        }


def diagnose(url: str, clock: Callable[[], float] = time.monotonic) -> Diagnosis:
    """What is on the port or URL, after looking for a few seconds."""
    plug = port_called(url).words
    try:
        source = SerialSource(url, clock)
    except SourceError as error:
        return Diagnosis(url, plug, str(error))
    try:
        return _looked_at(source, plug, clock)
    finally:
        source.close()


def _looked_at(source: SerialSource, plug: str, clock: Callable[[], float]) -> Diagnosis:
    end = clock() + _SEARCH
    while source.sensor is None and clock() < end and not _settled(source):
        source.read(_SOON)
    sensor, frames = source.sensor, list[Frame]()
    end = clock() + _LISTEN
    while sensor is not None and clock() < end and not source.trouble:
        frames += source.read(_SOON)
    rate, clock_sd = _pace(frames)
    why = source.trouble
    if sensor is not None and not frames:
        why = (
            why or f"{source.url}: the device says what it is but sends no readings; start it anew"
        )
    return Diagnosis(
        source.url,
        plug,
        why,
        f"{sensor.name} {sensor.serial_number}, firmware {sensor.firmware}" if sensor else "",
        rate,
        sensor.rate if sensor else math.nan,
        clock_sd,
        source.temperature,
        source.accounting(),
        tuple(source.events()),
    )


def _settled(source: SerialSource) -> bool:
    """Whether the trouble is one that no other baud rate can mend."""
    seen = source.accounting()
    understood = seen.good > 0 or seen.other_version is not None
    return bool(source.trouble) and (understood or not seen.bytes_in)


def _pace(frames: list[Frame]) -> tuple[float, float]:
    """How many of `frames` came in a second, and how well the time of the last is known, in s."""
    if len(frames) < _FEW:
        return math.nan, math.inf
    span = frames[-1].device_time - frames[0].device_time
    return (len(frames) - 1) / span if span > 0 else math.nan, frames[-1].taken_sd
