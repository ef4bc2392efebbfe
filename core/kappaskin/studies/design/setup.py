"""One point of a study: its scene, placement, fit and measures, and what is drawn at random."""

import json
import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import scipy

from kappaskin.bases import basis_for
from kappaskin.errors import Refusal
from kappaskin.estimation import (
    METHODS,
    PLACEMENTS,
    Estimator,
    check_placement,
    estimator_for,
    place_elements,
)
from kappaskin.scenes import Scene, TomlTable, scene_of

# Tables [[draw]]: values that are drawn anew for every block of frames


class Distribution(Protocol):
    """Something that values are drawn from; all of its values lie within bounds."""

    def __call__(self, rng: np.random.Generator) -> Any: ...


def _check_bounds(low: float, high: float) -> None:
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise Refusal(f"expected finite bounds with low below high, got {low:g} and {high:g}")


@dataclass(frozen=True)
class Uniform:
    """Even from `low` to `high`."""

    low: float
    high: float

    def __post_init__(self) -> None:
        _check_bounds(self.low, self.high)

    def __call__(self, rng: np.random.Generator) -> float:
        return float(rng.uniform(self.low, self.high))


@dataclass(frozen=True)
class LogUniform:
    """Every factor alike from `low` to `high`, both above zero."""

    low: float
    high: float

    def __post_init__(self) -> None:
        _check_bounds(self.low, self.high)
        if not self.low > 0:
            raise Refusal(f"expected low above zero where factors are alike, got {self.low:g}")

    def __call__(self, rng: np.random.Generator) -> float:
        return float(math.exp(rng.uniform(math.log(self.low), math.log(self.high))))


@dataclass(frozen=True)
class Normal:
    """Normal about `mean` with standard deviation `sd`, cut off below `low` and above `high`."""

    mean: float
    sd: float
    low: float
    high: float

    def __post_init__(self) -> None:
        _check_bounds(self.low, self.high)
        if not (math.isfinite(self.mean) and 0 < self.sd < math.inf):
            raise Refusal(f"expected a finite mean and an sd above zero, got {self}")
        if not self.low <= self.mean <= self.high:
            raise Refusal(f"expected the mean inside the bounds, got {self}")

    def __call__(self, rng: np.random.Generator) -> float:
        low, high = (
            float(scipy.special.ndtr((end - self.mean) / self.sd)) for end in (self.low, self.high)
        )
        drawn = self.mean + self.sd * float(scipy.special.ndtri(rng.uniform(low, high)))
        return min(max(drawn, self.low), self.high)


@dataclass(frozen=True)
class Whole:
    """A whole number from `low` to `high`, both among them."""

    low: int
    high: int

    def __post_init__(self) -> None:
        if not 0 <= self.low < self.high < 2**63:
            raise Refusal(f"expected 0 <= low < high < 2^63, got {self.low} and {self.high}")

    def __call__(self, rng: np.random.Generator) -> int:
        return int(rng.integers(self.low, self.high, endpoint=True))


@dataclass(frozen=True)
class Some:
    """`count` different whole numbers from 0 to `of` - 1, such as elements that are dead."""

    of: int
    count: int

    def __post_init__(self) -> None:
        if not 0 <= self.count <= self.of < 2**31:
            raise Refusal(f"expected a count from 0 to {self.of}, got {self.count}")

    def __call__(self, rng: np.random.Generator) -> list[int]:
        return sorted(rng.permutation(self.of)[: self.count].tolist())


KINDS = {
    "uniform": Uniform,
    "log-uniform": LogUniform,
    "normal": Normal,
    "whole": Whole,
    "some": Some,
}
"""What values can be drawn from, by name."""


def read_draw(table: TomlTable) -> tuple[str, Distribution]:
    """The place in the file `what`, and what its values are drawn from."""
    place = table.get("what", str)
    made = table.make(table.choose("kind", KINDS))
    table.done()
    return place, made


# The setup

_NAME = "the study"
_MOST_READINGS = 2**23  # in a block: 64 MB for each array of them
_ELSEWHERE = ("file", "recorded")  # keys of a touch that name other files


@dataclass(frozen=True)
class FitSettings:
    """How shapes are reconstructed: by a `method` of `METHODS` with Ni x Nj `functions`.

    With `compensate`, the loops of the scene's hysteresis are undone first, as by a calibration
    that found them exactly.
    """

    functions: tuple[int, int] = (8, 8)
    method: str = next(iter(METHODS))
    compensate: bool = False

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise Refusal(f"expected a method among {', '.join(METHODS)}, got {self.method!r}")
        if min(self.functions) < 1:
            raise Refusal(f"expected at least 1 x 1 functions, got {self.functions}")


