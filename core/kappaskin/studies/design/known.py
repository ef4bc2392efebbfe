"""Blocks of a point to what is known of each measure there, and to how many more it takes."""

import math
import sys
from dataclasses import dataclass, field

import numpy as np
import scipy

from kappaskin.frames import Array
from kappaskin.studies.design.measures import MEASURES
from kappaskin.studies.design.study import Point, Study
from kappaskin.studies.design.task import Measured, Moments

_MORE = 1.5  # times the blocks that were not enough
_DOUBT = 0.05  # what an interval of 95 % leaves


@dataclass(frozen=True, slots=True)
class Mean:
    """The `mean` of a measure with the `half` width of its 95 % interval, and the `sd` of a value.

    Blocks are independent of each other, frames of one may not be: the interval is Student's of
    the means of the blocks. Where all of them are all or nothing of something, it reaches to the
    share for which so many blocks are alike once in twenty times. NaN where nothing is known.
    """

    mean: float
    half: float
    sd: float
    count: int

    @classmethod
    def of(cls, blocks: list[Moments], share: bool = False) -> "Mean":
        """The mean of some blocks, which may be a `share` of something."""
        some = [block for block in blocks if block.count]
        count = sum(block.count for block in some)
        if not some:
            return cls(math.nan, math.nan, math.nan, 0)
        means = np.array([block.mean for block in some])
        weights = np.array([block.count for block in some]) / count
        mean = float(weights @ means)
        squares = sum(block.squares + block.count * (block.mean - mean) ** 2 for block in some)
        sd = math.sqrt(squares / (count - 1)) if count > 1 else math.nan
        alike = share and set(means.tolist()) in ({0.0}, {1.0})
        half = 1 - _DOUBT ** (1 / len(some)) if alike else _half(means, weights, mean)
        return cls(mean, half, sd, count)

    def within(self, share: float) -> bool:
        """Whether the interval reaches no further than this share of the mean."""
        return self.half <= share * abs(self.mean)


def _half(means: Array, weights: Array, mean: float) -> float:
    B = len(means)
    if B < 2:
        return math.nan
    variance = B / (B - 1) * float(np.sum((weights * (means - mean)) ** 2))
    return float(scipy.special.stdtrit(B - 1, 1 - _DOUBT / 2)) * math.sqrt(variance)


@dataclass(eq=False)
class Known:
    """What is known of one `point`: how many blocks are `done`, and why some failed.

    Results are held until no more are wanted, and then what they come to alone: a study of many
    points takes little more memory than one of few.
    """

    point: Point
    study: Study
    done: int = 0
    _results: dict[int, Measured | str] = field(default_factory=dict[int, "Measured | str"])
    _means: dict[str, Mean] = field(default_factory=dict[str, Mean])
    _failures: list[str] = field(default_factory=list[str])
    wanted: int = field(init=False)

    def __post_init__(self) -> None:
        self.wanted = self.study.stop.least

    def take(self, block: int, result: Measured | str) -> range:
        """Numbers of the blocks to compute next, when `block` was the last of those wanted.

        They follow from the results of all before alone, whoever computed them in whatever order.
        """
        self._results[block] = sys.intern(result) if isinstance(result, str) else result
        self.done += 1
        if not self.complete:
            return range(0)
        before, most = self.wanted, self.study.stop.most
        if before == most or self.failures or self.enough:
            self._close()
            return range(0)
        self.wanted = min(math.ceil(_MORE * before), most)
        return range(before, self.wanted)

    def _close(self) -> None:
        self._means = {name: self.mean(name) for name in self.study.measures}
        self._failures = self.failures
        self._results.clear()

    def _in_order(self) -> list[Measured | str]:
        return [self._results[block] for block in sorted(self._results)]

    @property
    def failures(self) -> list[str]:
        """Why blocks failed, in their order."""
        held = [result for result in self._in_order() if isinstance(result, str)]
        return self._failures or held

    @property
    def complete(self) -> bool:
        """Whether all blocks that it takes were computed."""
        return self.done == self.wanted

    @property
    def enough(self) -> bool:
        """Whether all that is to be known well is."""
        stop = self.study.stop
        return all(self.mean(name).within(stop.within) for name in stop.of)

    def mean(self, measure: str) -> Mean:
        """What is known of a measure, from its blocks in order."""
        if self._means:
            return self._means[measure]
        blocks = [result[measure] for result in self._in_order() if not isinstance(result, str)]
        return Mean.of(blocks, MEASURES[measure].share)
