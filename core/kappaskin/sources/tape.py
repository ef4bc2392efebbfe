"""What a source tells whoever records it: all that its frames come from, in order."""

from typing import Protocol

from kappaskin.frames import Frame
from kappaskin.sources.clock import Known


class Tape(Protocol):
    """Takes down what a source reads, before anybody computes with it."""

    def met(self, text: str) -> None:
        """The device is the one that the information `text` tells of."""
        ...

    def came(self, host_time: float, data: bytes) -> None:
        """These bytes came at `host_time` in s."""
        ...

    def sent(self, host_time: float, data: bytes) -> None:
        """These bytes were sent."""
        ...

    def ended(self, host_time: float) -> None:
        """The line is gone; what comes next comes over another one."""
        ...

    def mapped(self, since: float, known: Known) -> None:
        """From the scan of device time `since` in s on, times are mapped by what is now `known`.

        That scan is among the bytes told next; NaN for whichever comes next.
        """
        ...

    def simulated(self, frame: Frame) -> None:
        """The frame told next is simulated, and has a truth."""
        ...
