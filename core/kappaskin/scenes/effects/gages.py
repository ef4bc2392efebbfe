"""Effects in the strain gages: slope, length, strain, hysteresis, creep, temperature, tolerance."""

import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Annotated, ClassVar

import numpy as np

from kappaskin._schema import Within
from kappaskin.bases import Basis
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.mechanics import Plate
from kappaskin.scenes.effects.effect import (
    Effect,
    LayoutEffect,
    ReadingEffect,
    RunningEffect,
    Size,
    Survey,
)
from kappaskin.sensing import (
    NormalCurvature,
    PrandtlIshlinskii,
    SensorLayout,
    StandardLinearSolid,
    Transduction,
)


@dataclass(frozen=True)
class FiniteSlopeEffect(Effect):
    """Gages read the true normal curvature, of which the second derivative is the first order.

    It replaces the operator from coefficients to readings; heights and slopes stay as they are.
    """

    name: ClassVar = "finite-slope"
    elsewhere: ClassVar = "it has no parameters: name it in choose, on or off"
    formula: ClassVar = "largest slope squared"

    def size(self, survey: Survey) -> Size:
        layout = replace(survey.layout, gage_length=0.0)
        sensed = NormalCurvature(survey.basis, layout, plate=survey.plate)
        surface = sensed.surface(survey.coefficients)
        number = float(surface.slope.max(initial=0.0)) ** 2
        read = surface.readings.reshape(survey.curvature.shape)
        return Size(number, survey.share(survey.curvature - read))

    def sensed(
        self, basis: Basis, layout: SensorLayout, plate: Plate | None = None
    ) -> Callable[[Array], Array]:
        """Coefficients (Ni, Nj) in m to the readings (R,) of the elements."""
        from kappaskin.scenes.effects.at_work.gages import finite_slope

        return finite_slope(basis, layout, plate)


@dataclass(frozen=True)
class GageLength(LayoutEffect):
    """Gages are `length` L in m long, along x, along y and along both diagonals."""

    name: ClassVar = "gage-length"
    elsewhere: ClassVar = "set gage_length in [elements]"
    formula: ClassVar = "k L / 2, where k^2 is peak curvature over peak deflection"

    length: Annotated[float, Within(0, 10, "m")]

    def of(self, layout: SensorLayout) -> SensorLayout:
        return replace(layout, gage_length=self.length)

    def size(self, survey: Survey) -> Size:
        longer = self.of(survey.layout).operator(survey.basis, survey.plate)
        change = survey.coefficients @ (longer - survey.operator).T
        return Size(survey.wavenumber * self.length / 2, survey.share(change))


@dataclass(frozen=True)
class StrainLimit(ReadingEffect):
    """y = x + share z: beyond the elastic limit of metal foil the zero shifts, and stays shifted.

    z is how far the channel went beyond `strain_limit_curvature` of `transduction`: a play, which
    grows with the curvature, stays as that comes back, and shrinks where it is the limit below z.
    Assumed: the `share` is the same everywhere and from the first time on, time does not heal it,
    and of the twist's two gages counts what they differ by.
    """

    name: ClassVar = "strain-limit"
    of_gages: ClassVar = "metal foil has the limit"
    example: ClassVar = {"share": 0.1}
    formula: ClassVar = "peak curvature over that of 1 % strain"

    transduction: Transduction
    share: Annotated[float, Within(0, 1)]

    @property
    def limit(self) -> float:
        """The curvature in 1/m up to which gages are elastic."""
        return self.transduction.strain_limit_curvature

    def size(self, survey: Survey) -> Size:
        most = float(np.abs(survey.curvature).max(initial=0.0))
        error = self.share * max(survey.most - self.limit / survey.peak, 0.0)
        return Size(most / self.limit, error)

    def amplification(self, survey: Survey) -> float:
        return 1 + self.share

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> RunningEffect:
        from kappaskin.scenes.effects.at_work.gages import strain_limit

        return strain_limit(self.limit, self.share, shape)


_MOST = 100  # plays: each costs time in every frame


