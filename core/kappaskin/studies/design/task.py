"""A point of a study and the number of a block to what is measured there: one pure function."""

import hashlib
import json
import math
import threading
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from importlib import metadata
from typing import Any

import numpy as np
import scipy

from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.studies.design.block import block_of
from kappaskin.studies.design.measures import MEASURES
from kappaskin.studies.design.places import with_values
from kappaskin.studies.design.setup import Setup, estimator_of, setup_of

MEANING = 2
"""Goes up with every change that makes the same study give other numbers."""

_ONE_BY_ONE = threading.Lock()  # what blocks share is not made for several threads


@cache
def version() -> str:
    """What a worker must have to give the same numbers."""
    ours = f"kappaskin {metadata.version('kappaskin')}, meaning {MEANING}"
    return f"{ours}, NumPy {np.__version__}, SciPy {scipy.__version__}"


@dataclass(frozen=True, slots=True)
class Moments:
    """How many values there were, their mean, and the squares of what they differ from it, added.

    Of no values the mean is zero.
    """

    count: int
    mean: float
    squares: float

    @classmethod
    def of(cls, values: Array) -> "Moments":
        known = values[~np.isnan(values)]
        if not len(known):
            return cls(0, 0.0, 0.0)
        with np.errstate(over="ignore", invalid="ignore"):
            mean = float(known.mean())
            squares = float(np.sum((known - mean) ** 2))
        if not math.isfinite(squares):
            raise Refusal("expected finite errors, got infinity: the arithmetic overflowed")
        return cls(len(known), mean, squares)


Measured = dict[str, Moments]


@dataclass(frozen=True)
class Task:
    """Block number `block` of the point that `document`, in JSON, says; `version` is who asks.

    Its numbers depend on nothing else, whoever computes it, and when.
    """

    document: str
    block: int
    version: str

    def _digest(self, *parts: str) -> str:
        return hashlib.sha256("\n".join((*parts, str(self.block))).encode()).hexdigest()

    @cached_property
    def key(self) -> str:
        """The name of its result: another one where anything that matters is another."""
        return self._digest(self.version, self.document)

    @cached_property
    def seed(self) -> int:
        """The seed of what is random in it, whatever is measured of that."""
        said = json.loads(self.document)
        return int(self._digest(json.dumps(said | {"measure": None}, sort_keys=True))[:16], 16)


@lru_cache(4)
def _setup(document: str) -> Setup:
    return setup_of(json.loads(document), MEASURES)


def _drawn(task: Task) -> tuple[dict[str, Any], Setup]:
    """What the task's point says, and its setup, with what is drawn of them."""
    said, setup = json.loads(task.document), _setup(task.document)
    if not setup.draws:
        return said, setup
    rng = np.random.default_rng(task.seed)
    said = with_values(said, {place: draw(rng) for place, draw in setup.draws})
    return said, setup_of(said, MEASURES)


def run(task: Task) -> Measured:
    """What is measured in the block; raises a `Refusal` for one that cannot be computed."""
    if task.version != version():
        raise Refusal(
            f"expected a worker with {task.version}, got one with {version()}; install the same "
            "on all"
        )
    with _ONE_BY_ONE:
        said, setup = _drawn(task)
        block = block_of(setup, estimator_of(said, setup), task.seed)
        return {name: Moments.of(MEASURES[name].of(block)) for name in setup.measure.what}
