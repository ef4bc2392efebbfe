"""Readings, element after element, to the map of the channels that they show."""

from typing import cast

import numpy as np

from kappaskin.calibration.channel_map import Verdict, verdict_of
from kappaskin.calibration.press_judge import NOTHING, SKIPPED, Pressed, judge
from kappaskin.calibration.press_listener import Listener, Phase
from kappaskin.errors import Refusal
from kappaskin.frames import Array, Mask
from kappaskin.sensing import Sensor, SensorLayout

_MOST = 400  # elements: more nobody presses


def elements_to_press(layout: SensorLayout, quick: bool) -> tuple[int, ...]:
    """The elements to press, all that are live, or of a grid the few that tell of its lines.

    Those few have two elements in each column and in each row. So they tell any exchange of rows,
    of columns and of components, but not of two elements among those that they leave out.
    """
    live = cast("Mask", layout.live[:2].any(axis=0))
    chosen = np.flatnonzero(live)
    if quick and layout.shape and min(layout.shape) > 2:
        m, n = layout.shape
        k = np.arange(max(m, n))
        some = np.unique([k % m + m * (k % n), k % m + m * ((k + 1) % n)])
        chosen = some[live[some]]
    if not 0 < len(chosen) <= _MOST:
        raise Refusal(
            f"expected 1 to {_MOST} elements to press, got {len(chosen)}; of a grid a few will do"
        )
    return tuple(chosen.tolist())


class PressTest:
    """Asks for one of the `elements` after the other, and takes what the channels answer.

    `asked` is what is to be pressed now, `phase` whether a rest, the press or its end is waited
    for, `done` what came of those before. A test is over when none is asked for; its `verdict` then
    says what the map is.
    """

    def __init__(self, sensor: Sensor, elements: tuple[int, ...]) -> None:
        P = len(sensor.layout)
        if not elements or any(not 0 <= p < P for p in elements):
            raise Refusal(f"expected elements from 0 to {P - 1} to press, got {elements!s:.80}")
        self.sensor, self.elements = sensor, elements
        self.done: list[Pressed] = []
        self._listen()

    def _listen(self) -> None:
        resolution = self.sensor.transduction.resolution
        self._listener = Listener(self.sensor.channels, resolution)

    @property
    def asked(self) -> int | None:
        """The element to press, None when all are done."""
        return None if self.over else self.elements[len(self.done)]

    @property
    def over(self) -> bool:
        return len(self.done) == len(self.elements)

    @property
    def phase(self) -> Phase:
        return self._listener.phase

    def take(self, time: float, readings: Array) -> Pressed | None:
        """Take in `readings` (3 P,) in 1/m at `time` in s; what came of a press that is over.

        As the device numbers its channels, not as a fit that trusts the map sees them.
        """
        if readings.shape != (self.sensor.channels,):
            raise Refusal(f"expected readings ({self.sensor.channels},), got {readings.shape}")
        asked = self.asked
        if asked is None:
            return None
        self._listener(time, readings)
        if self._listener.peak is None:
            return None
        answer = self._listener.peak.reshape(3, -1)
        return self._note(judge(self.sensor.layout, asked, answer))

    def _note(self, pressed: Pressed) -> Pressed:
        self.done.append(pressed)
        self._listen()
        return pressed

    def nothing_came(self) -> Pressed | None:
        """Note that nothing answered where it was pressed, and go on."""
        return self._go_on(NOTHING)

    def skip(self) -> Pressed | None:
        """Leave this one out."""
        return self._go_on(SKIPPED)

    def _go_on(self, verdict: str) -> Pressed | None:
        if self.asked is None:
            return None
        nothing = np.zeros((3, len(self.sensor.layout)))
        return self._note(Pressed(self.asked, verdict, None, nothing))

    def back(self) -> None:
        """Press the last one again."""
        if self.done:
            self.done.pop()
            self._listen()

    def verdict(self) -> Verdict:
        """What the map is, as far as was pressed."""
        return verdict_of(self.sensor, tuple(self.done))