@dataclass(frozen=True)
class PlacementSettings:
    """Where the elements are: `by` one of `PLACEMENTS`, at least `apart` in m from each other."""

    by: str = "scene"
    apart: float = 4e-3

    def __post_init__(self) -> None:
        if self.by not in PLACEMENTS:
            raise Refusal(f"expected by among {', '.join(PLACEMENTS)}, got {self.by!r}")
        if not 0 < self.apart < 1:
            raise Refusal(f"expected elements apart by a distance above zero in m, got {self}")


@dataclass(frozen=True)
class MeasureSettings:
    """`what` to measure, in `frames` of each block."""

    what: tuple[str, ...]
    frames: int = 200

    def __post_init__(self) -> None:
        if not self.what:
            raise Refusal("expected at least one thing to measure, got none")
        if len(set(self.what)) < len(self.what):
            raise Refusal(f"expected to measure each thing once, got {', '.join(self.what)}")
        if self.frames < 1:
            raise Refusal(f"expected at least one frame in a block, got {self.frames}")


@dataclass(frozen=True)
class PointSetup:
    """One point: the scene, fit, placement and measures, and what is drawn at random."""

    scene: Scene
    fit: FitSettings
    place: PlacementSettings
    measure: MeasureSettings
    draws: tuple[tuple[str, Distribution], ...]


def read_setup(top: TomlTable, file: Path, known: Iterable[str]) -> PointSetup:
    """The setup in a file's `top` table; `known` are the names of measures."""
    tables = fit, place, measure = [top.table(name) for name in ("fit", "place", "measure")]
    drawing = top.tables("draw")
    scene = _scene(top, file)
    made = fit.make(FitSettings), place.make(PlacementSettings), measure.make(MeasureSettings)
    for table in tables:
        table.done()
    among = {name: name for name in known}
    for name in made[2].what:
        measure.stands_for(name, "what", among)
    with place.blamed():
        check_placement(scene.layout, made[1].by)
    if (readings := made[2].frames * 3 * len(scene.layout)) > _MOST_READINGS:
        raise measure.refusal(
            f"expected at most {_MOST_READINGS} readings in a block, got {made[2].frames} frames "
            f"of {3 * len(scene.layout)} = {readings}; take fewer frames and more blocks",
            "frames",
        )
    return PointSetup(scene, *made, tuple(read_draw(table) for table in drawing))


def _scene(top: TomlTable, file: Path) -> Scene:
    """The scene, which must be complete without other files: workers have none."""
    for touch in top.tables("touch"):
        for key in _ELSEWHERE:
            if key in touch:
                raise touch.refusal(
                    "expected nothing that is in a file of its own: workers have none; take a "
                    "sphere, a cylinder or another shape, and steps or an orbit",
                    key,
                )
    scene = scene_of(top, file)
    if not (scene.loads or scene.indenter):
        raise top.refusal(
            "expected a scene with a load or an object to measure errors by, got none"
        )
    return scene


def setup_of(content: dict[str, Any], known: Iterable[str]) -> PointSetup:
    """The setup of a point's `content`; its refusals name no file."""
    try:
        return read_setup(TomlTable(content, "", _NAME), Path("study.toml"), known)
    except Refusal as refusal:
        raise Refusal(str(refusal).removeprefix(f"{_NAME}, line 1: ")) from refusal


def estimator_of(content: dict[str, Any], setup: PointSetup) -> Estimator:
    """The estimator of a point, cached for points with the same sensor and fit."""
    if METHODS[setup.fit.method].remembers:
        return _estimator(setup)
    alike = {key: content.get(key) for key in ("skin", "elements", "fit", "place")}
    return _cached_estimator(_SameSensor(json.dumps(alike, sort_keys=True), setup))


@dataclass(frozen=True)
class _SameSensor:
    """A setup, equal to others with the same `description` of sensor and fit."""

    description: str
    setup: PointSetup = field(compare=False)


@lru_cache(8)
def _cached_estimator(alike: _SameSensor) -> Estimator:
    return _estimator(alike.setup)


def _estimator(setup: PointSetup) -> Estimator:
    scene, fit = setup.scene, setup.fit
    patch = scene.plate.patch
    Ni, Nj = fit.functions
    basis = basis_for(patch, scene.edge, Ni, 1 if patch.strip else Nj)
    layout = place_elements(scene.layout, basis, setup.place.by, setup.place.apart)
    return estimator_for(fit.method, basis, layout)
