"""The host program: the firmware on a pseudo-terminal, as another program hears and asks it."""

import json
import os
import random
import runpy
import signal
import struct
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from kappaskin import Frame
from kappaskin.sources import SerialSource

HERE = Path(__file__).parent
FIRMWARE = HERE.parents[1] / "resources" / "kappaskin_resources" / "firmware"
READ = runpy.run_path(str(HERE / "reader.py"))["read"]
MESSAGE = runpy.run_path(str(HERE / "make_vectors.py"))["message"]
SOURCES = (FIRMWARE / "host" / "kappaskin_host.c", *FIRMWARE.glob("kappaskin_*.c"))
INFORMATION, SAMPLES, COMMAND, REPLY = 1, 2, 3, 4
HELLO, START, STOP, SCAN_LIST, RATE, GAIN, IDENTIFY, PING = range(1, 9)


@dataclass(frozen=True)
class Said:
    """A message of the device."""

    kind: int
    sequence: int
    time: int
    payload: bytes

    @property
    def information(self) -> dict[str, Any]:
        return json.loads(self.payload)

    @property
    def channels(self) -> list[int]:
        runs = struct.iter_unpack("<HH", self.payload[2 : 2 + 4 * self.payload[1]])
        return [first + n for first, length in runs for n in range(length)]

    @property
    def counts(self) -> list[int]:
        letter, data = {2: "h", 4: "i"}[self.payload[0]], self.payload[2 + 4 * self.payload[1] :]
        return [count for (count,) in struct.iter_unpack(f"<{letter}", data)]

    @property
    def status(self) -> int:
        return self.payload[5]


def wait_for(ask: Callable[[], Any], within: float = 30.0) -> Any:
    """The first answer that is true, or the last one."""
    end = time.monotonic() + within
    while not (answer := ask()) and time.monotonic() < end:
        time.sleep(0.002)
    return answer


class Line:
    """The host's end of the line."""

    def __init__(self, port: str) -> None:
        self._file = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        self._data, self._sequence = b"", 100
        self.said: list[Said] = []

    def listen(self) -> list[Said]:
        """What came since."""
        try:
            while data := os.read(self._file, 65536):
                self._data += data
        except OSError:  # nothing more, or nobody is there
            pass
        found, waiting = READ(self._data)
        self._data = self._data[len(self._data) - waiting :]
        new = [
            Said(whole[3], *struct.unpack_from("<IQ", whole, 8), whole[22:-4]) for whole in found
        ]
        self.said += new
        return new

    def until(self, right: Callable[[Said], bool], within: float = 30.0) -> Said:
        """The first message from now on that is right."""
        found = wait_for(lambda: [said for said in self.listen() if right(said)], within)
        assert found, "it never came"
        return found[0]

    def write(self, data: bytes) -> None:
        while data:
            try:
                data = data[os.write(self._file, data) :]
            except BlockingIOError:
                time.sleep(0.001)

    def asks(self, operation: int, arguments: bytes = b"") -> Said:
        """The reply to a command."""
        self._sequence += 1
        self.write(MESSAGE(COMMAND, bytes([operation]) + arguments, self._sequence, 0))
        asked = struct.pack("<IB", self._sequence, operation)
        return self.until(lambda said: said.kind == REPLY and said.payload[:5] == asked)

    def close(self) -> None:
        os.close(self._file)


@dataclass
class Running:
    """A host program that serves, and what it said when it had ended."""

    process: subprocess.Popen[str]
    port: str
    rate: float
    ended: dict[str, int] | None = None

    def end(self) -> dict[str, int]:
        if self.ended is None:
            self.process.send_signal(signal.SIGTERM)
            _, errors = self.process.communicate(timeout=30)
            # An address or undefined-behaviour report would stand before the last line.
            assert self.process.returncode == 0, errors
            self.ended = json.loads(errors)
        return self.ended


@pytest.fixture(scope="module")
def program(compiled) -> Path:
    return compiled("kappaskin_host", *SOURCES, watched=True)


