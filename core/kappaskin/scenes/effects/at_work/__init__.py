"""Computation of the effects on readings: each module is imported when a scene needs it."""

from collections.abc import Callable

from kappaskin.frames import Array

RunningEffect = Callable[[Array, float], Array]
"""An effect at work: curvature in 1/m and the time in s to the curvature that is read then."""
