"""Gages of some length: each reads the mean of the curvature along it."""

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

from kappaskin.scenes.effects.effect import LayoutEffect, Size
from kappaskin.scenes.effects.parameters import Within
from kappaskin.scenes.effects.survey import Survey
from kappaskin.sensing import SensorLayout


@dataclass(frozen=True)
class GageLength(LayoutEffect):
    """Gages are `length` L in m long, along x, along y and along both diagonals."""

    name: ClassVar = "gage-length"
    formula: ClassVar = "k L / 2, where k^2 is peak curvature over peak deflection"

    length: Annotated[float, Within(0, 10, "m")]

    def of(self, layout: SensorLayout) -> SensorLayout:
        return replace(layout, gage_length=self.length)

    def size(self, survey: Survey) -> Size:
        longer = self.of(survey.layout).curvature_operator(survey.basis)
        change = survey.coefficients @ (longer - survey.operator).T
        return Size(survey.wavenumber * self.length / 2, survey.share(change))
