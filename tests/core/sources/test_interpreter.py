"""What messages mean, by what the device last said it is."""

from dataclasses import replace

import numpy as np
import pytest

from kappaskin import load_scene
from kappaskin.sources import Interpreter, sensor_to_json
from kappaskin.sources.clock import ClockMap
from kappaskin.sources.wire import Information, Reply, Samples

SENSOR = load_scene("centre").sensor()
TEXT = sensor_to_json(SENSOR)


def samples(*channels: int) -> Samples:
    chosen = np.array(channels, np.intp)
    return Samples(7, 2.5, chosen, np.arange(len(chosen), dtype=np.int32))


def taught(text: str = TEXT) -> Interpreter:
    means = Interpreter("loop://")
    assert means.learn(text)
    return means


def test_a_device_says_something_new_once_a_line() -> None:
    means = taught()
    first = means.sensor

    assert not means.learn(TEXT)

    means.begin(ClockMap())
    assert not means.known
    assert means.learn(TEXT)
    assert means.sensor is first  # the same device: it is not made again


def test_a_sensor_is_made_once_of_a_text_that_several_lines_share() -> None:
    made = {}
    first, second = Interpreter("a", made), Interpreter("b", made)
    first.learn(TEXT)
    second.learn(TEXT)
    assert first.sensor is second.sensor is made[TEXT]


def test_of_many_devices_only_the_last_few_are_remembered() -> None:
    made = {}
    for number in range(20):
        text = sensor_to_json(replace(SENSOR, name=f"hand {number}"))
        assert Interpreter("loop://", made).learn(text)
        assert text in made
        assert len(made) <= 8


def test_what_a_device_says_that_makes_no_sense_is_of_no_use_until_it_says_better() -> None:
    means = taught()

    assert not means.learn("{}")

    assert (means.sensor, means.known) == (None, False)
    assert means.unusable.startswith("loop://: ")
    assert means.frame(samples(0), 9.0) is None
    assert means.learn(TEXT)
    assert means.unusable == ""
    assert means.frame(samples(0), 9.0) is not None


def test_another_text_and_a_channel_that_is_not_there_are_of_another_device() -> None:
    means = taught()
    last = SENSOR.channels - 1

    assert means.is_of_another(Information(0, 0.0, TEXT + " "))
    assert not means.is_of_another(Information(0, 0.0, TEXT))
    assert means.is_of_another(samples(0, last + 1, 2))
    assert not means.is_of_another(samples(0, last, 2))
    assert not means.is_of_another(samples())
    assert not means.is_of_another(Reply(0, 0.0, 0, 8, 0, b""))


def test_before_a_device_says_what_it_is_nothing_is_of_another_and_no_frame_comes() -> None:
    means = Interpreter("loop://")
    assert not means.is_of_another(samples(60_000))
    assert means.frame(samples(0), 9.0) is None


def test_a_device_that_sends_what_it_says_it_has_not_gives_no_frame_any_more() -> None:
    means = taught()

    assert means.frame(samples(SENSOR.channels), 9.0) is None

    assert f"sends channel {SENSOR.channels} but reports {SENSOR.channels}" in means.unusable
    assert means.frame(samples(0), 9.0) is None


@pytest.mark.parametrize("wired", [None, np.roll(np.arange(SENSOR.channels), 5)])
def test_a_frame_has_the_numbers_that_its_channels_are_wired_to(wired) -> None:
    means = taught(sensor_to_json(replace(SENSOR, channel_map=wired)))

    frame = means.frame(samples(0, 5, 9), 9.0)

    assert frame is not None
    expected = [0, 5, 9] if wired is None else wired[[0, 5, 9]].tolist()
    assert frame.channels.tolist() == expected
    assert frame.counts.tolist() == [0, 1, 2]
    assert (frame.sequence, frame.device_time, frame.host_time) == (7, 2.5, 9.0)
