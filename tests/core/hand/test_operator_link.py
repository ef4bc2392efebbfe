"""The operator's process: by itself with a clock of the test, and as a process at 1 kHz."""

import math
import os
import signal
import socket
import threading
import time
from contextlib import closing

import numpy as np
import pytest

from kappaskin import Refusal
from kappaskin.hand import HandTarget, OperatorLink, OperatorSettings, TargetMessage
from kappaskin.hand.operation import decoded
from kappaskin.hand.operator_link import OperatorLoop

THERE = HandTarget((0.05, 0.0, 0.0), (0.0, 0.0, 0.4), 2.0)


class Clock:
    now = 100.0

    def __call__(self) -> float:
        return self.now


class Robot:
    """A port that keeps the messages it gets."""

    def __init__(self) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.setblocking(False)
        self.address = f"127.0.0.1:{self.socket.getsockname()[1]}"

    def messages(self) -> list[TargetMessage]:
        found = []
        while True:
            try:
                found.append(decoded(self.socket.recv(4096)))
            except BlockingIOError:
                return found


def free_address() -> str:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made:
        made.bind(("127.0.0.1", 0))
        return f"127.0.0.1:{made.getsockname()[1]}"


class Glove:
    """Sends targets to an address."""

    def __init__(self, address: str) -> None:
        host, port = address.split(":")
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect((host, int(port)))
        self.sequence = 0

    def send(self, target: HandTarget, time: float, enabled: bool = True) -> None:
        target = HandTarget(target.position, target.rotation, target.grip, time)
        self.socket.send(TargetMessage(target, enabled, 7, self.sequence).encoded())
        self.sequence += 1


@pytest.fixture
def robot():
    made = Robot()
    yield made
    made.socket.close()


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def loop(clock):
    with closing(OperatorLoop(HandTarget(), clock)) as made:
        yield made


def run(loop, clock, seconds, before=lambda: None) -> None:
    """Let so many seconds pass in steps of 4 ms, each after `before`."""
    for _ in range(round(seconds / 0.004)):
        clock.now += 0.004
        before()
        loop.step()


def test_targets_of_the_window_go_to_the_robot_within_limits(loop, clock, robot) -> None:
    settings = OperatorSettings(enabled=True, robot=robot.address)
    run(loop, clock, 0.5, lambda: loop.request(settings, THERE))
    came = robot.messages()
    assert len(came) == 125
    assert [message.sequence for message in came] == list(range(125))
    assert all(message.enabled for message in came)
    steps = np.diff([message.target.position[0] for message in came])
    assert np.all(steps <= 0.05 * 0.004 + 1e-12)
    assert came[-1].target.position[0] == pytest.approx(0.05 * 0.5, rel=0.2)
    assert came[-1].target.grip == 2.0


@pytest.mark.parametrize(
    ("settings", "wanted", "state"),
    [
        (OperatorSettings(), THERE, "off"),
        (OperatorSettings(enabled=True), None, "released"),
        (OperatorSettings(enabled=True, listen="127.0.0.1:0"), THERE, "waiting"),
    ],
)
def test_nothing_moves_unless_it_is_enabled_and_wanted(loop, clock, settings, wanted, state):
    run(loop, clock, 0.2, lambda: loop.request(settings, wanted))
    assert loop.status.state == state
    assert loop.status.target.position == (0.0, 0.0, 0.0)


def test_a_window_that_stops_asking_stops_the_hand(loop, clock, robot) -> None:
    settings = OperatorSettings(enabled=True, robot=robot.address)
    run(loop, clock, 0.2, lambda: loop.request(settings, THERE))
    run(loop, clock, 0.3)
    assert loop.status.state == "stale"
    came = robot.messages()
    assert not came[-1].enabled
    moved = [m.target.position[0] for m in came]
    assert moved[-1] == moved[-45] < 0.05 * 0.31
    assert came[-1].target.grip == 2.0  # what is held is not dropped


def test_messages_go_from_the_glove_to_the_robot_and_a_silent_glove_stops_it(loop, clock, robot):
    listen = free_address()
    settings = OperatorSettings(enabled=True, listen=listen, robot=robot.address)
    loop.request(settings, None)
    loop.step()
    glove = Glove(listen)
    with closing(glove.socket):
        run(loop, clock, 0.2, lambda: glove.send(THERE, clock.now))
        status = loop.status
        assert (status.received, status.refused, status.state) == (50, 0, "following")
        assert status.target.position[0] == pytest.approx(0.01, rel=0.1)
        assert 0 <= status.latency < 0.004
        run(loop, clock, 0.2)
        held = loop.status
        assert held.state == "stale"
        assert held.target.position[0] < status.target.position[0] + 0.05 * 0.105
        run(loop, clock, 0.1, lambda: glove.send(THERE, clock.now, enabled=False))
        assert loop.status.state == "released"
        assert loop.status.target.position == held.target.position
        loop.request(OperatorSettings(listen=listen, robot=robot.address), None)
        run(loop, clock, 0.1, lambda: glove.send(THERE, clock.now))
        assert loop.status.state == "off"
        assert loop.status.target.position == held.target.position
    assert not robot.messages()[-1].enabled


