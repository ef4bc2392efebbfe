"""The fixed gain and offset errors of a sensor that was never calibrated."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from kappaskin.frames import Array
from kappaskin.scenes.effects.effect import ReadingEffect, Running, Size
from kappaskin.scenes.effects.parameters import Within
from kappaskin.scenes.effects.survey import Survey


@dataclass(frozen=True)
class Tolerance(ReadingEffect):
    """Each channel reads gain times curvature plus offset, with both drawn once by `seed`.

    Gains are normal about 1 with standard deviation `gain_sd`, offsets about 0 with `offset_sd` in
    1/m. The seed is the skin's own: another seed of the scene leaves the skin the same.
    """

    name: ClassVar = "tolerance"
    at_once: ClassVar = True
    formula: ClassVar = "spread of the gains, plus that of the offsets over peak curvature"

    gain_sd: Annotated[float, Within(0, 10)]
    offset_sd: Annotated[float, Within(0, 1e4, "1/m")]
    seed: Annotated[int, Within(0, 2**63 - 1, whole=True)] = 0

    def errors(self, shape: tuple[int, ...]) -> tuple[Array, Array]:
        """Gain and offset in 1/m of every channel of a skin of `shape`."""
        rng = np.random.default_rng(self.seed)
        return rng.normal(1.0, self.gain_sd, shape), rng.normal(0.0, self.offset_sd, shape)

    def size(self, survey: Survey) -> Size:
        gain, offset = self.errors((3 * len(survey.layout),))
        K = survey.curvature.reshape(len(survey.times), -1)
        off = survey.share((gain - 1) * K + offset)
        return Size(self.gain_sd + self.offset_sd / survey.peak, off)

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> Running:
        from kappaskin.scenes.effects.at_work.tolerance import tolerance

        return tolerance(*self.errors(shape))
