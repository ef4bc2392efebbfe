"""A line that goes and comes back: who is there now, what was lost, and what the line is asked."""

import gc
import itertools
import json
import os
import random
import select
import struct
import threading
import time
from contextlib import closing, suppress
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from kappaskin import Pipeline, Setup, SourceError, load_scene
from kappaskin.live.recorder import LiveRecorder
from kappaskin.recording import Recording
from kappaskin.recording.recompute import Recomputation
from kappaskin.sources import (
    BAUD_RATES,
    Decoder,
    Port,
    SerialSource,
    information,
    serial_source,
)
from kappaskin.sources.decoder import FROM_HOST
from kappaskin.sources.wire import Operation, encode_information, encode_reply, encode_samples

pytestmark = pytest.mark.slow

pty = pytest.importorskip("pty", reason="no pseudo-terminals on this system")
termios, tty = map(pytest.importorskip, ("termios", "tty"))
SPEEDS = {getattr(termios, f"B{rate}", None): rate for rate in BAUD_RATES}

SENSOR = load_scene("centre").sensor()
TEXT = information.sensor_to_json(SENSOR)
CHANNELS = np.arange(12)
PERIOD = 0.002  # s from one scan to the next


def text_of(**said):
    return json.dumps({**json.loads(TEXT), **said})


def scan(sequence, time=None):
    counts = np.full(len(CHANNELS), sequence % 1000, np.int32)
    when = sequence * PERIOD if time is None else time
    return encode_samples(sequence, when, CHANNELS, counts, 2)


def stream(first, last):
    return b"".join(scan(sequence) for sequence in range(first, last))


class Device:
    """A scripted device behind a port whose name stays; asks nothing, says what it is told to."""

    def __init__(self, link: Path):
        self.link = link
        self._master, slave = pty.openpty()
        tty.setraw(slave)
        os.set_blocking(self._master, False)
        self._name = os.ttyname(slave)
        os.close(slave)
        self._decoder = Decoder(FROM_HOST)
        link.symlink_to(self._name)

    def say(self, data):
        while data:
            select.select([], [self._master], [])
            data = data[os.write(self._master, data[:1024]) :]

    def heard(self):
        """The commands since this was last asked."""
        with suppress(OSError):  # nothing was said, or nobody is there
            return self._decoder.feed(os.read(self._master, 65536))
        return []

    def baud_rate(self):
        return SPEEDS.get(termios.tcgetattr(self._master)[4])

    def drops_lines_on_closing(self):
        return bool(termios.tcgetattr(self._master)[2] & termios.HUPCL)

    def pull(self):
        if self._master >= 0:
            os.close(self._master)
            self.link.unlink()
        self._master = -1


@pytest.fixture(autouse=True)
def soon(monkeypatch):
    monkeypatch.setattr(serial_source, "_RETRY", 0.02)


@pytest.fixture
def plug(tmp_path):
    """Plugs devices into ports named in this test."""
    made = []

    def plug(name="ttyACM0"):
        made.append(Device(tmp_path / name))
        return made[-1]

    yield plug
    for device in made:
        device.pull()


@pytest.fixture
def opened():
    sources = []

    def open_one(device, clock=time.monotonic):
        sources.append(SerialSource(str(device.link), clock))
        return sources[-1]

    yield open_one
    for source in sources:
        source.close()


class Reader:
    """What a source gave and said so far."""

    def __init__(self, source):
        self.source, self.frames, self.events = source, [], []

    def until(self, holds, within=30.0):
        end = time.monotonic() + within
        while not holds():
            assert time.monotonic() < end, (self.source.trouble, self.events)
            self.frames += self.source.read(0.02)
            self.events += self.source.events()
        return self

    def took(self, sequence):
        return self.until(lambda: self.frames and self.frames[-1].sequence == sequence)

    def told(self, kind):
        self.until(lambda: kind in self.kinds())
        return next(event.text for event in self.events[::-1] if event.kind == kind)

    def kinds(self):
        return [event.kind for event in self.events]


