"""Curvature to volts to ADC counts, and back."""

import math
from dataclasses import dataclass, fields
from functools import cached_property
from typing import cast

import numpy as np
from numpy.typing import ArrayLike

from kappaskin.errors import Refusal
from kappaskin.frames import Array, Counts, Mask

ELASTIC_LIMIT = 0.01
"""Strain up to which metal-foil gages are elastic (paper, section 2.3)."""


def _require_positive(owner: object, names: tuple[str, ...]) -> None:
    for name in names:
        value = getattr(owner, name)
        if not (math.isfinite(value) and value > 0):
            raise Refusal(f"expected {type(owner).__name__}.{name} above zero, got {value}")


@dataclass(frozen=True)
class HalfBridge:
    """Back-to-back strain gages in a half-bridge with an amplifier.

    Thicknesses in m, excitation in V; gage factor and gain have no unit.
    """

    gage_factor: float = 2.1
    substrate_thickness: float = 225e-6
    gage_thickness: float = 25e-6
    excitation: float = 5.0
    gain: float = 100.0

    def __post_init__(self) -> None:
        _require_positive(self, tuple(f.name for f in fields(self)))

    @property
    def thickness(self) -> float:
        """t_s + t_g in m: the distance between the two gages of a pair."""
        return self.substrate_thickness + self.gage_thickness

    @property
    def sensitivity(self) -> float:
        """Volts out per 1/m of curvature: V_in GF (t_s + t_g) Gain / 4 (Eq. 7)."""
        return self.excitation * self.gage_factor * self.thickness * self.gain / 4

    def strain(self, curvature: ArrayLike) -> Array:
        """Gage strain: curvature in 1/m times half the distance between the gages."""
        return np.asarray(curvature, float) * self.thickness / 2


@dataclass(frozen=True)
class Converter:
    """A bipolar analog-to-digital converter, scanned over all channels.

    Reads volts between minus and plus `full_scale` as signed counts of `bits`; `offset` in V is
    what it reads at zero curvature; `conversion_time` in s per channel bounds the frame rate.
    """

    bits: int = 16
    full_scale: float = 2.5
    offset: float = 0.0
    conversion_time: float = 5e-6

    def __post_init__(self) -> None:
        _require_positive(self, ("full_scale", "conversion_time"))
        if not (8 <= self.bits <= 24 and self.bits == int(self.bits)):
            raise Refusal(f"expected a converter of 8 to 24 bits, got {self.bits}")
        if not abs(self.offset) < self.full_scale:
            raise Refusal(
                f"expected an offset inside +-{self.full_scale} V, got {self.offset} V; "
                "balance the bridge"
            )

    @cached_property
    def limits(self) -> tuple[int, int]:
        """The lowest and highest count: the rails."""
        return -(2 ** (self.bits - 1)), 2 ** (self.bits - 1) - 1

    @property
    def step(self) -> float:
        """Volts per count."""
        return self.full_scale / 2 ** (self.bits - 1)


@dataclass(frozen=True)
class Transduction:
    """What turns curvature in 1/m into counts, the same for every channel (Eqs. 7, 8)."""

    bridge: HalfBridge = HalfBridge()
    converter: Converter = Converter()

    @cached_property
    def resolution(self) -> float:
        """Curvature of one count, in 1/m."""
        return self.converter.step / self.bridge.sensitivity

    @cached_property
    def _offset(self) -> float:
        """Curvature that the converter's offset looks like, in 1/m."""
        return self.converter.offset / self.bridge.sensitivity

    def counts(self, curvature: Array) -> Counts:
        """What the converter reads, clipped at its rails; NaN is refused."""
        volts = self.bridge.sensitivity * curvature + self.converter.offset
        if np.isnan(volts).any():
            raise Refusal("expected numbers of curvature, got NaN; a converter always reads one")
        return np.clip(np.rint(volts / self.converter.step), *self.converter.limits).astype(
            np.int32
        )

    def curvature(self, counts: Counts) -> Array:
        """Curvature in 1/m (Eq. 8); NaN on the rails, where the true value is unknown."""
        low, high = self.converter.limits
        curvature = cast("Array", counts * self.resolution - self._offset)
        if counts.size and (counts.min() <= low or counts.max() >= high):
            curvature[self.saturated(counts)] = np.nan
        return curvature

    def saturated(self, counts: Counts) -> Mask:
        """Which counts stand on a rail."""
        low, high = self.converter.limits
        return (counts <= low) | (counts >= high)

    def scan_time(self, channels: int) -> float:
        """Seconds for one scan: conversion, not arithmetic, bounds the frame rate."""
        return channels * self.converter.conversion_time


PAPER = Transduction(converter=Converter(bits=12, conversion_time=20e-6))
"""The paper's time scale: 20 us per conversion, 300 channels at 167 frames/s."""