def started(program: Path, **options: object) -> Running:
    words = [str(word) for option in options.items() for word in option]
    words[::2] = [f"--{name.replace('_', '-')}" for name in words[::2]]
    process = subprocess.Popen(
        [str(program), *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    return Running(process, **json.loads(process.stdout.readline()))


@pytest.fixture
def serve(program: Path) -> Iterator[Callable[..., Running]]:
    """Starts the host program with options; it must end well, whatever happened to it."""
    running: list[Running] = []

    def start(**options: object) -> Running:
        running.append(started(program, **options))
        return running[-1]

    yield start
    for found in running:
        found.end()


@pytest.fixture
def device(serve) -> Running:
    return serve(rate=200)


@pytest.fixture
def line(device: Running) -> Iterator[Line]:
    opened = Line(device.port)
    yield opened
    opened.close()


def sampled(said: Said) -> bool:
    return said.kind == SAMPLES


def informed(said: Said) -> bool:
    return said.kind == INFORMATION


def heard(line: Line, frames: int) -> list[Said]:
    """So many frames, or more."""
    wait_for(lambda: line.listen() and sum(map(sampled, line.said)) >= frames)
    return [said for said in line.said if sampled(said)]


def times(frames: list[Said]) -> list[int]:
    return [said.time for said in frames]


# What it sends by itself


def test_it_says_what_it_is_and_sends_frames_to_whoever_only_listens(line) -> None:
    frames = heard(line, 5)

    assert line.said[0].kind == INFORMATION
    assert frames[0].channels == list(range(300))
    assert len(frames[0].counts) == 300
    assert [said.sequence for said in line.said] == list(range(len(line.said)))


def test_its_contact_moves(line) -> None:
    frames = heard(line, 60)

    first, last = np.array(frames[0].counts[:100]), np.array(frames[59].counts[:100])
    assert 1000 < np.abs(first).max() < 10_000
    assert first.argmax() != last.argmax()


def test_the_information_is_that_of_the_reference_board(line) -> None:
    expected = json.loads((FIRMWARE / "device.json").read_text("utf-8"))

    told = line.until(informed).information
    assert told.pop("rate") == pytest.approx(200, rel=1e-4)
    assert told == {name: value for name, value in expected.items() if name != "rate"}


def test_its_clock_and_its_numbers_begin_where_they_are_told_to(serve) -> None:
    device = serve(
        rate=200, sequence=2**32 - 3, clock_offset=5_000_000_000, serial="K-7", firmware="9.1"
    )
    with closing(Line(device.port)) as line:
        heard(line, 10)

    numbers = [said.sequence for said in line.said]
    assert numbers == [(2**32 - 3 + n) % 2**32 for n in range(len(numbers))]
    assert 5_000_000_000 < line.said[0].time < 5_010_000_000
    assert line.said[0].information["serial_number"] == "K-7"
    assert line.said[0].information["firmware"] == "9.1"


def test_its_clock_may_be_fast(serve) -> None:
    device = serve(rate=100, clock_ppm=100_000)
    with closing(Line(device.port)) as line:
        line.until(sampled)
        before, first, after = time.monotonic(), line.asks(PING), time.monotonic()
        time.sleep(0.3)
        then, second, end = time.monotonic(), line.asks(PING), time.monotonic()

    told = [struct.unpack_from("<Q", said.payload, 6)[0] * 1e-6 for said in (first, second)]
    assert 1.1 * (then - after) - 1e-4 < told[1] - told[0] < 1.1 * (end - before) + 1e-4


def test_it_plays_the_counts_of_a_file_round_and_round(serve, tmp_path) -> None:
    counts = np.random.default_rng(3).integers(-(2**15), 2**15, (7, 12)).astype("<i2")
    (tmp_path / "counts").write_bytes(counts.tobytes())

    device = serve(rate=500, grid="2x2", counts=tmp_path / "counts", frames=30)
    with closing(Line(device.port)) as line:
        frames = heard(line, 30)

    assert [said.counts for said in frames] == [counts[n % 7].tolist() for n in range(30)]
    assert device.process.wait(30) == 0


def test_a_gain_changes_the_counts(serve, tmp_path) -> None:
    (tmp_path / "counts").write_bytes(np.arange(-6, 6, dtype="<i2").tobytes())
    device = serve(rate=500, grid="2x2", counts=tmp_path / "counts")
    with closing(Line(device.port)) as line:
        assert line.asks(GAIN, struct.pack("<I", 300_000)).status == 0
        frame = line.until(sampled)

    assert frame.counts == [3 * n for n in range(-6, 6)]


# Commands over a line


def test_every_command_is_answered(line) -> None:
    assert line.asks(HELLO, b"\1\1").payload[5:] == b"\0\1"
    assert line.asks(STOP).status == 0
    assert line.asks(SCAN_LIST, b"\1" + struct.pack("<HH", 290, 10)).status == 0
    assert line.asks(RATE, struct.pack("<I", 1_000_000)).payload[5:] == b"\0" + struct.pack(
        "<I", 1_000_000
    )
    assert line.asks(IDENTIFY).status == 0
    assert line.asks(PING).payload[-2:] == struct.pack("<h", 2345)
    assert line.asks(START).status == 0
    assert line.until(sampled).channels == list(range(290, 300))
    assert line.asks(99).status == 1


def test_a_stopped_device_says_what_it_is_and_nothing_else(line) -> None:
    line.asks(STOP)
    seen = len(line.said)
    line.until(informed)

    assert not any(map(sampled, line.said[seen:]))


def test_garbage_from_the_host_harms_nothing(line) -> None:
    line.until(sampled)
    source = random.Random(2)
    for _ in range(50):
        line.write(source.randbytes(1000))
        line.listen()

    # Garbage may end in what looks like the beginning of a command: the first is then lost in it.
    line.write(MESSAGE(COMMAND, b"\10", 1, 2) * 2)
    line.until(lambda said: said.kind == REPLY)
    numbers = [said.sequence for said in line.said]
    assert numbers == list(range(len(numbers)))


# A line that nobody listens to, or that is gone


def test_without_a_listener_it_spends_nothing_and_the_next_is_introduced(serve) -> None:
    device, lines, busy = serve(rate=2000), list[Line](), list[float]()
    time.sleep(0.1)
    for _ in range(2):
        opened = time.monotonic()
        with closing(Line(device.port)) as line:
            heard(line, 5)
        lines.append(line)
        busy.append(time.monotonic() - opened)  # in which it may have gone on unheard
        time.sleep(0.2)

    told, (first, second) = device.end(), lines
    assert first.said[0].sequence == 0
    assert second.said[0].kind == INFORMATION
    assert second.said[0].sequence - first.said[-1].sequence < 200 + 2000 * busy[0]
    assert told["spent"] - second.said[-1].sequence < 200 + 2000 * busy[1]


def test_a_listener_that_never_reads_holds_nothing_up_and_finds_out_what_it_lost(serve) -> None:
    device = serve(rate=200, grid="64x64")
    with closing(Line(device.port)) as line:
        line.until(sampled)
        time.sleep(0.7)
        heard(line, 60)
        line.asks(STOP)

        numbers = [said.sequence for said in line.said]
        lost = numbers[-1] + 1 - len(numbers)
        assert numbers == sorted(set(numbers))
        assert all(len(said.counts) == 3 * 64 * 64 for said in line.said if sampled(said))
        assert lost > 10
    told = device.end()
    assert told["unsent"] >= lost


def made(link: Path) -> int | None:
    """When a link was made, in ns; None while there is none."""
    try:
        return link.lstat().st_mtime_ns
    except OSError:
        return None


def test_it_is_unplugged_and_comes_back_under_its_link(serve, tmp_path) -> None:
    link = tmp_path / "port"
    device = serve(rate=500, pty_link=link, away=60)
    numbers = list[int]()
    for _ in range(4):
        was = made(link)
        with closing(Line(str(link))) as line:
            heard(line, 5)
            device.process.send_signal(signal.SIGUSR1)
            assert wait_for(lambda was=was: made(link) not in (was, None))
            numbers += [said.sequence for said in line.said]

    told = device.end()
    assert told["unplugged"] == 4
    assert numbers == sorted(set(numbers))
    assert told["unsent"] >= 4 * 0.06 * 500 / 2  # it went on scanning, and nobody heard it
    assert not link.exists()


def test_it_is_unplugged_again_and_again(serve, tmp_path) -> None:
    link, seen = tmp_path / "port", set[int | None]()
    device = serve(rate=500, pty_link=link, unplug_every=30, away=20)
    wait_for(lambda: seen.add(made(link)) or len(seen - {None}) > 3)

    assert device.end()["unplugged"] > 2


# Loads


@pytest.mark.parametrize("options", [{"rate": 2000}, {"rate": 200, "grid": "64x64"}])
def test_nothing_is_lost_at_the_rates_that_are_promised(compiled, options) -> None:
    program, frames = compiled("kappaskin_host", *SOURCES), options["rate"] // 5
    device = started(program, **options, frames=frames)
    with closing(Line(device.port)) as line:
        assert len(heard(line, frames)) == frames
    assert device.process.wait(30) == 0
    assert device.end()["unsent"] == 0


# The library


def test_the_library_reads_it(serve) -> None:
    device = serve(rate=500, serial="K-7")
    source, frames = SerialSource(device.port), list[Frame]()
    wait_for(lambda: frames.extend(source.read(0.02)) or len(frames) > 30)
    source.close()

    seen = source.accounting()
    assert source.sensor is not None
    assert (source.sensor.serial_number, source.sensor.channels) == ("K-7", 300)
    assert seen.balanced
    assert seen.bytes_discarded == seen.lost == 0
    # Curvatures of a dent of some millimetres.
    assert 5 < np.nanmax(np.abs(source.sensor.nominal(frames[-1]))) < 50


# What it refuses


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["--speed", "3"], "there is no option --speed"),
        (["--rate"], "expected a value after --rate"),
        (["--rate", "fast"], "expected frames/s from"),
        (["--rate", "-1"], "expected frames/s from"),
        (["--rate", "nan"], "expected frames/s from"),
        (["--grid", "10"], "expected a grid such as 10x10"),
        (["--grid", "1000x1000"], "expected from 1 to 21845 elements"),
        (["--grid", "0x10"], "expected from 1 to 21845 elements"),
        (["--channels", "1"], "expected channels from 3"),
        (["--counts", "/nowhere"], "cannot be read"),
        (["--counts", __file__], "expected frames of 600 bytes"),
        (["--information", "/dev/null"], "expected"),
        (["--serial", 'a"b'], "without quotes"),
        (["--clock-ppm", "1e9"], "expected parts per million"),
        (["--pty-link", __file__], "expected nothing there"),
    ],
)
def test_what_makes_no_sense_is_refused(program, words, expected) -> None:
    told = subprocess.run(
        [program, *words], capture_output=True, text=True, check=False, timeout=30
    )

    assert told.returncode == 2
    assert expected in told.stderr
    assert told.stdout == ""
