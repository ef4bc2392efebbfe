"""Haptic cue: what an operator is to feel of a finger, within limits, and nothing of old data."""

import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np

from kappaskin.errors import Refusal
from kappaskin.frames import Estimate
from kappaskin.pipeline import Reported

FULL, FADE, RISE = 0.04, 0.05, 0.1
"""Seconds: the age up to which an estimate is felt fully, its fading, and the return from none.

Together with 10 ms for sending, nothing is felt 100 ms after the last estimate.
"""

LIVE, LATE, STALE, CUE_LOST = "live", "late", "stale", "lost"
"""States of a cue: estimates come and are new; come, but are old; do not come; have no source."""

Pair = tuple[float, float]


@dataclass(frozen=True)
class CueLimits:
    """What a cue never exceeds: `force` in N, `rate` of its change in N/s.

    And `curvature` in 1/m, `slip` in m/s. A `Refusal` for what is not above zero, and for a rate
    at which the force would not fade in time.
    """

    force: float = 3.0
    rate: float = 100.0
    curvature: float = 200.0
    slip: float = 0.5

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0 < value < math.inf:
                raise Refusal(f"expected a limit {name} above 0, got {value:g}")
        if self.rate * FADE < self.force:
            raise Refusal(
                f"expected a rate of at least {self.force / FADE:g} N/s, at which {self.force:g} N "
                f"fade within {1e3 * FADE:g} ms, got {self.rate:g} N/s; raise the rate or lower "
                "the force"
            )

    @property
    def query(self) -> str:
        """Those that are not usual, as in a target: force=5&rate=200."""
        changed = vars(self).items() - vars(CueLimits()).items()
        return "&".join(f"{name}={value}".removesuffix(".0") for name, value in sorted(changed))


def limits_of(query: str) -> CueLimits:
    """The limits in the query of a target, such as force=5&rate=200; a `Refusal` for others."""
    found, known = dict[str, float](), [field.name for field in fields(CueLimits)]
    for part in query.split("&") if query else ():
        name, _, value = part.partition("=")
        try:
            found[name] = float(value)
        except ValueError:
            found[name] = math.nan
        if name not in known or math.isnan(found[name]):
            raise Refusal(
                f"expected limits such as force=5&rate=200, of {', '.join(known)}, "
                f"got {part[:99]!r}"
            )
    return CueLimits(**found)


@dataclass(frozen=True)
class Cue:
    """What is to be felt of a finger now; no number exceeds the limits, and all felt are finite.

    `force` in N, principal curvatures of the skin `curvature` in 1/m, the larger one first, and
    `slip` in m/s along x and y are multiplied by `scale` already, from 1 for new data to 0 for old
    or none; so are their standard deviations, NaN if unknown. The force acts along the unit vector
    `direction`, the inward normal in the skin's coordinates, at `place` x, y in m, NaN without a
    contact. `age` in s is that of the estimate of the scan `sequence`, NaN and -1 without one; its
    bytes were `read` at a monotonic time in s, and the first cue of it is `fresh`.
    """

    state: str
    scale: float
    age: float
    read: float
    fresh: bool
    sequence: int
    force: float
    direction: tuple[float, float, float]
    place: Pair
    curvature: Pair
    curvature_sd: Pair
    slip: Pair
    slip_sd: Pair


_NONE, _ZERO = (math.nan, math.nan), (0.0, 0.0)


@dataclass(frozen=True)
class _Felt:
    """What an estimate says of the contact, of data that `began`, were `read`, and `came` here."""

    began: float
    read: float
    came: float
    sequence: int
    force: float = 0.0
    direction: tuple[float, float, float] | None = None
    place: Pair = _NONE
    curvature: Pair = _ZERO
    curvature_sd: Pair = _NONE
    slip: Pair = _ZERO
    slip_sd: Pair = _NONE


def _suspended() -> float:
    """For how long in s this machine has been suspended, where the system counts that."""
    if not hasattr(time, "CLOCK_BOOTTIME"):
        return 0.0
    return time.clock_gettime(time.CLOCK_BOOTTIME) - time.clock_gettime(time.CLOCK_MONOTONIC)


_SUSPENDED = 0.01  # s: more than reading two clocks one after the other


