"""A study's file: a scene, what of it is varied, and when a point is known well enough."""

import copy
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from importlib.resources import files
from itertools import pairwise, product
from math import prod
from pathlib import Path
from typing import Any, cast

import numpy as np

from kappaskin.errors import Refusal
from kappaskin.scenes import TomlTable, parsed, read_scene_text
from kappaskin.studies.design.measures import MEASURES
from kappaskin.studies.design.setup import Distribution, PointSetup, read_setup, setup_of

# Dotted places of values in a file

_PART = re.compile(r"([\w-]+)(?:\[([1-9]\d{0,8})\])?")


def parts_of(place: str) -> list[str | int]:
    """The keys of a place such as touch[1].x, tables of an array counted from one there."""
    found = list[str | int]()
    for part in place.split("."):
        if not (match := _PART.fullmatch(part)):
            raise Refusal(
                f"expected a place in this file such as elements.grid or touch[1].x, got {place!r}"
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
            f"expected {part}[1] or another number in {place!r}, for there are several"
            if isinstance(found, list)
            else f"expected no number after {part} in {place!r}, for there is one alone"
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
class _Range:
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
        raise table.refusal("expected values to go through, got none")
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
    made = inner.make(_Range)
    inner.done()
    with inner.blamed():
        return made.values(most)


def points_of(axes: tuple[Axis, ...]) -> Iterator[dict[str, Any]]:
    """Every combination of the axes' values by place, the last axis's in turn."""
    for each in product(*axes):
        yield {place: value for part in each for place, value in part.items()}


def check_product(axes: tuple[Axis, ...], most: int) -> None:
    """Refuse more than `most` points."""
    if (points := prod(map(len, axes))) > most:
        factors = " x ".join(str(len(axis)) for axis in axes)
        raise Refusal(
            f"expected at most {most} points, got {factors} = {points:.4g}; take fewer values, or "
            "allow as many by points = ... in [stop]"
        )


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
class Study:
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
        for values in points_of(self.axes):
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
    base = read_setup(top, file, MEASURES)
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
    among = {name: name for name in measured}
    for name in made.of:
        table.stands_for(name, "of", among)
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
                "expected to vary or draw what is simulated, not what the study does with it"
            )
        # A table says again all that stands in it.
        if any(parts[: len(other)] == other[: len(parts)] for other in seen):
            raise Refusal(f"expected to vary or draw each thing once, got {place} twice")
    seen.append(parts)


def _check(table: TomlTable, key: str, content: dict[str, Any], values: dict[str, Any]) -> None:
    """Refuse `values` by place, given at a `key`, that the scene cannot have."""
    try:
        setup_of(with_values(content, values), MEASURES)
    except Refusal as refusal:
        given = ", ".join(f"{place} = {value!r:.40}" for place, value in values.items())
        raise table.refusal(f"with {given}: {refusal}", key) from refusal
