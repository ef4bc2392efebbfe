"""Messages to datagrams of JSON, for anybody who listens: PlotJuggler's UDP server as it is."""

import errno
import socket
import time
from contextlib import suppress

from kappaskin.errors import Refusal
from kappaskin.publish.message import LARGEST, Message, State
from kappaskin.publish.publisher import Receiver
from kappaskin.publish.target import Target, reason

_AGAIN = 1.0  # s between two tries to find a way to a network that was gone


def opened(target: Target) -> "Udp":
    """A socket to the first address of `target` that can be sent to."""
    try:
        found = socket.getaddrinfo(target.host, target.port, type=socket.SOCK_DGRAM)
    except (OSError, UnicodeError) as error:
        raise Refusal(
            f"{target}: the host {target.host} is not known ({reason(error)}); give another "
            "name, or its address"
        ) from error
    # Of a name with both, most who receive listen on the older kind of address.
    found.sort(key=lambda each: each[0] != socket.AF_INET)
    trouble = ""
    for family, _, _, _, address in found:
        try:
            return Udp(str(target), _connected(family, address), address)
        except OSError as error:
            trouble = reason(error)
    raise Refusal(
        f"{target}: cannot be sent to ({trouble}); connect this machine to that network, then "
        "switch it on again"
    )


def _connected(family: int, address: object) -> socket.socket:
    """A socket that never waits; connected, it is told when nobody receives."""
    made = socket.socket(family, socket.SOCK_DGRAM)
    try:
        made.setblocking(False)
        if family == socket.AF_INET:
            made.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        made.connect(address)  # pyright: ignore[reportArgumentType]
    except OSError:
        made.close()
        raise
    return made


class Udp:
    """Sends each message as one datagram."""

    def __init__(self, name: str, made: socket.socket, address: tuple[object, ...]) -> None:
        self._name, self._socket, self._address = name, made, address
        self._sent = self._dropped = 0
        self._trouble, self._again = "", 0.0

    @property
    def receivers(self) -> tuple[Receiver, ...]:
        return (Receiver(self._name, self._sent, self._dropped, self._trouble),)

    @property
    def counts(self) -> tuple[int, int]:
        return self._sent, self._dropped

    def send(self, message: Message) -> None:
        self._put(message.contact)
        if message.shape_follows:
            self._put(message.shape)

    def tell(self, state: State) -> None:
        self._put(state.encoded())

    def _put(self, data: bytes) -> None:
        if len(data) > LARGEST:
            self._drop(f"a message of {len(data)} bytes is too large for a datagram")
            return
        try:
            self._send(data)
        except OSError as error:
            self._drop(reason(error))
            if error.errno not in (errno.EAGAIN, errno.ENOBUFS):
                self._find_way()
        else:
            self._sent += 1

    def _send(self, data: bytes) -> None:
        try:
            self._socket.send(data)
        except ConnectionRefusedError:
            # Told of the last one, which nobody received, in the place of sending this one.
            self._sent -= 1
            self._drop("nobody receives there")
            self._socket.send(data)

    def _drop(self, why: str) -> None:
        self._dropped += 1
        self._trouble = why

    def _find_way(self) -> None:
        """Look for the way anew, now and then: the network may have come back another."""
        now = time.monotonic()
        if now >= self._again:
            self._again = now + _AGAIN
            with suppress(OSError):
                self._socket.connect(self._address)  # pyright: ignore[reportArgumentType]

    def close(self) -> None:
        self._socket.close()
