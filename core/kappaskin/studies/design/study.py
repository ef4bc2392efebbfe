"""Design study files: a scene, the values that vary, the measures and when to stop."""

import copy
import json
import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import lru_cache
from importlib.resources import files
from itertools import pairwise, product
from math import prod
from pathlib import Path
from typing import Any, cast

import numpy as np
import scipy

from kappaskin._lazy import Displayed
from kappaskin._toml import TomlTable, parsed
from kappaskin.errors import Refusal
from kappaskin.estimation import (
    METHODS,
    Estimator,
    check_placement,
)
from kappaskin.scenes import Scene, read_scene_text, scene_of
from kappaskin.studies.design.measures import MEASURES, check_name, placed_estimator

# Dotted places of values in a file

_PART = re.compile(r"([\w-]+)(?:\[([1-9]\d{0,8})\])?")


def parts_of(place: str) -> list[str | int]:
    """The keys of a place such as touch[1].x, tables of an array counted from one there."""
    found = list[str | int]()
    for part in place.split("."):
        if not (match := _PART.fullmatch(part)):
            raise Refusal(
                f"expected a key in this file such as elements.grid or touch[1].x, got {place!r}"
            )
        found.append(match[1])
        if match[2]:
            found.append(int(match[2]) - 1)
    return found


def put_value(content: dict[str, Any], place: str, value: Any) -> None:
    """Set the `value` at `place` of `content`; tables on the way there are made."""
    parts, at = parts_of(place), cast("Any", content)
    for part, following in pairwise(parts):
        at = _inside(at, part, place, isinstance(following, int))
    if isinstance(last := parts[-1], int):
        raise Refusal(f"expected the name of a value at the end of {place!r}")
    if not isinstance(at, dict):
        raise Refusal(f"expected a table around {place!r}, got {at!r:.60}")
    at[last] = value


def _inside(at: Any, part: str | int, place: str, array: bool) -> Any:
    """What stands at `part`, which may be an `array` of tables."""
    if isinstance(part, int):
        many = cast("list[Any]", at)
        if not part < len(many):
            raise Refusal(f"expected one of {len(many)} tables in {place!r}, got number {part + 1}")
        return many[part]
    if not isinstance(at, dict):
        raise Refusal(f"expected a table around {part!r} of {place!r}, got {at!r:.60}")
    found = cast("dict[str, Any]", at).setdefault(part, [] if array else {})
    if isinstance(found, list) != array:
        raise Refusal(
            f"expected {part}[1] or another number in {place!r}, since there are several"
            if isinstance(found, list)
            else f"expected no number after {part} in {place!r}, since there is only one"
        )
    return found


def with_values(content: dict[str, Any], values: dict[str, Any]) -> dict[str, Any]:
    """A copy of `content` with these `values` at their places."""
    changed = copy.deepcopy(content)
    for place, value in values.items():
        put_value(changed, place, value)
    return changed


# Tables [[vary]]: the values that a study goes through

_SPACING = {"even": np.linspace, "log": np.geomspace}


@dataclass(frozen=True)
class _ValueRange:
    """`count` numbers from `first` to `last`, evenly or by the same factor (log)."""

    first: float
    last: float
    count: int
    spacing: str = "even"

    def __post_init__(self) -> None:
        if self.spacing not in _SPACING:
            raise Refusal(f"expected a spacing among {', '.join(_SPACING)}, got {self.spacing!r}")
        if not np.isfinite([self.first, self.last]).all():
            raise Refusal(f"expected a finite range, got {self.first:g} to {self.last:g}")
        if self.spacing == "log" and not min(self.first, self.last) > 0:
            raise Refusal(f"expected a range above zero, got {self.first:g} to {self.last:g}")
        if self.count < 1:
            raise Refusal(f"expected a range of at least one value, got {self.count}")

    def values(self, most: int) -> list[float]:
        if self.count > most:
            raise Refusal(f"expected at most {most} values, got {self.count}")
        return _SPACING[self.spacing](self.first, self.last, self.count).tolist()


@dataclass(frozen=True)
class Axis:
    """Values that go together: at each of `places` in the file as many."""

    places: dict[str, list[Any]]

    def __len__(self) -> int:
        return len(next(iter(self.places.values())))

    def __iter__(self) -> Iterator[dict[str, Any]]:
        for values in zip(*self.places.values(), strict=True):
            yield dict(zip(self.places, values, strict=True))


def read_axis(table: TomlTable, most: int) -> Axis:
    """What a table [[vary]] goes through, `most` values of each thing at most."""
    places = {place: _values(table, place, most) for place in table}
    counts = {place: len(values) for place, values in places.items()}
    if not places or not all(counts.values()):
        raise table.refusal("expected values to vary, got none")
    if len(set(counts.values())) > 1:
        got = ", ".join(f"{count} of {place}" for place, count in counts.items())
        raise table.refusal(f"expected as many values of each, since they go together, got {got}")
    return Axis(places)


