"""Skew: the multiplexer reads each channel at a time of its own."""

from dataclasses import dataclass
from typing import ClassVar

from kappaskin.scenes.effects.effect import Effect, Size
from kappaskin.scenes.effects.survey import Survey


@dataclass(frozen=True)
class Skew(Effect):
    """Channels are read one after the other while the skin moves; `Scan.times` says when."""

    name: ClassVar = "skew"
    formula: ClassVar = "scan time times rate of curvature over peak curvature"

    def size(self, survey: Survey) -> Size:
        number = survey.read_after.max() * survey.rates.max() / survey.peak
        change = float((survey.read_after * survey.rates).max()) / survey.peak
        # However fast it moves, a reading goes from one peak to the opposite one at most.
        return Size(float(number), min(change, 2.0))
