"""What a line brings to a tape, while one takes it down."""

import math
from collections.abc import Iterable

from kappaskin.sources.clock import Known
from kappaskin.sources.interpreter import Interpreter
from kappaskin.sources.tape import Tape
from kappaskin.sources.wire import FromDevice, Samples, encode_samples


class Taping:
    """Tells a tape all that frames come from, as the interpreter `means` it; nobody without one."""

    def __init__(self, means: Interpreter) -> None:
        self._means = means
        self._tape: Tape | None = None
        self._told: Known | None = None  # of the clock
        self._mapped: list[tuple[float, Known]] = []
        self._met = ""  # what was told of the device

    def to(self, tape: Tape | None) -> None:
        """Tell this one from now on."""
        self._tape, self._told, self._mapped = tape, None, []

    def begin(self, now: float, waiting: Iterable[tuple[float, FromDevice]], held: bytes) -> None:
        """Tell of the device, of messages `waiting` to be read, and of bytes `held` of the next."""
        if self._tape is None:
            return
        self._met = ""
        if self._means.sensor is not None:  # frames go through what was made of one that is gone
            self._meet(self._tape)
            if not self._means.known:
                self._tape.ended(now)
        for came, message in waiting:
            if isinstance(message, Samples):
                sequence, began, channels, counts = message
                self._tape.came(came, encode_samples(sequence, began, channels, counts, 4))
        self._told = self._means.times.known
        self._tape.mapped(math.nan, self._told)
        if held:
            self._tape.came(now, held)

    def sent(self, now: float, data: bytes) -> None:
        if self._tape is not None:
            self._tape.sent(now, data)

    def ended(self, now: float) -> None:
        if self._tape is not None:
            self._tape.ended(now)

    def map(self, since: float) -> None:
        """Take note of what is known of the clock from the scan at device time `since` on."""
        if self._tape is None:
            return
        known = self._means.times.known
        if self._told is None or known.map != self._told.map:
            self._mapped.append((since, known))
            self._told = known

    def came(self, came: list[tuple[float, bytes]]) -> None:
        """Tell of the bytes that were read, and before them of how their times are mapped."""
        if self._tape is None:
            return
        for since, known in self._mapped:
            self._tape.mapped(since, known)
        self._mapped = []
        for now, data in came:
            self._tape.came(now, data)
        if self._means.known:
            self._meet(self._tape)  # told in those bytes: here for whoever begins after them

    def _meet(self, tape: Tape) -> None:
        if self._means.text != self._met:
            self._met = self._means.text
            tape.met(self._met)
