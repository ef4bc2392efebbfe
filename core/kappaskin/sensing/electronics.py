"""The parts of Figs. 4 and 5: half-bridge, multiplexer, amplifier and converter."""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from kappaskin.errors import Refusal
from kappaskin.frames import Array


def _require_positive(owner: object, *names: str) -> None:
    for name in names:
        value = getattr(owner, name)
        if not (math.isfinite(value) and value > 0):
            raise Refusal(f"expected {type(owner).__name__}.{name} above zero, got {value}")


def _require_not_negative(owner: object, name: str) -> None:
    value = getattr(owner, name)
    if not (math.isfinite(value) and value >= 0):
        raise Refusal(f"expected {type(owner).__name__}.{name} of at least zero, got {value}")


@dataclass(frozen=True)
class HalfBridge:
    """Back-to-back strain gages in a half-bridge, and the dummy half-bridge beside it (Fig. 4).

    Thicknesses in m, excitation V_in in V; the gage factor has no unit. `gage_resistance` R_g in
    ohm is that of an unstrained gage, `gage_mismatch` by what share of it the lower gage of a pair
    exceeds the upper one. `dummy_resistance` R_d in ohm is the lower arm of the dummy, whose middle
    stands at `balance_voltage` V_bal in V; None means half of the excitation, two equal arms.

    One gage of a pair stretches by what the other shrinks, so their sum stays 2 R_g and the middle
    moves in proportion to the strain, however large it is: nothing of a quarter bridge's
    nonlinearity is left to model. Nor is what a mismatch m does beyond its offset: it bends that
    line by the share m GF strain / 2, 1e-4 at 1 % of each, and with a multiplexer of the supply
    tilts it by less than m / 2.
    """

    gage_factor: float = 2.1
    substrate_thickness: float = 225e-6
    gage_thickness: float = 25e-6
    excitation: float = 5.0
    gage_resistance: float = 350.0
    gage_mismatch: float = 0.0
    dummy_resistance: float = 350.0
    balance_voltage: float | None = None

    def __post_init__(self) -> None:
        _require_positive(self, "gage_factor", "substrate_thickness", "gage_thickness")
        _require_positive(self, "excitation", "gage_resistance", "dummy_resistance")
        if not abs(self.gage_mismatch) < 1:
            raise Refusal(
                "expected HalfBridge.gage_mismatch between -1 and 1, a share of the gage's "
                f"resistance, got {self.gage_mismatch}"
            )
        if not 0 < self.v_bal < self.excitation:
            raise Refusal(
                f"expected HalfBridge.balance_voltage between 0 and the excitation of "
                f"{self.excitation:g} V, got {self.balance_voltage}"
            )

    @property
    def thickness(self) -> float:
        """t_s + t_g in m: the distance between the two gages of a pair."""
        return self.substrate_thickness + self.gage_thickness

    @property
    def v_bal(self) -> float:
        """V_bal in V, where the middle of the dummy half-bridge stands."""
        return self.excitation / 2 if self.balance_voltage is None else self.balance_voltage

    @property
    def dummy_arms(self) -> tuple[float, float]:
        """The dummy's upper and lower resistor in ohm: a divider of V_in to V_bal."""
        R_d = self.dummy_resistance
        return R_d * (self.excitation / self.v_bal - 1), R_d

    def strain(self, curvature: ArrayLike) -> Array:
        """Gage strain: curvature in 1/m times half the distance between the gages."""
        return np.asarray(curvature, float) * self.thickness / 2

    def fed(self, supply_resistance: float = 0.0) -> float:
        """Volts across a pair that is fed through `supply_resistance` in ohm."""
        R_g = self.gage_resistance
        return self.excitation * 2 * R_g / (2 * R_g + supply_resistance)

    def null_voltage(self, supply_resistance: float = 0.0) -> float:
        """The balance voltage in V at which an unbent pair gives no voltage."""
        return self.fed(supply_resistance) * (1 + self.gage_mismatch / 2) / 2

    def balanced(self, supply_resistance: float = 0.0) -> "HalfBridge":
        """The same bridge with its dummy at `null_voltage`."""
        return replace(self, balance_voltage=self.null_voltage(supply_resistance))


@dataclass(frozen=True)
class Multiplexer:
    """Connects one half-bridge after the other; `settling_time` in s before each conversion.

    `supply_resistance` in ohm is what it puts between the excitation and the pair it feeds. It is
    0 for a multiplexer of signals as in Fig. 4: that one stands before an amplifier whose inputs
    draw no current, so nothing drops across its on-resistance and there is nothing to model.
    """

    settling_time: float = 0.0
    supply_resistance: float = 0.0

    def __post_init__(self) -> None:
        _require_not_negative(self, "settling_time")
        _require_not_negative(self, "supply_resistance")


@dataclass(frozen=True)
class Amplifier:
    """An instrumentation amplifier; its output stays between minus and plus `rail` in V."""

    gain: float = 100.0
    rail: float = 2.5

    def __post_init__(self) -> None:
        _require_positive(self, "gain", "rail")


@dataclass(frozen=True)
class Converter:
    """A bipolar analog-to-digital converter, scanned over all channels.

    Reads volts between minus and plus `full_scale` as signed counts of `bits`; `offset` in V is
    what it reads of no voltage; `conversion_time` in s per channel bounds the frame rate.
    """

    bits: int = 16
    full_scale: float = 2.5
    offset: float = 0.0
    conversion_time: float = 5e-6

    def __post_init__(self) -> None:
        _require_positive(self, "full_scale", "conversion_time")
        if not (8 <= self.bits <= 24 and self.bits == int(self.bits)):
            raise Refusal(f"expected a converter of 8 to 24 bits, got {self.bits}")
        if not abs(self.offset) < self.full_scale:
            raise Refusal(
                f"expected an offset inside +-{self.full_scale} V, got {self.offset} V; "
                "balance the bridge"
            )

    @cached_property
    def limits(self) -> tuple[int, int]:
        """The lowest and highest count."""
        return -(2 ** (self.bits - 1)), 2 ** (self.bits - 1) - 1

    @property
    def step(self) -> float:
        """Volts per count."""
        return self.full_scale / 2 ** (self.bits - 1)