@pytest.fixture
def streaming(plug, opened):
    """A device that sent sequence numbers 0 to 10, and who read them."""
    device = plug()
    reader = Reader(opened(device))
    device.say(encode_information(0, 0.0, TEXT) + stream(1, 11))
    return device, reader.took(10)


def pull(device, reader):
    before = reader.kinds().count("gone")
    device.pull()
    reader.until(lambda: reader.kinds().count("gone") > before)
    assert "plug it in to continue" in reader.source.trouble


def put_back(plug, reader, name="ttyACM0"):
    """A device on the port, once it was heard: what is said before it is opened goes unheard."""
    device = plug(name)
    reader.until(device.heard)
    return device


# Who comes back


def test_the_same_device_goes_on_and_the_gap_is_counted_not_filled(streaming, plug):
    device, reader = streaming
    sensor = reader.source.sensor
    pull(device, reader)
    reader.until(lambda: "no such port" in reader.source.trouble)
    back = put_back(plug, reader)
    # So many, and as many as it sends in ten seconds more: this process may sleep until it says so.
    away = round((10.0 + time.monotonic() - reader.frames[-1].host_time) / PERIOD)
    back.say(encode_information(away, away * PERIOD, TEXT) + stream(away + 1, away + 6))

    reader.took(away + 5)

    assert reader.source.sensor is sensor  # the pipeline need not be made anew
    assert reader.source.trouble == ""
    lost = away - 11
    assert reader.told("back").endswith(f": {lost} messages lost")
    seen = reader.source.accounting()
    assert (seen.lost, seen.restarts, seen.balanced) == (lost, 0, True)
    assert [frame.sequence for frame in reader.frames[10:]] == list(range(away + 1, away + 6))
    assert reader.kinds() == ["met", "gone", "back"]


def test_a_device_that_began_anew_while_away_is_not_said_to_have_lost_messages(streaming, plug):
    device, reader = streaming
    pull(device, reader)
    reader.until(lambda: "no such port" in reader.source.trouble)
    time.sleep(0.6)  # or its clock could as well have gone on
    put_back(plug, reader).say(encode_information(40, 0.0, TEXT) + scan(41, 0.001))
    reader.took(41)
    assert reader.told("back").endswith(", restarted: 0 messages lost")
    seen = reader.source.accounting()
    assert (seen.lost, seen.restarts, seen.balanced) == (0, 1, True)


def test_a_device_that_went_on_while_this_machine_slept_has_its_losses_counted(streaming, plug):
    device, reader = streaming
    pull(device, reader)
    reader.until(lambda: "no such port" in reader.source.trouble)
    away = 100_000  # scans, in 200 s of which this machine knows nothing
    put_back(plug, reader).say(
        encode_information(away, away * PERIOD, TEXT) + stream(away + 1, away + 6)
    )
    reader.took(away + 5)
    assert reader.told("back").endswith(f": {away - 11} messages lost")
    seen = reader.source.accounting()
    assert (seen.lost, seen.restarts, seen.balanced) == (away - 11, 0, True)


def test_a_message_that_waited_for_this_process_is_of_no_device_that_began_anew(plug, opened):
    device, now = plug(), [100.0]
    reader = Reader(opened(device, lambda: now[0]))
    device.say(encode_information(0, 0.0, TEXT) + stream(1, 11))
    reader.took(10)
    pull(device, reader)
    back = plug()

    def heard():
        now[0] += 0.1
        return back.heard()

    reader.until(heard)
    away = 10 + round((now[0] - 100.0) / PERIOD)
    now[0] += 5.0  # it came, and nobody had the time to look
    back.say(encode_information(away, away * PERIOD, TEXT) + stream(away + 1, away + 6))
    reader.took(away + 5)
    assert reader.told("back").endswith(f" s: {away - 11} messages lost")
    assert reader.source.accounting().restarts == 0


