"""What is to be exported, and whether that can be."""

import math
from dataclasses import dataclass
from pathlib import Path

from kappaskin.errors import Refusal
from kappaskin.pipeline import Setup
from kappaskin.recording.disk import is_there

TABLES = (".csv", ".npz", ".h5")
"""Suffixes of files with a row for each frame."""

SURFACES = (".vtp", ".stl", ".pvd")
"""Suffixes of files of the skin's surface."""


@dataclass(frozen=True)
class Wanted:
    """The file `to` of a `recording`, in the format that its suffix names.

    Times are in s since the recording began: from `begin` until `end`, one frame each `every` s, or
    all where that is 0; or the first frame from `at` on alone. Frames are worked out with the
    settings that were recorded, or with `setup`. A `Refusal` where that makes no file.
    """

    recording: Path
    to: Path
    begin: float = 0.0
    end: float = math.inf
    every: float = 0.0
    at: float | None = None
    setup: Setup | None = None

    def __post_init__(self) -> None:
        self._check_times()
        self._check_format()
        self._check_place()

    @property
    def format(self) -> str:
        return self.to.suffix.lower()

    @property
    def folder(self) -> Path | None:
        """Where the files of a series are; None for one file."""
        series = self.format == ".pvd" or (self.format == ".stl" and self.at is None)
        return self.to.with_suffix("") if series else None

    @property
    def beside(self) -> Path | None:
        """The file that tells of an STL file what that cannot tell itself."""
        return self.to.with_suffix(".json") if self.format == ".stl" else None

    @property
    def files(self) -> tuple[Path, ...]:
        """All that is made: files, and the folder of a series."""
        alone = self.format == ".stl" and self.folder is not None
        places = (None if alone else self.to, self.folder, self.beside)
        return tuple(place for place in places if place is not None)

    @property
    def first(self) -> float:
        """From when on frames are taken, in s since the beginning."""
        return self.begin if self.at is None else self.at

    def _check_times(self) -> None:
        at = self.first
        if not (math.isfinite(at) and self.end >= at >= 0 and 0 <= self.every < math.inf):
            raise Refusal(
                f"expected times in s from 0 on, in order, got from {at:g} until {self.end:g}, "
                f"every {self.every:g}"
            )
        if self.at is not None and (self.begin, self.end, self.every) != (0.0, math.inf, 0.0):
            raise Refusal("expected one moment, or a span, got both; leave one of them out")

    def _check_format(self) -> None:
        if self.format not in TABLES + SURFACES:
            raise Refusal(
                f"{self.to}: expected a file that ends in one of {', '.join(TABLES + SURFACES)}"
            )
        if self.format in TABLES and self.at is not None:
            raise Refusal(
                f"a {self.format} has a row for each frame: give from when until when instead of "
                "a moment"
            )
        if self.format == ".vtp" and self.at is None:
            raise Refusal(
                "a .vtp is the skin at one moment: give it, or export a series to a .pvd, with "
                "the time between two surfaces"
            )
        if self.format == ".pvd" and not self.every:
            raise Refusal("a .pvd is a series: give the time between two surfaces")
        if self.format == ".stl" and self.at is None and not self.every:
            raise Refusal(
                "an .stl is the skin at one moment, or a series: give the moment, or the time "
                "between two surfaces"
            )

    def _check_place(self) -> None:
        for place in self.files:
            if is_there(place):
                raise Refusal(f"{place}: is there already; choose another name")
