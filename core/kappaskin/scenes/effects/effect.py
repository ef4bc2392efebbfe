"""Interface of effects on readings: a name, parameters within limits, and a size in a scene.

The size of an effect is judged by a `Survey` of the scene, so that what does not matter there can
be left out.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from kappaskin._schema import parameters
from kappaskin.bases import Basis
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.mechanics import Plate, shapes_under
from kappaskin.scenes.effects.at_work import RunningEffect as RunningEffect
from kappaskin.sensing import DigitalReadings, SensorLayout, Transduction


def _check_ranges(name: str, effect: object) -> None:
    """Refuse an `effect`, called `name`, with a parameter out of its range."""
    for parameter, within in parameters(type(effect)).items():
        value = getattr(effect, parameter)
        if value not in within:
            raise Refusal(f"expected {name} with {parameter} of {within}, got {value!r:.80}")


@dataclass(frozen=True, eq=False)
class Survey:
    """S moments of a scene of `duration` s, as the theory of the whole plate has them.

    `coefficients` (S, N) in m at `times` (S,) in s are of `basis`; `forces` (S, N) in N the modal
    forces that make them, all zero where the skin lies on a cylinder; `curvature` (S, 3, P) in 1/m
    is what point-like elements of `layout` would read, (S, R) of other readings in units of theirs;
    `rates` (C,) in 1/m/s is the fastest that each of them changes, and `read_after` (C,) in s when
    in a scan it is read. Effects that act before the one that is judged add at most `carried` in
    1/m to a reading.
    """

    plate: Plate
    basis: Basis
    layout: SensorLayout
    transduction: Transduction | DigitalReadings
    times: Array
    forces: Array
    coefficients: Array
    curvature: Array
    rates: Array
    duration: float
    read_after: Array
    carried: float = 0.0

    @cached_property
    def peak(self) -> float:
        """The largest reading in 1/m; that of one count without a contact."""
        return max(float(np.abs(self.curvature).max(initial=0.0)), self.transduction.resolution)

    @cached_property
    def operator(self) -> Array:
        """Coefficients to readings of point-like elements, (C, N)."""
        layout = replace(self.layout, gage_length=0.0)
        return layout.operator(self.basis, self.plate)

    @cached_property
    def wavenumber(self) -> float:
        """k in 1/m of the scene: k^2 is the largest curvature over the largest deflection."""
        bends = replace(self.layout, gage_length=0.0).of_curvature
        operator = bends.operator(self.basis, self.plate) if self.layout.reads else self.operator
        bent = np.abs(self.coefficients @ operator.T).max(initial=0.0)
        deflection = self.coefficients @ self.basis.at(self.layout.positions).T
        most = np.abs(deflection).max(initial=0.0)
        return float(np.sqrt(bent / most)) if most else 0.0

    @cached_property
    def _shapes(self) -> dict[Plate, Array]:
        return {self.plate: self.coefficients}

    def shapes_on(self, plate: Plate) -> Array:
        """Coefficients (S, N) in m for the same forces on another `plate`."""
        if plate not in self._shapes:
            self._shapes[plate] = shapes_under(plate, self.basis, self.forces)
        return self._shapes[plate]

    def readings_on(self, plate: Plate) -> Array:
        """Readings (S, C) of point-like elements for the same forces on another `plate`."""
        return self.shapes_on(plate) @ self.operator.T

    def share(self, change: Array) -> float:
        """The largest `change` of a reading in 1/m as a share of the peak."""
        return float(np.abs(change).max(initial=0.0)) / self.peak

    @property
    def most(self) -> float:
        """The largest reading in 1/m, with what is carried, as a share of the peak."""
        return (float(np.abs(self.curvature).max(initial=0.0)) + self.carried) / self.peak


@dataclass(frozen=True, slots=True)
class Size:
    """How large an effect is in a scene: a dimensionless `number`, and what leaving it out does.

    `error` is by how much readings would be off at most, as a share of the scene's peak reading.
    """

    number: float
    error: float


NOTHING = Size(0.0, 0.0)


class Effect(ABC):
    """One thing that disturbs readings; two that disturb alike compare equal.

    To describe and judge one takes nothing of what it does: that is imported when it starts.
    """

    name: ClassVar[str]
    """Name in scenes and plans."""
    formula: ClassVar[str]
    """Formula of the number of its `Size`, in words."""
    label: ClassVar[str] = ""
    """Label on the screen, where it differs from the name."""
    example: ClassVar[Mapping[str, Any]] = {}
    """Keys in a scene file; none for an effect that follows from the rest of it."""
    elsewhere: ClassVar[str] = ""
    """Other keys of a scene file that define it."""
    of_gages: ClassVar[str] = ""
    """Why only strain gages have it; empty where any reading may."""
    authored: ClassVar[bool] = False
    """Whether only a scene's author selects it: a failure, whose `Size` has no error."""

    def __post_init__(self) -> None:
        _check_ranges(self.name, self)

    @classmethod
    def called(cls) -> str:
        """Label on the screen."""
        return cls.label or cls.name.replace("-", " ").capitalize()

    @abstractmethod
    def size(self, survey: Survey) -> Size:
        """Its size in a surveyed scene."""

    def amplification(self, survey: Survey) -> float:
        """How many times as large at most it makes a change of the readings before it."""
        return 1.0


class ReadingEffect(Effect):
    """An effect that changes one reading after the other, from curvature to curvature."""

    at_once: ClassVar[bool] = False
    """Whether it takes many frames (T, C) in one call, with the same result as one by one."""

    @abstractmethod
    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> RunningEffect:
        """The effect at work on curvature, or k readings of P elements, of `shape` (k, P).

        It is at rest, with a state of its own, is given the frames in order of time, and leaves the
        array it is given alone.
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
