"""Frames to findings: which channels are dead, stuck, noisy, saturated, swapped or drifting."""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

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
from kappaskin.sensing import Sensor

_FAR = 4.0  # standard deviations: a channel that is further off is accused
_NEAR = 2.5  # the same: one that is nearer agrees with the others again
_CONFIRMED = 4  # looks in a row that accuse a channel before it is a finding
_CALM = 16  # looks that agree with one before it is none any more
_ANSWERS = 3.0  # times what the others leave open, that they must move for a channel to answer
_LOUD = 4.0  # times the noise of the others
_LOUDS, _LOUD_OF = 5, 32  # looks with so much noise, of so many, make a noisy channel
_RAILED, _FREE = 0.5, 0.05  # share of the readings of a second that are on a rail
_SECOND = 4  # looks
_WITHIN = 0.25  # of the rail: where the others tell of less, nothing bends the skin so far

_LOOSE = (NOISY, OFFSET, DRIFTING)  # what something better may be found of
_ANSWERING = (DEAD, STUCK, SWAPPED)  # what only motion can clear


class HealthMonitor:
    """The health of every channel of `sensor`; `monitor(frame)` says whether a look has ended.

    Four times a second at most it compares what each channel reads with what those around it say,
    how noisy it is, and how often it is on a rail. A channel is accused when it was four standard
    deviations off for two seconds, by root mean square: by white noise less often than once in
    1e60 looks, by what is too fine for the elements never in the ready scenes, where it came to
    3.3. Of several accused beside each other the one furthest off is left out of what is told of
    the rest, which clears those that it misled. Accused for a second, it is a finding, until it
    agrees for four; a dead, stuck or swapped one until it does so while it is moved. Where nothing
    moves nothing is called that. A look is spread over the frames that follow it, so that none of
    them waits for the whole.

    `kinds` (C,) are numbers in `FAULTS`, 0 for channels that are well; `order` (C,) is how bad each
    is, the worst largest.
    """

    def __init__(self, sensor: Sensor) -> None:
        self.sensor = sensor
        self._dead = ~sensor.layout.live.ravel()
        self._window = StatisticsWindow(sensor)
        self.begin_anew()

    def begin_anew(self) -> None:
        """Forget all that was read and found, as where a device began anew."""
        layout, C = self.sensor.layout, self.sensor.channels
        self._against = InconsistencyTest(layout)
        self.kinds = np.where(layout.lacking.ravel(), DEAD, 0).astype(np.uint8)
        self._since, self._figures = np.full(C, math.nan), np.full((C, 2), math.nan)
        self._suspects = np.zeros(C, bool)
        self._accused, self._calm = np.zeros(C, int), np.zeros(C, int)
        self._loud, self._railed = np.zeros((_LOUD_OF, C), bool), np.zeros((_SECOND, C))
        self._last = -math.inf
        self._steps: Iterator[bool] = iter(())

    def __call__(self, frame: Frame) -> bool:
        """Take in the next frame; True where `kinds` may be others from it on."""
        if frame.device_time < self._last - OVERTAKEN:  # the clock of a device that began anew
            self.begin_anew()
        if frame.device_time < self._last:  # one that others overtook
            return next(self._steps, False)
        self._last = frame.device_time
        look = self._window(frame)
        if look is not None:
            self._steps = self._take_in(look)
        return next(self._steps, False)

    def _take_in(self, look: ChannelStatistics) -> Iterator[bool]:
        """Steps of a look, each as long as the estimate of a frame; True after the last.

        They are no more than the frames that a look is made of.
        """
        self._since[np.isnan(self._since) & (self.kinds > 0)] = look.time
        wrong = self._dead | (self.kinds > 0)
        for _ in self._against.steps(look, wrong | self._suspects, wrong):
            yield False
        self._listen(look)
        yield False
        self._look_at_rails(look)
        self._suspect(look)
        yield False
        self._confirm(look)
        yield False
        self._trust_again()
        yield True

    @property
    def badness(self) -> Array:
        """How bad each channel (C,) is: what tells nothing at all first, then by how far off."""
        nothing = np.isin(self.kinds, (DEAD, SATURATED, STUCK))
        return np.where(self.kinds > 0, self._against.off, 0.0) + np.where(nothing, 1e9, 0.0)

    def findings(self, kept: Mask) -> tuple[Finding, ...]:
        """What is found, of which some channels are `kept` (C,) in the fit all the same."""
        return findings(self.kinds, self._since, self._figures, kept)

    def _find(self, which: Mask, kind: int, since: float) -> None:
        self._since[which & (self.kinds == 0)] = since
        self.kinds[which], self._suspects[which], self._calm[which] = kind, False, 0

    def _may_be(self, which: Mask) -> Mask:
        """Those of `which` (C,) of which nothing better was found."""
        return which & ~self._dead & ((self.kinds == 0) | np.isin(self.kinds, _LOOSE))

    def _listen(self, look: ChannelStatistics) -> None:
        """Find channels noisier than all others and than those around them, in several looks."""
        P = len(self.sensor.layout)
        usual = max(self._against.usual, self.sensor.transduction.resolution)
        # A region of interest leaves most channels without a noise: they are as the others.
        noise = np.where(np.isnan(look.noise), usual, look.noise)
        loud = np.flatnonzero((noise > _LOUD * usual) & ~self._dead)
        near = self._against.neighbours.near[loud % P]
        if near.shape[1]:
            around = np.median(noise.reshape(3, P)[(loud // P)[:, None], near], axis=1)
            loud = loud[noise[loud] > _LOUD * around]
        self._loud[:-1] = self._loud[1:]
        self._loud[-1] = np.isin(np.arange(3 * P), loud)
        often = self._loud[-1] & (self._loud.sum(axis=0) >= _LOUDS)
        self._find(self._may_be(often), NOISY, look.time)
        heard = (self.kinds == NOISY) & self._loud[-1]
        self._figures[heard] = np.stack([noise, np.full(len(noise), usual)], axis=1)[heard]

    def _look_at_rails(self, look: ChannelStatistics) -> None:
        self._railed[:-1] = self._railed[1:]
        self._railed[-1] = np.nan_to_num(look.railed)
        share = self._railed.mean(axis=0)
        self._find(self._may_be(share > _RAILED), SATURATED, look.time)
        here = self.kinds == SATURATED
        self._figures[here, 0], self._figures[here, 1] = share[here], 0.0
        self.kinds[here & (share < _FREE)] = 0
        railed = np.flatnonzero(here & (share == 1))
        if railed.size:
            self._call_dead(railed)

    def _call_dead(self, railed: NDArray[np.intp]) -> None:
        """Of channels that stay on a rail, call those dead which nothing bends so far."""
        chain = self.sensor.transduction
        rail = chain.resolution * min(abs(limit) for limit in chain.limits)
        told, spread = self._against.levels(railed)
        within = np.abs(told) + _FAR * np.sqrt(spread) < _WITHIN * rail
        dead = railed[within]
        self.kinds[dead] = DEAD
        self._figures[dead, 0] = rail
        self._figures[dead, 1] = np.abs(told[within])

    def _suspect(self, look: ChannelStatistics) -> None:
        """Suspect the worst of those accused, and go on with those suspected before."""
        far = (self._against.distance > _FAR) & ~self._dead & (self.kinds == 0)
        far &= ~self._against.pressed
        off = np.where(far & ~self._suspects, self._against.off, 0.0).reshape(3, -1)
        near = self._against.neighbours.near
        around = off.max(axis=0)[near].max(axis=1, initial=0.0)
        new = (off > 0) & (off >= around)
        self._suspects = (self._suspects & far) | new.ravel()
        self._accused = np.where(self._suspects, self._accused + 1, 0)

    def _confirm(self, look: ChannelStatistics) -> None:
        sure = self._suspects & (self._accused >= _CONFIRMED)
        far = np.isin(self.kinds, _LOOSE) & (self._against.distance > _FAR)
        channels = np.flatnonzero(sure | far)
        if not channels.size:
            return
        step = look.seconds / len(look.means)
        told = classify_faults(self._against, channels, self.sensor.transduction.resolution, step)
        since = look.time - _CONFIRMED * look.seconds
        # Of what was loud before, being off for a while tells nothing better.
        better = (self.kinds[channels] != NOISY) | ~np.isin(told.kinds, _LOOSE)
        # What is unsteady for a moment may be about to stand still.
        better &= (told.kinds != NOISY) | (self._accused[channels] >= 2 * _CONFIRMED)
        # Under a point that presses on it an element reads much more than those around it tell.
        better &= ~np.isin(told.kinds, _LOOSE) | (self._against.beyond[channels] > 1)
        for kind in np.unique(told.kinds[better]):
            these = channels[better & (told.kinds == kind)]
            self._find(np.isin(np.arange(len(sure)), these), kind, since)
            self._figures[these] = told.figures[better & (told.kinds == kind)]

    def _trust_again(self) -> None:
        """Count the looks in which a channel agreed with the others, and trust it after enough."""
        against, kinds = self._against, self.kinds
        answering = np.isin(kinds, _ANSWERING) & ~self._dead
        off, moved, left_open = against.answer()
        agrees = np.where(answering, off < _NEAR * left_open, against.distance < _NEAR)
        agrees &= (against.distance > 0) & ~self._loud[-_CALM:].any(axis=0)
        enough = ~answering | (moved > _ANSWERS * left_open)
        self._calm = np.where(agrees, self._calm + enough, 0)
        trusted = (kinds > 0) & ~self._dead & (kinds != SATURATED) & (self._calm >= _CALM)
        against.begin_anew(trusted & answering)
        self.kinds = np.where(trusted, 0, kinds).astype(np.uint8)
