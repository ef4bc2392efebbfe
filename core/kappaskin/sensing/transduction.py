"""Signal chain: curvature to bridge voltage to ADC counts, and back (Figs. 4 and 5)."""

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import ClassVar, cast

import numpy as np
from numpy.typing import ArrayLike

from kappaskin.errors import Refusal
from kappaskin.frames import Array, Counts, Mask
from kappaskin.sensing.layout import SensorLayout


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
    """Back-to-back strain gages in a half-bridge, and the dummy half-bridge next to it (Fig. 4).

    Thicknesses in m, `excitation` V_in in V; the gage factor has no unit. `gage_resistance` R_g in
    ohm is that of an unstrained gage, `gage_mismatch` the share of it by which the lower gage of a
    pair exceeds the upper one. `dummy_resistance` R_d in ohm is the lower arm of the dummy, whose
    middle is at `balance_voltage` V_bal in V; None means half of the excitation, two equal arms.

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
        """V_bal in V, the voltage at the middle of the dummy half-bridge."""
        return self.excitation / 2 if self.balance_voltage is None else self.balance_voltage

    @property
    def dummy_arms(self) -> tuple[float, float]:
        """The dummy's upper and lower resistance in ohm: a divider from V_in to V_bal."""
        R_d = self.dummy_resistance
        return R_d * (self.excitation / self.v_bal - 1), R_d

    def strain(self, curvature: ArrayLike) -> Array:
        """Gage strain: curvature in 1/m times half the distance between the gages."""
        return np.asarray(curvature, float) * self.thickness / 2

    def fed(self, supply_resistance: float = 0.0) -> float:
        """Voltage in V across a pair that is supplied through `supply_resistance` in ohm."""
        R_g = self.gage_resistance
        return self.excitation * 2 * R_g / (2 * R_g + supply_resistance)

    def null_voltage(self, supply_resistance: float = 0.0) -> float:
        """The balance voltage in V at which an unbent pair reads zero."""
        return self.fed(supply_resistance) * (1 + self.gage_mismatch / 2) / 2

    def balanced(self, supply_resistance: float = 0.0) -> "HalfBridge":
        """The same bridge with its dummy at `null_voltage`."""
        return replace(self, balance_voltage=self.null_voltage(supply_resistance))


@dataclass(frozen=True)
class Multiplexer:
    """Connects one half-bridge at a time; `settling_time` in s before each conversion.

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

    It reads voltages between minus and plus `full_scale` in V as signed counts of `bits`; `offset`
    in V is its reading at zero volts; `conversion_time` in s per channel limits the frame rate.
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


ELASTIC_LIMIT = 0.01
"""Strain up to which metal-foil gages are elastic (paper, section 2.3)."""


@dataclass(frozen=True)
class Transduction:
    """The chain from curvature in 1/m to counts, the same for all channels (Eqs. 7 and 8).

    Raises a `Refusal` when the unbent skin already drives the amplifier or converter to a rail.
    """

    noise: ClassVar[tuple[tuple[str, float], ...]] = ()  # not stated
    bridge: HalfBridge = field(default_factory=HalfBridge)
    multiplexer: Multiplexer = field(default_factory=Multiplexer)
    amplifier: Amplifier = field(default_factory=Amplifier)
    converter: Converter = field(default_factory=Converter)

    def __post_init__(self) -> None:
        if not (0 < self.sensitivity < math.inf and 0 < self.resolution < math.inf):
            raise Refusal(
                f"expected electronics that convert 1/m to volts, got {self.sensitivity} V per 1/m "
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

    def check(self, layout: SensorLayout) -> None:
        """Raise a `Refusal` for readings that no half-bridge has."""
        if not layout.senses_curvature_only:
            raise Refusal(
                f"expected digital readings of {' and '.join(layout.kind_names)}, got a "
                "half-bridge of strain gages, which reads curvature; give [readings] instead of "
                "[electronics]"
            )

    @property
    def _resting(self) -> float:
        """Output of the amplifier in V when the skin is not bent."""
        null = self.bridge.null_voltage(self.multiplexer.supply_resistance)
        return self.amplifier.gain * (null - self.bridge.v_bal)

    @cached_property
    def offset(self) -> float:
        """What the converter reads in V when the skin is not bent."""
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
        """The offset as a curvature in 1/m."""
        return self.offset / self.sensitivity

    @cached_property
    def limits(self) -> tuple[int, int]:
        """Lowest and highest possible count: the converter's limits or the amplifier's rails."""
        low, high = self.converter.limits
        rail, offset = self.amplifier.rail, self.converter.offset
        return (
            max(low, round((offset - rail) / self._step)),
            min(high, round((offset + rail) / self._step)),
        )

    def strain(self, curvature: float) -> float:
        """Strain of a gage at `curvature` in 1/m."""
        return float(self.bridge.strain(curvature))

    @property
    def strain_limit_curvature(self) -> float:
        """Curvature in 1/m that strains a gage by 1 %, the elastic limit of metal foil."""
        return ELASTIC_LIMIT / float(self.bridge.strain(1.0))

    def overstrained(self, curvature: ArrayLike) -> Mask:
        """Which elements (..., P) are bent beyond `strain_limit_curvature`.

        `curvature` (..., 3, P) in 1/m. The larger principal curvature counts, the largest along
        any direction; where a reading is missing (NaN), the largest of the others, which is never
        more.
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
        """Counts for `curvature` in 1/m, clipped at the rails; raises a `Refusal` for NaN."""
        volts = self.sensitivity * curvature + self.offset
        if np.isnan(volts).any():
            raise Refusal("expected curvature without NaN; a converter always returns a count")
        return np.clip(np.rint(volts / self._step), *self.limits).astype(np.int32)

    def curvature(self, counts: Counts) -> Array:
        """Curvature in 1/m for `counts` (Eq. 8); NaN on the rails, where it is unknown."""
        low, high = self.limits
        curvature = cast("Array", counts * self.resolution)
        curvature -= self._offset
        if counts.size:
            ends = counts.argmin(), counts.argmax()  # min() and max() go through Python
            if not low < counts.item(ends[0]) <= counts.item(ends[1]) < high:
                curvature[self.saturated(counts)] = np.nan
        return curvature

    def saturated(self, counts: Counts) -> Mask:
        """Which counts are on a rail."""
        low, high = self.limits
        return (counts <= low) | (counts >= high)

    @property
    def count_bytes(self) -> int:
        """Bytes of a count on the wire."""
        return 2 if self.converter.bits <= 16 else 4

    @property
    def settling_time(self) -> float:
        """Time in s from the switch of the multiplexer to the conversion of a channel."""
        return self.multiplexer.settling_time

    @property
    def conversion_time(self) -> float:
        """Time in s that the converter takes for a channel."""
        return self.converter.conversion_time

    @property
    def channel_time(self) -> float:
        """Time in s for one channel: settling and conversion."""
        return self.settling_time + self.conversion_time

    def scan_time(self, channels: int) -> float:
        """Time in s for a scan of `channels`, which limits the frame rate."""
        return channels * self.channel_time


