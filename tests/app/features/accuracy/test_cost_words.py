"""What is said and drawn of costs, without a window."""

import math

import pytest

from kappaskin.estimation import METHODS
from kappaskin_app.features.accuracy.measurement import Frontier
from kappaskin_app.shell.settings.shown import METHOD_SHORT
from kappaskin_app.widgets.plots import LogAxis
from kappaskin_app.widgets.text import duration, length


def test_every_method_has_a_name_that_people_read() -> None:
    assert sorted(METHOD_SHORT) == sorted(METHODS)


def test_nothing_is_cheapest_where_nothing_was_measured() -> None:
    assert Frontier().cheapest(1.0) is None


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (1.64e-5, "0.016 mm"),
        (2.5e-3, "2.5 mm"),
        (0.12, "120 mm"),
        (9.96e-7, "0.0010 mm"),
        (4e-7, "0.00040 mm"),
        (math.nan, "\N{EN DASH}"),
        (math.inf, "\N{EN DASH}"),
    ],
)
def test_a_length_is_said_with_two_digits(value: float, words: str) -> None:
    assert length(value) == words


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (2.51e-5, "25 \N{MICRO SIGN}s"),
        (9.99e-4, "1.0 ms"),
        (0.0456, "46 ms"),
        (2.0, "2.0 s"),
        (1100, "18 min"),
    ],
)
def test_a_time_is_said_with_two_digits(value: float, words: str) -> None:
    assert duration(value) == words


def test_a_logarithmic_axis_has_round_ends_around_all_and_equal_ratios_apart() -> None:
    axis = LogAxis.around([3e-5, 7e-3, math.nan, 0.0, math.inf])
    assert (axis.least, axis.most) == pytest.approx((2e-5, 1e-2))
    steps = [axis.share(value) for value in (1e-4, 1e-3, 1e-2)]
    assert steps[1] - steps[0] == pytest.approx(steps[2] - steps[1])
    assert axis.at(axis.share(1e-3)) == pytest.approx(1e-3)
    assert (axis.share(1e-9), axis.share(1.0), axis.share(math.nan)) == (0.0, 1.0, 0.0)
    values = [value for value, _ in axis.ticks()]
    assert values == pytest.approx([2e-5, 5e-5, 1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2])


def test_an_axis_of_one_value_or_none_can_still_be_drawn() -> None:
    for axis in (LogAxis.around([]), LogAxis.around([1e-3]), LogAxis.around([math.nan])):
        assert 0 < axis.least < axis.most
        assert len(axis.ticks()) >= 2
