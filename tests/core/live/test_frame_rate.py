"""How many frames a second, and how evenly they came."""

import math

import numpy as np
import pytest

from kappaskin import Frame
from kappaskin.live.timing import ArrivalTimes


def frames(*times):
    empty = np.empty(0, np.intp), np.empty(0, np.int32)
    return [Frame(n, 0.0, time, *empty) for n, time in enumerate(times)]


@pytest.fixture
def arrivals():
    return ArrivalTimes()


def come(arrivals, *times):
    arrivals.read(frames(*times))
    for frame in frames(*times):
        arrivals.used(frame)


def test_nothing_has_come(arrivals) -> None:
    assert (arrivals.rate(5.0), arrivals.last) == (0.0, -math.inf)
    assert math.isnan(arrivals.gap(5.0))


@pytest.mark.parametrize("rate", [10, 500, 2000])
def test_the_rate_is_that_of_the_last_second(rate, arrivals) -> None:
    come(arrivals, *(np.arange(3 * rate) / rate))
    assert arrivals.rate(3.0 - 1 / rate) == pytest.approx(rate, rel=0.12)
    assert arrivals.last == 3.0 - 1 / rate
    assert arrivals.rate(3.5) == pytest.approx(rate / 2, rel=0.25)
    assert arrivals.rate(4.5) == 0.0


def test_before_a_second_is_over_it_is_that_of_what_there_was(arrivals) -> None:
    come(arrivals, *(np.arange(50) / 500))
    assert arrivals.rate(0.098) == pytest.approx(510, abs=5)


def test_one_gap_in_a_hundred_is_told(arrivals) -> None:
    times = np.cumsum([0.0, *([0.002] * 150), 0.05, *([0.002] * 150), *([0.05] * 6)])
    come(arrivals, *times)
    assert arrivals.gap(10.0) == pytest.approx(0.05)
    come(arrivals, times[-1])  # in the same read: no gap
    arrivals.clear()
    come(arrivals, 20.0, 20.001)
    assert arrivals.gap(21.0) == pytest.approx(0.001)
