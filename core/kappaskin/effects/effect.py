"""What every effect is: something that, once started, turns curvature into how it is read."""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from kappaskin.frames import Array

Running = Callable[[Array, float], Array]
"""An effect at work: curvature in 1/m and the time in s to the curvature that is read then."""


class Effect(Protocol):
    """One thing that spoils a reading; its values compare equal when they spoil alike."""

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> Running:
        """The effect at work on curvature of `shape`, at rest, with a state of its own.

        It is given the frames in order of time, and leaves the array it is given alone.
        """
        ...
