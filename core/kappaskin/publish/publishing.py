"""Publishing: targets such as `udp://HOST:PORT`."""

import math
import re
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from typing import Protocol, cast

import numpy as np

from kappaskin.errors import Refusal, optional
from kappaskin.frames import Estimate
from kappaskin.pipeline import Pipeline
from kappaskin.publish.access import THIS_MACHINE, Access
from kappaskin.publish.haptic_cue import CueLimits, limits_of
from kappaskin.publish.message import EstimateMessage, MessageHeader, SourceState, epoch


@dataclass(frozen=True)
class Receiver:
    """A receiver of messages: counts of `sent` and `dropped`, and why the last one was dropped."""

    name: str
    sent: int = 0
    dropped: int = 0
    trouble: str = ""


class Publisher(Protocol):
    """Transport of messages to receivers.

    No call waits for a receiver: what one does not take at once is dropped and counted.
    """

    @property
    def receivers(self) -> tuple[Receiver, ...]: ...

    @property
    def counts(self) -> tuple[int, int]:
        """Messages sent and dropped, with those of receivers that have gone."""
        ...

    @property
    def notices(self) -> tuple[str, ...]:
        """What a person has to know of those who connect, each once."""
        ...

    @property
    def cue(self) -> "CueStatus | None":
        """The state of the haptic cues that it sends."""
        ...

    def send(self, message: EstimateMessage) -> None:
        """Send the estimate of one frame."""
        ...

    def report(self, state: SourceState) -> None:
        """Send the state of the source; called several times a second."""
        ...

    def close(self) -> None: ...


MOST_TARGETS = 8
"""Targets published to at the same time, at most."""

PORTS = {"udp": 9870, "foxglove": 8765, "cue": 9871, "rerun": 9876}  # but for cue, viewers' own
_HOSTS = {"udp": "", "foxglove": "127.0.0.1", "cue": "", "rerun": "127.0.0.1"}
_SERVERS = ("foxglove",)
_FORM = re.compile(
    r"(\w+)://(?:\[([0-9a-fA-F:.]+(?:%[\w.-]+)?)\]|([\w.-]*))"  # IPv6, or a name
    r"(?::([^:/?]*))?/?(?:\?(.*))?"
)
_LONGEST = 253  # characters of a name on the internet


@dataclass(frozen=True)
class Target:
    """Destination of messages, by `scheme` their transport; `access` where others connect to it.

    Of a hand it is that of one `finger`. Haptic cues keep the `limits`.
    """

    scheme: str
    host: str
    port: int
    access: Access = THIS_MACHINE
    finger: str = ""
    limits: CueLimits = field(default_factory=CueLimits)

    @property
    def place(self) -> tuple[str, str, int]:
        """Where it is, whatever it gets there."""
        return self.scheme, self.host, self.port

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        query = f"?{self.limits.query}".removesuffix("?")
        return f"{self.scheme}://{host}:{self.port}{query}"


def target_of(text: str) -> Target:
    """The target that `text` names; a `Refusal` for an invalid one."""
    found = _FORM.fullmatch(text.strip())
    scheme = found[1].lower() if found else ""
    if found is None or scheme not in PORTS or (found[5] and scheme != "cue"):
        raise Refusal(
            "expected a target such as udp://127.0.0.1:9870, foxglove://, rerun:// or "
            f"cue://127.0.0.1:9871?force=2, got {text[:99]!r}"
        )
    host = (found[2] or found[3] or _HOSTS[scheme]).lower()
    if not host or len(host) > _LONGEST:
        raise Refusal(
            f"expected a host in front of the port, such as udp://127.0.0.1:9870, got {text[:99]!r}"
        )
    port = _port(found[4], PORTS[scheme])
    return Target(scheme, host, port, limits=limits_of(found[5] or ""))


def _port(text: str | None, usual: int) -> int:
    if text is None:
        return usual
    if not re.fullmatch("[0-9]{1,5}", text) or not 0 < int(text) < 65536:
        raise Refusal(f"expected a port from 1 to 65535, got {text[:20]!r}")
    return int(text)


