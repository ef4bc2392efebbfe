"""Health monitor: the faults of channels from frames."""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from kappaskin.bases import basis_for
from kappaskin.errors import Refusal
from kappaskin.frames import OVERTAKEN, Array, Frame, Mask
from kappaskin.health.findings import (
    DEAD,
    DRIFTING,
    NOISY,
    OFFSET,
    SATURATED,
    STUCK,
    SWAPPED,
    Finding,
    classify_faults,
    findings,
)
from kappaskin.health.inconsistency import ChannelStatistics, InconsistencyTest, StatisticsWindow
from kappaskin.sensing import DigitalReadings, Sensor
from kappaskin.skin import MeshSkin

_FAR = 4.0  # standard deviations: a channel that is further off is suspected
_NEAR = 2.5  # the same: one that is nearer agrees with the others again
_CONFIRMED = 4  # evaluations in a row that suspect a channel before it is a finding
_CALM = 16  # evaluations in which a finding agrees before it is cleared
_ANSWERS = 3.0  # times the error of the prediction: motion that shows whether a channel responds
_LOUD = 4.0  # times the noise of the others
_LOUDS, _LOUD_OF = 5, 32  # evaluations with so much noise, of so many, make a noisy channel
_RAILED, _FREE = 0.5, 0.05  # share of the readings of a second that are on a rail
_SECOND = 4  # evaluations
_SOFTEST = 5  # times as many functions of a mesh, by which its elements' readings are predicted
_WITHIN = 0.25  # of the rail: where less is predicted, nothing bends the skin so far

_LOOSE = (NOISY, OFFSET, DRIFTING)  # which a more specific fault may replace
_ANSWERING = (DEAD, STUCK, SWAPPED)  # what only motion can clear


