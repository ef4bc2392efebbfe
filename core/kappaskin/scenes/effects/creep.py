"""Creep of the gages: a reading that relaxes while the curvature stays."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kappaskin.scenes.effects.effect import ReadingEffect, Running, Size
from kappaskin.scenes.effects.survey import Survey
from kappaskin.sensing import StandardLinearSolid


@dataclass(frozen=True)
class Creep(ReadingEffect):
    """Of every reading the `share` relaxes away, with the `time_constant` in s."""

    name: ClassVar = "creep"
    formula: ClassVar = "share that relaxes away while the scene lasts"

    share: float
    time_constant: float

    def __post_init__(self) -> None:
        self.solid(1)

    def solid(self, channels: int) -> StandardLinearSolid:
        """The same creep in each of so many `channels`."""
        return StandardLinearSolid(np.full(channels, float(self.share)), self.time_constant)

    def size(self, survey: Survey) -> Size:
        gone = -self.share * math.expm1(-survey.duration / self.time_constant)
        return Size(gone, gone)

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> Running:
        from kappaskin.scenes.effects.at_work.creep import creep

        return creep(self.solid(int(np.prod(shape))), shape)
