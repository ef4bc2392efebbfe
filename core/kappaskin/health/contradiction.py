"""What channels read to how far each is from what those around it say, over the last seconds."""

from collections.abc import Iterator
from typing import cast

import numpy as np

from kappaskin.frames import Array, Mask
from kappaskin.health.neighbours import Indices, Neighbours
from kappaskin.health.window import Look
from kappaskin.sensing import SensorLayout

_KEPT = 128  # means, 16 a second
_RECENT = 32  # of them are judged
_OFTEN = 24  # of them at most may be explained where a channel is beyond what can be
_FEWEST = 8  # of those at least
_FORGOTTEN = 60.0  # s after which a reading that stays is what one is compared with
_SHAPE = 2.0  # times the mean square around is the most that a shape is thought to be
_GAIN = 0.05  # by which channels that are well may differ
_FAR = 4.0  # standard deviations
# Of what elements beside one change, what a point load on it makes its own reading differ by at
# most: 1.6 times, with 25 x 25 functions, where it presses on 10 x 10 elements; in a corner, with
# fewer beside it, so many times more.
_SHARP = 2.0
_SAME = 0.99  # of the correlation of what a channel reads and should, where a load presses on it
_USUAL = 1.4826  # standard deviations are so many times the median of the amounts
_FINE = 0.01  # of the largest change anywhere: finer than that nothing is foretold


def rms(values: Array) -> Array:
    """Root mean squares (C,) of what is known of `values` (T, C); zero where too little is."""
    known = ~np.isnan(values)
    count = known.sum(axis=0)
    squares = np.where(known, values, 0.0)
    total = np.einsum("tc,tc->c", squares, squares)
    return np.where(count < _FEWEST, 0.0, np.sqrt(total / np.maximum(count, 1)))


def _apart(values: Array) -> Array:
    """`values` (T, C) less the means of what is known of them."""
    known = ~np.isnan(values)
    return values - np.where(known, values, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)


def centred(values: Array) -> Array:
    """`values` (T, C) less their means; zero where one is not known."""
    return np.nan_to_num(_apart(values))


def _median(values: Array) -> float:
    known = values[~np.isnan(values)]
    return float(np.median(known)) if known.size else 0.0


def _largest(values: Array) -> float:
    return float(np.abs(np.nan_to_num(values)).max())


