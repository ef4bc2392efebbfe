"""Colours of numbers: a colour map between limits, or a colour for each whole number."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from kappaskin.frames import Array, Mask
from kappaskin_app.theme import DARK_INK, LIGHT_INK, SATURATED, Colours, colours_in_use

Part = Literal["sequential", "pulled", "diverging"]
"""The colours of values above zero, below it, and of both signs."""
_LIGHT = 128  # of 255, least of a light colour


def rgb_of(*colours: str) -> Colours:
    return np.array([[int(c[i : i + 2], 16) for i in (1, 3, 5)] for c in colours], np.uint8)


@dataclass(frozen=True, eq=False)
class Tint:
    """How numbers become colours: by a `part` of the colour map in use, between `limits` in `unit`.

    `limit` is how far they reach, as a range is locked to it; `noise` is the standard deviation of
    a number, 0 where it is not known. A tint of `kinds` has one colour of its `own` for each whole
    number instead.
    """

    part: Part
    limits: tuple[float, float]
    unit: str
    limit: float = 1.0
    kinds: tuple[str, ...] = ()
    own: Colours | None = None
    noise: float = 0.0

    @property
    def colours(self) -> Colours:
        return getattr(colours_in_use(), self.part) if self.own is None else self.own

    @property
    def ink(self) -> str:
        """What is seen against every one of the colours."""
        middle = int(self.colours[len(self.colours) // 2].min())
        return DARK_INK if self.part == "diverging" and middle > _LIGHT else LIGHT_INK

    @property
    def floor(self) -> tuple[float, float]:
        """The ends of what noise alone reaches, one standard deviation, as shares of the scale."""
        low, high = self.limits
        middle = (low + high) / 2 if self.part == "diverging" else 0.0
        ends = np.array([middle - self.noise, middle + self.noise])
        return tuple(np.clip((ends - low) / (high - low), 0.0, 1.0).tolist())

    def rgb(self, values: Array, missing: str, railed: Mask | None = None) -> Colours:
        """Colours (..., 3) of `values` (...); NaN is `missing`, what is `railed` has its own."""
        gone = ~np.isfinite(values)
        known = np.where(gone, 0.0, values)
        low, high = self.limits
        if self.kinds:
            index = known.astype(np.intp)
        else:
            share = (known - low) / (high - low) if high > low else np.full_like(known, 0.5)
            index = (np.clip(share, 0, 1) * 255).astype(np.intp)
        rgb = self.colours[index]
        rgb[gone] = rgb_of(missing)[0]
        if railed is not None and railed.any():
            rgb[railed] = rgb_of(SATURATED)[0]
        return rgb

    def legend(
        self, values: Array, missing: str, railed: Mask | None = None
    ) -> tuple[tuple[str, str], ...]:
        """What is seen beside the scale's own colours, or without a scale: colours and words."""
        if self.kinds:
            seen = np.unique(values[np.isfinite(values)].astype(int))
            return tuple((f"#{self.colours[k].tobytes().hex()}", self.kinds[k]) for k in seen)
        gone = ~np.isfinite(values)
        on_rail = np.zeros(len(values), bool) if railed is None else railed
        beside = (on_rail.any(), SATURATED, "saturated"), ((gone & ~on_rail).any(), missing, "none")
        return tuple((colour, words) for there, colour, words in beside if there)