def _values(table: TomlTable, place: str, most: int) -> list[Any]:
    if not table.is_table(place):
        return table.listed(place)
    inner = table.table(place)
    if "first" not in inner and "last" not in inner:
        raise inner.refusal(
            "expected a list or a range such as { first = 1, last = 9, count = 5 }; write a place "
            'with dots in quotes, as "elements.grid"'
        )
    made = inner.make(_ValueRange)
    inner.done()
    with inner.blamed():
        return made.values(most)


def check_product(axes: tuple[Axis, ...], most: int) -> None:
    """Refuse more than `most` points."""
    if (points := prod(map(len, axes))) > most:
        factors = " x ".join(str(len(axis)) for axis in axes)
        raise Refusal(
            f"expected at most {most} points, got {factors} = {points:.4g}; take fewer values, or "
            "allow as many by points = ... in [stop]"
        )


# Tables [[draw]]: values that are drawn anew for every block of frames


Distribution = Callable[[np.random.Generator], Any]
"""Something that values are drawn from; all of its values lie within bounds."""


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
class LogUniform(Uniform):
    """Every factor alike from `low` to `high`, both above zero."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.low > 0:
            raise Refusal(f"expected low above zero for a log-uniform draw, got {self.low:g}")

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
    """Where the elements are: `by` one of `PLACED_BY`, at least `apart` in m from each other."""

    by: str = "scene"
    apart: float = 4e-3

    def __post_init__(self) -> None:
        check_name(self.by)
        if not 0 < self.apart < 1:
            raise Refusal(f"expected a distance between elements above zero in m, got {self}")


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


def read_setup(top: TomlTable, file: Path) -> PointSetup:
    """The setup in a file's `top` table."""
    tables = fit, place, measure = [top.table(name) for name in ("fit", "place", "measure")]
    drawing = top.tables("draw")
    scene = _scene(top, file)
    made = fit.make(FitSettings), place.make(PlacementSettings), measure.make(MeasureSettings)
    for table in tables:
        table.done()
    for name in made[2].what:
        measure.stands_for(name, "what", MEASURES)
    with place.blamed():
        check_placement(scene.layout, made[1].by)
    if (readings := made[2].frames * scene.layout.channels) > _MOST_READINGS:
        raise measure.refusal(
            f"expected at most {_MOST_READINGS} readings in a block, got {made[2].frames} frames "
            f"of {scene.layout.channels} = {readings}; take fewer frames and more blocks",
            "frames",
        )
    return PointSetup(scene, *made, tuple(read_draw(table) for table in drawing))


def _scene(top: TomlTable, file: Path) -> Scene:
    """The scene, which must be complete without other files: workers have none."""
    for touch in top.tables("touch"):
        for key in _ELSEWHERE:
            if key in touch:
                raise touch.refusal(
                    "expected nothing in a separate file, which workers do not have; use a "
                    "sphere, a cylinder or another shape, and steps or an orbit",
                    key,
                )
    scene = scene_of(top, file)
    if not (scene.loads or scene.indenter):
        raise top.refusal(
            "expected a scene with a load or an object to measure errors by, got none"
        )
    return scene


def setup_of(content: dict[str, Any]) -> PointSetup:
    """The setup of a point's `content`; its refusals name no file."""
    return read_setup(TomlTable(content), Path("study.toml"))


def estimator_of(content: dict[str, Any], setup: PointSetup) -> Estimator:
    """The estimator of a point, cached for points with the same sensor and fit."""
    if METHODS[setup.fit.method].has_memory:
        return _estimator(setup)
    alike = {key: content.get(key) for key in ("skin", "elements", "readings", "fit", "place")}
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
    fit, place = setup.fit, setup.place
    return placed_estimator(setup.scene, fit.functions, place.by, place.apart, fit.method)


# The file

_FOLDER = Path(str(files("kappaskin_resources"))) / "studies"
_ENDING = ".toml"

STUDIES = tuple(sorted(file.stem for file in _FOLDER.iterdir() if file.suffix == _ENDING))
"""Names of the ready studies."""

_AROUND = ("vary", "stop")
_TEXTS = ("title", "text")  # which change no number
_NO_SCENE = (*_AROUND, *_TEXTS, "measure")


@dataclass(frozen=True)
class Stop:
    """When a point is known: 95 % of the means `of` some measures within a share of themselves.

    At least so many blocks are computed there and at `most` so many. A study has as many `points`
    at most.
    """

    of: tuple[str, ...] = ()
    within: float = 0.05
    least: int = 8
    most: int = 100
    points: int = 10_000

    def __post_init__(self) -> None:
        if not 0 < self.within < 1:
            raise Refusal(f"expected within as a share above 0 and below 1, got {self.within}")
        if not 2 <= self.least <= self.most <= 1_000_000:
            raise Refusal(
                f"expected 2 <= least <= most <= 1000000 blocks, got {self.least} and {self.most}"
            )
        if not 1 <= self.points <= 10_000_000:
            raise Refusal(f"expected to allow 1 to 10000000 points, got {self.points}")


