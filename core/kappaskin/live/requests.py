"""What may be asked of the live process."""

from dataclasses import dataclass, field, replace
from pathlib import Path

from kappaskin.estimation import Region
from kappaskin.pipeline import Setup
from kappaskin.scenes import Scene


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


@dataclass(frozen=True)
class Entrust:
    """Keep `data` of whoever asks, for the one that asks after it is gone."""

    data: bytes


@dataclass(frozen=True)
class Goodbye:
    """End, in order."""


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
    | Entrust
    | Goodbye
)


@dataclass(frozen=True)
class Asked:
    """What was asked for last, of everything that lasts; another may go on with it."""

    setup: Setup = field(default_factory=Setup)
    compared: Setup | None = None
    region: Region = field(default_factory=Region)
    targets: tuple[str, ...] = ()
    source: str | None = None
    scene: Scene | None = None
    speed: float = 1.0
    recording: Path | None = None
    entrusted: bytes = b""

    def after(self, request: Request) -> "Asked":
        """The same once `request` was asked for too."""
        match request:
            case Setup():
                return replace(self, setup=request)
            case Compare():
                return replace(self, compared=request.setup)
            case Region():
                return replace(self, region=request)
            case Publish():
                return replace(self, targets=request.targets)
            case Connect():
                return replace(self, source=request.source, scene=None, speed=1.0)
            case Disconnect():
                return replace(self, source=None, scene=None, speed=1.0)
            case Scene():
                return replace(self, scene=request)
            case Seek():
                return replace(self, speed=request.speed)
            case Step():
                return replace(self, speed=0.0)
            case Record():
                return replace(self, recording=request.path)
            case Entrust():
                return replace(self, entrusted=request.data)
            case TakeTare() | Note() | Goodbye():
                return self
