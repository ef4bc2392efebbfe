"""Channels that contradict those around them to what is wrong with each."""

from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from kappaskin.estimation import WHY
from kappaskin.frames import Array, Mask
from kappaskin.health.contradiction import Contradiction, centred
from kappaskin.health.neighbours import Indices

DEAD, STUCK, NOISY, SWAPPED, OFFSET, SATURATED, DRIFTING = (
    WHY.index(kind)
    for kind in ("dead", "stuck", "noisy", "swapped", "offset", "saturated", "drifting")
)

_STILL = 0.25  # of how the others say that it moves: a channel that moves less does not answer
_MOVED = 4.0  # times what is left open, that others say it moves: what it does then is told by
_AT_REST = 0.1  # of the same: one that stays nearer to zero is dead
_COUNTS = 5.0  # resolutions, within which zero is zero
_CROSSED = 0.2  # of the squares left where two channels are swapped back
_STEADY = 2.0  # times its scatter is what a channel is off by, or it is noise
_LINE = 0.8  # of the scatter that a line explains; of a step it explains 0.75 at most
_MOST = 512  # channels whose pairs are looked at


@dataclass(frozen=True, slots=True, eq=False)
class Explained:
    """What is wrong with n channels: `kinds` (n,) by number in `WHY` and `figures` (n, 2)."""

    kinds: NDArray[np.uint8]
    figures: Array


def explain(against: Contradiction, channels: Indices, resolution: float, step: float) -> Explained:
    """What is wrong with `channels` (n,), of which one mean comes every `step` s.

    Figures are in 1/m: of dead and stuck ones what they read and how far the others say that they
    move; of noisy ones their noise and the usual one; of swapped ones the channel that reads what
    they should, and NaN; of drifting ones and offsets what they are off by, and by how much more
    each minute.
    """
    changed, told = against.changed[:, channels], against.told[:, channels]
    left = changed - told
    changed, told = (np.where(np.isnan(left), np.nan, values) for values in (changed, told))
    lately = _amounts(told[against.recent]) > _MOVED * against.left_open[channels]
    moves, should = (
        np.where(lately, _amounts(values[against.recent]), _amounts(values))
        for values in (changed, told)
    )
    still = (moves < _STILL * should) & (should > _MOVED * against.left_open[channels])
    reads = against.reads[channels]
    rest = np.maximum(_AT_REST * should, _COUNTS * resolution)
    off, scatter = _means(left[against.recent]), _amounts(left[against.recent])
    line, slope = _trend(left)
    kinds = np.select(
        [still & (np.abs(reads) < rest), still, np.abs(off) < _STEADY * scatter, line > _LINE],
        [DEAD, STUCK, NOISY, DRIFTING],
        OFFSET,
    ).astype(np.uint8)
    figures = np.stack([off, slope * 60 / step], axis=1)
    figures[still] = np.stack([reads, should], axis=1)[still]
    loud = kinds == NOISY
    figures[loud] = np.stack([scatter, np.full(len(scatter), against.usual)], axis=1)[loud]
    crossed, partner = _partners(centred(changed), centred(told))
    kinds[crossed], figures[crossed] = SWAPPED, np.nan
    figures[crossed, 0] = channels[partner[crossed]]
    return Explained(kinds, figures)


def _means(values: Array) -> Array:
    """Means (n,) of what is known of `values` (T, n)."""
    known = ~np.isnan(values)
    return np.where(known, values, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)


def _amounts(values: Array) -> Array:
    """Standard deviations (n,) of what is known of `values` (T, n)."""
    apart, known = centred(values), np.count_nonzero(~np.isnan(values), axis=0)
    return np.sqrt(np.sum(apart**2, axis=0) / np.maximum(known, 1))


def _trend(left: Array) -> tuple[Array, Array]:
    """How much of the scatter of `left` (T, n) a line explains, and its slope, (n,) each."""
    time = np.where(np.isnan(left), np.nan, np.arange(len(left))[:, None])
    t, r = centred(time), centred(left)
    tt, tr, rr = (np.sum(a * b, axis=0) for a, b in ((t, t), (t, r), (r, r)))
    slope = np.divide(tr, tt, where=tt > 0, out=np.zeros_like(tr))
    return np.divide(slope * tr, rr, where=rr > 0, out=np.zeros_like(tr)), slope


def _partners(d: Array, p: Array) -> tuple[Mask, Indices]:
    """Which of n channels read what another one should and it what they should, and which one.

    Of how they move, `d` (T, n), and how they should, `p` (T, n).
    """
    n = int(d.shape[1])
    crossed = cast("Mask", np.zeros(n, bool))
    partner = cast("Indices", np.zeros(n, np.intp))
    if not 2 <= n <= _MOST:
        return crossed, partner
    D, Q, between = np.sum(d**2, axis=0), np.sum(p**2, axis=0), d.T @ p
    own = D + Q - 2 * np.diag(between)
    other = D[:, None] + Q - 2 * between  # of reading i as if it were j
    left = (other + other.T) / np.maximum(own[:, None] + own, np.finfo(float).tiny)
    np.fill_diagonal(left, np.inf)
    partner = cast("Indices", left.argmin(axis=1))
    # Of two stuck ones each moves as little as the other.
    crossed = cast("Mask", left.min(axis=1) < _CROSSED)
    each_other = cast("Mask", partner[partner] == np.arange(n))
    return crossed & each_other, partner
