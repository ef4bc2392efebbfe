"""Frames from a line: a pseudo-terminal, a loop and a socket, and everything that goes wrong."""

import binascii
import errno
import json
import os
import socket
import struct
import threading
import time
import zlib
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import serial

from kappaskin import Frame, Sensor, SourceError, load_scene
from kappaskin.sources import SerialSource, information, open_source, ports
from kappaskin.sources.wire import encode_information, encode_samples

pty = pytest.importorskip("pty", reason="no pseudo-terminals on this system")
grp, tty = map(pytest.importorskip, ("grp", "tty"))
lists_descriptors = pytest.mark.skipif(
    not Path("/proc/self/fd").exists(), reason="counts descriptors in /proc"
)

SENSOR = load_scene("centre").sensor()
TEXT = information.sensor_to_json(SENSOR)


def introduction(sequence: int = 0, text: str = TEXT) -> bytes:
    return encode_information(sequence, 0.0, text)


def scan(sequence: int, channels: int = SENSOR.channels) -> bytes:
    counts = np.full(channels, sequence, np.int32)
    return encode_samples(sequence, sequence / 500, np.arange(channels), counts, 2)


def stream(first: int, last: int) -> bytes:
    return b"".join(scan(sequence) for sequence in range(first, last))


class Line:
    """A pseudo-terminal: `write` is what the device does, `port` what the program opens."""

    def __init__(self) -> None:
        self._master, slave = pty.openpty()
        tty.setraw(slave)
        self.port = os.ttyname(slave)
        os.close(slave)

    def write(self, data: bytes) -> None:
        while data:
            data = data[os.write(self._master, data[:2048]) :]

    def unplug(self) -> None:
        if self._master >= 0:
            os.close(self._master)
        self._master = -1


@pytest.fixture
def line() -> Iterator[Line]:
    made = Line()
    yield made
    made.unplug()


@pytest.fixture
def opened() -> Iterator[Callable[[str], SerialSource]]:
    """Opens sources and closes them, after which no descriptor may be left."""
    sources: list[SerialSource] = []

    def open_one(url: str) -> SerialSource:
        sources.append(SerialSource(url))
        return sources[-1]

    yield open_one
    for source in sources:
        source.close()


@pytest.fixture
def hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("kappaskin.sources.serial_source._PATIENCE", 0.15)
    monkeypatch.setattr("kappaskin.sources.serial_source._DWELL", 60.0)  # at one baud rate


def read(source: SerialSource, count: int, within: float = 15.0) -> list[Frame]:
    """`count` frames or more, or what came within some seconds."""
    frames: list[Frame] = []
    end = time.monotonic() + within
    while len(frames) < count and time.monotonic() < end:
        frames += source.read(0.02)
    return frames


def read_until(source: SerialSource, holds: Callable[[], bool]) -> list[Frame]:
    """The frames that came until something held."""
    frames, end = list[Frame](), time.monotonic() + 30.0
    while not holds():
        assert time.monotonic() < end, source.trouble
        frames += source.read(0.02)
    return frames


def read_all(source: SerialSource, sent: bytes) -> list[Frame]:
    """The frames of all the bytes that were sent since the source was opened."""
    return read_until(source, lambda: source.accounting().bytes_in == len(sent))


def read_to_trouble(source: SerialSource) -> tuple[list[Frame], str]:
    """Every frame until the source is in trouble, and which."""
    frames: list[Frame] = []
    for _ in range(500):
        frames += source.read(0.02)
        if source.trouble:
            return frames, source.trouble
    pytest.fail("the source never was in trouble")


def sequences(frames: list[Frame]) -> list[int]:
    return [frame.sequence for frame in frames]


def same(one: Sensor | None, other: Sensor) -> bool:
    return one is not None and information.sensor_to_json(one) == information.sensor_to_json(other)


# What arrives


def test_frames_on_a_terminal_arrive_as_sent(line, opened) -> None:
    source = opened(line.port)
    assert source.sensor is None

    line.write(introduction(0) + stream(1, 41))
    frames = read(source, 40)

    assert sequences(frames) == list(range(1, 41))
    assert same(source.sensor, SENSOR)
    assert all((f.counts == f.sequence).all() and len(f.counts) == 300 for f in frames)
    assert [f.device_time for f in frames] == pytest.approx([q / 500 for q in range(1, 41)])
    assert np.ptp([f.host_time - time.monotonic() for f in frames]) < 3
    seen = source.accounting()
    assert seen.bytes_in == seen.bytes_good == len(introduction(0) + stream(1, 41))
    assert (seen.accepted, seen.lost, seen.buffered) == (41, 0, 0)


