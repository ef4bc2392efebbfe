"""Tables [[vary]] of a study to the values that it goes through."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from math import prod
from typing import Any

import numpy as np

from kappaskin.errors import Refusal
from kappaskin.scenes import TomlTable

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
        told = ", ".join(f"{count} of {place}" for place, count in counts.items())
        raise table.refusal(f"expected as many values of each, since they go together, got {told}")
    return Axis(places)


def _values(table: TomlTable, place: str, most: int) -> list[Any]:
    if not table.is_table(place):
        return table.listed(place)
    said = table.table(place)
    if "first" not in said and "last" not in said:
        raise said.refusal(
            "expected a list or a range such as { first = 1, last = 9, count = 5 }; write a place "
            'with dots in quotes, as "elements.grid"'
        )
    made = said.make(_Range)
    said.done()
    with said.blamed():
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
