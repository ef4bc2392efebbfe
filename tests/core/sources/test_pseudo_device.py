"""The simulated sensor on a pseudo-terminal: what it spends, others receive or count as lost."""

import json
import os
import signal
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from kappaskin import Estimate, Frame, Refusal, Simulator, load_scene
from kappaskin.live import LOST, STREAMING, Engine, Status
from kappaskin.scenes import Orbit
from kappaskin.scenes.effects import CorruptedFrames, DroppedFrames
from kappaskin.sources import Decoder, SerialSource
from kappaskin.sources.wire import (
    Fault,
    Information,
    Message,
    Operation,
    Reply,
    Samples,
    encode_command,
    pack_runs,
)

pytest.importorskip("pty", reason="no pseudo-terminals on this system")
from kappaskin.sources import PseudoDevice

pytestmark = pytest.mark.slow

SCENE = load_scene("circle")
MOTION = Orbit(0.022, 4.0)


def wait_for(ask: Callable[[], Any], within: float = 30.0) -> Any:
    """The first answer that is true, or the last one."""
    end = time.monotonic() + within
    while not (answer := ask()) and time.monotonic() < end:
        time.sleep(0.005)
    return answer


@contextmanager
def serving(device: PseudoDevice) -> Iterator[None]:
    stop = threading.Event()
    thread = threading.Thread(target=device.serve, args=(stop.is_set,))
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join(30.0)
        assert not thread.is_alive(), "the device blocks"
        device.close()


def listened(port: str, count: int, within: float = 30.0) -> tuple[SerialSource, list[Frame]]:
    """`count` frames or more of a source that is closed by now, and the source."""
    source, frames = SerialSource(port), list[Frame]()
    end = time.monotonic() + within
    while len(frames) < count and time.monotonic() < end:
        frames += source.read(0.02)
    source.close()
    return source, frames


class Listener:
    """The other end of the line, which reads only when told to."""

    def __init__(self, port: str) -> None:
        self._line = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        self.decoder, self._asked = Decoder(), 0

    def reads(self, spent: int, within: float = 30.0) -> list[Message]:
        """What comes until `spent` numbers are accounted for."""
        messages: list[Message] = []
        end = time.monotonic() + within
        while self.decoder.sequence.span < spent and time.monotonic() < end:
            try:
                messages += self.decoder.feed(os.read(self._line, 65536))
            except BlockingIOError:
                time.sleep(0.001)
        return messages

    def takes_in(self, kind: type[Message], messages: Sequence[Message] = ()) -> Message:
        """The newest of a kind in `messages`, or the first to come."""
        found = [message for message in messages if isinstance(message, kind)]
        end = time.monotonic() + 30.0
        while not found and time.monotonic() < end:
            found = [m for m in self.reads(10**9, within=0.02) if isinstance(m, kind)]
        assert found, f"no {kind.__name__} came"
        return found[-1]

    def asks(self, operation: int, arguments: bytes = b"") -> tuple[Reply, list[Message]]:
        """The reply to a command, and what came with it."""
        self._asked += 1
        os.write(self._line, encode_command(self._asked, 0.0, operation, arguments))
        messages: list[Message] = []
        end = time.monotonic() + 30.0
        while time.monotonic() < end:
            with suppress(BlockingIOError):
                messages += self.decoder.feed(os.read(self._line, 65536))
            for message in messages:
                if isinstance(message, Reply) and message.command == self._asked:
                    return message, messages
            time.sleep(0.001)
        pytest.fail("no reply came")

    def takes(self, count: int) -> list[Samples]:
        """The next `count` scans."""
        scans: list[Samples] = []
        end = time.monotonic() + 30.0
        while len(scans) < count and time.monotonic() < end:
            with suppress(BlockingIOError):
                came = self.decoder.feed(os.read(self._line, 65536))
                scans += [message for message in came if isinstance(message, Samples)]
        return scans

    def close(self) -> None:
        os.close(self._line)


class Clock:
    """Device time, which moves when told to."""

    now = 7.0

    def __call__(self) -> float:
        return self.now


# In this process