class HealthMonitor:
    """The health of every channel of `sensor`: `monitor(frame)` says whether an evaluation ended.

    Four times a second at most it evaluates how far each channel is from the prediction of its
    neighbours, how noisy it is, and how often it is on a rail. A channel is suspected when it was
    four standard deviations off for two seconds, by root mean square: by white noise less often
    than once in 1e60 evaluations, by detail too fine for the elements never in the ready scenes,
    where it came to 3.3. Of several suspects beside each other the one furthest off is excluded
    from the predictions, which clears those that it misled. Suspected for a second, it is a
    finding, until it agrees for four; a dead, stuck or swapped one until it does so in motion.
    Without motion no channel is called dead, stuck or swapped. The work of an evaluation is spread
    over the frames that follow, so that none of them waits for all of it.

    Neighbours predict readings that are smooth over the distance of elements: all of a plate, and
    the heights of any skin. Of an elastomer that reads slopes or curvatures, which a sharp edge
    bends at once, only those channels are found that the device reports as dead, or that are on a
    rail or missing.

    `kinds` (C,) are numbers in `FAULTS`, 0 for healthy channels; `badness` (C,) ranks them.
    """

    def __init__(self, sensor: Sensor) -> None:
        self.sensor = sensor
        self._dead = ~sensor.layout.live.ravel()
        self._window = StatisticsWindow(sensor)
        self._soft: Array | None = None
        if isinstance(sensor.layout.patch, MeshSkin):
            basis = basis_for(sensor.layout.patch, sensor.edge, _SOFTEST, _SOFTEST)
            read = sensor.layout.operator(basis, sensor.plate)
            self._soft = sensor.plate.compliance(basis).after(read)
        self.reset()

    def reset(self) -> None:
        """Forget all readings and findings, as when the device has restarted."""
        layout, C = self.sensor.layout, self.sensor.channels
        elastomer, units = self.sensor.plate.unknown_material, set(layout.kind_units)
        predictable = units == {"m"} or not elastomer
        soft = self._soft if predictable else None
        self._predicted = InconsistencyTest(layout, elastomer, soft) if predictable else None
        self.kinds = np.where(layout.lacking.ravel(), DEAD, 0).astype(np.uint8)
        self._since, self._figures = np.full(C, math.nan), np.full((C, 2), math.nan)
        self._suspects = np.zeros(C, bool)
        self._accused, self._calm = np.zeros(C, int), np.zeros(C, int)
        self._loud, self._railed = np.zeros((_LOUD_OF, C), bool), np.zeros((_SECOND, C))
        self._last = -math.inf
        self._steps: Iterator[bool] = iter(())

    def __call__(self, frame: Frame) -> bool:
        """Evaluate the next frame; True where `kinds` may have changed."""
        if frame.device_time < self._last - OVERTAKEN:  # the clock of a device that began anew
            self.reset()
        if frame.device_time < self._last:  # one that others overtook
            return next(self._steps, False)
        self._last = frame.device_time
        statistics = self._window(frame)
        if statistics is not None:
            self._steps = self._evaluate(statistics)
        return next(self._steps, False)

    @property
    def _test(self) -> InconsistencyTest:
        if self._predicted is None:
            raise Refusal("expected readings that their neighbours predict")
        return self._predicted

    @property
    def _resolution(self) -> Array:
        """That of one count of each channel (C,), in units of what the test compares."""
        return self.sensor.transduction.resolution / self._test.neighbours.scale

    def _evaluate(self, statistics: ChannelStatistics) -> Iterator[bool]:
        """The steps of an evaluation, each as long as the estimate of a frame; True after the last.

        There are no more of them than frames in an evaluation.
        """
        self._since[np.isnan(self._since) & (self.kinds > 0)] = statistics.time
        if self._predicted is None:
            self._find_saturated(statistics)
            yield True
            return
        statistics = self._predicted.scaled(statistics)
        wrong = self._dead | (self.kinds > 0)
        for _ in self._test.steps(statistics, wrong | self._suspects, wrong):
            yield False
        self._find_noisy(statistics)
        yield False
        self._find_saturated(statistics)
        self._suspect(statistics)
        yield False
        self._confirm(statistics)
        yield False
        self._clear()
        yield True

    @property
    def badness(self) -> Array:
        """Rank (C,) of the faults: channels without any information first, then by how far off."""
        nothing = np.isin(self.kinds, (DEAD, SATURATED, STUCK))
        off = self._predicted.off if self._predicted else 0.0
        return np.where(self.kinds > 0, off, 0.0) + np.where(nothing, 1e9, 0.0)

    def findings(self, retained: Mask) -> tuple[Finding, ...]:
        """The findings, of which some channels are `retained` (C,) in the fit all the same."""
        layout = self.sensor.layout
        figures = self._figures
        if self._predicted:
            unscaled = np.isin(self.kinds, (SATURATED, SWAPPED))
            figures = figures * np.where(unscaled, 1.0, self._predicted.neighbours.scale)[:, None]
        return findings(self.kinds, self._since, figures, retained, layout)

    def _find(self, which: Mask, kind: int, since: float) -> None:
        self._since[which & (self.kinds == 0)] = since
        self.kinds[which], self._suspects[which], self._calm[which] = kind, False, 0

    def _may_be(self, which: Mask) -> Mask:
        """Those of `which` (C,) that have no more specific fault."""
        return which & ~self._dead & ((self.kinds == 0) | np.isin(self.kinds, _LOOSE))

    def _find_noisy(self, statistics: ChannelStatistics) -> None:
        """Find channels noisier than all others and their neighbours, in several evaluations."""
        usual = np.maximum(self._test.usual, self._resolution)
        # A region of interest leaves most channels without a noise: they are as the others.
        noise = np.where(np.isnan(statistics.noise), usual, statistics.noise)
        loud = np.flatnonzero((noise > _LOUD * usual) & ~self._dead)
        around = noise[self._test.neighbours.alike[loud]]
        if around.size:
            loud = loud[noise[loud] > _LOUD * np.median(around, axis=1)]
        self._loud[:-1] = self._loud[1:]
        self._loud[-1] = np.isin(np.arange(len(noise)), loud)
        often = self._loud[-1] & (self._loud.sum(axis=0) >= _LOUDS)
        self._find(self._may_be(often), NOISY, statistics.time)
        heard = (self.kinds == NOISY) & self._loud[-1]
        self._figures[heard] = np.stack([noise, usual], axis=1)[heard]

    def _find_saturated(self, statistics: ChannelStatistics) -> None:
        self._railed[:-1] = self._railed[1:]
        self._railed[-1] = np.nan_to_num(statistics.railed)
        share = self._railed.mean(axis=0)
        self._find(self._may_be(share > _RAILED), SATURATED, statistics.time)
        here = self.kinds == SATURATED
        self._figures[here, 0], self._figures[here, 1] = share[here], 0.0
        self.kinds[here & (share < _FREE)] = 0
        railed = np.flatnonzero(here & (share == 1))
        if railed.size and self._predicted:
            self._call_dead(railed)

    def _call_dead(self, railed: NDArray[np.intp]) -> None:
        """Of channels that stay on a rail, find those dead whose neighbours predict far less."""
        chain = self.sensor.transduction
        rail = self._resolution[railed] * min(abs(limit) for limit in chain.limits)
        predicted, spread = self._test.predicted_levels(railed)
        within = np.abs(predicted) + _FAR * np.sqrt(spread) < _WITHIN * rail
        dead = railed[within]
        self.kinds[dead] = DEAD
        digital = isinstance(chain, DigitalReadings)  # whose device reports what it cannot read
        self._figures[dead, 0] = math.nan if digital else rail[within]
        self._figures[dead, 1] = np.abs(predicted[within])

    def _suspect(self, statistics: ChannelStatistics) -> None:
        """Suspect the worst of the channels that are off, and those suspected before."""
        far = (self._test.distance > _FAR) & ~self._dead & (self.kinds == 0)
        off = np.where(far & ~self._suspects, self._test.off, 0.0)
        # A pressed element misleads what is predicted of those around it, by less than of itself.
        around = off[self._test.neighbours.channels].max(axis=1, initial=0.0)
        new = (off > 0) & (off >= around[self._test.neighbours.of])
        self._suspects = ((self._suspects & far) | new) & ~self._test.pressed
        self._accused = np.where(self._suspects, self._accused + 1, 0)

    def _confirm(self, statistics: ChannelStatistics) -> None:
        sure = self._suspects & (self._accused >= _CONFIRMED)
        far = np.isin(self.kinds, _LOOSE) & (self._test.distance > _FAR)
        channels = np.flatnonzero(sure | far)
        if not channels.size:
            return
        step = statistics.seconds / len(statistics.means)
        faults = classify_faults(self._test, channels, self._resolution[channels], step)
        since = statistics.time - _CONFIRMED * statistics.seconds
        # For a noisy channel, being off for a while is no more specific fault.
        better = (self.kinds[channels] != NOISY) | ~np.isin(faults.kinds, _LOOSE)
        # What is unsteady for a moment may be about to stand still.
        better &= (faults.kinds != NOISY) | (self._accused[channels] >= 2 * _CONFIRMED)
        # Under a point load an element reads much more than its neighbours predict.
        better &= ~np.isin(faults.kinds, _LOOSE) | (self._test.beyond[channels] > 1)
        for kind in np.unique(faults.kinds[better]):
            these = channels[better & (faults.kinds == kind)]
            self._find(np.isin(np.arange(len(sure)), these), kind, since)
            self._figures[these] = faults.figures[better & (faults.kinds == kind)]

    def _clear(self) -> None:
        """Count the evaluations in which a channel agreed, and clear it after enough of them."""
        test, kinds = self._test, self.kinds
        answering = np.isin(kinds, _ANSWERING) & ~self._dead
        off, moved, left_open = test.motion()
        agrees = np.where(answering, off < _NEAR * left_open, test.distance < _NEAR)
        agrees &= (test.distance > 0) & ~self._loud[-_CALM:].any(axis=0)
        enough = ~answering | (moved > _ANSWERS * left_open)
        self._calm = np.where(agrees, self._calm + enough, 0)
        trusted = (kinds > 0) & ~self._dead & (kinds != SATURATED) & (self._calm >= _CALM)
        test.rebase(trusted & answering)
        self.kinds = np.where(trusted, 0, kinds).astype(np.uint8)
