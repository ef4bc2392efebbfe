"""Interface of sources, their recorders, and opening by name."""

import re
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Protocol

from kappaskin._plugins import SOURCES, error_text, left_out, plug_ins
from kappaskin.errors import Refusal, SourceError
from kappaskin.frames import Event, Frame
from kappaskin.sensing import Sensor
from kappaskin.sources.clock import ClockState
from kappaskin.sources.decoder import Accounting


class InputRecorder(Protocol):
    """Records all that a source's frames are made of, in order, before they are computed with."""

    def connected(self, information: str) -> None:
        """The device is the one that this information text describes."""
        ...

    def received(self, host_time: float, data: bytes) -> None:
        """These bytes arrived at `host_time` in s."""
        ...

    def sent(self, host_time: float, data: bytes) -> None:
        """These bytes were sent."""
        ...

    def disconnected(self, host_time: float) -> None:
        """The connection was lost; the next bytes are of another one."""
        ...

    def clock(self, since: float, state: ClockState) -> None:
        """From the scan of device time `since` in s on, the map of times has this `state`.

        That scan is among the bytes recorded next; NaN for whichever comes next.
        """
        ...

    def simulated(self, frame: Frame) -> None:
        """The frame recorded next is simulated, and has a truth."""
        ...


class Source(Protocol):
    """Where frames come from; nothing after it can tell a simulated device from a real one."""

    @property
    def sensor(self) -> Sensor | None:
        """The sensor that the device describes; None until it has sent its information."""
        ...

    def read(self, timeout: float) -> list[Frame]:
        """The frames that arrived, after at most `timeout` s; a `Refusal` if none ever will."""
        ...

    @property
    def patient(self) -> bool:
        """Whether what is not read waits, however long; a live source goes on meanwhile."""
        ...

    @property
    def trouble(self) -> str:
        """Why no frames come at present, and what to do; empty when nothing is wrong."""
        ...

    @property
    def temperature(self) -> float:
        """The device's temperature in degrees Celsius, the last one reported; NaN without."""
        ...

    def record(self, recorder: InputRecorder | None) -> None:
        """Give `recorder` from now on all that frames are made of; nobody without one."""
        ...

    def events(self) -> list[Event]:
        """The events since the last call."""
        ...

    def accounting(self) -> Accounting:
        """What became of every byte and every sequence number."""
        ...

    def close(self) -> None: ...


_FINGER = re.compile(r"[A-Za-z]\w{0,31}", re.ASCII)  # as a part of a topic in ROS 2


def is_finger(name: str) -> bool:
    """Whether a finger may have this name: a letter, then letters, digits and _, 32 at most."""
    return _FINGER.fullmatch(name) is not None


def named_sources(texts: Sequence[str]) -> dict[str, str]:
    """The source of each finger by its name, of texts NAME=SOURCE.

    One alone may be without a name, which is empty then. A source may have an = of its own: it has
    a name only where that may be one. Raises a `Refusal` for a name that is missing or given twice.
    """
    found: dict[str, str] = {}
    for text in texts:
        name, named, source = text.partition("=")
        name, source = (name, source) if named and is_finger(name) else ("", text)
        if not name and len(texts) > 1:
            raise Refusal(
                f"expected a name for each of several sources, such as thumb={text}, got {text}; "
                "a name is a letter, then letters, digits and _"
            )
        if name in found:
            raise Refusal(f"expected one source for the finger {name}, got two; change a name")
        found[name] = source
    return found


_schemes: dict[str, Callable[[str, bool], Source]] = {}


def register_scheme(scheme: str, opened: Callable[[str, bool], Source]) -> None:
    """Open names that begin with `scheme`, such as `replay:`, by `opened` with what follows it.

    It is also called with the `trust` of `open_source`. The empty scheme opens every other name.
    """
    _schemes[scheme] = opened


@cache
def _plugged() -> dict[str, Callable[[str, Path | None], Source]]:
    return plug_ins(SOURCES, _check, own_schemes())


def own_schemes() -> set[str]:
    """The schemes that no plug-in may open."""
    return {scheme.removesuffix(":") for scheme in _schemes} | {"hand", "replay", "udp"}


def _check(name: str, made: object) -> None:
    """Raise a `TypeError` for what cannot open a source."""
    if not callable(made):
        raise TypeError(f"expected a function of a URL and a sensor's file, got {made!r:.60}")


def plugged_source(url: str, sensor: Path | None) -> Source | None:
    """The source that a plug-in opens of a `url` and a `sensor`'s description, if one does.

    Raises a `SourceError` that names a plug-in which raises anything but a `Refusal`, or which
    opens something else than a source.
    """
    scheme, found, _ = url.partition(":")
    if not found or scheme not in _plugged():
        return None
    try:
        made = _plugged()[scheme](url, sensor)
        if lacks := [part for part in vars(Source) if part[0] != "_" and not hasattr(made, part)]:
            raise TypeError(f"{made!r:.60} has no {', '.join(lacks)}")
        return made
    except Refusal:
        raise
    except BaseException as error:  # a plug-in may raise anything
        raise SourceError(
            f"expected a source for {url}, got {error_text(error)}{left_out(SOURCES, scheme)}"
        ) from error


def open_source(name: str, trust: bool = False) -> Source:
    """The source called `name`: `sim:SCENE`, `replay:FILE`, `feed:NAME`, or what pyserial opens.

    A plug-in may open others. With `trust` a scene may name files outside its folder.
    `replay:` is registered by the room `recording`, `hand:` by `hand`, once these are imported.
    """
    if not name.strip():
        raise SourceError(
            "expected a source: sim:SCENE, replay:FILE, feed:NAME, a port or a URL; got no name"
        )
    scheme = max((scheme for scheme in _schemes if name.startswith(scheme)), key=len)
    if not scheme and (plugged := plugged_source(name, None)) is not None:
        return plugged
    return _schemes[scheme](name.removeprefix(scheme), trust)
