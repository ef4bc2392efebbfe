"""The map from a device's clock to this machine's: its bound holds, and nothing poisons it."""

import math
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin.sources.clock import ClockMap

START = 1e5  # s on the host's clock
WRAP = 2**32 * 1e-6


@dataclass
class Line:
    """Both ends of a line, and what is true: `now` is the host's time."""

    slower: float = 0.0  # s/s that the device's clock loses
    warming: float = 0.0  # 1/s by which it loses more and more
    least: tuple[float, float] = (2e-4, 2e-4)  # s a message is under way at least, there and back
    jitter: tuple[float, float] = (3e-4, 3e-4)
    working: float = 5e-5  # s from a ping to its answer
    started: float = START - 1e4
    seed: int = 1
    clock: ClockMap = field(default_factory=ClockMap)
    now: float = START + 10.0

    def __post_init__(self):
        self.rng = np.random.default_rng(self.seed)

    def device(self, host):
        lost = self.slower * (host - self.started) + self.warming * (host - START) ** 2 / 2
        return math.floor((host - self.started - lost) * 1e6) * 1e-6

    def delay(self, way):
        return self.least[way] + self.rng.exponential(self.jitter[way])

    def ping(self):
        came = self.now + self.delay(0)
        gone = came + self.working
        self.clock.exchange(self.now, self.device(came), self.device(gone), gone + self.delay(1))

    def message(self):
        self.clock.heard(self.device(self.now), self.now + self.delay(1))

    def errors(self, seconds, messages=4, pings=True):
        """Errors and bounds in s of messages over so many `seconds`, with a ping in each."""
        told = []
        for _ in range(int(seconds)):
            if pings:
                self.ping()
            for _ in range(messages):
                self.now += 1 / messages
                self.message()
                device = self.device(self.now)
                told.append((self.clock.taken(device) - self.now, self.clock.bound(device)))
        return np.array(told).T


@pytest.mark.slow
@pytest.mark.parametrize("slower", [-50e-6, 0.0, 50e-6, 5e-3])
def test_the_bound_holds_for_an_hour_of_drift_and_is_near_half_a_round_trip(slower):
    line = Line(slower)

    errors, bounds = line.errors(3600, messages=1)

    assert (np.abs(errors) <= bounds + 2e-6).all()  # the device tells its time in whole us
    settled = bounds[100:]
    assert np.median(settled) < 2 * line.least[0]
    assert line.clock.steps == 0


@pytest.mark.parametrize("slower", [-50e-6, 50e-6])
def test_the_drift_lies_within_its_bound(slower):
    line = Line(slower)

    line.errors(300, messages=1)

    true = 1e6 * slower / (1 - slower)
    assert abs(line.clock.drift - true) < line.clock.drift_bound < 25


def test_a_clock_that_warms_up_is_followed_without_a_step():
    line = Line(warming=50e-6 / 1000, least=(2e-5, 2e-5), jitter=(0.0, 0.0))

    errors, bounds = line.errors(1000, messages=1)

    assert (np.abs(errors) <= bounds + 2e-6).all()
    assert line.clock.drift == pytest.approx(50, abs=line.clock.drift_bound)
    assert line.clock.steps == 0


@pytest.mark.parametrize("working", [0.0, 0.2])
@pytest.mark.parametrize("slower", [-5e-3, 1e-7, 5e-3])
def test_no_delay_and_a_device_slow_to_answer_are_no_contradiction(slower, working):
    line = Line(slower, least=(0.0, 0.0), jitter=(0.0, 0.0), working=working)

    errors, bounds = line.errors(60, messages=1)

    assert np.isfinite(bounds).all()
    assert (np.abs(errors) <= bounds + 2e-6).all()
    assert line.clock.steps == 0


def test_delays_that_differ_between_the_ways_shift_it_within_the_bound():
    line = Line(20e-6, least=(5e-3, 1e-4))

    errors, bounds = line.errors(300)

    assert (np.abs(errors) <= bounds + 2e-6).all()
    # Half of what the ways differ by: nothing that comes can tell it.
    assert np.median(errors[100:]) == pytest.approx(-2.45e-3, abs=0.5e-3)


def test_the_standard_deviation_is_that_of_anywhere_within_the_bound():
    line = Line()
    line.ping()

    assert line.clock.sd(10.0) == pytest.approx(line.clock.bound(10.0) / math.sqrt(3))


def test_a_delayed_answer_changes_nothing():
    line = Line(50e-6)
    line.errors(60)
    device = line.device(line.now)
    before = line.clock.taken(device), line.clock.bound(device)

    line.clock.exchange(line.now, device + 1e-4, device + 2e-4, line.now + 0.4)

    after = line.clock.taken(device), line.clock.bound(device)
    assert after == pytest.approx(before, abs=2e-5)
    assert line.clock.steps == 0


def test_without_pings_it_tells_the_latest_that_it_can_have_been():
    line = Line(50e-6)

    errors, bounds = line.errors(300, pings=False)

    assert np.isinf(bounds).all()
    assert np.isnan(line.clock.drift)
    assert np.isinf(line.clock.drift_bound)
    assert errors.min() > -1e-3
    assert np.median(errors) < 2e-3