def test_a_first_byte_in_the_middle_of_a_frame_costs_only_that_frame(line, opened) -> None:
    source = opened(line.port)
    line.write(scan(5)[100:] + introduction(6) + stream(7, 10))
    assert sequences(read(source, 3)) == [7, 8, 9]
    assert source.accounting().bytes_discarded == len(scan(5)) - 100


def test_frames_before_the_information_wait_for_it(line, opened) -> None:
    source = opened(line.port)
    line.write(stream(0, 3))
    assert read(source, 1, within=0.2) == []
    line.write(introduction(3) + stream(4, 6))
    assert sequences(read(source, 5)) == [0, 1, 2, 4, 5]
    assert source.accounting().accepted == 6


def test_of_frames_that_wait_for_it_the_newest_are_kept_in_bounded_memory(
    line, opened, monkeypatch
) -> None:
    monkeypatch.setattr("kappaskin.sources.serial_source._UNREAD", 10 * (300 + 64))
    source = opened(line.port)
    line.write(stream(0, 40))
    assert read_all(source, stream(0, 40)) == []
    line.write(introduction(40))
    assert sequences(read(source, 10)) == list(range(30, 40))


def test_bytes_that_nobody_takes_are_thrown_away_beyond_a_bound_and_counted(
    line, opened, monkeypatch
) -> None:
    monkeypatch.setattr("kappaskin.sources.ports._BACKLOG", 20_000)
    monkeypatch.setattr("kappaskin.sources.ports._BLOCK", 4096)  # or one read may bring all of it
    source = opened(line.port)
    sent = introduction(0) + stream(1, 101)
    line.write(sent)
    end = time.monotonic() + 30.0  # the system may hand some over after it has none to hand over
    while dict(source.accounting().discarded).get("overrun", 0) < len(sent) - 30_000:
        assert time.monotonic() < end
        time.sleep(0.01)

    frames = read_all(source, sent)
    line.write(stream(101, 111))
    frames += read_all(source, sent + stream(101, 111))

    seen = source.accounting()
    assert seen.balanced
    assert seen.bytes_in == len(sent) + len(stream(101, 111))
    assert 20_000 < seen.bytes_in - dict(seen.discarded)["overrun"] < 40_000
    assert sequences(frames)[-9:] == list(range(102, 111))
    assert seen.lost == 110 - len(frames)


def test_information_repeated_changes_nothing(line, opened) -> None:
    source = opened(line.port)
    line.write(introduction(0) + scan(1))
    read(source, 1)
    sensor = source.sensor
    line.write(introduction(2) + scan(3))
    read(source, 1)
    assert source.sensor is sensor


def test_frames_from_before_and_after_a_change_of_sensor_are_never_mixed(line, opened) -> None:
    small = replace(SENSOR, layout=SENSOR.layout.without([7]), name="repaired")
    source = opened(line.port)
    line.write(introduction(0) + stream(1, 4) + introduction(4, information.sensor_to_json(small)))
    line.write(stream(5, 8))
    met: list[tuple[str, int]] = []
    end = time.monotonic() + 30
    while len(met) < 6 and time.monotonic() < end:
        met += [(source.sensor.name, f.sequence) for f in source.read(0.02) if source.sensor]
    assert met == [(SENSOR.name, q) for q in (1, 2, 3)] + [("repaired", q) for q in (5, 6, 7)]


def test_what_a_channel_reads_is_told_by_the_map_of_the_device(line, opened) -> None:
    wired = np.roll(np.arange(SENSOR.channels), 7)
    source = opened(line.port)
    line.write(
        introduction(0, information.sensor_to_json(replace(SENSOR, channel_map=wired))) + scan(1)
    )
    (frame,) = read(source, 1)
    assert frame.channels.tolist() == wired.tolist()


def test_a_loop_url_works_like_a_port(opened, monkeypatch) -> None:
    ports: list[serial.SerialBase] = []
    make = serial.serial_for_url

    def noted(*args, **kwargs) -> serial.SerialBase:
        ports.append(make(*args, **kwargs))
        return ports[-1]

    monkeypatch.setattr(serial, "serial_for_url", noted)
    source = opened("loop://")
    ports[0].write(introduction(0) + stream(1, 4))
    assert sequences(read(source, 3)) == [1, 2, 3]


