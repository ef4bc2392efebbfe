"""Messages to a WebSocket server that Foxglove, or anything that speaks its protocol, connects to.

The protocol is foxglove.websocket.v1, and foxglove.sdk.v1, its name since 2025. The thread that
computes writes a message straight into the socket of each client that asked for it; what a client
leaves no room for is dropped. Another thread accepts clients, reads what they say, and draws the
skin as a cloud of points, when one of them looks at it.
"""

import selectors
import socket
import sys
import threading
import time
from contextlib import suppress
from typing import Any

from kappaskin.errors import Refusal
from kappaskin.publish.channels import CONTACT, LOG, POSE, SHAPE, SKIN, STATUS, logged
from kappaskin.publish.client import Client
from kappaskin.publish.cloud import Cloud, pose
from kappaskin.publish.message import Message, State
from kappaskin.publish.publisher import Receiver
from kappaskin.publish.target import Target, reason

MOST_CLIENTS = 16
"""So many clients at most are served at the same time."""

FRAME = 1 / 30  # s between two pictures of the skin
_TICK = 0.1  # s between two looks at clients that say nothing
_READ = 65536


def opened(target: Target) -> "Foxglove":
    """A server at `target`; a `Refusal` where its port is taken, or not this machine's."""
    try:
        found = socket.getaddrinfo(
            target.host, target.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )
    except (OSError, UnicodeError) as error:
        raise Refusal(
            f"{target}: the host {target.host} is not known ({reason(error)}); give an "
            "address of this machine, or 0.0.0.0 for all of them"
        ) from error
    family, _, _, _, address = min(found, key=lambda each: each[0] != socket.AF_INET)
    try:
        server = _listening(family, address)
    except OSError as error:
        raise Refusal(
            f"{target}: cannot be listened on ({reason(error)}); choose another port, or "
            "an address of this machine"
        ) from error
    return Foxglove(server)


def _listening(family: int, address: Any) -> socket.socket:
    """A socket that listens and never waits."""
    made = socket.socket(family, socket.SOCK_STREAM)
    try:
        if sys.platform != "win32":  # there it would let two servers share a port
            made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        made.bind(address)
        made.listen(MOST_CLIENTS)
        made.setblocking(False)
    except OSError:
        made.close()
        raise
    return made


class Foxglove:
    """Serves clients that come and go on the listening socket `server`."""

    def __init__(self, server: socket.socket) -> None:
        self._server = server
        self._clients: tuple[Client, ...] = ()  # replaced whole: two threads read it
        self._gone = (0, 0)
        self._latest: Message | None = None
        self._drawn: Message | None = None
        self._cloud, self._next_cloud = Cloud(), 0.0
        self._ending, self._wake = socket.socketpair()
        self._selector = selectors.DefaultSelector()
        for each in (server, self._ending):
            self._selector.register(each, selectors.EVENT_READ)
        self._thread = threading.Thread(target=self._serve, name="foxglove", daemon=True)
        self._thread.start()

    # What the thread that computes calls.

    @property
    def receivers(self) -> tuple[Receiver, ...]:
        return tuple(client.told for client in self._clients)

    @property
    def counts(self) -> tuple[int, int]:
        sent, dropped = self._gone
        for client in self._clients:
            sent, dropped = sent + client.sent, dropped + client.dropped
        return sent, dropped

    def send(self, message: Message) -> None:
        self._latest = message
        for client in self._clients:
            wanted = client.subscribed
            if CONTACT in wanted:
                client.offer(CONTACT, message.timestamp, message.contact)
            if POSE in wanted and message.estimate.touch.present:
                client.offer(POSE, message.timestamp, pose(message))
            if SHAPE in wanted and message.mark.with_shape:
                client.offer(SHAPE, message.timestamp, message.shape)

    def tell(self, state: State) -> None:
        now, encoded = time.time(), state.encoded()
        lines: list[tuple[float, bytes]] = []
        for event in state.events:
            when = now - time.monotonic() + event.time
            lines.append((when, logged(event, when)))
        for client in self._clients:
            client.offer(STATUS, now, encoded)
            for when, line in lines:
                client.offer(LOG, when, line)

    def close(self) -> None:
        self._wake.close()
        self._thread.join()

    # What the server's own thread does.

    def _serve(self) -> None:
        while not self._turn():
            pass
        for client in self._clients:
            client.close()
        for each in (self._server, self._ending):
            each.close()
        self._selector.close()

    def _turn(self) -> bool:
        """Wait for something to be done, and do it; True at the end."""
        watched = any(SKIN in client.subscribed for client in self._clients)
        for key, _ in self._selector.select(FRAME if watched else _TICK):
            if key.fileobj is self._ending:
                return True
            if key.fileobj is self._server:
                self._accept()
            else:
                key.data.read()
        for client in self._clients:
            client.go_on()
            if client.ended:
                self._drop(client)
        if watched:
            self._draw()
        return False

    def _accept(self) -> None:
        with suppress(OSError):  # it went away again
            made, address = self._server.accept()
            if len(self._clients) >= MOST_CLIENTS:
                made.close()
                return
            made.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            client = Client(made, f"{address[0]}:{address[1]}")
            self._clients = (*self._clients, client)
            self._selector.register(made, selectors.EVENT_READ, client)

    def _drop(self, client: Client) -> None:
        self._selector.unregister(client.socket)
        client.close()
        sent, dropped = self._gone
        self._gone = sent + client.sent, dropped + client.dropped
        self._clients = tuple(other for other in self._clients if other is not client)

    def _draw(self) -> None:
        """Send the skin as it is now to those who look at it, if it is another than the last."""
        now, message = time.monotonic(), self._latest
        if message is None or message is self._drawn or now < self._next_cloud:
            return
        self._next_cloud, self._drawn = now + FRAME, message
        if (data := self._cloud(message)) is not None:
            for client in self._clients:
                client.offer(SKIN, message.timestamp, data)
