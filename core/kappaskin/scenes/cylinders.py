"""Cylinders that a skin is laid on to be calibrated: radii, and the schedule of steps."""

import math
from bisect import bisect_right
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate

import numpy as np

from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.sensing import Sensor

RADII = (0.1, 0.05, 0.033, 0.025, 0.02, 0.017, 0.0145, 0.013)
"""Radii in m, in curvature steps of about 10 1/m, up to the paper's fingertip's 77 1/m."""

FEWEST_RADII = 3
_LADDER = 5  # cylinders for a sensor that cannot read the usual ones
_HEADROOM = 1.3  # times its curvature that a cylinder may read, by tolerances, and be on no rail
_ROUNDING = 1e-6  # s by which a time may be off that was summed up, or sent on a line

FACES = {1: "inner face", -1: "outer face"}
"""Which side of the skin lies on the cylinder, by the sign of the curvature."""

ADVICE = (
    "Readings depend on the previous curvature: slide the skin from each cylinder to the next "
    "without letting it spring back, and wait until it lies still."
)
"""Instructions before the first step."""

WAYS = {
    "there": "falling radius",
    "back": "rising radius",
    "first": "preconditioning",
}

_BENT = {
    "x": ("bent along x", (1.0, 0.0, 0.0)),
    "y": ("bent along y", (0.0, 1.0, 0.0)),
    # The axis at 45 degrees: f = (x + y)^2 / 4R bends and twists alike.
    "diagonal": ("bent along the diagonal from corner x = y = 0", (0.5, 0.5, 0.5)),
}


@dataclass(frozen=True)
class CylinderStep:
    """One thing to lay the skin on: a cylinder of `radius` in m, or a flat table (infinite).

    `along` is x, y or diagonal, the direction in which the skin bends. `face` is 1 when the inner
    face lies on the cylinder, so that the skin is convex seen from outside and its curvature
    positive, and -1 for the outer face, which objects touch. `way` is there, to smaller radii,
    back, or first. The skin stays for `hold` s, or no longer than a reading takes.
    """

    number: int
    radius: float = math.inf
    along: str = "x"
    face: int = 1
    way: str = "there"
    hold: float = 0.0

    @property
    def flat(self) -> bool:
        return math.isinf(self.radius)

    @property
    def back(self) -> bool:
        return self.way == "back"

    @property
    def curvature(self) -> Array:
        """Curvature (3,) in 1/m of the skin that lies on it, the same at all elements."""
        return self.face / self.radius * np.array(_BENT[self.along][1])

    def __str__(self) -> str:
        if self.flat:
            return "Flat table, nothing pressing on the skin"
        face = FACES[self.face]
        way = f"held for {self.hold:g} s" if self.hold else WAYS[self.way]
        return (
            f"Cylinder of radius {1e3 * self.radius:g} mm, {_BENT[self.along][0]}, {face} on it, "
            f"{way}"
        )


def schedule(
    radii: tuple[float, ...] = RADII, hold: float = 0.0, strip: bool = False
) -> tuple[CylinderStep, ...]:
    """The steps with cylinders of `radii` in m, as the paper took them (section 5).

    For each direction of bending, on a `strip` x alone: from large to small radii and back with
    one face, then with the other, flat before and after each. First of all the skin is bent as far
    as it will be, the other way: whatever loops its past left it in, they are wiped out. A `hold`
    in s above zero begins with a stay of so long on the smallest cylinder, which bends every
    channel and shows its creep.
    """
    radii = tuple(sorted({float(radius) for radius in radii}, reverse=True))
    if not all(0 < radius < math.inf for radius in radii):
        raise Refusal(f"expected radii above zero in m, got {radii}")
    if len(radii) < FEWEST_RADII:
        raise Refusal(
            f"expected at least {FEWEST_RADII} different radii, got {len(radii)}; with fewer, "
            "the error of a line through them cannot be estimated"
        )
    if not 0 <= hold < math.inf:
        raise Refusal(f"expected a hold of at least 0 s, got {hold}")
    steps = [CylinderStep(1)]
    if hold:
        steps += [
            CylinderStep(2, radii[-1], "x" if strip else "diagonal", hold=hold),
            CylinderStep(3),
        ]
    for along in ("x",) if strip else _BENT:
        stays = [[(radii[-1], -1, "first")]]
        for face in (1, -1):
            there = [(radius, face, "there") for radius in radii]
            stays.append(there + [(radius, face, "back") for radius in reversed(radii[:-1])])
        for stay in stays:
            for radius, face, way in stay:
                steps.append(CylinderStep(len(steps) + 1, radius, along, face, way))
            steps.append(CylinderStep(len(steps) + 1))
    return tuple(steps)


def applied_curvature(steps: tuple[CylinderStep, ...]) -> Array:
    """The curvature (S, 3) in 1/m of every step."""
    return np.array([step.curvature for step in steps]).reshape(-1, 3)