@pytest.fixture
def server() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as made:
        made.settimeout(30)
        yield made


def url_of(server: socket.socket) -> str:
    return f"socket://127.0.0.1:{server.getsockname()[1]}"


def test_a_socket_works_like_a_port(server, opened) -> None:
    source = opened(url_of(server))
    with server.accept()[0] as device:
        device.sendall(introduction(0) + stream(1, 200))
        assert sequences(read(source, 199)) == list(range(1, 200))
        device.sendall(stream(200, 203))
        assert sequences(read(source, 3)) == [200, 201, 202]


def test_what_came_before_a_socket_closed_is_not_lost(server, opened) -> None:
    source = opened(url_of(server))
    with server.accept()[0] as device:
        device.sendall(introduction(0) + stream(1, 101))
    frames, why = read_to_trouble(source)
    assert sequences(frames) == list(range(1, 101))
    assert "connection lost" in why


def test_a_silent_socket_keeps_nobody_waiting(server, opened) -> None:
    reads, closes = list[float](), list[float]()
    for _ in range(3):  # each time, unless the machine is busy
        source = opened(url_of(server))
        with server.accept()[0]:
            start = time.monotonic()
            assert source.read(0.05) == []
            reads.append(time.monotonic() - start)
            start = time.monotonic()
            source.close()
            closes.append(time.monotonic() - start)
    assert min(reads) < 1
    assert min(closes) < 1


# What goes wrong once it is open


def test_a_silent_device_is_given_up(line, opened, hasty) -> None:
    frames, why = read_to_trouble(opened(line.port))
    assert frames == []
    assert why == (
        f"{line.port}: silent for more than 0.15 s; check the power, and that this is its port"
    )


def test_a_device_is_given_the_patience_that_is_promised(line) -> None:
    now = [100.0]
    with closing(SerialSource(line.port, lambda: now[0])) as source:
        for now[0], why in ((102.9, ""), (103.1, "silent for more than 3 s")):
            assert source.read(0.0) == []
            assert why in source.trouble
            assert bool(source.trouble) == bool(why)


def test_another_protocol_is_told_apart(line, opened, hasty) -> None:
    source = opened(line.port)
    line.write(said := b"$GPGGA,123519,4807.038,N\r\n" * 10)
    assert read_all(source, said) == []
    frames, why = read_to_trouble(source)
    assert frames == []
    assert "260 bytes came but no message of wire version 1" in why
    assert "at 2000000 baud; other rates are tried as bytes arrive, or it is another kind" in why
    assert "one that prints numbers needs --sensor FILE" in why


def test_another_version_is_told_apart(line, opened, hasty) -> None:
    head = b"\x4b\xa7" + struct.pack("<BBIIQ", 7, 1, len(TEXT), 0, 0)
    body = head + struct.pack("<H", binascii.crc_hqx(head, 0)) + TEXT.encode()
    source = opened(line.port)
    line.write(said := body + struct.pack("<I", zlib.crc32(body)))
    read_all(source, said)
    _, why = read_to_trouble(source)
    assert "speaks wire version 7, this program uses 1; update the older" in why


def test_a_device_that_never_says_what_it_is_is_given_up(line, opened, hasty) -> None:
    source = opened(line.port)
    line.write(stream(0, 5))
    assert read_all(source, stream(0, 5)) == []
    _, why = read_to_trouble(source)
    assert "messages arrive, but in 0.15 s none described the device;" in why


def test_information_that_cannot_be_used_is_refused_after_the_frames_before_it(
    line, opened
) -> None:
    source = opened(line.port)
    bad = json.dumps({**json.loads(TEXT), "rate": -1})
    line.write(introduction(0) + stream(1, 4) + introduction(4, bad))
    frames, why = read_to_trouble(source)
    assert sequences(frames) == [1, 2, 3]
    assert "the device's information cannot be used" in why


def test_a_channel_that_the_device_does_not_have_is_refused_after_the_frames_before_it(
    line, opened
) -> None:
    source = opened(line.port)
    line.write(introduction(0) + stream(1, 4) + scan(4, channels=301))
    frames, why = read_to_trouble(source)
    assert sequences(frames) == [1, 2, 3]
    assert "sends channel 300 but reports 300" in why
    line.write(introduction(5) + stream(6, 8))
    assert read(source, 1, within=0.2) == []
    assert source.trouble == why  # until it says something else of itself


