"""Cost of accuracy: settings, the cost of each, and those that no other beats."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from kappaskin.errors import Refusal
from kappaskin.estimation import METHODS
from kappaskin.frames import Array, Mask
from kappaskin.scenes import Scene
from kappaskin.sensing import SensorLayout

FUNCTIONS = (4, 6, 8, 12)
"""Functions along each side that are tried."""
ELEMENTS = (6, 10, 16)
"""Elements along each side that are tried, besides the scene's own."""
PRECISIONS = ("float64", "float32")

ALL = "all"
_REGION = 1 / 3  # of the elements


def _every(layout: SensorLayout, contact: Array) -> Mask:
    return np.ones(len(layout), bool)


def _half(layout: SensorLayout, contact: Array) -> Mask:
    # Column and row of each element, counted where elements are.
    rounded = np.round(layout.positions / (layout.patch.a, layout.patch.b), 9)
    column, row = (np.unique(along, return_inverse=True)[1].ravel() for along in rounded.T)
    return (column + row) % 2 == 0


def _region(layout: SensorLayout, contact: Array) -> Mask:
    away = np.hypot(*(layout.positions - contact).T)
    nearest = np.argsort(away, kind="stable")[: math.ceil(_REGION * len(layout))]
    return np.isin(np.arange(len(layout)), nearest)


SCANS: dict[str, Callable[[SensorLayout, Array], Mask]] = {
    ALL: _every,
    "half": _half,
    "region": _region,
}
"""Which elements (P,) a frame scans, by name, of a layout with a contact (2,) in m.

All, every second one as on a chessboard, or the third of them that is nearest to the contact.
"""


@dataclass(frozen=True)
class Setting:
    """One way from readings to a shape: a `method` of `METHODS` for Ni x Nj `functions`.

    `elements` are m x n at the centres of a tiling, or the scene's own as they are when None.
    A frame is computed in `precision` and rests on what is `scanned`, one of `SCANS`, alone:
    nothing is held from earlier frames.
    """

    method: str
    functions: tuple[int, int]
    elements: tuple[int, int] | None = None
    precision: str = PRECISIONS[0]
    scanned: str = ALL

    def __post_init__(self) -> None:
        for what, got, known in (
            ("method", self.method, METHODS),
            ("precision", self.precision, PRECISIONS),
            ("scan", self.scanned, SCANS),
        ):
            if got not in known:
                raise Refusal(f"expected a {what} among {', '.join(known)}; got {got!r}")


@dataclass(frozen=True)
class ShapeErrors:
    """Errors in m, as those of a `Cost`."""

    e_exact: float
    rms_exact: float
    e: float
    rms: float


@dataclass(frozen=True)
class Cost:
    """What a setting gives and takes; lengths in m, times in s, memory in bytes.

    `time_per_frame` is the median from readings to coefficients, `lstsq_time` that of
    numpy.linalg.lstsq on the same operator, called in turn with it; `setup_time` goes from the
    setting to its first answer; `memory` is the most that the set-up and a frame held at once.
    `conversion_time` is what the scene's electronics need for the `channels`.

    `e` is the mean of the signed error at the load over the frames and `e_sd` its standard
    deviation, `rms` the mean of the RMS error over the skin; `e_exact` and `rms_exact` are those
    of readings that nothing spoils. `shape_rms` is the RMS of the true shape itself, the error
    of an answer that is always zero. These take the scene's functions for the whole truth; `summed`
    are the same errors where the skin's response is summed until it stands, None of a skin whose
    response is not (`SummedResponse`).
    """

    setting: Setting
    count: int
    channels: int
    conversion_time: float
    setup_time: float
    time_per_frame: float
    lstsq_time: float
    memory: int
    e_exact: float
    rms_exact: float
    e: float
    e_sd: float
    rms: float
    shape_rms: float
    summed: ShapeErrors | None = None

    @property
    def errors(self) -> ShapeErrors:
        """The errors to expect of a real skin, as far as they are known."""
        return self.summed or ShapeErrors(self.e_exact, self.rms_exact, self.e, self.rms)

    @property
    def ratio(self) -> float:
        """Time per frame over that of lstsq."""
        return self.time_per_frame / self.lstsq_time

    @property
    def total_time(self) -> float:
        """Seconds until the answer is there: conversion, then arithmetic."""
        return self.conversion_time + self.time_per_frame

    def time(self, total: bool) -> float:
        """Seconds of the arithmetic, or in `total`."""
        return self.total_time if total else self.time_per_frame


@dataclass(frozen=True)
class Refused:
    """A setting that gives no answer, and the reason."""

    setting: Setting
    reason: str


def own_elements(scene: Scene) -> tuple[int, int] | None:
    """The scene's own m x n elements; None where they are no full grid."""
    return scene.layout.shape


def settings_to_try(
    scene: Scene,
    methods: Sequence[str] = tuple(METHODS),
    functions: Sequence[int] = FUNCTIONS,
    elements: Sequence[int] = ELEMENTS,
    precisions: Sequence[str] = PRECISIONS,
    scanned: Sequence[str] = tuple(SCANS),
) -> tuple[Setting, ...]:
    """Every combination of these, square ones, on the scene's own `elements` and on others.

    The most informative come first: the scene's own elements, all of them scanned, in float64.
    On a strip `functions` and `elements` are those along it.
    """
    strip = scene.layout.patch.strip

    def square(count: int) -> tuple[int, int]:
        return count, 1 if strip else count

    own = own_elements(scene)
    layouts = [own, *(square(m) for m in elements if square(m) != own)]
    return tuple(
        Setting(method, square(N), layout, precision, scan)
        for layout, scan, precision, N, method in product(
            layouts, scanned, precisions, functions, methods
        )
    )


# Which costs are worth their time

ALIKE = 0.01
"""Relative difference below which errors count as equal."""


def frontier(costs: Iterable[Cost | Refused], total: bool = False) -> tuple[Cost, ...]:
    """The costs that no other beats in both RMS error, with noise, and time; fastest first.

    The time is that of the arithmetic in a frame; with `total`, conversion counts too. A slower one
    must be better than the faster ones here by more than `ALIKE`. An error larger
    than the shape itself is beaten by an answer of zero.
    """
    known = [cost for cost in costs if isinstance(cost, Cost) and cost.rms < cost.shape_rms]
    kept: list[Cost] = []
    for cost in sorted(known, key=lambda cost: (cost.time(total), cost.rms)):
        # Better than those kept, not than all: many small steps make a large one.
        if not kept or cost.rms < (1 - ALIKE) * kept[-1].rms:
            kept.append(cost)
    return tuple(kept)


def cheapest(costs: Iterable[Cost | Refused], within: float) -> Cost | None:
    """The cost with the least total time whose RMS error, with noise, is `within` m or less.

    It is that of `Cost.errors`.
    """
    if not 0 < within < math.inf:
        raise Refusal(f"expected an accuracy above zero in m, got {within}")
    able = [cost for cost in costs if isinstance(cost, Cost) and cost.errors.rms <= within]
    return min(able, key=lambda cost: (cost.total_time, cost.errors.rms), default=None)
