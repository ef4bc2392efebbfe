"""Standard deviations of the differences between two setups, which share the noise of readings."""

import math
import time
from collections.abc import Callable, Generator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from kappaskin.errors import Refusal
from kappaskin.frames import Array, Estimate
from kappaskin.live.ring import Ring
from kappaskin.live.status import Status
from kappaskin.pipeline import REPORTED, Pipeline, Readout, Setup, readouts
from kappaskin.sensing import Sensor

_COUNT, _FEWEST = 100, 20  # frames with fresh noise: the errors are right within 7 or 16 %
_LONGEST = 2.0  # s of processor time, after which the fewest are enough
_SETTLED = 20  # frames of a contact that stays as it is, which an estimator with a memory gets
_SHORTEST = 1e-3  # s between two of them, where the device decides it
_STEP = 0.5  # of the noise is added: the readings have it already, and twice as much is another
_FOLLOWS = 0.05  # s between two frames that follow each other, at most
_OFTEN = 0.5  # share of frames that determine a difference which is determined
_PERIOD = 1.0  # s between two pairs of estimates
_STANDING = 0.2  # s between two looks for another pair
_COMPARED = {label for each in REPORTED if each.sd is not None for label in each.labels_shown}


def compared_readouts(estimate: Estimate) -> list[Readout]:
    """The readouts that have a standard deviation."""
    return [each for each in readouts(estimate) if each.label in _COMPARED]


def reading_noise(times: Array, nominal: Array, sigma: Array | None) -> float:
    """Standard deviation of the noise in 1/m, or over `sigma`, by `nominal` (T, 3, P) of frames.

    These were taken at `times` (T,) in s. By second differences of frames that follow each other,
    in which neither a skin that moves evenly nor the error of a shape leaves anything. The median
    over the channels; NaN where there are too few frames.
    """
    gaps = np.diff(times)
    follows = (gaps > 0) & (gaps < _FOLLOWS)
    second = np.diff(nominal, n=2, axis=0)[follows[1:] & follows[:-1]].reshape(-1, nominal[0].size)
    if len(second) < _FEWEST:
        return math.nan
    variance = np.mean(second**2, axis=0) / 6
    if sigma is not None:
        variance /= sigma.ravel() ** 2
    return float(np.sqrt(np.nanmedian(variance)))


class DifferenceErrors:
    """Standard deviations of B - A for the setups `a` and `b`, by frames with fresh noise.

    A and B use the same readings, so that their errors are correlated. Noise is added to the
    readings of a frame, both setups compute each, and the spread of the differences is the standard
    deviation. A and B may differ in everything. Calibration and tare are taken as exact, as in the
    error bars of A and B. An estimator with a memory begins anew with each, and gets 20 frames with
    noise of their own: a contact that stays as it is.
    """

    def __init__(self, sensor: Sensor, a: Setup, b: Setup) -> None:
        setups = [replace(each, quantities=("contact", "geometry")) for each in (a, b)]
        self._pipelines = [Pipeline(sensor, each) for each in setups]
        self._frames = _SETTLED if any(each.fit.has_memory for each in self._pipelines) else 1
        self._seconds = max(1 / sensor.rate, _SHORTEST)
        sigma, shape = sensor.sigma, sensor.layout.frame_shape
        self._sigma = np.ones(shape) if sigma is None else sigma.reshape(shape)
        self._gains = [
            np.ones(shape) if each is None else each.noise_gain.reshape(shape)
            for each in (a.calibration, b.calibration)
        ]

    def __call__(
        self,
        a: Estimate,
        b: Estimate,
        noise: float = math.nan,
        count: int = _COUNT,
        longest: float = _LONGEST,
    ) -> Array:
        """Standard deviations (n,) of the differences of the n `compared_readouts`.

        In the units of these; NaN where one is not determined. `noise` is the `reading_noise`;
        where it is unknown, the least that the fits leave, in which the error of too few functions
        is. By `count` frames, fewer where they take longer than `longest` in s of processor time.
        """
        unknown = np.full(len(compared_readouts(a)), np.nan)
        if not (a.contact.present and b.contact.present):
            return unknown
        if math.isnan(noise):
            each = zip((a, b), self._gains, strict=True)
            noise = min(of.noise / float(np.nanmedian(gain)) for of, gain in each)
        read = [np.where(np.isfinite(e.residual), e.curvature, np.nan) for e in (a, b)]
        step = _STEP * noise * self._sigma
        rng, found, until = np.random.default_rng(0), list[Array](), time.process_time() + longest
        while len(found) < _FEWEST or (len(found) < count and time.process_time() < until):
            drawn = step * rng.standard_normal((self._frames, *step.shape))
            one, other = (
                self._last(pipeline, curvature + gain * drawn)
                for pipeline, curvature, gain in zip(
                    self._pipelines, read, self._gains, strict=True
                )
            )
            found.append(other - one)
        values = np.stack(found)
        often = np.isfinite(values).mean(axis=0) > _OFTEN
        unknown[often] = np.nanstd(values[:, often], axis=0, ddof=1) / _STEP
        return unknown

    def _last(self, pipeline: Pipeline, frames: Array) -> Array:
        """The readouts (n,) of the last of `frames` (T, 3, P) in 1/m, of which it is given all."""
        pipeline.fit.restart()
        wanted, pipeline.wanted = pipeline.wanted, frozenset()
        for n, curvature in enumerate(frames[:-1]):
            pipeline.again(curvature, n * self._seconds)
        pipeline.wanted = wanted
        estimate = pipeline.again(frames[-1], len(frames) * self._seconds)
        return np.array([each.value for each in compared_readouts(estimate)])