def test_an_unplugged_device_is_noticed_after_its_last_frame(line, opened, monkeypatch) -> None:
    taken, arriving = bytearray(), ports._arriving  # noqa: SLF001

    def noted(port: serial.SerialBase) -> bytes:
        data = arriving(port)
        taken.extend(data)
        return data

    monkeypatch.setattr(ports, "_arriving", noted)
    source = opened(line.port)
    line.write(sent := introduction(0) + stream(1, 6))
    end = time.monotonic() + 30.0
    while len(taken) < len(sent):  # what the program has not taken is gone with the line
        assert time.monotonic() < end
        time.sleep(0.01)
    line.unplug()

    frames, why = read_to_trouble(source)

    assert sequences(frames) == [1, 2, 3, 4, 5]
    assert "connection lost: the device was unplugged or stopped; plug it in" in why
    assert source.read(0.0) == []


# What goes wrong on opening


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("", "expected a source: sim:SCENE, replay:FILE, feed:NAME, a port or a URL; got no name"),
        ("  ", "got no name"),
        ("/dev/ttyABSENT7", "there is no such port; plug the sensor in, or choose one"),
        ("COM77", "there is no such port"),
        (__file__, "a file, not a serial port; expected a port such as"),
        ("/tmp", "a folder, not a serial port; expected a port such as"),
        ("/dev/null", "a device, not a serial port; expected a port such as"),
        ("a\0b", "expected a port such as"),
        ("foo://x", "protocol 'foo' not known"),
        ("loop://?logging=nonsense", "cannot be opened"),
        ("hwgrep://(", "cannot be opened"),
        ("hwgrep://no such device", "no ports found"),
        ("socket://127.0.0.1", "expected host and port, such as socket://host:5000"),
        ("socket://127.0.0.1:1", "no server listens at this address"),
        ("replay:x.mcap", "cannot be read"),
        ("sim:nowhere", "expected a scene among"),
    ],
)
def test_what_cannot_be_opened_is_refused_with_a_reason(name: str, reason: str) -> None:
    with pytest.raises(ValueError, match=reason.replace("(", r"\(")) as refusal:
        open_source(name)
    assert type(refusal.value).__name__ in ("SourceError", "Refusal")


def test_a_port_opened_twice_is_busy(line, opened) -> None:
    opened(line.port)
    with pytest.raises(SourceError, match="busy, opened by another program; close that program"):
        SerialSource(line.port)


@pytest.mark.parametrize("code", [errno.EACCES, errno.EPERM])
def test_a_port_without_permission_names_the_group_and_the_line_that_mends_it(
    line, monkeypatch, code
) -> None:
    def denied(*args, **kwargs) -> None:
        raise serial.SerialException(code, f"could not open port {args[0]}")

    monkeypatch.setattr(serial, "serial_for_url", denied)
    group = grp.getgrgid(os.stat(line.port).st_gid).gr_name
    with pytest.raises(SourceError, match=f"no permission .*`sudo usermod -aG {group} ") as refusal:
        SerialSource(line.port)
    assert "then log in again" in str(refusal.value)


def test_without_the_port_the_usual_group_is_named(monkeypatch) -> None:
    def denied(*_, **__) -> None:
        raise serial.SerialException(errno.EACCES, "could not open port")

    monkeypatch.setattr(serial, "serial_for_url", denied)
    with pytest.raises(SourceError, match="usermod -aG dialout"):
        SerialSource("/dev/ttyABSENT7")


# What is left


@lists_descriptors
def test_a_closed_source_leaves_no_thread_and_no_descriptor(line) -> None:
    threads, descriptors = threading.enumerate(), set(os.listdir("/proc/self/fd"))
    source = SerialSource(line.port)
    assert len(threading.enumerate()) == len(threads) + 1
    line.write(introduction() + scan(1))
    source.read(0.2)

    source.close()

    assert threading.enumerate() == threads
    assert set(os.listdir("/proc/self/fd")) == descriptors
    source.close()  # once more does no harm


@lists_descriptors
@pytest.mark.parametrize("name", ["/dev/ttyABSENT7", __file__, "socket://127.0.0.1:1"])
def test_a_refused_port_leaves_no_descriptor(name: str) -> None:
    before = set(os.listdir("/proc/self/fd"))
    with pytest.raises(SourceError):
        SerialSource(name)
    assert set(os.listdir("/proc/self/fd")) == before