def test_another_device_on_the_port_is_said_with_both_names(streaming, plug):
    device, reader = streaming
    sensor = reader.source.sensor
    pull(device, reader)
    other = text_of(serial_number="B-2", name="Thumb")
    put_back(plug, reader).say(encode_information(0, 0.0, other) + stream(1, 4))
    reader.took(3)
    assert reader.told("other") == "another device: Thumb B-2 instead of SIM-0001"
    assert reader.source.sensor is not sensor
    assert reader.source.sensor.name == "Thumb"
    assert "back" not in reader.kinds()
    assert reader.source.accounting().balanced


def test_another_firmware_is_said(streaming, plug):
    device, reader = streaming
    pull(device, reader)
    newer = text_of(firmware="kappaskin 2.0")
    put_back(plug, reader).say(encode_information(0, 0.0, newer) + stream(1, 4))
    reader.took(3)
    assert reader.told("firmware") == "firmware kappaskin 2.0 instead of kappaskin simulator"
    assert "back" in reader.kinds()
    assert "other" not in reader.kinds()


def test_information_that_changes_on_the_line_is_said(streaming):
    device, reader = streaming
    device.say(encode_information(11, 0.022, text_of(dead_channels=[7])) + stream(12, 14))
    reader.took(13)
    assert "sent a different description than before" in reader.told("changed")


def test_a_device_that_says_much_of_itself_is_told_of_in_few_words(streaming):
    device, reader = streaming
    device.say(encode_information(11, 0.022, text_of(serial_number=200_000 * "7")))
    assert len(reader.told("other")) <= 500


def test_a_device_that_begins_anew_on_the_line_is_said_and_goes_on(streaming):
    device, reader = streaming
    device.say(stream(500, 510))
    reader.took(509)
    device.say(encode_information(0, 0.0, TEXT) + stream(1, 4))
    reader.took(3)
    assert "restarted while it was connected" in reader.told("restarted")
    assert reader.source.accounting().restarts == 1
    assert reader.source.accounting().balanced


def test_lost_messages_are_told_together_and_not_more_than_once_a_second(plug, opened):
    device, now = plug(), [100.0]
    reader = Reader(opened(device, lambda: now[0]))
    device.say(encode_information(0, 0.0, TEXT) + stream(1, 11))
    for first in (20, 40, 60):
        device.say(stream(first, first + 2))
        reader.took(first + 1)
    assert sum(map(lost_in, reader.events)) == 9
    now[0] += 1.0
    reader.until(lambda: sum(map(lost_in, reader.events)) == 9 + 18 + 18)
    assert reader.kinds().count("gap") == 2
    assert reader.source.accounting().lost == 45


def lost_in(event):
    return int(event.text.split()[0]) if event.kind == "gap" else 0


def test_messages_between_the_line_and_who_is_there_wait_and_are_not_lost(streaming, plug):
    device, reader = streaming
    pull(device, reader)
    back = put_back(plug, reader)
    back.say(stream(11, 20))
    reader.until(lambda: reader.source.accounting().good == 20)
    time.sleep(0.05)
    assert len(reader.frames) == 10  # nobody has said yet that it is the same device
    back.say(encode_information(20, 0.04, TEXT) + scan(21))
    reader.took(21)
    assert [frame.sequence for frame in reader.frames[10:]] == [*range(11, 20), 21]


@pytest.mark.parametrize("when", ["gone", "back, and nobody said yet who"])
@pytest.mark.parametrize("earlier", [False, True], ids=["first", "second"])
def test_a_recording_that_begins_without_the_device_goes_through_what_was_computed(
    when, earlier, streaming, plug, tmp_path
):
    device, reader = streaming
    source = reader.source
    side = SimpleNamespace(pipeline=Pipeline(source.sensor, Setup(nx=5, ny=5)), excluded=None)
    with closing(LiveRecorder()) as keeping:
        if earlier:
            keeping.begin(tmp_path / "earlier.mcap", source, side)
        pull(device, reader)
        if when == "gone":
            keeping.begin(tmp_path / "a.mcap", source, side)
        back = put_back(plug, reader)
        back.say(scan(11))
        reader.until(lambda: source.accounting().good == 12)
        if when != "gone":
            keeping.begin(tmp_path / "a.mcap", source, side)
        back.say(encode_information(12, 0.024, TEXT) + scan(13))
        reader.took(13)

    with Recording(tmp_path / "a.mcap") as recording:
        retrace = Recomputation(recording)
        again = [frame for message in recording.messages() for frame in retrace(message)]
    assert retrace.pipeline is not None
    assert [(f.sequence, f.taken, f.taken_sd) for f in again] == [
        (f.sequence, f.taken, f.taken_sd) for f in reader.frames[10:]
    ]


