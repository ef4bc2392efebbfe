import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin import Pipeline, Setup, Simulator, load_scene
from kappaskin.live import Status
from kappaskin_app.shell.background import Tasks
from kappaskin_app.shell.colouring import Colouring, Ranges, SteadyRange
from kappaskin_app.shell.settings import Settings
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


def test_noise_alone_stays_within_a_fifth_of_the_range() -> None:
    ranges, settings = Ranges(side=100.0), Settings()
    noise = np.full(100, 0.4)
    assert ranges.limit("xx", noise, settings, 0.0) == 0.5
    assert ranges.limit("xx", noise, settings, 0.1, noise=0.231) >= 5 * 0.231
    assert ranges.limit("displacement", 0.01 * noise, settings, 0.0, noise=0.05) >= 0.25


def test_no_range_is_wider_than_a_skin_or_an_object_can_be() -> None:
    ranges, settings = Ranges(side=100.0), Settings()
    wild = np.array([0.0, 1e12])
    limits = [ranges.limit(name, wild, settings, 0.0) for name in ("displacement", "xx", "mean")]
    assert limits == [100.0, 1e3, 1e3]


def test_the_noise_of_a_colour_is_that_of_the_estimate_with_and_without_a_contact(qtbot) -> None:
    scene = load_scene("centre")
    sensor = scene.sensor()
    estimate = Pipeline(sensor, Setup())(Simulator(scene).frame(0, lambda: 0.0))
    tasks = Tasks()
    colouring = Colouring(tasks)
    colouring.follow(Status(sensor=sensor, setup=Setup()))
    assert colouring.noise("xx", estimate) == estimate.noise > 0
    untouched = replace(estimate, contact=replace(estimate.contact, displacement_sd=math.nan))
    qtbot.waitUntil(lambda: colouring.noise("displacement", untouched) > 0)
    bars = colouring.error_bars(estimate)
    largest = 1e3 * float(np.nanmax(bars.on_surface(estimate.noise)))
    for name in ("displacement", "difference"):
        assert colouring.noise(name, untouched) == pytest.approx(largest)
        limit = Ranges(side=100.0).limit(name, np.zeros(4), Settings(), 0.0, largest)
        assert limit >= 5 * largest
    assert colouring.noise("mean", estimate) == estimate.noise
    assert colouring.noise("gaussian", estimate) == 0
    tasks.close()


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