def step_pairs(steps: tuple[CylinderStep, ...], x: Array, face: int) -> list[tuple[int, int]]:
    """Steps (there, back) on the same cylinder with `face`, among those with curvature in `x`."""
    there: dict[tuple[str, float], int] = {}
    found: list[tuple[int, int]] = []
    for k, step in enumerate(steps):
        key = (step.along, step.radius)
        if step.face != face or not x[k]:
            continue
        if step.way == "there":
            there[key] = k
        elif step.back and key in there:
            found.append((there[key], k))
    return found


def _reads(sensor: Sensor, curvature: float) -> bool:
    """Whether the sensor's electronics read `curvature` in 1/m, either way, and are on no rail."""
    chain = sensor.transduction
    return bool(np.isfinite(chain.curvature(chain.counts(np.array([curvature, -curvature])))).all())


def _most_read(sensor: Sensor, most: float) -> float:
    """The largest curvature in 1/m, up to `most`, that the sensor's electronics read."""
    if _reads(sensor, most):
        return most
    low, high = 0.0, most
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if _reads(sensor, middle) else (low, middle)
    return low


def radii_for(sensor: Sensor) -> tuple[float, ...]:
    """Radii in m of cylinders that `sensor` can read: `RADII`, or larger ones in whole mm.

    The larger ones have evenly spaced curvatures. Gains may be off by a third.
    """
    most = min(1 / min(RADII), sensor.transduction.strain_limit_curvature)
    most = min(most, _most_read(sensor, _HEADROOM * most) / _HEADROOM)
    if most * min(RADII) >= 1 - 1e-9:
        return RADII
    steps = np.arange(1, _LADDER + 1) / _LADDER
    return tuple(float(radius) for radius in np.ceil(1e3 / (most * steps)) / 1e3)


def check_readable(steps: tuple[CylinderStep, ...], sensor: Sensor) -> None:
    """Refuse steps that no channel could read, before anybody takes the first."""
    smallest = min(steps, key=lambda step: step.radius)
    if not smallest.flat and not _reads(sensor, 1 / smallest.radius):
        least = 1 / _most_read(sensor, 1 / smallest.radius)
        raise Refusal(
            f"step {smallest.number}: a cylinder of radius {1e3 * smallest.radius:g} mm drives the "
            f"amplifiers of {sensor.name} onto their rails; use radii of at least "
            f"{1e3 * least:.3g} mm, or lower the amplifier's gain"
        )


def check_strain(steps: tuple[CylinderStep, ...], sensor: Sensor) -> None:
    """Refuse steps that would bend the sensor's gages beyond their elastic limit."""
    # The gage that reads twist lies along the diagonal, and so bends with the full 1/R.
    least = 1 / sensor.transduction.strain_limit_curvature
    for step in steps:
        if step.radius < least * (1 - 1e-9):
            strain = sensor.transduction.strain(1 / step.radius)
            raise Refusal(
                f"step {step.number}: a cylinder of radius {1e3 * step.radius:g} mm strains the "
                f"gages of {sensor.name} by {100 * strain:.2f} %, beyond their elastic limit; use "
                f"radii of at least {1e3 * least:.3g} mm"
            )


@dataclass(frozen=True)
class Presentation:
    """Automatic steps, each for `dwell` s, or its hold if longer."""

    steps: tuple[CylinderStep, ...]
    dwell: float

    def __post_init__(self) -> None:
        if not (self.steps and 0 < self.dwell < math.inf):
            raise Refusal(
                f"expected at least one step and a dwell above zero in s, got {len(self.steps)} "
                f"steps and {self.dwell}"
            )

    @cached_property
    def _ends(self) -> list[float]:
        return list(accumulate(max(self.dwell, step.hold) for step in self.steps))

    @property
    def duration(self) -> float:
        """Seconds until the last step is over."""
        return self._ends[-1]

    @property
    def middles(self) -> list[float]:
        """The time in s in the middle of every step."""
        ends = self._ends
        return [(start + end) / 2 for start, end in zip([0.0, *ends], ends, strict=False)]

    def index(self, time: float) -> int:
        """Which step is presented at `time` in s, their number once all are over."""
        return bisect_right(self._ends, time + _ROUNDING)

    def settled(self, time: float) -> bool:
        """Whether what is read at `time` in s counts: that of a hold, or once the skin lies still.

        That is taken to be the second half of a dwell, less its end, where two clocks may disagree.
        """
        index = self.index(time)
        if index == len(self.steps):
            return False
        left = self._ends[index] - time
        start = math.inf if self.steps[index].hold else 0.5 * self.dwell
        return 0.05 * self.dwell < left <= start

    def curvature(self, time: float) -> Array:
        """Curvature (3,) in 1/m at `time` in s; the last step stays."""
        return self.steps[min(self.index(time), len(self.steps) - 1)].curvature
