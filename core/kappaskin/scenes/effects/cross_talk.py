"""Cross-talk: a channel that has not settled still reads some of the one scanned before it."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from kappaskin.scenes.effects.effect import ReadingEffect, Running, Size
from kappaskin.scenes.effects.parameters import Within
from kappaskin.scenes.effects.survey import Survey


@dataclass(frozen=True)
class CrossTalk(ReadingEffect):
    """y_c = x_c + s (y_(c-1) - x_c): of the voltage before it a channel keeps the `share` s.

    One capacitor behind the multiplexer is charged by one channel after the other, in the order of
    a whole scan: 0 to 3 P - 1, component by component, and on with the next frame's channel 0. It
    begins at rest.
    """

    name: ClassVar = "cross-talk"
    formula: ClassVar = "share kept of the channel scanned before"

    share: Annotated[float, Within(0, 0.5)]

    def size(self, survey: Survey) -> Size:
        K = survey.curvature.reshape(len(survey.times), -1)
        largest = np.abs(K).max(axis=0, initial=0.0)
        between_frames = float(largest[0] + largest[-1])
        step = max(float(np.abs(np.diff(K)).max(initial=0.0)), between_frames)
        # |y_c - x_c| <= s (|x_(c-1) - x_c| + |y_(c-1) - x_(c-1)|), so the largest is s/(1-s) steps.
        return Size(self.share, self.share / (1 - self.share) * step / survey.peak)

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> Running:
        from kappaskin.scenes.effects.at_work.cross_talk import cross_talk

        return cross_talk(self.share, shape)