def test_every_number_spent_is_received() -> None:
    clock = Clock()
    device = PseudoDevice(SCENE, clock)
    listener = Listener(device.port)
    with serving(device):
        listener.reads(2)
        for _ in range(16):  # a second, in steps that a clock in binary does not round
            clock.now += 1 / 16
            listener.reads(listener.decoder.sequence.span + 31)
        listener.reads(504)
    listener.close()

    seen = listener.decoder.accounting()
    # A second of frames, its first and last included, and an introduction every half of it.
    assert device.spent == seen.span == seen.accepted == 501 + 3
    assert (seen.bytes_discarded, seen.buffered, device.unsent, device.samples) == (0, 0, 0, 501)


@pytest.mark.full
def test_a_link_that_fails_spoils_messages_which_the_receiver_tells() -> None:
    clock = Clock()
    device = PseudoDevice(replace(SCENE, effects=(DroppedFrames(0.1), CorruptedFrames(0.2))), clock)
    listener = Listener(device.port)
    with serving(device):
        for step in range(17):
            clock.now = 7.0 + step / 16
            assert wait_for(lambda due=1 + 500 * step // 16: device.samples == due)
            listener.reads(10**9, within=0.1)
    listener.close()

    seen = listener.decoder.accounting()
    spoilt = sum(count for reason, count in seen.discarded if count)
    assert device.spent == 504
    assert seen.accepted + seen.lost == seen.span
    assert 0.2 < seen.lost / seen.span < 0.36
    assert spoilt > 0
    assert seen.bytes_in == seen.bytes_good + seen.bytes_discarded + seen.buffered


@pytest.mark.full
def test_a_listener_that_never_reads_holds_nothing_up_and_finds_out_what_it_lost() -> None:
    clock = Clock()
    device = PseudoDevice(SCENE, clock)
    listener = Listener(device.port)
    with serving(device):
        assert wait_for(lambda: device.spent == 2)
        for second in range(1, 9):
            clock.now += 1.0
            assert wait_for(lambda due=2 + 501 * second: device.spent == due)
        unsent = device.unsent
        assert unsent > 100

        listener.reads(device.spent - unsent)
        clock.now += 0.05
        listener.reads(device.spent + 25)

        seen = listener.decoder.accounting()
        assert seen.lost == unsent == device.unsent
        assert seen.span == device.spent
        assert seen.bytes_discarded == 0
    listener.close()


def test_at_its_end_it_sends_what_is_in_the_outbox_to_who_takes_it(monkeypatch) -> None:
    monkeypatch.setattr("kappaskin.sources.pseudo_device._PATIENCE", 30.0)
    clock = Clock()
    device = PseudoDevice(SCENE, clock)
    listener = Listener(device.port)
    stop = threading.Event()
    thread = threading.Thread(target=device.serve, args=(stop.is_set,))
    thread.start()
    assert wait_for(lambda: device.spent == 2)
    clock.now += 0.5  # more than a terminal holds, less than the outbox
    assert wait_for(lambda: device.spent >= 252)
    stop.set()
    time.sleep(0.2)
    listener.reads(device.spent)
    thread.join(30.0)
    assert not thread.is_alive()
    device.close()
    listener.close()
    assert device.unsent == 0
    assert listener.decoder.accounting().span == device.spent


def test_a_listener_that_is_late_has_all_of_it_before_the_port_is_closed(monkeypatch) -> None:
    monkeypatch.setattr("kappaskin.sources.pseudo_device._PATIENCE", 30.0)
    device = PseudoDevice(replace(SCENE, rate=20.0))
    listener = Listener(device.port)
    stop = threading.Event()
    thread = threading.Thread(target=device.serve, args=(stop.is_set,))
    thread.start()
    wait_for(lambda: device.spent >= 3)
    stop.set()
    thread.join(30.0)
    closing = threading.Thread(target=device.close)
    closing.start()
    time.sleep(0.6)
    messages = listener.reads(device.spent)
    closing.join()
    listener.close()
    assert len(messages) == device.spent
    assert device.unsent == 0


def test_the_bytes_carry_the_simulation_unchanged() -> None:
    device = PseudoDevice(replace(SCENE, seed=5))
    with serving(device):
        source, frames = listened(device.port, 50)

    simulator = Simulator(replace(SCENE, seed=5))
    last = round(frames[-1].device_time * 500)
    made = [simulator.frame(n, time.monotonic) for n in range(last + 1)]
    for frame in frames:
        twin = made[round(frame.device_time * 500)]
        assert np.array_equal(frame.counts, twin.counts)
        assert np.array_equal(frame.channels, twin.channels)
        assert frame.truth is None
    assert source.sensor is not None
    assert source.sensor.name == SCENE.sensor().name
    assert len(frames) >= 50


def test_it_keeps_its_rate() -> None:
    device = PseudoDevice(replace(SCENE, rate=200.0))
    with serving(device):
        source, late = SerialSource(device.port), list[float]()

        def on_time() -> bool:
            for frame in source.read(0.02):
                begun = device._start  # noqa: SLF001
                late.append(frame.host_time - begun - len(late) / 200)
            return len(late) >= 100 and late[-1] < 0.1

        assert wait_for(on_time)  # again, where the machine stood still
        source.close()
    assert min(late) > -1e-3


def stands_still(device: PseudoDevice) -> int:
    """How many numbers it has spent, once it spends no more for a while."""

    def still() -> int | None:
        spent = device.spent
        time.sleep(0.2)
        return spent if device.spent == spent else None

    spent = wait_for(still)
    assert spent is not None, "it goes on"
    return spent


def test_without_a_listener_it_spends_nothing() -> None:
    device = PseudoDevice(SCENE)
    with serving(device):
        time.sleep(0.2)
        assert device.spent == 0
        listened(device.port, 20)
        assert stands_still(device) > 0


def test_a_second_listener_is_introduced_and_served() -> None:
    device = PseudoDevice(SCENE)
    with serving(device):
        _, first = listened(device.port, 20)
        spent = stands_still(device)  # or it may not see that nobody listened
        made = device.samples
        source, second = listened(device.port, 20)

    assert len(second) >= 20
    # Opening a line discards what came before: of the first frames some, of the clock nothing. It
    # stood still for 100 frames at least.
    number = second[0].device_time * SCENE.rate
    assert number == pytest.approx(round(number), abs=1e-5 * SCENE.rate)
    assert made <= round(number) < made + 50
    assert first[-1].sequence < spent < second[0].sequence
    assert source.accounting().lost == 0
    assert source.accounting().bytes_discarded == 0


def test_what_one_listener_leaves_unread_is_not_the_nexts() -> None:
    device = PseudoDevice(SCENE)
    with serving(device):
        first = os.open(device.port, os.O_RDWR | os.O_NOCTTY)
        assert len(os.read(first, 100)) <= 100  # of its introduction
        os.close(first)
        stands_still(device)

        second = Listener(device.port)
        second.takes_in(Information)
        assert second.takes(3)
        second.close()

    seen = second.decoder.accounting()
    assert (seen.bytes_discarded, seen.lost) == (0, 0)


def test_the_first_commands_of_a_second_host_are_no_repetitions_of_the_firsts() -> None:
    device = PseudoDevice(SCENE)
    with serving(device):
        for _ in range(2):
            source = SerialSource(device.port)
            known = wait_for(lambda: [f for f in source.read(0.02) if f.taken_sd < 0.1])  # noqa: B023
            source.close()  # so shortly that it may not see that nobody listens
            assert known  # by the answer to a ping


def test_a_rate_that_no_converter_keeps_is_refused_and_leaves_no_descriptor() -> None:
    before = os.listdir("/dev/fd")
    with pytest.raises(Refusal, match=r"at most 666.7 frames/s, got 5000"):
        PseudoDevice(replace(SCENE, rate=5000.0))
    assert os.listdir("/dev/fd") == before


# What a host asks for


@pytest.fixture
def asked() -> Iterator[Listener]:
    """A listener at a device that obeys, and has room for seconds in which nobody listens."""
    device = PseudoDevice(replace(SCENE, rate=100.0))
    listener = Listener(device.port)
    with serving(device):
        yield listener
        listener.close()


def test_it_speaks_a_version_that_both_know_or_refuses(asked: Listener) -> None:
    assert asked.asks(Operation.HELLO, b"\1\3")[0].data == b"\1"
    refused, _ = asked.asks(Operation.HELLO, b"\2\3")
    assert (refused.fault, refused.reason) == (Fault.NO_COMMON_VERSION, "this device speaks 1")


def test_it_stops_and_starts(asked: Listener) -> None:
    asked.asks(Operation.STOP)
    asked.reads(10**9, within=0.3)  # what was under way
    assert wait_for(lambda: not any(isinstance(m, Samples) for m in asked.reads(10**9, 0.3)), 5.0)
    asked.asks(Operation.START)
    assert len(asked.takes(10)) >= 10
    assert asked.decoder.accounting().lost == 0


def test_it_scans_the_channels_asked_for_and_all_for_none(asked: Listener) -> None:
    asked.asks(Operation.SCAN_LIST, pack_runs([7, 3, 4, 5]))
    assert asked.takes(5)[-1].channels.tolist() == [7, 3, 4, 5]
    for wrong in ([300], [3, 4, 3]):
        assert asked.asks(Operation.SCAN_LIST, pack_runs(wrong))[0].fault == Fault.OUT_OF_RANGE
    assert asked.takes(5)[-1].channels.tolist() == [7, 3, 4, 5]
    asked.asks(Operation.SCAN_LIST, pack_runs([]))
    assert len(asked.takes(5)[-1].channels) == 300


def test_it_goes_at_the_rate_asked_for_if_it_can(asked: Listener) -> None:
    reply, _ = asked.asks(Operation.RATE, struct.pack("<I", 200_000))
    assert reply.data == struct.pack("<I", 200_000)
    times = [scan.time for scan in asked.takes(12)][-8:]
    assert np.diff(times) == pytest.approx(0.005, abs=1e-5)
    for wrong in (0, 900_000):
        refused, _ = asked.asks(Operation.RATE, struct.pack("<I", wrong))
        assert refused.fault == Fault.OUT_OF_RANGE
        assert "at most 666.7 frames/s" in refused.reason


def test_another_gain_is_told_at_once_and_changes_the_counts(asked: Listener) -> None:
    before = asked.takes(1)[-1].counts
    _, with_it = asked.asks(Operation.GAIN, struct.pack("<I", 50_000))
    told = asked.takes_in(Information, with_it)
    assert json.loads(told.text)["amplifier"]["gain"] == 50
    after = asked.takes(1)[-1].counts
    assert np.abs(after).max() < 0.7 * np.abs(before).max()
    assert asked.asks(Operation.GAIN, struct.pack("<I", 0))[0].fault == Fault.OUT_OF_RANGE


def test_it_introduces_itself_when_asked(asked: Listener) -> None:
    asked.takes(1)
    _, with_it = asked.asks(Operation.IDENTIFY)
    asked.takes_in(Information, with_it)


def test_a_ping_is_answered_with_the_time_it_came(asked: Listener) -> None:
    began = time.monotonic()
    reply, _ = asked.asks(Operation.PING)
    received_us, hundredths = struct.unpack("<Qh", reply.data)
    assert 0 <= reply.time - received_us * 1e-6 < time.monotonic() - began
    assert hundredths == -(2**15)  # this skin does not say how warm it is


@pytest.mark.parametrize(
    ("operation", "arguments", "fault"),
    [
        (99, b"", Fault.UNKNOWN_OPERATION),
        (Operation.HELLO, b"\1", Fault.WRONG_LENGTH),
        (Operation.START, b"\0", Fault.WRONG_LENGTH),
        (Operation.PING, b"\0", Fault.WRONG_LENGTH),
        (Operation.RATE, b"\0", Fault.WRONG_LENGTH),
        (Operation.SCAN_LIST, b"\2\0\0", Fault.WRONG_LENGTH),
    ],
)
def test_what_is_no_command_is_refused_with_the_reason(asked, operation, arguments, fault) -> None:
    reply, _ = asked.asks(operation, arguments)
    assert reply.fault == fault
    assert reply.reason


# As a process of its own


class Device:
    """`kappaskin device`, and the port that it told."""

    def __init__(self, *arguments: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "kappaskin", "device", *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert self.process.stdout is not None
        self.said = json.loads(self.process.stdout.readline())
        self.port: str = self.said["port"]

    def end(self, how: signal.Signals = signal.SIGTERM) -> tuple[int, str, str]:
        """Exit code, and what else was written on standard output and error."""
        self.process.send_signal(how)
        out, err = self.process.communicate(timeout=30)
        return self.process.returncode, out, err


@pytest.fixture
def device(request) -> Iterator[Device]:
    made = Device("circle", "--rate", str(getattr(request, "param", 500)))
    yield made
    made.process.kill()
    made.process.communicate()


@pytest.mark.parametrize("device", [50], indirect=True)
def test_the_command_tells_its_port_and_reports_what_it_spent(device) -> None:
    assert device.said == {"port": device.port, "rate": 50.0}
    assert os.path.exists(device.port)
    _, frames = listened(device.port, 20)

    code, out, err = device.end()

    assert (code, out) == (0, "")
    report = json.loads(err)
    assert report.keys() == {"spent", "unsent"}
    assert report["unsent"] == 0
    assert report["spent"] > frames[-1].sequence


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGINT])
def test_the_command_ends_at_once_when_told_with_a_listener_or_without(how) -> None:
    device = Device()
    assert device.said["rate"] == SCENE.rate
    assert device.end(how) == (0, "", '{"spent": 0, "unsent": 0}\n')


