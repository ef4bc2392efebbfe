"""Foxglove transport: a WebSocket server for Foxglove and others that speak its protocol.

The protocol is foxglove.websocket.v1, and foxglove.sdk.v1, its name since 2025. The thread that
computes writes a message straight into the socket of each client that requests it; what a client
does not accept is dropped. Another thread accepts clients, reads what they send, and computes
the skin as a mesh or as points, when one of them shows it.
"""

import json
import math
import selectors
import socket
import struct
import sys
import threading
import time
from contextlib import suppress
from typing import Any, cast

from websockets.exceptions import WebSocketException
from websockets.frames import Frame, Opcode
from websockets.http11 import Request, Response
from websockets.protocol import State
from websockets.server import ServerProtocol
from websockets.typing import Subprotocol

from kappaskin.errors import Refusal
from kappaskin.publish.access import AccessCheck
from kappaskin.publish.foxglove_channels import (
    CHANNELS,
    CONTACT,
    FRAMES,
    LOG,
    MESH,
    POSE,
    SHAPE,
    SKIN,
    STATUS,
    Channel,
    SkinMessages,
    frames,
    logged,
    pose,
)
from kappaskin.publish.message import EstimateMessage, SourceState
from kappaskin.publish.publishing import Receiver, Target, reason

PROTOCOLS = ("foxglove.sdk.v1", "foxglove.websocket.v1")
"""Names of the protocol, which are two of one thing."""

_Answer = dict[str, Any]

_SERVER_INFO: _Answer = {
    "op": "serverInfo",
    "name": "kappaskin",
    "capabilities": [],
    "sessionId": str(time.time_ns()),  # of this process: a client that reconnects continues
}
_BY_NUMBER = {channel.number: channel for channel in CHANNELS}

LARGEST = 65536  # bytes of a client's message
PER_SECOND = 2**18  # bytes that a client may send in a second: no viewer sends more
_WAITING = 2**18  # bytes in the socket that the client has not taken yet
_REST = 2**20  # bytes of replies to a client that sends requests but reads nothing
_PATIENCE = 5.0  # s for a handshake
PING = 5.0  # s of silence after which a client is pinged
SILENT = 9.0  # s after a ping for its reply, or for room in a full socket
_MOMENT = 1e-3  # s that the other thread may have the socket
_WARNING = 1
_HEADER = struct.Struct("<BIQ")  # opcode of data, subscription, time in ns
_DATA = 1
_MOST_IDS = 2**32