def test_half_a_message_at_the_end_of_the_line_is_cut_off_and_no_part_of_the_next(streaming, plug):
    device, reader = streaming
    device.say(scan(11)[:30])
    reader.until(lambda: reader.source.accounting().buffered == 30)
    pull(device, reader)
    put_back(plug, reader).say(encode_information(12, 0.024, TEXT) + scan(13))
    reader.took(13)
    seen = reader.source.accounting()
    assert (dict(seen.discarded)["cut off"], seen.balanced) == (30, True)


def test_a_plug_is_found_by_its_serial_number_under_another_name(plug, opened, monkeypatch):
    here = []
    monkeypatch.setattr(Port, "found", lambda: list(here))
    device = plug()
    here.append(Port(str(device.link), "Fingertip", "Kappa", "A-7", (1, 2)))
    reader = Reader(opened(device))
    device.say(encode_information(0, 0.0, TEXT) + stream(1, 4))
    reader.took(3)

    here.clear()
    pull(device, reader)
    stranger = plug()
    here.append(Port(str(stranger.link), "Fingertip", "Kappa", "B-8", (1, 2)))
    here.append(Port(str(stranger.link.with_name("ttyACM1")), "Fingertip", "Kappa", "A-7", (1, 2)))
    same = put_back(plug, reader, "ttyACM1")
    assert not stranger.heard()
    same.say(encode_information(4, 0.008, TEXT) + stream(5, 8))

    reader.took(7)
    assert reader.told("back")


@pytest.mark.full
def test_a_hundred_cycles_leave_no_thread_and_no_descriptor_and_count_every_gap(plug, opened):
    device = plug()
    reader = Reader(opened(device))
    device.say(encode_information(0, 0.0, TEXT) + scan(1))
    reader.took(1)
    gc.collect()  # what others left is not counted
    before = threading.active_count(), len(os.listdir("/proc/self/fd"))
    sequence = 2
    for _ in range(100):
        pull(device, reader)
        sequence += 10  # in which it sent eight messages that nobody heard
        device = put_back(plug, reader)
        now = sequence * PERIOD
        device.say(encode_information(sequence, now, TEXT) + scan(sequence + 1))
        reader.took(sequence + 1)
        sequence += 2
    assert (threading.active_count(), len(os.listdir("/proc/self/fd"))) == before
    seen = reader.source.accounting()
    assert reader.kinds() == ["met"] + 100 * ["gone", "back"]
    assert (seen.accepted, seen.lost + 10 * seen.restarts, seen.balanced) == (202, 1000, True)


# What the line is asked


def garbled(data):
    """What a receiver at another rate makes of `data`, more or less."""
    noise = random.Random(0)
    return bytes(byte ^ noise.randrange(1, 256) for byte in data)


@pytest.mark.parametrize("rate", [2_000_000, 115_200])
def test_the_baud_rate_is_searched_while_bytes_mean_nothing(plug, opened, rate):
    device, now, said = plug(), [100.0], 0
    reader = Reader(opened(device, lambda: now[0]))
    sent = itertools.count()

    def talk():
        nonlocal said
        if reader.source.accounting().bytes_in == said:  # or some are of the rate before
            now[0] += 0.3
            message = encode_information(next(sent), 0.0, TEXT)[:9000]
            message = message if device.baud_rate() == rate else garbled(message[:200])
            said += len(message)
            device.say(message)
        return reader.source.sensor is not None

    reader.until(talk)
    assert device.baud_rate() == rate
    told = [event.text for event in reader.events if event.kind == "rate"]
    usual = rate == BAUD_RATES[0]
    assert told == ([] if usual else [f"the device sends at {rate} baud"])


