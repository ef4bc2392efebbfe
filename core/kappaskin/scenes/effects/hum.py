"""Hum: what wires pick up of the mains."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from kappaskin.scenes.effects.effect import ReadingEffect, Running, Size
from kappaskin.scenes.effects.parameters import Within
from kappaskin.scenes.effects.survey import Survey


@dataclass(frozen=True)
class MainsHum(ReadingEffect):
    """A sine of `amplitude` in 1/m and `frequency` in Hz, alike in all channels of a frame.

    Its phase at time 0 is drawn with the scene's seed: the mains know of no scene, and a fixed one
    would favour some frames in every run.
    """

    name: ClassVar = "mains-hum"
    formula: ClassVar = "amplitude over peak curvature"

    amplitude: Annotated[float, Within(0, 1e4, "1/m")]
    frequency: Annotated[float, Within(1, 1000, "Hz")] = 50.0

    def size(self, survey: Survey) -> Size:
        number = self.amplitude / survey.peak
        return Size(number, number)

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> Running:
        from kappaskin.scenes.effects.at_work.hum import hum

        return hum(self.amplitude, self.frequency, rng)
