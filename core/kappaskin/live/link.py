"""The connection of a window to an engine on another machine: messages, and proof of the token.

The engine greets with a challenge, the window answers it with one of its own, and the engine
answers that: both have shown that they have the token, which is never sent. What follows is
neither encrypted nor signed.
"""

import hmac
import platform
import secrets
import select
import socket
import struct
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from importlib import metadata

from kappaskin._text import printable
from kappaskin.errors import Refusal, SourceError
from kappaskin.live.codec import LARGEST, BadMessageError, decoded, encoded
from kappaskin.live.requests import Action, Requested
from kappaskin.sources import Source, register_scheme

PORT = 9871
"""The port of an engine that listens, unless another one is given."""
SCHEME = "engine:"
"""The beginning of the name of an engine on another machine, `engine:HOST:PORT`."""

_LENGTH = struct.Struct("<I")  # before each message
_UNPROVEN = 4096  # bytes of a message at most, from one that has not shown that it has the token
_READ = 2**18  # bytes read at once
_NAME = 80  # characters of the name of a machine
VERSION = metadata.version("kappaskin")


@dataclass(frozen=True)
class Greeting:
    """First message of the engine: its version, and a `challenge`."""

    version: str
    challenge: bytes


@dataclass(frozen=True)
class Answer:
    """The window's answer: `proof` that it has the token, a `challenge`, and who it is.

    `window` is a secret that tells it from others, `machine` its machine's name, and `finger` the
    one that the connection is for; without one it asks what there is.
    """

    version: str
    proof: bytes
    challenge: bytes
    window: str
    machine: str
    finger: str | None


@dataclass(frozen=True)
class Welcome:
    """The engine's answer to that: its `proof`, and what is requested of each finger.

    `received` is the number of the last `Change` that came from this window, below zero where none
    did since another window was connected, or the engine was started.
    """

    proof: bytes
    fingers: Mapping[str, Requested]
    received: int = -1


@dataclass(frozen=True)
class Denied:
    """The engine ends the connection, and why."""

    reason: str


@dataclass(frozen=True)
class Change:
    """Settings of `Requested` by name, as bytes, and actions that the window requests."""

    number: int
    settings: Mapping[str, bytes]
    actions: tuple[Action, ...] = ()


@dataclass(frozen=True)
class Seen:
    """The window has received the report or estimate of this number."""

    number: int


@dataclass(frozen=True)
class Ping:
    """Sent by the window at this time in s on its clock."""

    sent: float


@dataclass(frozen=True)
class Pong:
    """The engine's answer to a ping, at `time` in s on its clock."""

    sent: float
    time: float


@dataclass(frozen=True)
class Report:
    """What has changed of the engine's status: fields by name, as bytes.

    The engine has all changes up to `received`.
    """

    number: int
    received: int
    fields: Mapping[str, bytes]


@dataclass(frozen=True)
class Shown:
    """An estimate as the bytes of its record, of the `generation` and its `count` in it.

    `compared` is that of the same frame with the other setup, empty without one.
    """

    number: int
    generation: int
    count: int
    record: bytes
    compared: bytes


Message = Greeting | Answer | Welcome | Denied | Change | Seen | Ping | Pong | Report | Shown


class MessageSocket:
    """Messages over a connected socket. No call waits but `expect`; an `OSError` at its end.

    Until it is `proven` only short ones are read. A `BadMessageError` for anything else than one.
    """

    def __init__(self, line: socket.socket) -> None:
        line.setblocking(False)
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.line, self.proven = line, False
        self.heard = time.monotonic()
        """When something came last, in s on the monotonic clock."""
        self._in, self._out = bytearray(), bytearray()

    def fileno(self) -> int:
        return self.line.fileno()

    @property
    def waiting(self) -> int:
        """Bytes that the connection has not taken yet."""
        return len(self._out)

    def send(self, message: Message) -> None:
        data = encoded(message)
        self._out += _LENGTH.pack(len(data)) + data
        self.flush()

    def flush(self) -> None:
        """Hand over what the connection takes."""
        with suppress(BlockingIOError):
            while self._out:
                del self._out[: self.line.send(memoryview(bytes(self._out[:_READ])))]

    def receive(self) -> list[Message]:
        """The messages that have come."""
        ended = self._read()
        found = list(iter(self._next, None))
        if ended and not found:
            raise ConnectionResetError("the other end closed the connection")
        return found

    def _read(self) -> bool:
        """Read what has come; whether it has ended."""
        with suppress(BlockingIOError):
            while len(self._in) <= self._most:
                data = self.line.recv(_READ)
                if not data:
                    return True
                self._in += data
                self.heard = time.monotonic()
        return False

    @property
    def _most(self) -> int:
        return LARGEST if self.proven else _UNPROVEN

    def _next(self) -> Message | None:
        if len(self._in) < _LENGTH.size:
            return None
        (length,) = _LENGTH.unpack_from(self._in)
        if length > self._most:
            raise BadMessageError(f"expected a message of at most {self._most} bytes, got {length}")
        if len(self._in) < _LENGTH.size + length:
            return None
        data = bytes(self._in[_LENGTH.size : _LENGTH.size + length])
        del self._in[: _LENGTH.size + length]
        return decoded(data, Message, self._most)

    def expect(self, end: float) -> Message:
        """The next message, until a monotonic time in s; an `OSError` where none comes."""
        ended = False
        while (message := self._next()) is None:
            left = end - time.monotonic()
            if ended:
                raise ConnectionResetError("the other end closed the connection")
            if left <= 0:
                raise TimeoutError("no answer")
            select.select([self], [self] if self._out else [], [], left)
            self.flush()
            ended = self._read()
        return message

    def close(self) -> None:
        self.line.close()


