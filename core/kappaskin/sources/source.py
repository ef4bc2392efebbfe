"""Sources of frames: what every source offers, who records it, and how one is opened by name."""

from collections.abc import Callable
from typing import Protocol

from kappaskin.errors import SourceError
from kappaskin.frames import Event, Frame
from kappaskin.sensing import Sensor
from kappaskin.sources.clock import ClockState
from kappaskin.sources.decoder import Accounting


class InputRecorder(Protocol):
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

    def mapped(self, since: float, known: ClockState) -> None:
        """From the scan of device time `since` in s on, times are mapped by what is now `known`.

        That scan is among the bytes told next; NaN for whichever comes next.
        """
        ...

    def simulated(self, frame: Frame) -> None:
        """The frame told next is simulated, and has a truth."""
        ...


SIMULATION = "sim:"


class Source(Protocol):
    """Yields frames; nothing after it can tell a simulated from a real one."""

    @property
    def sensor(self) -> Sensor | None:
        """What the device says it is; None until it has said so."""
        ...

    def read(self, timeout: float) -> list[Frame]:
        """The frames that came, after at most `timeout` s; a `Refusal` when there will be none."""
        ...

    @property
    def trouble(self) -> str:
        """Why no frames come at present, and what to do; empty when nothing is wrong."""
        ...

    @property
    def temperature(self) -> float:
        """The device's temperature in degrees Celsius, as it told last; NaN if it does not."""
        ...

    def record(self, tape: InputRecorder | None) -> None:
        """Tell `tape` from now on all that frames come from; nobody without one."""
        ...

    def events(self) -> list[Event]:
        """What happened since this was last asked."""
        ...

    def accounting(self) -> Accounting:
        """What became of every byte and every sequence number."""
        ...

    def close(self) -> None: ...


_schemes: dict[str, Callable[[str], Source]] = {}


def register_scheme(scheme: str, opened: Callable[[str], Source]) -> None:
    """Open names that begin with `scheme`, such as `replay:`, by `opened` with what follows it.

    The empty scheme opens every other name.
    """
    _schemes[scheme] = opened


def open_source(name: str) -> Source:
    """The source called `name`: `sim:`, `sim:SCENE`, `replay:FILE`, or what pyserial opens.

    `replay:` is registered by the room `recording`, as soon as that is imported.
    """
    if not name.strip():
        raise SourceError(
            "expected a source: sim:, sim:SCENE, replay:FILE, a port or a URL; got an empty name"
        )
    scheme = max((scheme for scheme in _schemes if name.startswith(scheme)), key=len)
    return _schemes[scheme](name.removeprefix(scheme))