@dataclass(frozen=True)
class Point:
    """One combination of values by their place in the file; `document` is the point in JSON."""

    values: dict[str, Any]
    document: str


@dataclass(frozen=True, eq=False)
class Study(Displayed):
    """A study, as its file's `text` describes it; `base` is the setup before anything varies."""

    name: str
    title: str
    description: str
    text: str
    base: PointSetup
    axes: tuple[Axis, ...]
    stop: Stop
    content: dict[str, Any]

    @property
    def measures(self) -> tuple[str, ...]:
        return self.base.measure.what

    @property
    def places(self) -> list[str]:
        """The places in the file of all that is varied."""
        return [place for axis in self.axes for place in axis.places]

    def called(self, place: str) -> str:
        """What to call a place: that of a number of a [[draw]] by what is drawn."""
        head, _, name = place.partition(".")
        if not head.startswith("draw["):
            return place
        return f"{name} of {self.base.draws[int(head[5:-1]) - 1][0]}"

    @property
    def count(self) -> int:
        """How many points there are."""
        return prod(map(len, self.axes))

    def points(self) -> Iterator[Point]:
        """Every combination of what is varied."""
        for each in product(*self.axes):  # the last axis's values in turn
            values = {place: value for part in each for place, value in part.items()}
            yield Point(values, json.dumps(with_values(self.content, values), sort_keys=True))


def load_study(name: str) -> Study:
    """The ready study of that `name`, or that in the TOML file of that name."""
    if not name.endswith(_ENDING) and name not in STUDIES:
        raise Refusal(
            f"expected a study among {', '.join(STUDIES)}, or a file that ends in {_ENDING}; got "
            f"{name!r}"
        )
    file = Path(name) if name.endswith(_ENDING) else _FOLDER / f"{name}{_ENDING}"
    return read_study(read_scene_text(file), file)


def read_study(text: str, file: Path) -> Study:
    """The study that `text`, of `file`, describes."""
    content = parsed(text, file)
    top = TomlTable(content, text, str(file))
    tables, stopping = top.tables("vary"), top.table("stop")
    base = read_setup(top, file)
    stop = _stop(stopping, base.measure.what)
    axes = tuple(read_axis(table, stop.points) for table in tables)
    own = {key: value for key, value in content.items() if key not in (*_AROUND, *_TEXTS)}
    with top.blamed("vary"):
        check_product(axes, stop.points)
    _check_places(top, axes, base.draws)
    for table, axis in zip(tables, axes, strict=True):
        for values in axis:  # each with everything else as it is: not as many as there are points
            _check(table, next(iter(values)), own, values)
    for table, (place, draw) in zip(top.tables("draw"), base.draws, strict=True):
        _check(table, "what", own, {place: draw(np.random.default_rng(0))})
    title, description = base.scene.title, base.scene.text
    return Study(file.stem, title, description, text, base, axes, stop, own)


def _stop(table: TomlTable, measured: tuple[str, ...]) -> Stop:
    made = table.make(Stop)
    table.done()
    for name in made.of:
        table.stands_for(name, "of", dict.fromkeys(measured))
    return made if made.of else replace(made, of=measured[:1])


def _check_places(
    top: TomlTable, axes: tuple[Axis, ...], draws: tuple[tuple[str, Distribution], ...]
) -> None:
    """Refuse what would be set twice, and what changes nothing that is simulated."""
    seen = list[list[str | int]]()
    for table, axis in zip(top.tables("vary"), axes, strict=True):
        for place in axis.places:
            _check_place(table, place, place, _NO_SCENE, seen)
    for table, (place, _) in zip(top.tables("draw"), draws, strict=True):
        # A block has drawn by then, and has a seed of its own.
        _check_place(table, "what", place, (*_NO_SCENE, "draw", "seed"), seen)


def _check_place(
    table: TomlTable, key: str, place: str, barred: tuple[str, ...], seen: list[list[str | int]]
) -> None:
    with table.blamed(key):
        parts = parts_of(place)
        if parts[0] in barred:
            raise Refusal(
                "expected a parameter of the scene, fit or placement, not of the study itself"
            )
        # A table says again all that stands in it.
        if any(parts[: len(other)] == other[: len(parts)] for other in seen):
            raise Refusal(f"expected to vary or draw each thing once, got {place} twice")
    seen.append(parts)


def _check(table: TomlTable, key: str, content: dict[str, Any], values: dict[str, Any]) -> None:
    """Refuse `values` by place, given at a `key`, that the scene cannot have."""
    try:
        setup_of(with_values(content, values))
    except Refusal as refusal:
        given = ", ".join(f"{place} = {value!r:.40}" for place, value in values.items())
        raise table.refusal(f"with {given}: {refusal}", key) from refusal
