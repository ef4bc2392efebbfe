"""Inputs of described sensors beside ports: datagrams, standard input and files."""

import math
import os
import select
import socket
import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import ClassVar
from urllib.parse import urlsplit

from kappaskin.errors import SourceError
from kappaskin.sources.lines import LineDecoder

STANDARD_INPUT = "-"
"""Name of standard input as a source."""
UDP = "udp://"
"""Scheme of datagrams that come to a port of this machine."""

_WAIT = 0.1  # s that a read waits
_BLOCK = 65536  # bytes of a read; more than a datagram has
_KEPT = 2**22  # bytes of datagrams that the system keeps until they are read


class EndOfInput(Exception):
    """There is no more to read, and will not be."""


class Input(ABC):
    """Where bytes come from, as from an open port; nothing can be sent there.

    A `patient` one waits until its bytes are taken, so that none are lost. `silence` says what to
    check when nothing comes for seconds; nothing where that may be; `lost` why no more comes of one
    that broke off.
    """

    patient: ClassVar[bool] = True
    silence: ClassVar[str] = ""
    lost: ClassVar[str] = "the device was unplugged or stopped; plug it in to continue"

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock

    @abstractmethod
    def arriving(self) -> tuple[float, bytes]:
        """What arrived and when, after 0.1 s at most; raises `EndOfInput` at its end."""

    def write(self, data: bytes) -> int:
        """The number of bytes sent: none."""
        return 0

    def close(self) -> None:  # noqa: B027 standard input stays open
        """Let go of what was opened."""


class Datagrams(Input):
    """Datagrams that come to `udp://:PORT`; with a host, to that address of this machine."""

    patient = False
    silence = "check that it is sent to this address, and that no firewall keeps it away"

    def __init__(self, url: str, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(clock)
        try:
            place = urlsplit(url)
            host, port = place.hostname or "", place.port
            if not port or place.path or place.query:
                raise ValueError("no port")
        except ValueError as error:
            raise SourceError(f"expected {UDP}:PORT such as {UDP}:9870, got {url!r}") from error
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _KEPT)
            self._socket.bind((host, port))
        except OSError as error:
            self._socket.close()
            raise SourceError(
                f"{url}: cannot listen there ({error.strerror}); choose another port, or end the "
                "program that has it"
            ) from error

    def arriving(self, within: float = _WAIT) -> tuple[float, bytes]:
        """What arrived and when, after `within` s at most."""
        came = select.select([self._socket], [], [], within)[0]
        return self._clock(), self._socket.recv(_BLOCK) if came else b""

    def close(self) -> None:
        self._socket.close()


class StandardInput(Input):
    """Standard input, which the processes that are started here have too."""

    silence = "check the program that writes to it"
    _DESCRIPTOR = 0

    def arriving(self) -> tuple[float, bytes]:
        where = self._DESCRIPTOR
        if sys.platform != "win32" and not select.select([where], [], [], _WAIT)[0]:
            return self._clock(), b""
        if not (data := os.read(where, _BLOCK)):
            raise EndOfInput
        return self._clock(), data


class PlayedFile(Input):
    """A file of records, played at their time stamps, or without them at a `rate` in 1/s.

    Time that goes back begins anew. `decoder` is one that reads them, and no other's.
    """

    def __init__(
        self,
        path: Path,
        decoder: LineDecoder,
        rate: float,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__(clock)
        self._timed, self._decoder, self._rate = decoder.timed, decoder, rate
        if not (decoder.timed or rate):
            raise SourceError(
                f"{path}: its records have no time stamps; give rate = 100, in records per second, "
                "in [line], or a column of time"
            )
        try:
            self._file = path.open("rb")
        except OSError as error:
            raise SourceError(f"{path}: cannot be read ({error.strerror})") from error
        self._held, self._due, self._played = b"", clock(), 0
        self._began, self._last = -math.inf, math.inf  # the clock at time stamp 0, the last stamp

    def arriving(self) -> tuple[float, bytes]:
        if not self._held:
            self._held = self._decoder.next_of(self._file)
            if not self._held:
                raise EndOfInput
            self._find_due()
        if (wait := self._due - self._clock()) > 0:
            time.sleep(min(wait, _WAIT))
        if wait > _WAIT:
            return self._clock(), b""
        data, self._held = self._held, b""
        return self._due, data

    def _find_due(self) -> None:
        """When the next bytes are due; those without a record come with what was before them."""
        for record in self._decoder.feed(self._held):
            stamp = record.time if self._timed else self._played / self._rate
            self._played += 1
            if stamp < self._last:
                self._began = max(self._due, self._clock()) - stamp
            self._due, self._last = self._began + stamp, stamp

    def close(self) -> None:
        self._file.close()