@dataclass(frozen=True)
class Hysteresis(ReadingEffect):
    """The same loops in every channel: plays of `weights` at `thresholds` in 1/m.

    Loops on positive curvature are `asymmetry` times wider than on negative curvature, in which
    thresholds count. A long way in one direction is read with its true slope of 1.
    """

    name: ClassVar = "hysteresis"
    of_gages: ClassVar = "its loops are those of gages on a substrate"
    example: ClassVar = {"like": "second"}
    formula: ClassVar = "hysteresis lag over the peak reading"

    thresholds: tuple[float, ...]
    weights: tuple[float, ...]
    asymmetry: float = 1.0

    def __post_init__(self) -> None:
        if not (len(self.thresholds) == len(self.weights) and min(self.weights, default=0.0) >= 0):
            raise Refusal(
                "expected one weight of at least 0 for each threshold, got "
                f"{len(self.weights)} for {len(self.thresholds)}, {self.weights}"
            )
        if len(self.weights) > _MOST:
            raise Refusal(f"expected at most {_MOST} thresholds, got {len(self.weights)}")
        if not sum(self.weights) < 1:
            raise Refusal(f"expected weights whose sum is below 1, got {sum(self.weights):g}")
        self.operator(1)

    def operator(self, channels: int) -> PrandtlIshlinskii:
        """The same loops in each of so many `channels`."""

        def everywhere(values: tuple[float, ...]) -> Array:
            return np.tile(np.array(values, float)[:, None], channels)

        p = everywhere(self.weights)
        a = np.full(channels, float(self.asymmetry))
        return PrandtlIshlinskii(everywhere(self.thresholds), p, 1 - p.sum(axis=0), a)

    def size(self, survey: Survey) -> Size:
        # Each play lags behind by its threshold, or by all there is to lag behind of.
        wider = max(self.asymmetry, 1.0)
        widths = np.array(self.thresholds) * wider / survey.peak
        number, error = (
            float((np.minimum(widths, most) * self.weights).sum()) for most in (1.0, survey.most)
        )
        return Size(number, error)

    def amplification(self, survey: Survey) -> float:
        return max(self.asymmetry, 1 / self.asymmetry)

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> RunningEffect:
        from kappaskin.scenes.effects.at_work.gages import hysteresis

        return hysteresis(self.operator(int(np.prod(shape))), shape)


# A loop that swings to both sides is 2 a sum p_j r_j wide on the positive one and 2 sum p_j r_j on
# the other, as soon as it is wider than the plays: 7 1/m (the paper's section 6.2) and 4.4 here,
# over +-80 1/m, which is 1 % strain in a skin of 250 um. From rest the first one is 6.5 wide.
_THRESHOLDS = tuple(2.5 * j for j in range(1, 9))
_ASYMMETRY = 1.6
_WEIGHT = 7 / (2 * _ASYMMETRY * sum(_THRESHOLDS))

SECOND_GENERATION_LOOPS = Hysteresis(_THRESHOLDS, (_WEIGHT,) * 8, _ASYMMETRY)
"""The paper's second prototype (Fig. 8): loops up to 7 1/m wide, less on negative curvature."""

FIRST_GENERATION_LOOPS = Hysteresis(_THRESHOLDS, (3 * _WEIGHT,) * 8, _ASYMMETRY)
"""The paper's first prototype (Fig. 7): loops three times as wide."""


@dataclass(frozen=True)
class Creep(ReadingEffect):
    """Of every reading the `share` relaxes away, with the `time_constant` in s."""

    name: ClassVar = "creep"
    of_gages: ClassVar = "what creeps is the bond of a gage"
    example: ClassVar = {"share": 0.1, "time_constant": 8.0}
    formula: ClassVar = "share that relaxes during the scene"

    share: float
    time_constant: float

    def __post_init__(self) -> None:
        self.solid(1)

    def solid(self, channels: int) -> StandardLinearSolid:
        """The same creep in each of so many `channels`."""
        return StandardLinearSolid(np.full(channels, float(self.share)), self.time_constant)

    def size(self, survey: Survey) -> Size:
        gone = -self.share * math.expm1(-survey.duration / self.time_constant)
        return Size(gone, gone * survey.most)

    def amplification(self, survey: Survey) -> float:
        return 1 + self.share

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> RunningEffect:
        from kappaskin.scenes.effects.at_work.gages import creep

        return creep(self.solid(int(np.prod(shape))), shape)


