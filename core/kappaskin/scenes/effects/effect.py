"""What every effect is: something that spoils readings, and knows how much it would in a scene."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kappaskin.frames import Array
from kappaskin.mechanics import Plate
from kappaskin.scenes.effects.parameters import check
from kappaskin.scenes.effects.survey import Survey
from kappaskin.sensing import SensorLayout

Running = Callable[[Array, float], Array]
"""An effect at work: curvature in 1/m and the time in s to the curvature that is read then."""


@dataclass(frozen=True, slots=True)
class Size:
    """How large an effect is in a scene: a dimensionless `number`, and what leaving it out does.

    `error` is by how much readings would be off at most, as a share of the scene's peak curvature.
    """

    number: float
    error: float


NOTHING = Size(0.0, 0.0)


class Effect(ABC):
    """One thing that spoils readings; its values compare equal when they spoil alike.

    An effect is told and judged without what it takes to work: that is imported when it starts.
    """

    name: ClassVar[str]
    """What scenes and plans call it."""
    formula: ClassVar[str]
    """The number of its `Size`, in words."""
    authored: ClassVar[bool] = False
    """Whether only a scene's author decides on it: a failure, whose `Size` tells of no error."""

    def __post_init__(self) -> None:
        check(self.name, self)

    @abstractmethod
    def size(self, survey: Survey) -> Size:
        """How large it is in a scene that was surveyed."""


class ReadingEffect(Effect):
    """An effect that changes one reading after the other, from curvature to curvature."""

    at_once: ClassVar[bool] = False
    """Whether at work it takes many frames (T, C) in one call, as it would one after the other."""

    @abstractmethod
    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> Running:
        """The effect at work on curvature of `shape`, at rest, with a state of its own.

        It is given the frames in order of time, and leaves the array it is given alone.
        """


class SkinEffect(Effect):
    """An effect that makes another skin: one that is pulled, or rests on something."""

    @abstractmethod
    def of(self, plate: Plate) -> Plate:
        """The skin with the effect."""

    @abstractmethod
    def off(self, plate: Plate) -> Plate:
        """The skin without it."""


class LayoutEffect(Effect):
    """An effect that makes other elements: longer ones, or dead ones."""

    @abstractmethod
    def of(self, layout: SensorLayout) -> SensorLayout:
        """The elements with the effect."""
