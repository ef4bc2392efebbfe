"""Curvature to volts to ADC counts, and back: the chain of Figs. 4 and 5."""

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import cast

import numpy as np
from numpy.typing import ArrayLike

from kappaskin.errors import Refusal
from kappaskin.frames import Array, Counts, Mask
from kappaskin.sensing.electronics import Amplifier, Converter, HalfBridge, Multiplexer

ELASTIC_LIMIT = 0.01
"""Strain up to which metal-foil gages are elastic (paper, section 2.3)."""


@dataclass(frozen=True)
class Transduction:
    """What turns curvature in 1/m into counts, the same for every channel (Figs. 4, 5; Eqs. 7, 8).

    Refused when the unbent skin already drives the amplifier or the converter to a rail.
    """

    bridge: HalfBridge = field(default_factory=HalfBridge)
    multiplexer: Multiplexer = field(default_factory=Multiplexer)
    amplifier: Amplifier = field(default_factory=Amplifier)
    converter: Converter = field(default_factory=Converter)

    def __post_init__(self) -> None:
        if not (0 < self.sensitivity < math.inf and 0 < self.resolution < math.inf):
            raise Refusal(
                f"expected electronics that turn 1/m into volts, got {self.sensitivity} V per 1/m "
                f"with steps of {self._step} V; check thicknesses, gain and excitation"
            )
        out, rail = self._resting, self.amplifier.rail
        low, high = self.limits
        if not (abs(out) < rail and low < (out + self.converter.offset) / self._step < high):
            raise Refusal(
                f"expected the unbent skin to read inside +-{rail:g} V at the amplifier and "
                f"+-{self.converter.full_scale:g} V at the converter, got {out:.4g} V with a "
                f"balance voltage of {self.bridge.v_bal:g} V; balance the bridge with "
                f"{self.bridge.null_voltage(self.multiplexer.supply_resistance):.6g} V"
            )

    @property
    def _resting(self) -> float:
        """Volts out of the amplifier when the skin is not bent."""
        null = self.bridge.null_voltage(self.multiplexer.supply_resistance)
        return self.amplifier.gain * (null - self.bridge.v_bal)

    @cached_property
    def offset(self) -> float:
        """Volts that the converter reads when the skin is not bent."""
        return self._resting + self.converter.offset

    @cached_property
    def sensitivity(self) -> float:
        """Volts out per 1/m of curvature: V_in GF (t_s + t_g) Gain / 4 (Eq. 7).

        V_in is what a multiplexer of the supply leaves of the excitation.
        """
        V_in = self.bridge.fed(self.multiplexer.supply_resistance)
        GF, t = self.bridge.gage_factor, self.bridge.thickness
        return V_in * GF * t * self.amplifier.gain / 4

    @property
    def _step(self) -> float:
        return self.converter.step

    @cached_property
    def resolution(self) -> float:
        """Curvature of one count, in 1/m."""
        return self._step / self.sensitivity

    @cached_property
    def _offset(self) -> float:
        """Curvature that the offset looks like, in 1/m."""
        return self.offset / self.sensitivity

    @cached_property
    def limits(self) -> tuple[int, int]:
        """The lowest and highest count that can come: the converter's, or the amplifier's rails."""
        low, high = self.converter.limits
        rail, offset = self.amplifier.rail, self.converter.offset
        return (
            max(low, round((offset - rail) / self._step)),
            min(high, round((offset + rail) / self._step)),
        )

    @property
    def strain_limit_curvature(self) -> float:
        """Curvature in 1/m that strains a gage by 1 %: beyond it, metal foil is not elastic."""
        return ELASTIC_LIMIT / float(self.bridge.strain(1.0))

    def overstrained(self, curvature: ArrayLike) -> Mask:
        """Which elements (..., P) are bent beyond `strain_limit_curvature`.

        `curvature` (..., 3, P) in 1/m. What counts is the larger principal curvature, the most
        that a gage along any direction can see; where a reading is missing (NaN), the largest of
        the others, which is never more.
        """
        K = np.asarray(curvature, float)
        if K.ndim < 2 or K.shape[-2] != 3:
            raise Refusal(f"expected curvature of shape (..., 3, P) in 1/m, got {K.shape}")
        xx, yy, xy = (K[..., n, :] for n in range(3))
        with np.errstate(invalid="ignore"):  # of infinite readings the differences are NaN
            principal = np.abs(xx + yy) / 2 + np.hypot((xx - yy) / 2, xy)
        largest = np.fmax.reduce([np.abs(xx), np.abs(yy), np.abs(xy), principal])
        return largest > self.strain_limit_curvature

    def counts(self, curvature: Array) -> Counts:
        """What the converter reads, clipped at the rails; NaN is refused."""
        volts = self.sensitivity * curvature + self.offset
        if np.isnan(volts).any():
            raise Refusal("expected numbers of curvature, got NaN; a converter always reads one")
        return np.clip(np.rint(volts / self._step), *self.limits).astype(np.int32)

    def curvature(self, counts: Counts) -> Array:
        """Curvature in 1/m (Eq. 8); NaN on the rails, where the true value is unknown."""
        low, high = self.limits
        curvature = cast("Array", counts * self.resolution - self._offset)
        if counts.size and (counts.min() <= low or counts.max() >= high):
            curvature[self.saturated(counts)] = np.nan
        return curvature

    def saturated(self, counts: Counts) -> Mask:
        """Which counts stand on a rail."""
        low, high = self.limits
        return (counts <= low) | (counts >= high)

    @property
    def channel_time(self) -> float:
        """Seconds that one channel takes: settling, then conversion."""
        return self.multiplexer.settling_time + self.converter.conversion_time

    def scan_time(self, channels: int) -> float:
        """Seconds for one scan: conversion, not arithmetic, bounds the frame rate."""
        return channels * self.channel_time


# The paper gives neither excitation, gain, gage nor converter: the defaults above, 12 bits, and
# 20 us that hold the settling too. A foil gage is taken as 25 um of polyimide with 5 um of foil.
_GAGE = 30e-6
_CONVERTER = Converter(bits=12, conversion_time=20e-6)

FIRST_GENERATION = Transduction(
    HalfBridge(substrate_thickness=2 * (25e-6 + 13e-6) + 50e-6, gage_thickness=_GAGE),
    converter=_CONVERTER,
)
"""The first prototype (section 3, Fig. 3): two halves of flex circuit with 13 um copper foil,
glued by an adhesive film. Assumed: 25 um of polyimide in each half, as in the second, and a film
of 50 um; 126 um of substrate in all."""

SECOND_GENERATION = Transduction(
    HalfBridge(substrate_thickness=25e-6 + 2 * 35e-6, gage_thickness=_GAGE),
    converter=_CONVERTER,
)
"""The second prototype (section 5, Fig. 5): gages bonded to 25 um of polyimide clad with 35 um of
copper on both sides. Assumed: the copper stays under the gages; 95 um of substrate in all."""
