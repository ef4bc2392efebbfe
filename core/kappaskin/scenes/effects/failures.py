"""Failures of elements and of the link from the device, selected by the scene's author."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray

from kappaskin._schema import Within
from kappaskin.errors import Refusal
from kappaskin.scenes.effects.effect import (
    Effect,
    LayoutEffect,
    ReadingEffect,
    RunningEffect,
    Size,
    Survey,
)
from kappaskin.sensing import SensorLayout


@dataclass(frozen=True)
class _Failing(Effect):
    """Some `elements`, each with all its channels, fail."""

    authored: ClassVar = True
    formula: ClassVar = "share of the elements that fail"

    elements: tuple[int, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        each = self.elements
        whole = type(each) is tuple and all(type(p) is int and p >= 0 for p in each)
        if not (whole and len(set(each)) == len(each)):
            raise Refusal(
                f"expected {self.name} with a tuple of different elements, counted from 0, got "
                f"{each!r:.80}"
            )

    def size(self, survey: Survey) -> Size:
        return Size(len(self.elements) / len(survey.layout), 0.0)

    def channels(self, shape: tuple[int, ...]) -> NDArray[np.intp]:
        """The channels (k, E) of the failing elements on a skin with readings of `shape` (k, P)."""
        k, P = shape
        if absent := [p for p in self.elements if p >= P]:
            raise Refusal(f"expected {self.name} with elements from 0 to {P - 1}, got {absent}")
        return np.add.outer(P * np.arange(k), np.array(self.elements, np.intp))


@dataclass(frozen=True)
class DeadElements(_Failing, LayoutEffect):
    """The `elements` never read anything: the layout says so, and the device with it."""

    name: ClassVar = "dead"
    label: ClassVar = "Dead elements"
    elsewhere: ClassVar = "set dead in [elements]"

    def of(self, layout: SensorLayout) -> SensorLayout:
        return layout.without(self.elements)


@dataclass(frozen=True)
class StuckElements(_Failing, ReadingEffect):
    """The `elements` read what they read at the first frame from `since` in s on, ever after."""

    name: ClassVar = "stuck"
    label: ClassVar = "Stuck elements"
    example: ClassVar = {"elements": [5]}

    since: Annotated[float, Within(0, 1e9, "s")] = 0.0

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> RunningEffect:
        from kappaskin.scenes.effects.at_work.failures import stuck

        return stuck(self.channels(shape), self.since)


@dataclass(frozen=True)
class IntermittentElements(_Failing, ReadingEffect):
    """The `elements` drop to the reading of rest, 0, and come back, each for itself.

    On average they are there for `on` s and away for `off` s at a time (a Markov chain with two
    states). At first each is there with the probability on / (on + off) that it has ever after.
    """

    name: ClassVar = "intermittent"
    label: ClassVar = "Loose elements"
    example: ClassVar = {"elements": [3]}

    on: Annotated[float, Within(1e-6, 1e9, "s")] = 1.0
    off: Annotated[float, Within(1e-6, 1e9, "s")] = 0.1

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> RunningEffect:
        from kappaskin.scenes.effects.at_work.failures import intermittent

        return intermittent(self.channels(shape), self.on, self.off, rng)


@dataclass(frozen=True)
class _LinkFailure(Effect):
    """The `share` of all frames is hit, each for itself."""

    authored: ClassVar = True
    formula: ClassVar = "share of the frames"

    share: Annotated[float, Within(0, 1)]

    def size(self, survey: Survey) -> Size:
        return Size(self.share, 0.0)

    def start(self, rng: np.random.Generator) -> Callable[[int], bool]:
        """Whether frame n is hit: independent of the order and number of calls."""
        from kappaskin.scenes.effects.at_work.failures import hits

        return hits(self.share, rng)


@dataclass(frozen=True)
class DroppedFrames(_LinkFailure):
    """The `share` of all frames never arrives."""

    name: ClassVar = "dropped-frames"
    example: ClassVar = {"share": 0.01}


@dataclass(frozen=True)
class CorruptedFrames(_LinkFailure):
    """The `share` of all frames arrives with wrong bytes, which the checksum detects."""

    name: ClassVar = "corrupted-frames"
    example: ClassVar = {"share": 0.01}