class FoxgloveClient:
    """A connection; `offer` is called by one thread, everything else by another.

    `subscribed` are the channels that it requests, with the numbers it gave them. `refused` is why
    it was not let in. It is connected `since` a monotonic time in s, once the handshake is done.
    """

    def __init__(
        self, made: socket.socket, name: str, check: AccessCheck, finger: str = ""
    ) -> None:
        self.socket, self.name, self._check, self._finger = made, name, check, finger
        made.setblocking(False)
        made.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _WAITING)
        self._protocol = ServerProtocol(
            subprotocols=[Subprotocol(name) for name in PROTOCOLS], max_size=LARGEST
        )
        self.subscribed: dict[Channel, int] = {}  # replaced whole: two threads read it
        self.sent = self.dropped = 0
        self.ended, self.refused = False, ""
        self._lock = threading.Lock()  # of the socket, and of what is left to be written
        self._rest = bytearray()
        self._full = self._last_shut = False
        now = time.monotonic()
        self.since = self._alive = now
        self._pinged = math.inf  # since when a reply is due
        self._second, self._heard = now, 0

    @property
    def receiver(self) -> Receiver:
        return Receiver(self.name, self.sent, self.dropped, "too slow" if self._rest else "")

    @property
    def connected(self) -> bool:
        """Whether it completed the handshake."""
        return self._protocol.state is not State.CONNECTING

    def offer(self, channel: Channel, when: float, data: bytes) -> None:
        """Send a message of `when` in s since 1970, if the client leaves room for it now."""
        number = self.subscribed.get(channel)
        if number is None:
            return
        # The other thread has it for microseconds, unless the system let it sleep meanwhile.
        if not self._lock.acquire(timeout=_MOMENT):
            self.dropped += 1
            return
        try:
            self._flush()
            if self._rest or self._protocol.state is not State.OPEN:
                self.dropped += 1
                return
            head = _HEADER.pack(_DATA, number, round(when * 1e9))
            self._rest += Frame(Opcode.BINARY, head + data).serialize(mask=False)
            self._flush()
            self.sent += 1
        finally:
            self._lock.release()

    def _flush(self) -> None:
        """Write as much of the unsent bytes as the socket accepts, without waiting."""
        if not self._rest or self.ended:
            return
        try:
            taken = self.socket.send(self._rest)
        except BlockingIOError:
            self._full = True
            return
        except OSError:
            self.ended = True
            return
        del self._rest[:taken]
        if self._full:
            self._reply_came()  # there is room again: somebody reads
        self._full = bool(self._rest)

    def _reply_came(self) -> None:
        self._alive, self._pinged = time.monotonic(), math.inf

    def go_on(self) -> None:
        """Write unsent bytes, ping, and end a connection that is over: called now and then."""
        now = time.monotonic()
        # The lock is taken for who lags behind alone: were this thread put to sleep with it, the
        # one that computes would drop messages to a client that takes all of them.
        if self._rest:
            with self._lock:
                self._flush()
        if self.connected and now - self._alive > PING and self._pinged == math.inf:
            self._ping(now)
        over = self._last_shut and not self._rest
        late = now - self.since > _PATIENCE and not self.connected
        silent = now - self._pinged > SILENT or len(self._rest) > _REST
        self.ended = self.ended or over or late or silent

    def _ping(self, now: float) -> None:
        """Ping it; where its socket is full, that it takes more is as good a reply."""
        self._pinged = now
        with self._lock, suppress(WebSocketException):  # it is closing
            if not self._rest:
                self._protocol.send_ping(b"")
                self._answer()

    def read(self) -> None:
        """Read received bytes, and reply."""
        try:
            data = self.socket.recv(LARGEST)
        except BlockingIOError:
            return
        except OSError:
            self.ended = True
            return
        if not data or self._floods(len(data)):
            self.ended = True
            return
        self._reply_came()
        with self._lock:
            self._protocol.receive_data(data)
            for event in self._protocol.events_received():
                self._take(event)
            self._answer()

    def _floods(self, count: int) -> bool:
        now = time.monotonic()
        if now - self._second > 1.0:
            self._second, self._heard = now, 0
        self._heard += count
        return self._heard > PER_SECOND

    def _answer(self) -> None:
        for data in self._protocol.data_to_send():
            self._rest += data
            self._last_shut = self._last_shut or not data  # an empty one is the end
        self._flush()

    def _take(self, event: object) -> None:
        if isinstance(event, Request):
            if self._protocol.close_expected():
                return  # what came right behind it was wrong
            self._protocol.send_response(self._response(event))
            if self._protocol.state is State.OPEN:
                self.since = time.monotonic()
                self._reply(_SERVER_INFO)
                advertised = [channel.advertised(self._finger) for channel in CHANNELS]
                self._reply({"op": "advertise", "channels": advertised})
        elif isinstance(event, Frame) and event.opcode in (Opcode.TEXT, Opcode.BINARY):
            if event.opcode is Opcode.TEXT and event.fin and self._handle(bytes(event.data)):
                return
            words = "expected a JSON object with op subscribe or unsubscribe and their lists"
            self._reply({"op": "status", "level": _WARNING, "message": words})

    def _response(self, request: Request) -> Response:
        """The reply to a handshake, which refuses who may not connect."""
        headers = request.headers
        denial = self._check.denial(
            request.path, headers.get_all("Host"), headers.get_all("Origin")
        )
        if denial is None:
            return self._protocol.accept(request)
        self.refused = denial.reason
        return self._protocol.reject(denial.status, f"{denial.reason}\n")

    def _reply(self, answer: _Answer) -> None:
        with suppress(WebSocketException):  # it is closing
            self._protocol.send_text(json.dumps(answer).encode())

    def _handle(self, text: bytes) -> bool:
        """Carry out a client's message; whether it was valid."""
        try:
            request = cast("_Answer", json.loads(text))
            if request["op"] == "subscribe":
                pairs = [
                    (each["id"], _BY_NUMBER.get(each["channelId"]))
                    for each in request["subscriptions"]
                ]
                self._subscribe(pairs)
            elif request["op"] == "unsubscribe":
                ended = set(request["subscriptionIds"])
                self.subscribed = {c: n for c, n in self.subscribed.items() if n not in ended}
            else:
                return False
        except (ValueError, KeyError, TypeError, RecursionError):
            return False
        return True

    def _subscribe(self, pairs: "list[tuple[object, Channel | None]]") -> None:
        """Add channels, under numbers that fit in a message; those not known are passed over."""
        fresh = dict(self.subscribed)
        for number, channel in pairs:
            if not (isinstance(number, int) and 0 <= number < _MOST_IDS):
                raise ValueError(number)
            if channel is not None:
                fresh[channel] = number
        self.subscribed = fresh

    def close(self) -> None:
        with self._lock:
            self.ended = True
            self.subscribed = {}
            self.socket.close()


MOST_CLIENTS = 16
"""Clients served at the same time, at most, and as many in the handshake."""

_QUEUE = 128  # connections that may wait to be accepted
_MOST_NOTICES = 16

