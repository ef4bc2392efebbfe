import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from kappaskin_app.shell.colouring import Ranges, SteadyRange
from kappaskin_app.widgets.text import round_up


@given(st.floats(1e-9, 1e9))
def test_a_rounded_limit_holds_the_value_and_little_more(value: float) -> None:
    assert value * (1 - 1e-9) <= round_up(value) <= 1.7 * value


def test_a_range_widens_at_once() -> None:
    steady = SteadyRange(1.0)
    steady.follow(1.0, now=0.0)
    assert steady.follow(8.0, now=0.01) == 10.0


def test_a_range_narrows_only_after_staying_small() -> None:
    steady = SteadyRange(1.0)
    steady.follow(8.0, now=0.0)
    limits = [steady.follow(2.0, now=t) for t in (0.1, 1.0, 2.05, 2.2)]
    assert limits == [10.0, 10.0, 10.0, 2.0]


def test_a_peak_between_keeps_the_range() -> None:
    steady = SteadyRange(1.0)
    steady.follow(8.0, now=0.0)
    steady.follow(2.0, now=0.1)
    steady.follow(9.0, now=1.5)
    assert steady.follow(2.0, now=2.5) == 10.0
    assert not math.isnan(steady.limit)


def test_a_skin_at_rest_keeps_its_side() -> None:
    ranges = Ranges(side=100.0)
    sides = [
        ranges.pulled(np.array(w)) for w in ([0.1, 3.0], [-0.05, 0.04], [-3.0, 0.1], [0.0, 0.05])
    ]
    assert sides == [False, False, True, True]


def test_a_skin_that_bulges_nearly_as_far_as_it_is_pressed_keeps_its_side() -> None:
    ranges = Ranges(side=100.0)
    sides = [ranges.pulled(np.array(w)) for w in ([-3.1, 3.0], [-5.0, 3.0], [-3.0, 3.1], [-1, 3])]
    assert sides == [False, True, True, False]