def proof_of(token: str, role: str, *secrets_of_both: bytes) -> bytes:
    """Proof that a side in its `role` has the token, without telling it (HMAC of SHA-256)."""
    return hmac.digest(token.encode(), b"\0".join([role.encode(), *secrets_of_both]), "sha256")


@dataclass(frozen=True)
class EngineAddress:
    """Where an engine listens, the token for it, and the `window` that connects."""

    host: str
    port: int
    token: str
    window: str

    @property
    def place(self) -> str:
        """The host and the port as text."""
        return place_text(self.host, self.port)

    def connect(self, finger: str | None, within: float) -> tuple[MessageSocket, Welcome]:
        """A connection, and what the engine has: a `SourceError` where there is none.

        Where it is denied, a plain `Refusal`. It takes at most some `within` s.
        """
        end = time.monotonic() + within
        try:
            line = MessageSocket(socket.create_connection((self.host, self.port), within))
        except OSError as error:
            raise SourceError(
                f"expected an engine at {self.place}, got no connection "
                f"({error.strerror or error}); start `kappaskin serve` there"
            ) from error
        try:
            return line, self._introduce(line, finger, end)
        except OSError as error:
            line.close()
            raise SourceError(
                f"expected an engine at {self.place}, got {error.strerror or error}"
            ) from error
        except BadMessageError:
            line.close()
            raise Refusal(
                f"expected an engine of Kappaskin {VERSION} at {self.place}, got something else; "
                "check the port"
            ) from None
        except BaseException:
            line.close()
            raise

    def _introduce(self, line: MessageSocket, finger: str | None, end: float) -> Welcome:
        greeting, challenge = line.expect(end), secrets.token_bytes(32)
        if isinstance(greeting, Denied):
            raise Refusal(f"{self.place}: {printable(greeting.reason)}")
        if not isinstance(greeting, Greeting):
            raise BadMessageError("expected a greeting")
        check_version(greeting.version, f"the engine at {self.place}")
        both = greeting.challenge, challenge
        proof = proof_of(self.token, "window", *both)
        machine = platform.node()[:_NAME]
        line.send(Answer(VERSION, proof, challenge, self.window, machine, finger))
        line.proven = True  # a large tare makes a long welcome
        welcome = line.expect(end)
        if isinstance(welcome, Denied):
            raise Refusal(f"{self.place}: {printable(welcome.reason)}")
        if not isinstance(welcome, Welcome):
            raise BadMessageError("expected a welcome")
        if not hmac.compare_digest(welcome.proof, proof_of(self.token, "engine", *both)):
            raise Refusal(f"{self.place} does not have the token: it is another program")
        return welcome


def check_version(version: str, whose: str) -> None:
    """Raise a `Refusal` for another version than this one."""
    if version != VERSION:
        raise Refusal(
            f"expected the same version at both ends, got {printable(version[:20])} of {whose} and "
            f"{VERSION} here; install the same one"
        )


def _refuse(name: str, _: bool) -> Source:
    raise Refusal(
        f"expected a source of readings, got the engine {name}; open `kappaskin app --source "
        f"{SCHEME}{name}`, with no other source"
    )


register_scheme(SCHEME, _refuse)


def place_text(host: str, port: int) -> str:
    """HOST, or HOST:PORT where it is not the usual one, as `place_of` reads it."""
    host = f"[{host}]" if ":" in host else host
    return host if port == PORT else f"{host}:{port}"


def place_of(text: str) -> tuple[str, int]:
    """Host and port in HOST[:PORT], with an IPv6 address in brackets; a `Refusal` for no such."""
    host, colon, port = text.rpartition(":")
    if not colon or text.endswith("]"):
        host, port = text, str(PORT)
    whole = host.startswith("[") == host.endswith("]") and (":" not in host or "[" in host)
    if not (host.strip("[]") and whole and port.isascii() and port.isdigit()):
        raise Refusal(f"expected HOST or HOST:PORT, got {text!r:.99}")
    if not 0 <= int(port) < 2**16:
        raise Refusal(f"expected a port up to 65535, got {port:.20}")
    return host.strip("[]"), int(port)