@dataclass(frozen=True)
class DigitalReadings:
    """Readings that a device sends as numbers, all at once: its electronics are not known.

    A frame holds them in counts of `resolution`, in the unit of each; the lowest one stands for no
    reading. `noise` is the standard deviation of some quantities, or of a reading along one
    direction, by name (`name_of_reading`), in their units.
    """

    resolution: float = 1e-7
    noise: tuple[tuple[str, float], ...] = ()
    limits: ClassVar[tuple[int, int]] = -(2**31), 2**31 - 1
    count_bytes: ClassVar[int] = 4
    settling_time: ClassVar[float] = 0.0
    conversion_time: ClassVar[float] = 0.0
    channel_time: ClassVar[float] = 0.0
    strain_limit_curvature: ClassVar[float] = math.inf

    def __post_init__(self) -> None:
        _require_positive(self, "resolution")
        for name, noise in self.noise:
            if not (math.isfinite(noise) and noise >= 0):
                raise Refusal(f"expected a noise of {name} of at least zero, got {noise}")

    def check(self, layout: SensorLayout) -> None:
        """Any reading may be digital."""

    def counts(self, curvature: Array) -> Counts:
        """Counts for `curvature`, or other readings; the lowest for NaN and out of range."""
        counts = np.rint(curvature / self.resolution)
        low, high = self.limits
        known = (counts > low) & (counts < high)
        return np.where(known, counts, low).astype(np.int32)

    def curvature(self, counts: Counts) -> Array:
        """Curvature, or other readings, for `counts`; NaN where there was none."""
        curvature = cast("Array", counts * self.resolution)
        curvature[self.saturated(counts)] = np.nan
        return curvature

    def saturated(self, counts: Counts) -> Mask:
        """Which counts stand for no reading."""
        low, high = self.limits
        return (counts <= low) | (counts >= high)

    def strain(self, curvature: float) -> float:
        """Strain of a gage at `curvature` in 1/m: not known."""
        return math.nan

    def overstrained(self, curvature: ArrayLike) -> Mask:
        """Which elements (..., P) are over their strain limit: none, as it is not known."""
        K = np.asarray(curvature, float)
        return np.zeros((*K.shape[:-2], K.shape[-1]), bool)

    def scan_time(self, channels: int) -> float:
        """Time in s for a scan: none that is known."""
        return 0.0


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
