"""The messages of a recording to its estimates: what its frames went through, once more."""

from collections import deque
from collections.abc import Iterator
from typing import Any

from kappaskin._state import StateArrays
from kappaskin.errors import Refusal
from kappaskin.frames import Array, Estimate, Frame
from kappaskin.pipeline import Pipeline, Setup
from kappaskin.recording import messages as m
from kappaskin.recording.cdr import decode
from kappaskin.recording.reading import Message, Recording
from kappaskin.recording.recorded_frames import Reenactment
from kappaskin.recording.setup_text import setup_from
from kappaskin.sensing import Sensor

_WAITING = 2**14  # frames that wait until one is asked for, at most


class Retrace:
    """Takes the messages of a `recording` as they were written, and works out what is asked for.

    Frames go through the `pipeline` of their time, whose generation counts those recorded from 0;
    with a `setup` through one of that instead, which begins at rest, and leaves out what was left
    out. A frame of which no estimate is asked for is remembered, as the live process does.
    """

    def __init__(self, recording: Recording, setup: Setup | None = None) -> None:
        self._recording, self._setup = recording, setup
        self._reenact = Reenactment(str(recording.path))
        self.sensor: Sensor | None = None
        self.pipeline: Pipeline | None = None
        self._memory: StateArrays = {}
        self._made = 0
        self._waiting: deque[Frame] = deque()
        self._last: Estimate | None = None

    def __call__(self, message: Message) -> Iterator[Frame]:
        """The frames that came with one message; what it says otherwise is done when they are out.

        A `Refusal` when it is none of its topic.
        """
        for frame in self._reenact(message):
            self._meet()
            if len(self._waiting) == _WAITING:
                self._pass_over(1)
            self._waiting.append(frame)
            yield frame
        self._meet()
        self._take(message)

    def _take(self, message: Message) -> None:
        if message.topic == m.DEVICE.name:
            self.sensor = None  # another source, if of the same device: it begins at rest
            self._meet()
        elif message.topic == m.LEFT_OUTS.name:
            self._leave_out(decode(m.LEFT_OUT, message.data))
        elif self._setup is not None:
            return
        elif message.topic == m.SETUP.name:
            text = decode(m.STRING, message.data)["data"]
            self._set_up(setup_from(text, self._recording.attachment))
        elif message.topic == m.MEMORIES.name:
            said = decode(m.MEMORY, message.data)
            self._memory[said["name"]] = _shaped(said)

    def _leave_out(self, said: dict[str, Any]) -> None:
        self._pass_over(len(self._waiting))
        if self.pipeline is None:
            return
        C, sizes = self.pipeline.sensor.channels, {said["kinds"].size, said["badness"].size}
        if sizes != {C}:
            raise Refusal(f"expected {C} channels of which some are left out, got {sizes}")
        self.pipeline.leave_out(said["kinds"], said["badness"])

    def _meet(self) -> None:
        """Another device, if that is what the next frame is of, has no pipeline yet."""
        if self._reenact.sensor is self.sensor:
            return
        self.sensor, self.pipeline, self._last = self._reenact.sensor, None, None
        self._waiting.clear()
        self._memory.clear()
        if self._setup is not None and self.sensor is not None:
            self.pipeline = Pipeline(self.sensor, self._setup)

    def _set_up(self, setup: Setup) -> None:
        if self.sensor is None:
            raise Refusal(
                f"{self._recording.path}: expected a device before a setup; `kappaskin repair` "
                "saves what is whole"
            )
        self._pass_over(len(self._waiting))
        was, made = self.pipeline, Pipeline(self.sensor, setup, self._made)
        if was is not None:
            made.continue_from(was)
        self.pipeline, self._made = made, self._made + 1

    def _pass_over(self, count: int) -> None:
        """Let the first `count` of the frames that wait be remembered."""
        if self.pipeline is not None and self._memory:
            self.pipeline.restore(self._memory)
            self._memory = {}
        for _ in range(count):
            frame = self._waiting.popleft()
            if self.pipeline is not None:
                self.pipeline.pass_over(frame)

    def estimate(self, sequence: int) -> Estimate | None:
        """Of the frame `sequence`, the last one asked for or one since then; None of any other."""
        if self._last is not None and self._last.sequence == sequence:
            return self._last
        places = (n for n, frame in enumerate(self._waiting) if frame.sequence == sequence)
        return self._worked_out(next(places, -1))

    def newest(self) -> Estimate | None:
        """Of the frame that came last; None where it went through no pipeline."""
        return self._worked_out(len(self._waiting) - 1)

    def _worked_out(self, place: int) -> Estimate | None:
        if self.pipeline is None or place < 0:
            return None
        self._pass_over(place)
        self._last = self.pipeline(self._waiting.popleft())
        return self._last


def _shaped(said: dict[str, Any]) -> Array:
    try:
        return said["values"].reshape(said["shape"])
    except ValueError as error:
        raise Refusal(f"expected what was remembered in its shape: {error!s:.80}") from error