def targets_of(texts: Sequence[str], access: Access = THIS_MACHINE) -> tuple[Target, ...]:
    """The targets with these names, of which servers have `access`; a `Refusal` for duplicates."""
    found = map(target_of, texts)
    targets = tuple(replace(t, access=access) if t.scheme in _SERVERS else t for t in found)
    for number, target in enumerate(targets):
        if any(target.place == one.place for one in targets[:number]):
            raise Refusal(f"{target} is given twice; give every target once")
    if len(targets) > MOST_TARGETS:
        raise Refusal(f"expected at most {MOST_TARGETS} targets, got {len(targets)}")
    return targets


def of_finger(texts: Sequence[str], number: int) -> list[str]:
    """The targets with these names for the finger of this `number` in a hand, from 0.

    A receiver gets the messages of all fingers; of servers each finger has one, at the port so many
    higher. A `Refusal` where that is none.
    """
    targets = (
        replace(target, port=target.port + number * (target.scheme in _SERVERS))
        for target in targets_of(texts)
    )
    return [str(target) for target in targets_of([str(target) for target in targets])]


def reason(error: OSError | UnicodeError) -> str:
    """The message of a system error, without its number."""
    return getattr(error, "strerror", None) or str(error)


def opened(target: Target) -> Publisher:
    """The transport to `target`; a `Refusal` where it cannot be opened. May take seconds."""
    # By name: a transport is imported when it is first used.
    module = optional(f"kappaskin.publish.{target.scheme}", target.scheme, str(target))
    return cast("Publisher", module.opened(target))


SHAPES = 0.01
"""Seconds between two messages of kind shape at least: they are long, and change slowly."""

_PATIENCE = 5.0  # s that finding a host and binding a port may take
_KEPT = 1024  # messages that the percentiles are taken over
_EVERY = 1.0  # s between two computations of them

Opened = Callable[[Target], Publisher]


@dataclass(frozen=True)
class Latency:
    """99th percentiles in s: from the arrival of a frame's bytes until its message was sent.

    And of its parts: the `wait` for the computing to begin, `compute` and `send`.
    """

    whole: float = math.nan
    wait: float = math.nan
    compute: float = math.nan
    send: float = math.nan


@dataclass(frozen=True)
class CueStatus:
    """State of haptic cues since the last status: that of the faintest one, and its `scale`.

    Percentiles in s of the time from the arrival of a frame's bytes until the first cue of its
    estimate was sent: `half`, the median, and `most`, the 99th; `missed` counts the cues that were
    not sent since their time had passed.
    """

    state: str = ""
    scale: float = 1.0
    half: float = math.nan
    most: float = math.nan
    missed: int = 0


@dataclass(frozen=True)
class TargetStatus:
    """State of a target: `opening`, refused and why, or sent to.

    `sent` and `dropped` count with receivers that have gone. `notices` are what a person has to
    know of those who connect, each once. Of a haptic device there is a `cue`.
    """

    target: str
    opening: bool = False
    refusal: str = ""
    sent: int = 0
    dropped: int = 0
    receivers: tuple[Receiver, ...] = ()
    notices: tuple[str, ...] = ()
    cue: CueStatus | None = None


@dataclass(frozen=True)
class PublishStatus:
    """State of each target, and the latency of messages."""

    targets: tuple[TargetStatus, ...] = ()
    latency: Latency = field(default_factory=Latency)


