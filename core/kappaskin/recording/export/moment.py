"""One frame of a recording with all that it came to."""

from pathlib import Path
from typing import NamedTuple, Protocol

from kappaskin.frames import Estimate, Frame
from kappaskin.pipeline import Pipeline
from kappaskin.recording.export.about import About
from kappaskin.recording.export.wanted import Wanted


class Moment(NamedTuple):
    """A `frame`, that came `at` s after the recording began, and what `pipeline` made of it."""

    at: float
    frame: Frame
    estimate: Estimate
    pipeline: Pipeline


class Writer(Protocol):
    """Writes what is `wanted` into the folder `room`; an `OSError` where there is no room."""

    def __init__(self, room: Path, wanted: Wanted, about: About) -> None: ...

    def take(self, moment: Moment) -> bool:
        """Write one moment; whether there was anything to write."""
        ...

    def finish(self) -> None:
        """Write what is still to be written."""
        ...

    def close(self) -> None:
        """Hold no file open any more."""
        ...