@pytest.mark.parametrize("seed", range(5))
def test_no_message_is_told_to_be_made_after_it_came(seed):
    line = Line(50e-6, least=(1e-3, 1e-4), jitter=(2e-3, 1e-4), seed=seed)

    for n in range(2000):
        if n % 100 == 0:
            line.ping()
        line.now += 5e-3
        device, came = line.device(line.now), line.now + line.delay(1)
        line.clock.heard(device, came)
        assert line.clock.taken(device) < came + 3e-4


def test_a_message_that_came_sooner_than_an_answer_narrows_the_bound():
    line = Line(least=(5e-3, 5e-3), jitter=(0.0, 0.0))
    line.errors(100)
    before = line.clock.bound(line.device(line.now))
    line.least = (5e-3, 1e-4)

    line.errors(3, pings=False)

    assert line.clock.bound(line.device(line.now)) < 0.7 * before


def test_the_bound_grows_while_no_answer_comes():
    line = Line()
    line.errors(60)
    device = line.device(line.now)

    assert line.clock.bound(device + 1000) > line.clock.bound(device) + 4e-3


def test_nothing_is_known_before_anything_came():
    clock = ClockMap()

    assert math.isnan(clock.taken(1.0))
    assert math.isinf(clock.bound(1.0))
    assert math.isnan(clock.drift)


def test_a_counter_that_wraps_goes_on():
    clock = ClockMap()
    times = [4290.0, 4294.9, 0.1, 4294.95, 0.2, 2000.0, 4290.0, 3.0]

    unwrapped = [clock.unwrap(time) for time in times]

    expected = [4290, 4294.9, WRAP + 0.1, 4294.95, WRAP + 0.2, WRAP + 2000, WRAP + 4290]
    assert unwrapped == pytest.approx([*expected, 2 * WRAP + 3.0])


@pytest.mark.parametrize("before", [5000.0, 4000.0, 100.0])
def test_a_restart_is_no_wrap(before):
    clock = ClockMap()
    clock.unwrap(before)

    assert clock.unwrap(0.5) == 0.5


def test_garbage_between_is_no_wrap():
    clock = ClockMap()
    clock.unwrap(10.0)
    for garbage in (math.nan, math.inf, -3.0, 1e18):
        clock.unwrap(garbage)

    assert clock.unwrap(11.0) == 11.0


def test_a_wrapped_counter_keeps_its_map():
    line = Line(50e-6, started=START - 4200.0)
    for _ in range(200):
        line.now += 1.0
        came = line.now + line.delay(0)
        raw = line.device(came) % WRAP
        device = line.clock.unwrap(raw)
        line.clock.exchange(line.now, device, device, came + line.delay(1))

    device = line.device(line.now)
    assert device > WRAP
    assert line.clock.steps == 0
    assert abs(line.clock.taken(device) - line.now) <= line.clock.bound(device)


def test_a_restart_is_told_and_learnt_anew():
    line = Line(50e-6)
    line.errors(60)

    line.started = line.now + 2.0
    line.now += 4.0
    errors, bounds = line.errors(5)

    assert line.clock.steps == 1
    known = ~np.isnan(errors)
    assert known.sum() >= len(errors) - 1
    assert (np.abs(errors[known]) <= bounds[known] + 2e-6).all()


@pytest.mark.parametrize("pings", [True, False])
@pytest.mark.parametrize("step", [-3600.0, 3600.0, -5.0, 5.0])
def test_a_step_of_either_clock_is_told_and_learnt_anew(step, pings):
    line = Line(50e-6)
    line.errors(60, pings=pings)

    line.started += step  # the device goes on while the host's stands still, or the reverse
    errors, _ = line.errors(8, pings=pings)

    assert line.clock.steps == 1
    settled = errors[-8:]
    assert np.isfinite(settled).all()
    assert np.abs(settled).max() < 3e-3


def test_a_step_of_a_few_milliseconds_is_found_by_pings():
    line = Line()
    line.errors(60)

    line.started += 5e-3
    line.errors(3)

    assert line.clock.steps == 1


GARBAGE = st.sampled_from([math.nan, math.inf, -math.inf, -1.0, -1e18, 1e18, 1e300, 0.0, 5e12])


@given(st.lists(st.tuples(GARBAGE, GARBAGE, GARBAGE, GARBAGE), max_size=8))
def test_garbage_never_poisons_it(garbage):
    line = Line(50e-6)
    line.errors(5)
    for four in garbage:
        line.clock.exchange(*four)
        line.clock.heard(*four[:2])

    errors, bounds = line.errors(6)

    settled = slice(-4, None)
    assert (np.abs(errors[settled]) <= bounds[settled] + 2e-6).all()


@given(st.tuples(GARBAGE, GARBAGE, GARBAGE, GARBAGE))
def test_garbage_as_the_first_thing_is_forgotten(four):
    line = Line()
    line.clock.heard(*four[:2])
    line.clock.exchange(*four)

    errors, bounds = line.errors(6)

    settled = slice(-4, None)
    assert (np.abs(errors[settled]) <= bounds[settled] + 2e-6).all()


def test_one_wrong_message_among_good_ones_is_no_step():
    line = Line()
    line.errors(10)
    device = line.device(line.now)

    line.clock.heard(device + 500.0, line.now)
    doubted = line.clock.taken(device + 500.0)
    line.message()

    assert math.isnan(doubted)
    assert line.clock.steps == 0
    assert abs(line.clock.taken(device) - line.now) < 1e-3
