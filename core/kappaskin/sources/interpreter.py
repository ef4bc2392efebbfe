"""Interpreter of messages: those of a device to frames."""

import math

import numpy as np
from numpy.typing import NDArray

from kappaskin.errors import SourceError
from kappaskin.frames import Frame
from kappaskin.sensing import Sensor
from kappaskin.sources import information
from kappaskin.sources.clock import ClockMap
from kappaskin.sources.decoder import SEQUENCES
from kappaskin.sources.wire import FromDevice, Information, Samples

_SENSORS = 8  # that are cached
_GRAIN = 1e-6  # s between two records that arrived together


class Interpreter:
    """What the messages from the device on `url` mean.

    `sensor` is what its information `text` describes; `known` tells whether it has sent that since
    the connection began, `unusable` why its messages cannot be used. `cache` holds the sensors of
    earlier texts: the same text is the same object again, and so the same device.
    """

    def __init__(self, url: str, cache: dict[str, Sensor] | None = None) -> None:
        self._url = url
        self._cache = {} if cache is None else cache
        self.sensor: Sensor | None = None
        self.text = ""
        self._checked_list: NDArray[np.intp] | None = None
        self._highest_in_list = -1
        self.begin(ClockMap())

    def begin(self, clock_map: ClockMap) -> None:
        """A connection begins, to a device whose clock is mapped by `clock_map`."""
        self.clock_map, self.known, self.unusable = clock_map, False, ""
        self._last = -math.inf

    def learn(self, text: str) -> bool:
        """Take the device's information; whether it can be used, and is new."""
        if self.known and text == self.text:
            return False
        if text != self.text:
            self.sensor, self.text, self.known = None, "", False
            try:
                self.sensor = self._cache.get(text) or information.sensor_from_json(text)
            except SourceError as error:
                self.unusable = f"{self._url}: {error}"
                return False
            if len(self._cache) >= _SENSORS:
                self._cache.clear()
            self._cache[text] = self.sensor
        self.text, self.unusable, self.known = text, "", True
        return True

    def is_of_another(self, message: FromDevice) -> bool:
        """Whether the message is of another device than `sensor`, or of none that can be."""
        if isinstance(message, Information):
            return message.text != self.text
        if not isinstance(message, Samples) or self.sensor is None:
            return False
        return self._highest(message) >= self.sensor.channels

    def _highest(self, samples: Samples) -> int:
        """The highest channel; scans of one list share it, so it is computed once for each list."""
        if samples.channels is not self._checked_list:
            self._checked_list = samples.channels
            self._highest_in_list = int(np.max(samples.channels, initial=-1))
        return self._highest_in_list

    def frame(self, message: Samples, now: float) -> Frame | None:
        """The frame that arrived at host time `now` in s; None where it cannot be used."""
        sensor = self.sensor
        if sensor is None or self.unusable:
            return None
        if self.is_of_another(message):
            self.unusable = (
                f"{self._url}: the device sends channel {self._highest(message)} but reports "
                f"{sensor.channels}; its firmware and its information disagree"
            )
            return None
        # A device that tells no time: its record began when it arrived, each after the one before.
        time = message.time if math.isfinite(message.time) else max(now, self._last + _GRAIN)
        clock_map, began = self.clock_map, self.clock_map.unwrap(time)
        self._last = began
        # One that does not number them: by its time, the same wherever a recording is read from.
        sequence = message.sequence if message.sequence >= 0 else round(began * 1e6) % SEQUENCES
        clock_map.heard(began, now)
        channels = message.channels
        if sensor.channel_map is not None:
            channels = sensor.channel_map[channels]
        taken = clock_map.taken(began), clock_map.sd(began)
        return Frame(sequence, began, now, channels, message.counts, None, *taken)
