"""Messages of a device to frames, once it has said what it is."""

import numpy as np
from numpy.typing import NDArray

from kappaskin.errors import SourceError
from kappaskin.frames import Frame
from kappaskin.sensing import Sensor
from kappaskin.sources import information
from kappaskin.sources.clock import ClockMap
from kappaskin.sources.wire import FromDevice, Information, Samples

_SENSORS = 8  # that are remembered


class Interpreter:
    """What the messages on the line `url` mean.

    `sensor` is what the device said it is, in `text`; `known` tells whether it has said so since
    the line began, and `unusable` why its messages are of no use. What was `made` of a text once is
    not made of it again: it is the same device.
    """

    def __init__(self, url: str, made: dict[str, Sensor] | None = None) -> None:
        self._url = url
        self._made = {} if made is None else made
        self.sensor: Sensor | None = None
        self.text = ""
        self._looked_at: NDArray[np.intp] | None = None
        self._highest_there = -1
        self.begin(ClockMap())

    def begin(self, times: ClockMap) -> None:
        """Another line begins, of a device whose clock `times` map."""
        self.times, self.known, self.unusable = times, False, ""

    def learn(self, text: str) -> bool:
        """Take what the device says it is; whether that can be used, and says something new."""
        if self.known and text == self.text:
            return False
        if text != self.text:
            self.sensor, self.text, self.known = None, "", False
            try:
                self.sensor = self._made.get(text) or information.sensor_from_json(text)
            except SourceError as error:
                self.unusable = f"{self._url}: {error}"
                return False
            if len(self._made) >= _SENSORS:
                self._made.clear()
            self._made[text] = self.sensor
        self.text, self.unusable, self.known = text, "", True
        return True

    def upsets(self, message: FromDevice) -> bool:
        """Whether the message is of another device, or of none that can be."""
        if isinstance(message, Information):
            return message.text != self.text
        if not isinstance(message, Samples) or self.sensor is None:
            return False
        return self._highest(message) >= self.sensor.channels

    def _highest(self, samples: Samples) -> int:
        """The highest channel; scans of one list share it, and so it is seldom looked for."""
        if samples.channels is not self._looked_at:
            self._looked_at = samples.channels
            self._highest_there = int(np.max(samples.channels, initial=-1))
        return self._highest_there

    def frame(self, message: Samples, now: float) -> Frame | None:
        """The frame that came at host time `now` in s; None where it cannot be used."""
        sensor = self.sensor
        if sensor is None or self.unusable:
            return None
        if self.upsets(message):
            self.unusable = (
                f"{self._url}: the device sends channel {self._highest(message)} but says it has "
                f"{sensor.channels}; its firmware and its information disagree"
            )
            return None
        times, began = self.times, self.times.unwrap(message.time)
        times.heard(began, now)
        channels = message.channels
        if sensor.channel_map is not None:
            channels = sensor.channel_map[channels]
        taken = times.taken(began), times.sd(began)
        return Frame(message.sequence, began, now, channels, message.counts, None, *taken)