class _OpenTarget:
    """A target and its transport, once that is open."""

    def __init__(self, target: Target, how: Opened, clock: Callable[[], float]) -> None:
        self.target, self._clock = target, clock
        self.publisher: Publisher | None = None
        self.refusal, self._until = "", clock() + _PATIENCE
        self._opening: Future[Publisher] = Future()
        # A daemon: a name lookup cannot be cancelled, and is not worth waiting for.
        threading.Thread(
            target=_open, args=(self._opening, how, target), name="target-opener", daemon=True
        ).start()

    def check(self) -> None:
        """Take over the opened transport, or the reason why it cannot be opened."""
        if self.publisher is not None or self.refusal:
            return
        if self._opening.done():
            try:
                self.publisher = self._opening.result()
            except Refusal as refusal:
                self.refusal = str(refusal)
        elif self._clock() > self._until and self._opening.cancel():
            self.refusal = (
                f"{self.target}: its address was not found within {_PATIENCE:g} s; give "
                "the address instead of the name"
            )

    def status(self) -> TargetStatus:
        name, sender = str(self.target), self.publisher
        if sender is None:
            return TargetStatus(name, not self.refusal, self.refusal)
        rest = sender.receivers, sender.notices, sender.cue
        return TargetStatus(name, False, "", *sender.counts, *rest)

    def close(self) -> None:
        if not self._opening.cancel() and self._opening.exception() is None:
            self._opening.result().close()


def _open(opening: "Future[Publisher]", how: Opened, target: Target) -> None:
    """Open `target`; closed again if it is no longer requested."""
    try:
        made = how(target)
    except Refusal as refusal:
        if opening.set_running_or_notify_cancel():
            opening.set_exception(refusal)
        return
    if opening.set_running_or_notify_cancel():
        opening.set_result(made)
    else:
        made.close()


class Publishing:
    """Publishes to the requested targets, initially none."""

    def __init__(self, how: Opened = opened, clock: Callable[[], float] = time.monotonic) -> None:
        self._how, self._clock = how, clock
        self._places: list[_OpenTarget] = []
        self._source, self._epoch, self._finger = "", epoch(), ""
        self._number, self._next_shape = 0, -math.inf
        self._parts: deque[tuple[float, float, float]] = deque(maxlen=_KEPT)
        self._latency, self._next_check = Latency(), -math.inf

    def request(
        self, texts: Sequence[str], access: Access = THIS_MACHINE, finger: str = ""
    ) -> None:
        """Publish to these targets, of which servers have `access`, what a `finger` feels.

        Open ones stay open, refused ones are retried; servers of other access are opened again.
        """
        self._finger = finger
        targets = [replace(each, finger=finger) for each in targets_of(texts, access)]
        open_already = {p.target: p for p in self._places if p.target in targets and not p.refusal}
        for place in self._places:
            if place.target not in open_already:
                place.close()
        self._places = [
            open_already[target]
            if target in open_already
            else _OpenTarget(target, self._how, self._clock)
            for target in targets
        ]
        if not targets:
            self._parts.clear()
            self._latency = Latency()

    @property
    def active(self) -> bool:
        """Whether there are targets."""
        return bool(self._places)

    def send(self, estimate: Estimate, pipeline: Pipeline, began: float) -> None:
        """Send an estimate of the `pipeline`, computed since the monotonic time `began` in s."""
        senders = [place.publisher for place in self._places if place.publisher is not None]
        fit = pipeline.fitted
        if not senders or fit is None:
            return
        with_shape = began >= self._next_shape
        if with_shape:
            self._next_shape = began + SHAPES
        mark = MessageHeader(self._source, self._epoch, self._number, with_shape, self._finger)
        message = EstimateMessage(estimate, fit, pipeline, mark)
        self._number += 1
        for sender in senders:
            sender.send(message)
        ready = estimate.ready_time
        if all(place.target.scheme == "cue" for place in self._places):
            return  # which tells itself how late it is
        self._parts.append((began - estimate.host_time, ready - began, self._clock() - ready))

    def report(self, state: SourceState) -> None:
        """Send the state of the source, and take over targets that have been opened."""
        self._source, self._epoch = state.source, epoch()
        for place in self._places:
            place.check()
            if place.publisher is not None:
                place.publisher.report(replace(state, finger=self._finger))

    @property
    def status(self) -> PublishStatus:
        now = self._clock()
        if self._parts and now >= self._next_check:
            self._next_check = now + _EVERY
            parts = np.array(self._parts)
            whole = np.percentile(parts.sum(axis=1), 99)
            self._latency = Latency(float(whole), *np.percentile(parts, 99, axis=0).tolist())
        return PublishStatus(tuple(place.status() for place in self._places), self._latency)

    def close(self) -> None:
        self.request(())
