"""Finite slope: gages sense the curvature of the deflected surface, which the slope tilts."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from kappaskin.bases import Basis
from kappaskin.frames import Array
from kappaskin.scenes.effects.effect import Effect, Size
from kappaskin.scenes.effects.survey import Survey
from kappaskin.sensing import SensorLayout, slope_correction


@dataclass(frozen=True)
class FiniteSlope(Effect):
    """Gages read the true normal curvature, of which the second derivative is the first order.

    It replaces the operator from coefficients to curvature. For a bent skin there is no such
    formula here: its readings are those of first order, and leaving that as it is costs nothing.
    """

    name: ClassVar = "finite-slope"
    formula: ClassVar = "largest slope squared"

    def size(self, survey: Survey) -> Size:
        fx, fy = survey.slopes[:, 0], survey.slopes[:, 1]
        number = float((fx**2 + fy**2).max(initial=0.0))
        if survey.plate.patch.base_curvature:
            return Size(number, 0.0)
        return Size(number, survey.share(survey.curvature * (1 - 1 / slope_correction(fx, fy))))

    def sensed(self, basis: Basis, layout: SensorLayout) -> Callable[[Array], Array]:
        """Coefficients (Ni, Nj) in m to the curvature (3 P,) in 1/m that the elements read."""
        from kappaskin.scenes.effects.at_work.finite_slope import finite_slope

        return finite_slope(basis, layout)
