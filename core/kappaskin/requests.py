"""What may be asked of the live process."""

from dataclasses import dataclass

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
class Seek:
    """Go on with a simulated scene from its time `at` in s, or from where it is, at a `speed`."""

    at: float | None
    speed: float


@dataclass(frozen=True)
class TakeTare:
    """Take a tare from now on, and hold what it finds against the tare of the setup."""


Request = Connect | Disconnect | Setup | Scene | Seek | Region | TakeTare