FRAME = 1 / 30  # s between two pictures of the skin
_TICK = 0.1  # s between two checks of silent clients
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
            f"{target}: cannot be opened for listening ({reason(error)}); choose another port, or "
            "an address of this machine"
        ) from error
    try:
        check = AccessCheck(target.access, target.host, str(address[0]))
    except Refusal:
        server.close()
        raise
    return Foxglove(server, target.port, check, target.finger)


def _listening(family: int, address: Any) -> socket.socket:
    """A socket that listens and never waits."""
    made = socket.socket(family, socket.SOCK_STREAM)
    try:
        if sys.platform != "win32":  # there it would let two servers share a port
            made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        made.bind(address)
        made.listen(_QUEUE)
        made.setblocking(False)
    except OSError:
        made.close()
        raise
    return made


class Foxglove:
    """Serves clients that come and go on the listening socket `server` if `check` accepts them.

    Of a hand it serves one `finger`, whose name is in the topics.
    """

    def __init__(
        self, server: socket.socket, port: int, check: AccessCheck, finger: str = ""
    ) -> None:
        self._server, self._check, self._finger = server, check, finger
        invitation = check.invitation("ws", port)
        self.notices = (invitation,) if invitation else ()
        self.cue = None
        self._clients: tuple[FoxgloveClient, ...] = ()  # replaced whole: two threads read it
        self._disconnected = (0, 0)
        self._latest: EstimateMessage | None = None
        self._drawn: EstimateMessage | None = None
        self._skin, self._next_drawing = SkinMessages(), 0.0
        self._ending, self._wake = socket.socketpair()
        self._selector = selectors.DefaultSelector()
        for each in (server, self._ending):
            self._selector.register(each, selectors.EVENT_READ)
        self._thread = threading.Thread(target=self._serve, name="foxglove", daemon=True)
        self._thread.start()

    # What the thread that computes calls.

    @property
    def receivers(self) -> tuple[Receiver, ...]:
        return tuple(client.receiver for client in self._clients)

    @property
    def counts(self) -> tuple[int, int]:
        sent, dropped = self._disconnected
        for client in self._clients:
            sent, dropped = sent + client.sent, dropped + client.dropped
        return sent, dropped

    def send(self, message: EstimateMessage) -> None:
        self._latest = message
        for client in self._clients:
            subscribed = client.subscribed
            if CONTACT in subscribed:
                client.offer(CONTACT, message.timestamp, message.contact)
            for channel, made in ((POSE, pose), (FRAMES, frames)):
                if channel in subscribed and message.estimate.contact.present:
                    client.offer(channel, message.timestamp, made(message))
            if SHAPE in subscribed and message.mark.with_shape:
                client.offer(SHAPE, message.timestamp, message.shape)

    def report(self, state: SourceState) -> None:
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
        """Wait for the next event, and handle it; True at the end."""
        watched = any({SKIN, MESH} & {*client.subscribed} for client in self._clients)
        for key, _ in self._selector.select(FRAME if watched else _TICK):
            if key.fileobj is self._ending:
                return True
            if key.fileobj is self._server:
                self._accept()
            else:
                key.data.read()
        if len(self._clients) > MOST_CLIENTS:
            self._limit()
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
            made.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            name = f"{address[0]}:{address[1]}"
            client = FoxgloveClient(made, name, self._check, self._finger)
            self._clients = (*self._clients, client)
            self._selector.register(made, selectors.EVENT_READ, client)

    def _limit(self) -> None:
        """Drop who is too many: in the handshake the oldest; of the others who does not subscribe.

        Of those the oldest, and where all subscribe the newest.
        """
        waiting = [client for client in self._clients if not client.connected]
        served = sorted(
            (client for client in self._clients if client.connected),
            key=lambda client: (1, -client.since) if client.subscribed else (0, client.since),
        )
        for client in (*waiting[:-MOST_CLIENTS], *served[: max(len(served) - MOST_CLIENTS, 0)]):
            self._drop(client)

    def _drop(self, client: FoxgloveClient) -> None:
        refused, room = client.refused, len(self.notices) < _MOST_NOTICES
        if refused and refused not in self.notices and room:
            self.notices = (*self.notices, refused)
        self._selector.unregister(client.socket)
        client.close()
        sent, dropped = self._disconnected
        self._disconnected = sent + client.sent, dropped + client.dropped
        self._clients = tuple(other for other in self._clients if other is not client)

    def _draw(self) -> None:
        """Send the present skin to its subscribers, if it differs from the last one sent."""
        now, message = time.monotonic(), self._latest
        if message is None or message is self._drawn or now < self._next_drawing:
            return
        self._next_drawing, self._drawn = now + FRAME, message
        for channel in (SKIN, MESH):
            watching = [client for client in self._clients if channel in client.subscribed]
            if watching and (data := self._skin(channel, message)) is not None:
                for client in watching:
                    client.offer(channel, message.timestamp, data)
