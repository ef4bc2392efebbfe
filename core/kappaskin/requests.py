"""What may be asked of the live process."""

from dataclasses import dataclass
from pathlib import Path

from kappaskin.pipeline import Setup
from kappaskin.region import Region
from kappaskin.scene import Scene


@dataclass(frozen=True)
class Connect:
    source: str


@dataclass(frozen=True)
class Disconnect:
    pass


@dataclass(frozen=True)
class Compare:
    """Compute with another setup too, beside the one in use; None to end that."""

    setup: Setup | None


@dataclass(frozen=True)
class Seek:
    """Go on with a scene or recording from its time `at` in s, or from where it is, at a `speed`.

    A recording that is `looped` begins anew at its end; None leaves that as it is.
    """

    at: float | None
    speed: float
    looped: bool | None = None


@dataclass(frozen=True)
class Step:
    """Let a recording stand, so many `frames` further on, or back."""

    frames: int


@dataclass(frozen=True)
class TakeTare:
    """Take a tare from now on, and hold what it finds against the tare of the setup."""


@dataclass(frozen=True)
class Record:
    """Record to a file at `path` from now on, None to end that."""

    path: Path | None


@dataclass(frozen=True)
class Note:
    """Something that a person wants to be recorded, in words."""

    text: str


@dataclass(frozen=True)
class Publish:
    """Publish to these targets, and to no others."""

    targets: tuple[str, ...]


Request = (
    Connect
    | Disconnect
    | Setup
    | Compare
    | Scene
    | Seek
    | Step
    | Region
    | TakeTare
    | Record
    | Note
    | Publish
)
