"""Failures of the link from the device: frames that do not come, or come spoilt."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from kappaskin.scenes.effects.effect import Effect, Size
from kappaskin.scenes.effects.parameters import Within
from kappaskin.scenes.effects.survey import Survey


@dataclass(frozen=True)
class _LinkFailure(Effect):
    """The `share` of all frames is hit, each for itself."""

    authored: ClassVar = True
    formula: ClassVar = "share of the frames"

    share: Annotated[float, Within(0, 1)]

    def size(self, survey: Survey) -> Size:
        return Size(self.share, 0.0)

    def start(self, rng: np.random.Generator) -> Callable[[int], bool]:
        """Whether frame n is hit: of a frame asked for twice, or out of turn, it is the same."""
        from kappaskin.scenes.effects.at_work.link import hits

        return hits(self.share, rng)


@dataclass(frozen=True)
class DroppedFrames(_LinkFailure):
    """The `share` of all frames never arrives."""

    name: ClassVar = "dropped-frames"


@dataclass(frozen=True)
class CorruptedFrames(_LinkFailure):
    """The `share` of all frames arrives with wrong bytes, which its checksum tells."""

    name: ClassVar = "corrupted-frames"
