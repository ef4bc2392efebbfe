"""What the converter does to curvature: it has steps, and ends at rails."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kappaskin.scenes.effects.effect import ReadingEffect, Running, Size
from kappaskin.scenes.effects.survey import Survey
from kappaskin.sensing import Transduction


@dataclass(frozen=True)
class Quantisation(ReadingEffect):
    """Curvature is that of the count next to it, as `transduction` counts: no rails, only steps."""

    name: ClassVar = "quantisation"
    at_once: ClassVar = True
    formula: ClassVar = "half a count over peak curvature"

    transduction: Transduction

    def size(self, survey: Survey) -> Size:
        number = self.transduction.resolution / 2 / survey.peak
        return Size(number, number)

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> Running:
        from kappaskin.scenes.effects.at_work.converter import quantisation

        return quantisation(self.transduction)


@dataclass(frozen=True)
class Saturation(ReadingEffect):
    """Curvature stays between the lowest and the highest count of `transduction`."""

    name: ClassVar = "saturation"
    at_once: ClassVar = True
    formula: ClassVar = "largest curvature over that at the rail on its side"

    transduction: Transduction

    @property
    def rails(self) -> tuple[float, float]:
        """The curvature in 1/m of the lowest and of the highest count, below and above zero."""
        electronics = self.transduction
        shift = electronics.offset / electronics.sensitivity
        low, high = electronics.limits
        return low * electronics.resolution - shift, high * electronics.resolution - shift

    def size(self, survey: Survey) -> Size:
        (low, high), K = self.rails, survey.curvature
        number = float(np.maximum(K / low, K / high).max(initial=0.0))
        return Size(number, survey.share(np.clip(K, low, high) - K))

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> Running:
        from kappaskin.scenes.effects.at_work.converter import saturation

        return saturation(*self.rails)
