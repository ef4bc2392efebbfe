"""Motions that cannot be are refused when they are made, with what was expected."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from kappaskin import Refusal
from kappaskin.scene import motion


@pytest.mark.parametrize(
    ("make", "expected"),
    [
        (lambda: motion.Orbit(-0.01, 2.0), "a radius >= 0 m"),
        (lambda: motion.Hold(0.0), "a step that takes"),
        (lambda: motion.Hold(1.0, "bouncing"), "an ease among smooth, linear, got 'bouncing'"),
        (lambda: motion.Press(1.0, to=math.nan), "a share of"),
        (lambda: motion.Slide(1.0, by=(0.0, math.inf)), "two finite numbers of metres"),
        (lambda: motion.Turn(1.0, by=math.nan), "a finite angle in rad"),
        (lambda: motion.Tap(1.0, times=0), "1 to 1000 taps, got 0"),
        (lambda: motion.Recorded(np.zeros(1), np.zeros((1, 3))), "at least two times"),
        (lambda: motion.Recorded(np.array([0.0, 1.0]), np.zeros((2, 2))), "at least two times"),
        (lambda: motion.Recorded(np.array([0.0, 0.0]), np.zeros((2, 3))), "begin with 0 and rise"),
        (lambda: motion.Recorded(np.array([1.0, 2.0]), np.zeros((2, 3))), "begin with 0 and rise"),
        (lambda: motion.Recorded(np.array([0.0, 2e9]), np.zeros((2, 3))), "a record of"),
    ],
)
def test_a_motion_that_cannot_be_is_refused(make: Callable[[], object], expected: str) -> None:
    with pytest.raises(Refusal, match=expected):
        make()