def newest_pair(ring: Ring, compared: Ring, status: Status) -> tuple[Estimate, Estimate] | None:
    """The newest frame that was computed with both setups; None where it is not there any more."""
    of = status.compared
    if status.slot is None or of is None or of.slot is None:
        return None
    b = compared.read(of.generation, of.slot)
    a = None if b is None else ring.read(status.generation, status.slot, b.sequence)
    return None if a is None or b is None else (a, b)


@dataclass(frozen=True, eq=False)
class PairErrors:
    """Standard deviations `sd` (n,) of the differences of the n `compared_readouts` of a pair.

    Of the estimates of these `generations`, at `device_time` in s.
    """

    generations: tuple[int, int]
    device_time: float
    sd: Array


def difference_errors(
    opened: Callable[[str], Ring], name: str, compared: str
) -> Generator[PairErrors]:
    """The errors of the newest differences, about once a second, to be run in a process.

    It reads the memory of these names, as `Engine.rings` has them. Of a recording that is paused
    they are computed once, at once, with the noise that was measured while it was played.
    """
    ring, other = opened(name), opened(compared)
    errors: tuple[tuple[int, int], DifferenceErrors] | None = None
    noise, of_connection = math.nan, 0
    last: tuple[int, int, int] | None = None
    while True:
        began = time.monotonic()
        status: Status | None = ring.read_status()
        pair = None if status is None else newest_pair(ring, other, status)
        now = pair and (pair[0].generation, pair[1].generation, pair[0].sequence)
        other_status = status and status.compared
        if not (status and status.sensor and other_status and pair) or now == last:
            time.sleep(_STANDING)
            continue
        last, generations = now, (pair[0].generation, pair[1].generation)
        slot = cast("np.dtype[np.void]", status.slot)
        times, (nominal,), _ = ring.recent(generations[0], slot, 0, ["nominal"])
        measured = reading_noise(times, nominal, status.sensor.sigma)
        if of_connection != status.connections or not math.isnan(measured):
            noise, of_connection = measured, status.connections
        with suppress(Refusal, MemoryError):  # then there are none
            if errors is None or errors[0] != generations:
                setups = status.setup, other_status.setup
                errors = generations, DifferenceErrors(status.sensor, *setups)
            yield PairErrors(generations, pair[0].device_time, errors[1](*pair, noise))
        taken = time.monotonic() - began
        time.sleep(max(_PERIOD - taken, taken))
