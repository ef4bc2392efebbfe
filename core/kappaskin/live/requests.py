"""Requested state of the engine: what the window requests, and how it reaches the engine.

The window holds one frozen value, `Requested`, and the engine another; each change at the window
makes the next one and sends what the engine is not known to have. Every value has a number and the
newest wins, so that a dropped, late or duplicated message does not change the final state.
"""

import math
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from kappaskin.estimation import Region
from kappaskin.pipeline import Setup
from kappaskin.publish import THIS_MACHINE, Access
from kappaskin.recording import HandPart
from kappaskin.scenes import Scene

_RESEND = 0.5  # s after which an engine that reports, but not of what was sent, did not get it

SETTINGS = (
    *("setup", "compared", "region", "targets", "source", "scene", "recording", "recomputes"),
    "added_noise",
)
"""The fields of `Requested` that the engine reacts to when they change."""


@dataclass(frozen=True)
class Seek:
    """Continue a scene or recording from time `at` in s, or from its present time, at a `speed`.

    A recording that is `looped` restarts at its end; None leaves this setting unchanged.
    """

    at: float | None
    speed: float
    looped: bool | None = None

    def overtakes(self, other: "Action | str") -> bool:
        """Whether this request makes the `other` one, which came just before, ineffective."""
        if not isinstance(other, Seek) or self.at is None:
            return False
        return other.looped is None or self.looped is not None


@dataclass(frozen=True)
class StepFrames:
    """Pause a recording, so many `frames` further on, or back."""

    frames: int


@dataclass(frozen=True)
class TakeTare:
    """Take a tare from now on."""


@dataclass(frozen=True)
class Note:
    """A person's note, to be recorded."""

    text: str


@dataclass(frozen=True)
class RestartEffects:
    """Restart the simulated sensor's effects, as from rest."""


Action = Seek | StepFrames | TakeTare | Note | RestartEffects
"""Requests carried out once, as opposed to lasting settings."""


@dataclass(frozen=True)
class Requested:
    """All that is requested of the engine; another engine can continue with it.

    Lasting settings come first: `targets` that are servers have `access`, with `trust` the scene
    that `source` names may name files outside its folder, `recording` is a file or the part of a
    finger in that of a hand, whose messages name the `finger`, a scene or recording plays at
    `speed`, `looped` or not, a recording shows recorded estimates unless it `recomputes` them,
    `added_noise` in 1/m is added to the readings of shown estimates, and `window_state` is stored
    for a window
    that resumes the engine. `actions` are the last ones, each with the `number` of the value that
    added it; `changed` has the number with which each setting was last requested. `over` ends the
    engine.
    """

    finger: str = ""
    setup: Setup = field(default_factory=Setup)
    compared: Setup | None = None
    region: Region = field(default_factory=Region)
    targets: tuple[str, ...] = ()
    access: Access = THIS_MACHINE
    source: str | None = None
    trust: bool = False
    scene: Scene | None = None
    recording: Path | HandPart | None = None
    speed: float = 1.0
    looped: bool = False
    recomputes: bool = False
    added_noise: float = 0.0
    window_state: bytes = b""
    actions: tuple[tuple[int, Action], ...] = ()
    over: bool = False
    number: int = 0
    changed: Mapping[str, int] = field(default_factory=dict[str, int])

    def changing(self, **settings: Any) -> "Requested":
        """The next value, in which these settings are requested, the same ones as before or not."""
        number = self.number + 1
        changed = {**self.changed, **dict.fromkeys(settings, number)}
        return replace(self, number=number, changed=changed, **settings)

    def doing(self, action: Action, **settings: Any) -> "Requested":
        """The next value, in which an `action` is requested, and these settings."""
        actions = (*self.actions, (self.number + 1, action))
        return self.changing(actions=actions, **settings)

    def without_actions(self, number: int) -> "Requested":
        """The same without the actions up to `number`."""
        return replace(self, actions=tuple(each for each in self.actions if each[0] > number))

    def since(self, number: int) -> "list[str | Action]":
        """The settings, by name, and actions requested after `number`, in order.

        A seek that the next one overtakes is left out.
        """
        settings = [(self.changed.get(name, 0), name) for name in SETTINGS]
        # A stable sort: of one number the settings go first, the source before its scene.
        ordered = sorted([*settings, *self.actions], key=lambda each: each[0])
        found: list[str | Action] = []
        for at, each in ordered:
            if at <= number:
                continue
            if found and isinstance(each, Seek) and each.overtakes(found[-1]):
                found.pop()
            found.append(each)
        return found

    def update(self, number: int) -> "Update":
        """The update that turns any value from `number` on into this one."""
        changed = {name: at for name, at in self.changed.items() if at > number}
        values = {name: getattr(self, name) for name in changed}
        return Update(self.number, number, values, changed)

    def updated(self, update: "Update") -> "Requested":
        """The value after an `update`, or this one where the update is not newer."""
        if not update.number > self.number >= update.since:
            return self
        changed = {**self.changed, **update.changed}
        return replace(self, number=update.number, changed=changed, **update.values)


@dataclass(frozen=True)
class Update:
    """The message to the engine: what of `Requested` has `changed` after the number `since`."""

    number: int
    since: int
    values: Mapping[str, Any]
    changed: Mapping[str, int]


class RequestSender:
    """The window's side: holds what is `requested`, and sends it until the engine has it."""

    def __init__(self, requested: Requested, clock: Callable[[], float] = time.monotonic) -> None:
        self.requested, self._clock = requested, clock
        self._line: Connection[Update, Any] | None = None
        self._known, self._sent = 0, math.inf

    def connect(self, line: "Connection[Update, Any]", known: int = 0) -> None:
        """Send all of it by `line` to an engine that has the value numbered `known`.

        To another engine than before no action is sent again.
        """
        self._line, self._known = line, known
        self.requested = self.requested.without_actions(self.requested.number)
        self._send()

    def change(self, **settings: Any) -> None:
        """Request these settings."""
        self.requested = self.requested.changing(**settings)
        self._send()

    def act(self, action: Action, **settings: Any) -> None:
        """Request an action, and the settings that come with it."""
        self.requested = self.requested.doing(action, **settings)
        self._send()

    def acknowledge(self, number: int, reported: float) -> None:
        """The engine `reported`, at a monotonic time in s, that it has the value of this number."""
        if number > self._known:
            self._known = number
            self.requested = self.requested.without_actions(number)
        if self._known < self.requested.number and reported > self._sent + _RESEND:
            self._send()

    def _send(self) -> None:
        if self._line is None or self._known == self.requested.number:
            return
        self._sent = self._clock()
        with suppress(OSError):  # the process died: `status` says so
            self._line.send(self.requested.update(self._known))

    def say_goodbye(self) -> None:
        """End the engine; `requested` stays as it is, for another engine."""
        if self._line is not None:
            with suppress(OSError):
                self._line.send(self.requested.changing(over=True).update(self._known))

    def disconnect(self) -> None:
        """Close the line."""
        if self._line is not None:
            self._line.close()
        self._line = None
