"""A scanner's choice to commands: which, when, again, and what a device that refuses is told of."""

import struct
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin import Region, load_scene
from kappaskin.estimation import Scanner
from kappaskin.sources.commands import ScanControl, in_few_runs
from kappaskin.sources.wire import MOST_RUNS, Fault, Operation, Reply, pack_runs, unpack_runs

SENSOR = load_scene("centre").sensor()
BY_HAND = Region("elements", elements=(3, 4), share=0.0)
NUMBERS = [3, 4, 103, 104, 203, 204]


class Device:
    """Notes what it is asked for, and answers when it is told to."""

    def __init__(self, scanning, sensor=SENSOR):
        self.scanning, self.sensor = scanning, sensor
        self.asked = []
        self.faults = {}

    def ask(self, operation, now, arguments=b""):
        self.asked.append((now, operation, arguments))
        return len(self.asked)

    def run(self, start, end, answers=True):
        """Let time go by in steps of 1 ms; what was asked for meanwhile."""
        before = len(self.asked)
        for now in np.arange(start, end, 1e-3):
            count = len(self.asked)
            self.scanning.attend(now, self.sensor, self.ask)
            for number in range(count + 1, len(self.asked) + 1):
                if answers:
                    self.answer(number)
        return self.asked[before:]

    def answer(self, number):
        operation = self.asked[number - 1][1]
        fault = self.faults.get(operation, Fault.NONE)
        self.scanning.take(Reply(0, 0.0, number, operation, fault, b"no, thanks"))


def lists(asked):
    return [unpack_runs(how).tolist() for _, what, how in asked if what == Operation.SCAN_LIST]


def rates(asked):
    return [struct.unpack("<I", how)[0] for _, what, how in asked if what == Operation.RATE]


def device(region=BY_HAND, sensor=SENSOR):
    made = Device(ScanControl(), sensor)
    made.scanning.scan(Scanner(sensor, region))
    return made


def test_a_device_of_which_nothing_is_asked_is_told_nothing():
    quiet = Device(ScanControl())
    assert quiet.run(0, 3) == []
    quiet.scanning.scan(None)
    assert quiet.run(3, 6) == []


def test_a_region_by_hand_is_asked_for_once_with_its_rate():
    asked = device(replace(BY_HAND, rate=1234.5678)).run(0, 3)
    assert lists(asked) == [NUMBERS]
    assert rates(asked) == [1234567]  # frames per 1000 s, not above what was asked for


def test_the_rate_is_what_the_scan_allows():
    few = SENSOR.scan(NUMBERS)
    assert rates(device(replace(BY_HAND, rate=1e9)).run(0, 1)) == [int(few.rate * 1000)]


def test_elements_in_turn_are_asked_for_twenty_times_a_second_at_most():
    asked = device(replace(BY_HAND, share=0.1)).run(0, 2)
    times = [now for now, what, _ in asked if what == Operation.SCAN_LIST]
    assert 35 < len(times) <= 40
    assert np.diff(times).min() > 0.0499
    others = {number for chosen in lists(asked) for number in chosen}
    assert others == set(range(300))


def test_the_channels_of_the_wire_are_asked_for_not_the_readings():
    wired = np.random.default_rng(1).permutation(300)
    asked = device(sensor=replace(SENSOR, channel_map=wired)).run(0, 1)
    (chosen,) = lists(asked)
    assert sorted(wired[chosen]) == NUMBERS


def test_off_everything_is_asked_for_at_the_devices_own_rate():
    told = device(replace(BY_HAND, rate=321))
    told.run(0, 1)
    told.scanning.scan(None)
    asked = told.run(1, 3)
    assert lists(asked) == [[]]
    assert rates(asked) == [int(SENSOR.rate * 1000)]


def test_of_list_and_rate_the_one_that_lessens_the_work_comes_first():
    slow = replace(SENSOR, rate=100.0)
    told = device(sensor=slow)
    assert [what for _, what, _ in told.run(0, 1)] == [Operation.SCAN_LIST, Operation.RATE]
    told.scanning.scan(None)
    assert [what for _, what, _ in told.run(1, 2)] == [Operation.RATE, Operation.SCAN_LIST]


def test_what_is_not_answered_is_asked_for_again_each_half_second():
    told = device()
    asked = told.run(0, 1.4, answers=False)
    assert lists(asked) == [NUMBERS] * 3
    assert len(rates(asked)) == 3
    assert np.diff(sorted({now for now, _, _ in asked})) == pytest.approx([0.5, 0.5], abs=2e-3)
    told.answer(5)
    told.answer(6)
    assert told.run(1.4, 3) == []
    assert told.scanning.refusal == ""


def test_a_device_that_answers_nothing_is_told_of_after_two_seconds_until_it_does():
    told = device()
    told.run(0, 1.9, answers=False)
    assert told.scanning.refusal == ""
    told.run(1.9, 2.6, answers=False)
    assert "got no reply" in told.scanning.refusal
    told.run(2.6, 3.2)
    assert told.scanning.refusal == ""


def test_what_a_dead_device_was_asked_for_is_taken_back_when_the_region_is_off():
    told = device()
    told.run(0, 1, answers=False)
    told.scanning.scan(None)
    assert lists(told.run(1, 1.4)) == [[]]  # it may have heard the question
    assert told.scanning.refusal == ""


def test_a_device_that_refuses_the_list_is_asked_no_more_until_something_else_is_wanted():
    told = device(replace(BY_HAND, share=0.1))
    told.faults = {Operation.SCAN_LIST: Fault.UNKNOWN_OPERATION}
    assert len(lists(told.run(0, 3))) == 1
    assert told.scanning.refusal == "the device refused the scan list: no, thanks"
    told.faults = {}
    told.scanning.scan(Scanner(SENSOR, BY_HAND))
    assert lists(told.run(3, 4)) == [NUMBERS]
    assert told.scanning.refusal == ""


def test_a_device_that_keeps_its_rate_scans_the_region_all_the_same():
    told = device(replace(BY_HAND, share=0.1))
    told.faults = {Operation.RATE: Fault.UNKNOWN_OPERATION}
    asked = told.run(0, 1)
    assert len(rates(asked)) == 1
    assert len(lists(asked)) > 15
    assert told.scanning.refusal == ""


def test_a_device_that_began_anew_is_told_again():
    told = device()
    told.run(0, 1)
    told.scanning.begin()
    asked = told.run(1, 2)
    assert (lists(asked), len(rates(asked))) == ([NUMBERS], 1)


@given(
    st.sets(st.integers(0, 2999), min_size=1, max_size=50),
    st.integers(1, 5),
)
def test_any_channels_fit_into_one_list_with_few_others_besides(some, spread):
    comb = np.arange(0, 3000 * spread, 2 * spread)  # as many runs as channels
    chosen = np.random.default_rng(0).permutation(np.union1d(comb, list(some)))
    listed = in_few_runs(chosen)
    assert np.isin(chosen, listed).all()
    assert (np.diff(listed) > 0).all()
    runs = 1 + np.count_nonzero(np.diff(listed) > 1)
    assert runs <= MOST_RUNS
    assert unpack_runs(pack_runs(listed)).tolist() == listed.tolist()


def test_of_the_gaps_the_smallest_are_filled():
    pairs = np.arange(400) * 100
    listed = in_few_runs(np.concatenate([pairs, pairs + 3]))
    # All 400 of 2 channels, and of 399 of 96 as many as leave the others to part 255 runs.
    assert len(listed) == 800 + 400 * 2 + (399 - 254) * 96
    few = np.arange(0, 200, 2)
    assert in_few_runs(few[::-1]).tolist() == few.tolist()
