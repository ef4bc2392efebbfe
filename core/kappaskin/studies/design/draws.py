"""Tables [[draw]] of a study to values that are drawn anew for every block of frames."""

import math
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import scipy

from kappaskin.errors import Refusal
from kappaskin.scenes import TomlTable


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