@dataclass(frozen=True)
class Temperature(ReadingEffect):
    """y = (1 + g T) x + o T as the skin warms from time 0 on by T = rise (1 - exp(-t / tau)).

    `rise` in K and tau, the `time_constant` in s: short for a step, long for a drift. The half
    bridge leaves over the apparent curvature o, `offset` in 1/m/K, which differs from channel to
    channel with the standard deviation `spread`, a share of it; the `seed` is the skin's own. The
    gage factor changes by g, `gain` per K. Each metre along x and y from the middle of the elements
    it warms by the shares `gradient_x` and `gradient_y` more.
    """

    name: ClassVar = "temperature"
    example: ClassVar = {"rise": 5.0, "time_constant": 60.0, "offset": 0.05}
    formula: ClassVar = "apparent reading over the peak reading, plus change of the gain"

    rise: Annotated[float, Within(-200, 200, "K")]
    time_constant: Annotated[float, Within(1e-3, 1e6, "s")]
    offset: Annotated[float, Within(-100, 100, "1/m/K")]
    spread: Annotated[float, Within(0, 1)] = 0.0
    gain: Annotated[float, Within(-1e-2, 1e-2, "1/K")] = 0.0
    seed: Annotated[int, Within(0, 2**63 - 1, whole=True)] = 0
    gradient_x: Annotated[float, Within(-1e3, 1e3, "1/m")] = 0.0
    gradient_y: Annotated[float, Within(-1e3, 1e3, "1/m")] = 0.0

    def on(self, layout: SensorLayout) -> "Temperature":
        """The effect on the elements of a layout."""
        if not (self.gradient_x or self.gradient_y):
            return self
        own = {field.name: getattr(self, field.name) for field in fields(self)}
        centred = layout.positions - layout.positions.mean(axis=0)
        warmth = 1 + centred @ (self.gradient_x, self.gradient_y)
        return _TemperatureOf(**own, warmth=tuple(warmth.tolist()))

    def shares(self, shape: tuple[int, ...]) -> Array:
        """How much every channel of a skin of `shape` warms, over what the middle does."""
        return np.ones(shape)

    def warmer(self, time: float) -> float:
        """By how many K the skin is warmer at `time` in s than it was at rest."""
        return -self.rise * math.expm1(-max(time, 0.0) / self.time_constant)

    def offsets(self, shape: tuple[int, ...]) -> Array:
        """Apparent curvature of every channel of a skin of `shape`, in 1/m per K in its middle."""
        rng = np.random.default_rng(self.seed)
        return self.offset * rng.normal(1.0, self.spread, shape) * self.shares(shape)

    def size(self, survey: Survey) -> Size:
        T = abs(self.warmer(survey.duration))
        K = survey.curvature.reshape(len(survey.times), -1)
        change = T * (self.gain * self.shares(K.shape[1:]) * K + self.offsets(K.shape[1:]))
        number = T * (abs(self.offset) / survey.peak + abs(self.gain))
        error = (
            survey.share(change) + (self.amplification(survey) - 1) * survey.carried / survey.peak
        )
        return Size(number, error)

    def amplification(self, survey: Survey) -> float:
        T = abs(self.warmer(survey.duration))
        shares = self.shares(survey.curvature.shape[1:])
        return 1 + T * abs(self.gain) * float(np.abs(shares).max())

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> RunningEffect:
        from kappaskin.scenes.effects.at_work.gages import temperature

        return temperature(self.warmer, self.gain * self.shares(shape), self.offsets(shape))


@dataclass(frozen=True)
class _TemperatureOf(Temperature):
    """The same on elements that warm differently: `warmth` (P,), over that in the middle."""

    warmth: tuple[float, ...] = ()

    def shares(self, shape: tuple[int, ...]) -> Array:
        return np.tile(self.warmth, math.prod(shape) // len(self.warmth)).reshape(shape)


@dataclass(frozen=True)
class Tolerance(ReadingEffect):
    """Each channel reads gain times curvature plus offset, with both drawn once by `seed`.

    Gains are normal about 1 with standard deviation `gain_sd`, offsets about 0 with `offset_sd` in
    1/m. The seed is the skin's own: another seed of the scene leaves the skin the same.
    """

    name: ClassVar = "tolerance"
    example: ClassVar = {"gain_sd": 0.05, "offset_sd": 1.0}
    at_once: ClassVar = True
    formula: ClassVar = "sd of the gains, plus that of the offsets over the peak reading"

    gain_sd: Annotated[float, Within(0, 10)]
    offset_sd: Annotated[float, Within(0, 1e4, "1/m")]
    seed: Annotated[int, Within(0, 2**63 - 1, whole=True)] = 0

    def errors(self, shape: tuple[int, ...]) -> tuple[Array, Array]:
        """Gain and offset in 1/m of every channel of a skin of `shape`."""
        rng = np.random.default_rng(self.seed)
        return rng.normal(1.0, self.gain_sd, shape), rng.normal(0.0, self.offset_sd, shape)

    def size(self, survey: Survey) -> Size:
        gain, offset = self.errors((survey.layout.channels,))
        K = survey.curvature.reshape(len(survey.times), -1)
        off = survey.share((gain - 1) * K + offset)
        off += float(np.abs(gain - 1).max()) * survey.carried / survey.peak
        return Size(self.gain_sd + self.offset_sd / survey.peak, off)

    def amplification(self, survey: Survey) -> float:
        return float(np.abs(self.errors((survey.layout.channels,))[0]).max())

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> RunningEffect:
        from kappaskin.scenes.effects.at_work.gages import tolerance

        return tolerance(*self.errors(shape))
