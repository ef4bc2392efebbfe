"""Strain limit: a gage that was bent too far does not come back to zero."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from kappaskin.scenes.effects.effect import ReadingEffect, Running, Size
from kappaskin.scenes.effects.parameters import Within
from kappaskin.scenes.effects.survey import Survey
from kappaskin.sensing import Transduction


@dataclass(frozen=True)
class StrainLimit(ReadingEffect):
    """y = x + share z: beyond the elastic limit of metal foil the zero shifts, and stays shifted.

    z is how far the channel went beyond `strain_limit_curvature` of `transduction`: a play, which
    grows with the curvature, stays as that comes back, and shrinks where it is the limit below z.
    Assumed: the `share` is the same everywhere and from the first time on, time does not heal it,
    and of the twist's two gages counts what they differ by.
    """

    name: ClassVar = "strain-limit"
    formula: ClassVar = "peak curvature over that of 1 % strain"

    transduction: Transduction
    share: Annotated[float, Within(0, 1)]

    @property
    def limit(self) -> float:
        """The curvature in 1/m up to which gages are elastic."""
        return self.transduction.strain_limit_curvature

    def size(self, survey: Survey) -> Size:
        most = float(np.abs(survey.curvature).max(initial=0.0))
        return Size(most / self.limit, self.share * max(most - self.limit, 0.0) / survey.peak)

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> Running:
        from kappaskin.scenes.effects.at_work.strain_limit import strain_limit

        return strain_limit(self.limit, self.share, shape)
