"""What is found of the channels of a skin, and what leaving them out costs."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kappaskin.estimation import WHY
from kappaskin.frames import COMPONENTS, Array

_MOST = 256  # findings that are told one by one


@dataclass(frozen=True)
class Finding:
    """What is wrong with one channel: `kind` is a word of `WHY`, `figure` says by how much.

    `since` when, in s on the clock of `Frame.host_time`. `kept` says that it is in the fit all the
    same, as no shape could be told without it.
    """

    channel: int
    element: int
    component: str
    kind: str
    since: float
    figure: str
    kept: bool = False

    def __str__(self) -> str:
        kept = "; kept, as no shape can be told without it" if self.kept else ""
        return f"{self.component} of element {self.element} {self.kind}: {self.figure}{kept}"


@dataclass(frozen=True)
class Health:
    """All that is wrong with the channels of a skin now.

    `findings` are told one by one, upwards, at most 256 of the `count` there are. Leaving them out
    makes the error bars of the shape `cost` times as wide, and that of the displacement at the
    contact `contact_cost` times, NaN where there is no contact. `kept` of them are in the fit all
    the same.
    """

    findings: tuple[Finding, ...] = ()
    count: int = 0
    kept: int = 0
    cost: float = 1.0
    contact_cost: float = math.nan

    def __str__(self) -> str:
        if not self.count:
            return "no channel is found wanting"
        out = self.count - self.kept
        words = [f"{out} channel{'' if out == 1 else 's'} left out"]
        words.append(f"error bars {100 * (self.cost - 1):+.0f} %")
        if math.isfinite(self.contact_cost):
            words.append(f"at the contact {100 * (self.contact_cost - 1):+.0f} %")
        if self.kept:
            words.append(f"{self.kept} found wanting, but no shape can be told without")
        return ", ".join(words)


def findings(
    kinds: NDArray[np.uint8], since: Array, figures: Array, kept: NDArray[np.bool_]
) -> tuple[Finding, ...]:
    """What is found of C channels: `kinds`, `since` and `kept` (C,), `figures` (C, 2)."""
    P = len(kinds) // 3
    return tuple(
        Finding(
            int(channel),
            int(channel % P),
            COMPONENTS[int(channel) // P],
            WHY[int(kinds[channel])],
            float(since[channel]),
            _figure(
                WHY[int(kinds[channel])], float(figures[channel, 0]), float(figures[channel, 1]), P
            ),
            bool(kept[channel]),
        )
        for channel in np.flatnonzero(kinds)[:_MOST]
    )


def _figure(kind: str, first: float, second: float, elements: int) -> str:
    """The figures that `explain` gives, with their units in words."""
    if math.isnan(first):
        return "the device says so"
    if kind in ("dead", "stuck"):
        return f"reads {first:+.2f} 1/m while those around it tell of {second:.2f} 1/m of motion"
    if kind == "noisy":
        return f"{first:.2g} 1/m of noise, others have {second:.2g} 1/m"
    if kind == "saturated":
        return f"on a rail for {100 * first:.0f} % of the last second"
    if kind == "swapped":
        other = int(first)
        return f"reads what {COMPONENTS[other // elements]} of element {other % elements} should"
    trend = f", going by {second:+.2g} 1/m a minute" if kind == "drifting" else ""
    return f"{first:+.2f} 1/m off what those around it say{trend}"
