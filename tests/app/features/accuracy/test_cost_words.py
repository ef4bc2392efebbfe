"""What is said and drawn of costs, without a window."""

import math

import pytest

from kappaskin.estimation import METHODS
from kappaskin_app.features.accuracy.measurement import Frontier
from kappaskin_app.shell.settings.shown import METHOD_SHORT
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