class CueGenerator:
    """Makes cues of the newest estimate that it was given, at any time.

    An estimate is felt fully while its data are at most `FULL` s old, and not at all `FADE` s
    later; its age counts from when its scan began or, if unknown, from when it was read. The cue
    also fades within `FADE` s where `streams` is set to False, for a source that is lost or to be
    left. It returns within `RISE` s. The force never changes faster than the limits say. A force
    that is unknown is none, as is one near a held rim and one that pulls. After a suspension of
    the machine, or where the `clock` went back, nothing is felt before there is another estimate.

    `take` and the rest may be called by two threads.
    """

    def __init__(
        self,
        limits: CueLimits | None = None,
        clock: Callable[[], float] = time.monotonic,
        suspended: Callable[[], float] = _suspended,
    ) -> None:
        self.limits = limits or CueLimits()
        self._clock, self._suspended = clock, suspended
        self.streams = True
        self._newest: _Felt | None = None
        self._before: _Felt | None = None  # of the last cue
        self._slips = SlipEstimator()
        self._last, self._slept = clock(), suspended()
        self._scale = self._force = 0.0
        self._direction = 0.0, 0.0, -1.0

    def take(self, estimate: Estimate) -> None:
        """Make cues of this `estimate` from now on."""
        contact, came = estimate.contact, self._clock()
        slip, slip_sd = self._slips(estimate)
        read = estimate.host_time
        times = estimate.taken if estimate.taken <= read else read, read, came
        if not contact.present:
            self._newest = _Felt(*times, estimate.sequence)
            return
        limits, (nx, ny, nz) = self.limits, estimate.geometry.normal.tolist()
        x, y = contact.position.tolist()
        k1, k1_sd, k2, k2_sd = Reported(estimate).principal()[0]
        most, known = limits.curvature, not contact.near_rim and contact.force > 0
        less = min(1.0, limits.slip / max(math.hypot(*slip), _LEAST))
        self._newest = _Felt(
            *(*times, estimate.sequence, min(contact.force, limits.force) if known else 0.0),
            (-nx, -ny, -nz) if math.isfinite(nx + ny + nz) else None,
            (x, y),
            *_known((_towards(0.0, k1, most, most), _towards(0.0, k2, most, most)), (k1_sd, k2_sd)),
            *_known((less * slip[0], less * slip[1]), slip_sd),
        )

    def __call__(self) -> Cue:
        """The cue now."""
        passed = self._passed()
        newest, now = self._newest, self._last
        age = math.nan if newest is None else now - newest.began
        wanted = 0.0
        if newest is not None and self.streams:
            wanted = min(max((FULL + FADE - age) / FADE, 0.0), 1.0) if age >= 0 else 0.0
        self._scale = _towards(self._scale, wanted, passed / FADE, passed / RISE)
        felt = newest or _Felt(now, now, now, -1)
        fresh, self._before = felt is newest is not self._before, newest
        most = passed * self.limits.rate
        self._force = _towards(self._force, self._scale * felt.force, most, most)
        self._direction = felt.direction or self._direction
        scaled = (
            (self._scale * x, self._scale * y)
            for x, y in (felt.curvature, felt.curvature_sd, felt.slip, felt.slip_sd)
        )
        return Cue(
            *(self._state(newest, age), self._scale, age, felt.read, fresh, felt.sequence),
            *(self._force, self._direction, felt.place, *scaled),
        )

    def _passed(self) -> float:
        """Seconds since the last cue; without an estimate from now on where they are in doubt."""
        now, slept = self._clock(), self._suspended()
        passed, asleep = now - self._last, slept - self._slept
        # A pause between reading two clocks makes their difference smaller, and never larger.
        self._last, self._slept = now, max(slept, self._slept)
        if asleep < _SUSPENDED:
            asleep = 0.0
        if passed < 0 or asleep:
            self._newest = None
        return max(passed, 0.0) + asleep

    def _state(self, newest: _Felt | None, age: float) -> str:
        if not self.streams:
            return CUE_LOST
        if newest is None or self._last - newest.came > FULL:
            return STALE
        return LIVE if age <= FULL else LATE


def _towards(value: float, wanted: float, down: float, up: float) -> float:
    """`value` moved towards `wanted`, by so much at most."""
    return min(max(wanted, value - down), value + up)


_LEAST = 1e-12  # m/s, so that no slip is divided by


def _known(values: Pair, sd: Pair) -> tuple[Pair, Pair]:
    """The values with their error bars; zero if they are unknown."""
    if not math.isfinite(sum(values)):
        return _ZERO, _NONE
    return values, sd if math.isfinite(sum(sd)) else _NONE


_WINDOW = 0.05  # s of places that the slip is of
_MOST = 64  # of them
_LEAST_SD = 1e-9  # m: exact places of a simulation have weights too


class SlipEstimator:
    """Velocity of the contact along the skin, from its places in the last `_WINDOW` s.

    It is the slope of the weighted least-squares line through them, over the device's time. Its
    standard deviation follows from that of the places, taken as independent, and is larger by the
    Birge ratio where they scatter about the line by more. A contact moves along the skin where the
    object slides and where it rolls: one normal force does not tell which.
    """

    def __init__(self) -> None:
        self._places: deque[list[float]] = deque(maxlen=_MOST)  # time, x, y, and their sd
        self._generation = -1

    def __call__(self, estimate: Estimate) -> tuple[Pair, Pair]:
        """Velocity in m/s along x and y and its standard deviations, NaN if unknown."""
        contact, places, now = estimate.contact, self._places, estimate.device_time
        goes_on = places and 0 < now - places[-1][0] <= _WINDOW
        if not (goes_on and contact.present and estimate.generation == self._generation):
            places.clear()
        self._generation = estimate.generation
        if contact.present:
            places.append([now, *contact.position.tolist(), *contact.position_sd.tolist()])
        while places and now - places[0][0] > _WINDOW:
            places.popleft()
        return self._slope() if len(places) > 2 else (_NONE, _NONE)

    def _slope(self) -> tuple[Pair, Pair]:
        rows = np.array(self._places)
        times, places, w = rows[:, :1], rows[:, 1:3], np.maximum(rows[:, 3:], _LEAST_SD) ** -2
        share = w / w.sum(axis=0)
        t = times - (share * times).sum(axis=0)
        p = places - (share * places).sum(axis=0)
        wt = w * t
        information = (wt * t).sum(axis=0)
        v = (wt * p).sum(axis=0) / information
        birge = (w * (p - v * t) ** 2).sum(axis=0) / (len(rows) - 2)
        sd = np.sqrt(np.maximum(birge, 1.0) / information)
        (x, y), (x_sd, y_sd) = v.tolist(), sd.tolist()
        return (x, y), (x_sd, y_sd)