class Contradiction:
    """How each of C channels changed, `changed` (T, C) in 1/m, and should have, `told` (T, C).

    Changes are those from what was read about a minute ago: offsets and old contacts contradict
    nothing. A channel that is `missing` tells nothing of others, and is told of by them.
    `open` (T, C) in 1/m^2 is the variance of what the others leave open. `distance` (C,) is how far
    a channel was off in the last two seconds, in standard deviations, zero where nothing is known;
    `off` (C,) the same in 1/m. `beyond` (C,) is above one where for a quarter of the time a channel
    was further off than four of them and a point load on its element could explain. What is no
    further off, and always reads more than it should, may be `pressed` (C,) by such a load.
    """

    def __init__(self, layout: SensorLayout) -> None:
        C = 3 * len(layout)
        self.neighbours = Neighbours(layout)
        self._every = np.arange(len(layout))
        self.missing = np.zeros(C, bool)
        self.reads: Array = np.full(C, np.nan)
        """What each channel (C,) read last, in 1/m."""
        self.base: Array = np.full(C, np.nan)
        """What that is compared with, in 1/m."""
        self.changed, self.told, self.open = (np.full((_KEPT, C), np.nan) for _ in range(3))
        self._beside = np.zeros((_KEPT, len(layout)))
        """How much an element next to each changed at most, in 1/m."""
        self._alike = np.zeros(_KEPT)  # in 1/m, how far off channels are that have nothing wrong
        self.usual = 0.0
        """Noise in 1/m that half of the channels have, of those whose noise can be told."""
        self.distance, self.off, self.left_open = np.zeros(C), np.zeros(C), np.zeros(C)
        self.beyond = np.zeros(C)
        self.pressed = np.zeros(C, bool)

    @property
    def recent(self) -> slice:
        return slice(_KEPT - _RECENT, None)

    def steps(self, look: Look, missing: Mask, wrong: Mask) -> Iterator[None]:
        """Take in what was read, without what is `missing` (C,), some of it known to be `wrong`.

        In steps, each after the one before.
        """
        known = ~np.isnan(look.means)
        with np.errstate(invalid="ignore"):  # of none comes NaN
            reads = np.where(known, look.means, 0.0).sum(axis=0) / known.sum(axis=0)
        self.reads = np.where(np.isnan(reads), self.reads, reads)
        self.base = np.where(np.isnan(self.base), reads, self.base)
        T = self._push(look.means - self.base)
        yield
        self._compare(T)
        yield
        unread = np.isnan(self.changed[self.recent]).all(axis=0)
        self.leave_out(missing | unread)
        self._forget(look.seconds, wrong)
        yield
        self._measure(look)
        yield

    def _push(self, changed: Array) -> int:
        """Take in the newest changes (T, C); T."""
        T = len(changed)
        for ring in (self.changed, self.told, self.open):
            ring[:-T] = ring[T:]
        self.changed[-T:] = changed
        self._tell(self._every, slice(_KEPT - T, None))
        heard = np.nan_to_num(np.where(self.missing, 0.0, np.abs(self.changed[-T:])))
        self._beside[:-T] = self._beside[T:]
        self._beside[-T:] = heard[:, self.neighbours.beside].max(axis=2, initial=0.0)
        return T

    def _compare(self, T: int) -> None:
        """How far off the channels that have nothing wrong were in the newest T."""
        self._alike[:-T] = self._alike[T:]
        self._alike[-T:] = [
            np.hypot(_USUAL * _median(np.abs(now - told)), _FINE * _largest(now))
            for now, told in zip(self.changed[-T:], self.told[-T:], strict=True)
        ]

    def _tell(self, elements: Indices, when: slice) -> None:
        heard = np.where(self.missing, 0.0, self.changed[when])
        told, spread = self.neighbours.told(heard, elements)
        P = len(self._every)
        for ring, new in ((self.told, told), (self.open, spread)):
            ring.reshape(_KEPT, 3, P)[when][:, :, elements] = new

    def leave_out(self, missing: Mask) -> None:
        """Let the `missing` (C,) channels tell nothing of others, and others something again."""
        changed = missing != self.missing
        if changed.any():
            self.missing = missing.copy()
            elements = self.neighbours.touched_by(changed)
            self.neighbours.leave_out(missing, elements)
            self._tell(elements, slice(None))

    def _forget(self, seconds: float, wrong: Mask) -> None:
        """Let what is compared with follow what is read, or where it is not trusted is told."""
        latest = cast("Array", np.where(wrong, self.told[-1], self.changed[-1]))
        step: Array = np.nan_to_num(latest) * min(1.0, seconds / _FORGOTTEN)
        self.base += step

    def _measure(self, look: Look) -> None:
        heard = look.noise[~self.missing & ~np.isnan(look.noise)]
        self.usual = float(np.median(heard)) if heard.size else self.usual
        around = (self.neighbours.weights**2).sum(axis=2).T.ravel()
        white = np.fmax(look.noise, self.usual) ** 2 + self.usual**2 * around
        white /= look.frames
        left = (self.changed - self.told)[self.recent]
        s2 = _SHAPE * self.open[self.recent] + (_GAIN * self.told[self.recent]) ** 2
        s2 += white + self._alike[self.recent, None] ** 2
        with np.errstate(invalid="ignore", divide="ignore"):
            self.distance = rms(left / np.sqrt(s2))
            sharp = _SHARP * np.tile(self.neighbours.alone * self._beside[self.recent], 3)
            beyond = np.nan_to_num(np.abs(left) / (_FAR * np.sqrt(s2) + sharp))
        self.beyond = np.partition(beyond, _OFTEN, axis=0)[_OFTEN]
        changed, told = (np.nan_to_num(ring[self.recent]) for ring in (self.changed, self.told))
        own, alike = (np.einsum("tc,tc->c", changed, other) for other in (changed, told))
        same = alike**2 > _SAME**2 * own * np.einsum("tc,tc->c", told, told)
        self.pressed = (self.beyond <= 1) & same & (alike > 0) & (alike < own)
        self.off, self.left_open = rms(left), rms(np.sqrt(s2))

    def answer(self) -> tuple[Array, Array, Array]:
        """How each channel moved otherwise than told, how it should, and how sure that is.

        In the last two seconds, (C,) each in 1/m, whatever its offset.
        """
        changed, told = self.changed[self.recent], self.told[self.recent]
        left = changed - told
        told = np.where(np.isnan(left), np.nan, told)
        return rms(_apart(left)), rms(_apart(told)), self.left_open

    def begin_anew(self, channels: Mask) -> None:
        """Compare some `channels` (C,) with what those around them tell of them now."""
        left = (self.changed - self.told)[self.recent][:, channels]
        known = ~np.isnan(left)
        shift = np.where(known, left, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
        self.base[channels] += shift
        self.changed[:, channels] -= shift

    def levels(self, channels: Indices) -> tuple[Array, Array]:
        """What `channels` (n,) should read now, and the variance left open, (n,) each."""
        P = len(self._every)
        reads = np.where(self.missing, 0.0, np.nan_to_num(self.reads))
        told, spread = self.neighbours.told(reads[None], channels % P)
        row, each = channels // P, np.arange(len(channels))
        return told[0, row, each], spread[0, row, each]
