"""A study's file to its points: a scene, what of it is varied, and when that is known enough."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from importlib.resources import files
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from kappaskin.errors import Refusal
from kappaskin.scenes import TomlTable, parsed, read_scene_text
from kappaskin.studies.design.draws import Distribution
from kappaskin.studies.design.measures import MEASURES
from kappaskin.studies.design.places import parts_of, with_values
from kappaskin.studies.design.setup import Setup, read_setup, setup_of
from kappaskin.studies.design.vary import Axis, check_product, points_of, read_axis

_FOLDER = Path(str(files("kappaskin_resources"))) / "studies"
_ENDING = ".toml"

STUDIES = tuple(sorted(file.stem for file in _FOLDER.iterdir() if file.suffix == _ENDING))
"""Names of the ready studies."""

_AROUND = ("vary", "stop")
_TOLD = ("title", "text")  # which change no number
_NO_SCENE = (*_AROUND, *_TOLD, "measure")


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
    """One combination of what is varied, by its place in the file; `document` says all in JSON."""

    values: dict[str, Any]
    document: str


@dataclass(frozen=True, eq=False)
class Study:
    """What a study's file, of this `text`, says; `base` is its setup before anything is varied."""

    name: str
    title: str
    description: str
    text: str
    base: Setup
    axes: tuple[Axis, ...]
    stop: Stop
    said: dict[str, Any]

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
            yield Point(values, json.dumps(with_values(self.said, values), sort_keys=True))


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
    said = parsed(text, file)
    top = TomlTable(said, text, str(file))
    tables, stopping = top.tables("vary"), top.table("stop")
    base = read_setup(top, file, MEASURES)
    stop = _stop(stopping, base.measure.what)
    axes = tuple(read_axis(table, stop.points) for table in tables)
    own = {key: value for key, value in said.items() if key not in (*_AROUND, *_TOLD)}
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
    """Refuse what would be said twice, and what changes nothing that is simulated."""
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


def _check(table: TomlTable, key: str, said: dict[str, Any], values: dict[str, Any]) -> None:
    """Refuse `values` by place, which are said at a `key`, that the scene cannot have."""
    try:
        setup_of(with_values(said, values), MEASURES)
    except Refusal as refusal:
        told = ", ".join(f"{place} = {value!r:.40}" for place, value in values.items())
        raise table.refusal(f"with {told}: {refusal}", key) from refusal