def test_the_robot_is_told_to_hold_still_at_the_end(clock, robot) -> None:
    loop = OperatorLoop(HandTarget(), clock)
    settings = OperatorSettings(enabled=True, robot=robot.address)
    run(loop, clock, 0.1, lambda: loop.request(settings, THERE))
    loop.close()
    came = robot.messages()
    assert came[-2].enabled
    assert not came[-1].enabled


def test_a_robot_that_does_not_listen_is_reported_and_found_again(loop, clock) -> None:
    settings = OperatorSettings(robot=free_address())
    run(loop, clock, 0.1, lambda: loop.request(settings, None))
    assert loop.status.dropped > 5
    assert "does not receive (Connection refused)" in loop.status.trouble
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as there:
        host, port = settings.robot.split(":")
        there.bind((host, int(port)))
        run(loop, clock, 2.0)
        assert loop.status.trouble == ""


@pytest.mark.parametrize("address", ["nowhere", "127.0.0.1", "127.0.0.1:99999", ":9", "a b:9"])
def test_an_address_that_is_none_is_refused(loop, clock, address) -> None:
    run(loop, clock, 0.05, lambda: loop.request(OperatorSettings(robot=address), None))
    assert (
        loop.status.trouble.startswith("expected HOST:PORT") or "cannot be" in loop.status.trouble
    )


def test_a_port_that_is_taken_is_reported_and_tried_again(loop, clock) -> None:
    listen = free_address()
    host, port = listen.split(":")
    settings = OperatorSettings(listen=listen)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind((host, int(port)))
        run(loop, clock, 0.1, lambda: loop.request(settings, None))
        assert "is not available" in loop.status.trouble
    run(loop, clock, 1.2, lambda: loop.request(settings, None))
    assert loop.status.trouble == ""


# As a process


def until(link: OperatorLink, settings: OperatorSettings, holds, wanted=None):
    end = time.monotonic() + 60
    while not holds(status := link.request(settings, wanted)):
        assert time.monotonic() < end, status
        time.sleep(0.004)
    return status


@pytest.mark.slow
def test_a_thousand_targets_a_second_pass_by_the_window(robot) -> None:
    listen = free_address()
    settings = OperatorSettings(enabled=True, listen=listen, robot=robot.address)
    with closing(OperatorLink()) as link:
        until(link, settings, lambda status: status.sent)  # then it listens, too
        glove, ends = Glove(listen), threading.Event()

        def send() -> None:
            due = time.monotonic()
            while not ends.is_set():
                glove.send(THERE, time.monotonic())
                due += 0.001
                time.sleep(max(0.0, due - time.monotonic()))

        sender = threading.Thread(target=send)
        sender.start()
        time.sleep(2.0)  # nobody asks for the status meanwhile, as in a window that draws
        ends.set()
        sender.join()
        glove.socket.close()
        status = until(link, settings, lambda s: s.received + s.late + s.refused == glove.sequence)
    assert (status.refused, status.late) == (0, 0)
    assert status.received > 1000
    assert status.sent > 1000
    assert status.latency < 0.05  # on a busy machine; a benchmark says how long it takes


@pytest.mark.slow
def test_a_process_that_dies_is_reported() -> None:
    with closing(OperatorLink(THERE)) as link:
        assert until(link, OperatorSettings(), lambda s: s.target.time).target.grip == 2.0
        os.kill(link.process.pid, signal.SIGKILL)
        with pytest.raises(Refusal, match="ended unexpectedly"):
            until(link, OperatorSettings(), lambda _: False)


@pytest.mark.slow
def test_a_process_that_hangs_does_not_hold_up_the_window() -> None:
    link = OperatorLink()
    os.kill(link.process.pid, signal.SIGSTOP)
    began = time.monotonic()
    for _ in range(1000):
        link.request(OperatorSettings(), None)
    assert time.monotonic() - began < 5.0
    os.kill(link.process.pid, signal.SIGCONT)
    link.close()


def test_the_loop_takes_far_more_targets_than_it_sends(loop, clock, robot) -> None:
    listen = free_address()
    settings = OperatorSettings(enabled=True, listen=listen, robot=robot.address)
    loop.request(settings, None)
    loop.step()
    glove = Glove(listen)
    with closing(glove.socket):
        for number in range(200):  # 10,000 a second: the newest of them is sent
            clock.now += 0.0001
            glove.send(THERE, clock.now)
            if number % 2:
                loop.step()
    assert loop.status.received == 200
    assert 33 <= len(robot.messages()) <= 42
    assert math.isfinite(loop.status.latency)
