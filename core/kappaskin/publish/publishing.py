"""Estimates to every target that was asked for: opened beside the frames, sent between them."""

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field

import numpy as np

from kappaskin.errors import Refusal
from kappaskin.frames import Estimate
from kappaskin.pipeline import Pipeline
from kappaskin.publish.message import Mark, Message, State, epoch
from kappaskin.publish.publisher import Publisher, Receiver
from kappaskin.publish.target import Target, opened, targets_of

SHAPES = 0.01
"""Seconds between two messages of kind shape at least: they are long, and change slowly."""

_PATIENCE = 5.0  # s that finding a host and binding a port may take
_KEPT = 1024  # messages that the percentiles are taken over
_EVERY = 1.0  # s between two looks at them

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
class Published:
    """How a target is doing: `opening`, refused and why, or sent to.

    `sent` and `dropped` count with receivers that have gone.
    """

    target: str
    opening: bool = False
    refusal: str = ""
    sent: int = 0
    dropped: int = 0
    receivers: tuple[Receiver, ...] = ()


@dataclass(frozen=True)
class PublishNews:
    """How each target is doing, and how late messages are."""

    targets: tuple[Published, ...] = ()
    latency: Latency = field(default_factory=Latency)


class _Place:
    """A target and what sends there, once it is open."""

    def __init__(self, target: Target, how: Opened, clock: Callable[[], float]) -> None:
        self.target, self._clock = target, clock
        self.publisher: Publisher | None = None
        self.refusal, self._until = "", clock() + _PATIENCE
        self._opening: Future[Publisher] = Future()
        # A daemon: nothing ends a look for a name, and none is worth waiting for.
        threading.Thread(
            target=_open, args=(self._opening, how, target), name="target-opener", daemon=True
        ).start()

    def look(self) -> None:
        """Take over what was opened, or why it cannot be."""
        if self.publisher is not None or self.refusal:
            return
        if self._opening.done():
            try:
                self.publisher = self._opening.result()
            except Refusal as refusal:
                self.refusal = str(refusal)
        elif self._clock() > self._until and self._opening.cancel():
            self.refusal = (
                f"{self.target}: it was not found out within {_PATIENCE:g} s where that is; give "
                "its address instead of its name"
            )

    def news(self) -> Published:
        name, sender = str(self.target), self.publisher
        if sender is None:
            return Published(name, not self.refusal, self.refusal)
        return Published(name, False, "", *sender.counts, sender.receivers)

    def close(self) -> None:
        if not self._opening.cancel() and self._opening.exception() is None:
            self._opening.result().close()


def _open(opening: "Future[Publisher]", how: Opened, target: Target) -> None:
    """Open `target`; closed again where nobody waits for it any more."""
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
    """Publishes to the targets that were asked for last; at first there are none."""

    def __init__(self, how: Opened = opened, clock: Callable[[], float] = time.monotonic) -> None:
        self._how, self._clock = how, clock
        self._places: list[_Place] = []
        self._source, self._epoch = "", epoch()
        self._number, self._next_shape = 0, -math.inf
        self._parts: deque[tuple[float, float, float]] = deque(maxlen=_KEPT)
        self._latency, self._next_look = Latency(), -math.inf

    def ask(self, texts: Sequence[str]) -> None:
        """Publish to these targets; those that are open stay so, what was refused is tried anew."""
        wanted = targets_of(texts)
        kept = {p.target: p for p in self._places if p.target in wanted and not p.refusal}
        for place in self._places:
            if place.target not in kept:
                place.close()
        self._places = [
            kept[target] if target in kept else _Place(target, self._how, self._clock)
            for target in wanted
        ]
        if not wanted:
            self._parts.clear()
            self._latency = Latency()

    @property
    def active(self) -> bool:
        """Whether anything is to be published."""
        return bool(self._places)

    def send(self, estimate: Estimate, pipeline: Pipeline, began: float) -> None:
        """Send what was estimated by the `pipeline` just now, which `began` at a monotonic time."""
        senders = [place.publisher for place in self._places if place.publisher is not None]
        fit = pipeline.fitted
        if not senders or fit is None:
            return
        with_shape = began >= self._next_shape
        if with_shape:
            self._next_shape = began + SHAPES
        mark = Mark(self._source, self._epoch, self._number, with_shape)
        message = Message(estimate, fit, pipeline, mark)
        self._number += 1
        for sender in senders:
            sender.send(message)
        ready = estimate.ready_time
        self._parts.append((began - estimate.host_time, ready - began, self._clock() - ready))

    def tell(self, state: State) -> None:
        """Say how the source is doing, and see which targets have been opened."""
        self._source, self._epoch = state.source, epoch()
        for place in self._places:
            place.look()
            if place.publisher is not None:
                place.publisher.tell(state)

    @property
    def news(self) -> PublishNews:
        now = self._clock()
        if self._parts and now >= self._next_look:
            self._next_look = now + _EVERY
            parts = np.array(self._parts)
            whole = np.percentile(parts.sum(axis=1), 99)
            self._latency = Latency(float(whole), *np.percentile(parts, 99, axis=0).tolist())
        return PublishNews(tuple(place.news() for place in self._places), self._latency)

    def close(self) -> None:
        self.ask(())
