"""The device's loop, on a pseudo-terminal: what it sends, and what it answers to its host."""

import json
import os
import runpy
import signal
import struct
import subprocess
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

HERE = Path(__file__).parent
FIRMWARE = HERE.parents[1] / "resources" / "kappaskin_resources" / "firmware"
READ = runpy.run_path(str(HERE / "reader.py"))["read"]
MESSAGE = runpy.run_path(str(HERE / "make_vectors.py"))["message"]
SOURCES = (FIRMWARE / "host" / "kappaskin_host.c", *FIRMWARE.glob("kappaskin_*.c"))
INFORMATION, SAMPLES, COMMAND, REPLY = 1, 2, 3, 4
HELLO, START, STOP, SCAN_LIST, RATE, GAIN, IDENTIFY, PING = range(1, 9)
DONE, UNKNOWN_OPERATION, WRONG_LENGTH, OUT_OF_RANGE, NO_COMMON_VERSION = range(5)


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


def wait_for(ask: Callable[[], Any], within: float = 5.0) -> Any:
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

    def until(self, right: Callable[[Said], bool], within: float = 5.0) -> Said:
        """The first message from now on that is right."""
        found = wait_for(lambda: [said for said in self.listen() if right(said)], within)
        assert found, "it never came"
        return found[0]

    def write(self, data: bytes) -> None:
        os.write(self._file, data)

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
            _, errors = self.process.communicate(timeout=10)
            assert self.process.returncode == 0, errors
            self.ended = json.loads(errors)
        return self.ended


@pytest.fixture(scope="module", params=[False, True], ids=["plain", "watched"])
def program(compiled, request: pytest.FixtureRequest) -> Path:
    return compiled("kappaskin_host", *SOURCES, watched=request.param)


@pytest.fixture
def serve(program: Path) -> Iterator[Callable[..., Running]]:
    """Starts the host program with options; it must end well, whatever happened to it."""
    running: list[Running] = []

    def start(**options: object) -> Running:
        words = [str(w) for name, value in options.items() for w in (f"--{name.replace('_', '-')}", value)]
        process = subprocess.Popen(
            [str(program), *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        assert process.stdout is not None
        running.append(Running(process, **json.loads(process.stdout.readline())))
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


# What it sends by itself


def test_it_says_what_it_is_and_sends_frames_to_whoever_only_listens(line) -> None:
    line.until(sampled)
    line.until(informed)

    assert line.said[0].kind == INFORMATION
    assert line.said[0].information["grid"] == [10, 10]
    first = next(said for said in line.said if sampled(said))
    assert first.channels == list(range(300))
    assert len(first.counts) == 300
    assert [said.sequence for said in line.said] == list(range(len(line.said)))


def test_its_frames_come_at_the_rate_on_its_own_clock(line) -> None:
    wait_for(lambda: len([s for s in line.listen() + line.said if sampled(s)]) > 60)

    times = [said.time for said in line.said if sampled(said)]
    assert (times[-1] - times[0]) / (len(times) - 1) == pytest.approx(5000, rel=0.05)


def test_the_information_is_that_of_the_reference_board(line) -> None:
    expected = json.loads((FIRMWARE / "device.json").read_text("utf-8"))
    expected["rate"] = line.until(informed).information["rate"]

    assert line.said[0].information == expected