def test_what_is_no_device_is_said_once_every_rate_was_tried(plug, opened, monkeypatch):
    monkeypatch.setattr(serial_source, "_DWELL", 0.02)
    monkeypatch.setattr(serial_source, "_PATIENCE", 0.1)
    device, tried = plug(), set()
    reader = Reader(opened(device))

    def talk():
        tried.add(device.baud_rate())
        device.say(b"$GPGGA,123519,4807.038,N\r\n")
        return "at any baud rate" in reader.source.trouble

    reader.until(talk)
    assert tried == set(BAUD_RATES)
    assert "it is another kind of device" in reader.source.trouble


def test_noise_of_a_known_device_does_not_make_its_rate_doubted(streaming):
    device, reader = streaming
    for sequence in range(11, 20):
        device.say(garbled(scan(sequence)) + scan(sequence))
        reader.took(sequence)
    assert device.baud_rate() == BAUD_RATES[0]
    assert "rate" not in reader.kinds()


def test_closing_drops_no_line_that_could_reset_the_board(plug):
    device = plug()
    source = SerialSource(str(device.link))
    assert not device.drops_lines_on_closing()
    source.close()
    assert not device.drops_lines_on_closing()


def test_a_device_that_answers_tells_its_time_and_temperature(streaming):
    device, reader = streaming
    ahead = 1000.0 - time.monotonic()  # the device's clock before the host's

    def answer():
        for command in device.heard():
            if command.operation == Operation.PING:
                now = time.monotonic() + ahead
                data = struct.pack("<Qh", round(now * 1e6), 2345)
                device.say(encode_reply(11, now, command, data=data))
        return np.isfinite(reader.source.temperature)

    reader.until(answer)
    assert reader.source.temperature == 23.45


def test_a_device_back_on_the_line_is_greeted_as_the_first_was(streaming, plug):
    device, reader = streaming
    first = four_commands(device, reader)
    assert first == [Operation.HELLO, Operation.IDENTIFY, Operation.SCAN_LIST, Operation.START]
    pull(device, reader)
    assert four_commands(plug(), reader) == first


def four_commands(device, reader):
    """What the first commands ask that a device hears."""
    heard = []
    reader.until(lambda: heard.extend(device.heard()) or len(heard) >= 4)
    return [command.operation for command in heard[:4]]


def test_a_refusal_by_the_device_is_told_in_its_words(streaming):
    device, reader = streaming
    heard = []
    reader.until(lambda: heard.extend(device.heard()) or heard)
    hello = heard[0]
    device.say(encode_reply(11, 0.1, hello, 5, b"not before noon"))
    assert reader.told("refused") == "the device refused hello: not before noon"


def test_a_port_taken_meanwhile_is_waited_for(streaming, plug, monkeypatch):
    device, reader = streaming
    pull(device, reader)
    real, refused = serial_source.SerialConnection, []

    def busy(url, *others):
        if len(refused) < 3:
            refused.append(url)
            raise SourceError(f"{url}: busy, opened by another program; close that program")
        return real(url, *others)

    monkeypatch.setattr(serial_source, "SerialConnection", busy)
    back = plug()
    reader.until(lambda: "close that program; retrying" in reader.source.trouble)
    reader.until(back.heard)
    back.say(encode_information(12, 0.024, TEXT) + scan(13))
    reader.took(13)
    assert len(refused) == 3


def test_a_source_on_a_dead_line_can_be_closed(streaming):
    device, reader = streaming
    pull(device, reader)
    reader.source.close()
    reader.source.close()
    assert reader.source.accounting().balanced
