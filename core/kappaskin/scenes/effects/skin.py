"""What resists besides the skin's stiffness in bending: tension, foam, fluid and stretching."""

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np

from kappaskin._schema import Within
from kappaskin.mechanics import Plate
from kappaskin.scenes.effects.effect import NOTHING, Size, SkinEffect, Survey


def _stiffness(plate: Plate) -> float:
    """D k^4 + T k^2 + k_f in N/m^3 of the first mode of a hinged rectangle."""
    across = 0.0 if plate.patch.strip else 1 / plate.patch.b**2
    k2 = np.pi**2 * (1 / plate.patch.a**2 + across)
    return plate.rigidity * k2**2 + plate.tension * k2 + plate.foundation


class _Backing(SkinEffect):
    """Judged by what the same forces make of the skin with the backing and without it."""

    def _number(self, survey: Survey) -> float:
        """By how much it is stiffer with the backing, as a share of what it is without."""
        return _stiffness(self.of(survey.plate)) / _stiffness(self.off(survey.plate)) - 1

    def size(self, survey: Survey) -> Size:
        whole, bare = self.of(survey.plate), self.off(survey.plate)
        if whole == bare:
            return NOTHING
        change = survey.readings_on(whole) - survey.readings_on(bare)
        return Size(self._number(survey), survey.share(change))


@dataclass(frozen=True)
class Tension(_Backing):
    """The skin is pulled with `tension` T in N/m all round, as a drum head."""

    name: ClassVar = "tension"
    elsewhere: ClassVar = "set tension in [skin]"
    formula: ClassVar = "T k^2 over the rest of the first mode's stiffness, D k^4 + k_f"

    tension: Annotated[float, Within(0, 1e6, "N/m")]

    def of(self, plate: Plate) -> Plate:
        return replace(plate, tension=self.tension)

    def off(self, plate: Plate) -> Plate:
        return replace(plate, tension=0.0)


@dataclass(frozen=True)
class Foam(_Backing):
    """The skin lies on foam with the `foundation` modulus k_f in N/m^3."""

    name: ClassVar = "foam"
    elsewhere: ClassVar = "set foundation in [skin]"
    formula: ClassVar = (
        "k_f over the rest of the first mode's stiffness, D k^4 + T k^2: k_f a^4 / (4 D pi^4) of a "
        "square without tension"
    )

    foundation: Annotated[float, Within(0, 1e12, "N/m^3")]

    def of(self, plate: Plate) -> Plate:
        return replace(plate, foundation=self.foundation)

    def off(self, plate: Plate) -> Plate:
        return replace(plate, foundation=0.0)


@dataclass(frozen=True)
class Fluid(_Backing):
    """The skin closes in a fluid that keeps its volume."""

    name: ClassVar = "fluid"
    elsewhere: ClassVar = "set fluid in [skin]"
    formula: ClassVar = "volume displaced without it, over area times peak deflection"

    def of(self, plate: Plate) -> Plate:
        return replace(plate, fluid=True)

    def off(self, plate: Plate) -> Plate:
        return replace(plate, fluid=False)

    def _number(self, survey: Survey) -> float:
        basis = survey.basis
        c = self.off(survey.plate).compliance(basis).after(survey.forces)
        points, weights = basis.quadrature()
        deflection = c @ basis.at(points).T
        most = float(np.abs(deflection).max(initial=0.0) * weights.sum())
        return float(np.abs(deflection @ weights).max(initial=0.0)) / most if most else 0.0


@dataclass(frozen=True)
class StretchingEffect(SkinEffect):
    """A flat sheet of `thickness` h in m stretches as it deflects (von Karman).

    Disks, polygons and bent skins do not here: for those there is no such computation.
    """

    name: ClassVar = "stretching"
    elsewhere: ClassVar = "set thickness in [skin]"
    formula: ClassVar = "largest deflection over thickness"

    thickness: float

    def of(self, plate: Plate) -> Plate:
        return replace(plate, thickness=self.thickness)

    def off(self, plate: Plate) -> Plate:
        return replace(plate, thickness=None)

    def size(self, survey: Survey) -> Size:
        whole, bare = self.of(survey.plate), self.off(survey.plate)
        if not whole.stretches:
            return NOTHING
        deflections = survey.shapes_on(whole) @ survey.basis.at(survey.layout.positions).T
        change = survey.readings_on(whole) - survey.readings_on(bare)
        number = float(np.abs(deflections).max(initial=0.0)) / self.thickness
        return Size(number, survey.share(change))