def contact_at(time: float) -> np.ndarray:
    pose = MOTION.at(time)
    return np.array([0.05 + pose.dx, 0.05 + pose.dy])


def test_an_engine_on_a_real_port_loses_nothing_and_follows_the_contact(device) -> None:
    estimates: dict[int, Estimate] = {}
    with Engine() as engine:
        engine.connect(device.port)
        assert wait_for(lambda: engine.status().state == STREAMING), engine.status().message
        end = time.monotonic() + 3.2

        def watched() -> Status | None:
            status = engine.status()
            if estimate := engine.latest(status):
                estimates[estimate.sequence] = estimate
            as_asked = status.rate == pytest.approx(500, rel=0.4)  # the machine may be busy
            long = time.monotonic() > end and status.accounting.span > 3 * 500
            return status if long and as_asked and len(estimates) > 100 else None

        status = wait_for(watched)
        assert status, engine.status()
        code, _, err = device.end()
        after = wait_for(lambda: (found := engine.status()).state == LOST and found)

    report, seen = json.loads(err), after.accounting
    errors = [
        np.hypot(*(e.contact.position - contact_at(e.device_time))) for e in estimates.values()
    ]
    close = np.mean(np.array(errors) < 1e-3)
    print(
        f"rate {status.rate:.1f}/s, reader gap {status.reader_gap * 1e3:.1f} ms; {report}; {seen}; "
        f"{len(errors)} contacts, {close:.2%} within 1 mm, median {np.median(errors) * 1e3:.2f} mm"
    )
    assert code == 0
    assert (seen.lost, seen.duplicate, seen.restarts, report["unsent"]) == (0, 0, 0, 0)
    assert seen.bytes_in == seen.bytes_good + seen.bytes_discarded + seen.buffered
    # What is under way when either end starts or stops is all that may be missing.
    assert 0 <= report["spent"] - seen.span < 30
    assert close > 0.98
    assert all(np.isnan(e.true_contact).all() for e in estimates.values())


@pytest.mark.full
def test_a_killed_device_is_lost_within_a_second_and_another_can_take_over(device) -> None:
    with Engine() as engine:
        engine.connect(device.port)
        assert wait_for(lambda: engine.status().state == STREAMING)
        device.process.kill()
        killed = time.monotonic()

        status = wait_for(lambda: (found := engine.status()).state == LOST and found, within=3.0)

        assert time.monotonic() - killed < 1.0
        assert "connection lost" in status.message
        assert status.accounting.accepted > 0
        other = Device("circle")
        engine.connect(other.port)
        assert wait_for(lambda: engine.status().state == STREAMING)
        other.end()
