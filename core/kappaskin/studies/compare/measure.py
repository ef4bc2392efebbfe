"""Every way through the same work: how far off it comes out, how long it takes, what it holds."""

import statistics
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import cycle
from typing import Any

import numpy as np

from kappaskin.studies.compare.elements import library
from kappaskin.studies.compare.way import Way
from kappaskin.studies.compare.works import Work, works
from kappaskin.studies.cost.bench import seconds, traced

_TURNS, _BUDGET = (7, 201), 0.1  # least and most that are timed of a work, and about how long in s


@dataclass(frozen=True)
class Compared:
    """One way through one work; lengths in mm, times in s, memory in bytes.

    `error_bars` tells whether the answers come with some, None where there is nothing to err about.
    `e_mm` and `rms_mm` are means over draws with noise of the signed error at the load and of the
    RMS error over the skin, `e_sd_mm` is that error's standard deviation; None where there is no
    noise. Those of exact readings are `exact`. `setup_s` goes to the first answer, `frame_s` is the
    median of the next ones, and `ratio` is that over the median of our first way. `memory_bytes` is
    the most that the set-up and an answer held at once.
    """

    work: str
    by: str
    unknowns: int
    error_bars: bool | None
    e_exact_mm: float
    rms_exact_mm: float
    e_mm: float | None
    e_sd_mm: float | None
    rms_mm: float | None
    setup_s: float
    frame_s: float
    ratio: float
    memory_bytes: int


def compared() -> list[Compared]:
    """All works by all ways; raises a `Refusal` when what they need is not installed."""
    library()  # at once, not after half of the work
    return [row for work in works() for row in _through(work)]


def _through(work: Work) -> list[Compared]:
    made = [_made(make, work.asked) for make in work.ways.values()]
    medians = _medians([way for way, _, _ in made], work.draws)
    return [
        Compared(
            work.name,
            by,
            way.count,
            way.error_bars if work.noisy else None,
            *_errors(work, way),
            setup,
            median,
            median / medians[0],
            memory,
        )
        for by, (way, setup, memory), median in zip(work.ways, made, medians, strict=True)
    ]


def _errors(work: Work, way: Way) -> tuple[float, float, float | None, float | None, float | None]:
    found = way.solve(work.asked)[None]
    if not work.noisy:
        (e,), (rms,) = work.errors(way, found)
        return float(e), float(rms), None, None, None
    e, rms = work.errors(way, np.vstack([found, way.solve(work.draws)]))
    noisy = float(e[1:].mean()), float(e[1:].std(ddof=1)), float(rms[1:].mean())
    return float(e[0]), float(rms[0]), *noisy


def _made(make: Callable[[], Way], asked: Any) -> tuple[Way, float, int]:
    """A way that has answered once, the seconds until then and the bytes."""

    def answered() -> Way:
        way = make()
        way.solve(asked)
        return way

    way, memory = traced(answered)
    return way, seconds(answered), memory + way.kept


def _medians(ways: Sequence[Way], draws: Iterable[Any]) -> list[float]:
    """Median seconds of each way's answers to the `draws`, in turn with the others."""
    each, (least, most) = cycle(draws), _TURNS
    taken: list[list[float]] = []
    end = time.perf_counter() + _BUDGET
    while len(taken) < least or (len(taken) < most and time.perf_counter() < end):
        one = next(each)
        taken.append([seconds(way.solve, one) for way in ways])
    return [statistics.median(times) for times in zip(*taken, strict=True)]
