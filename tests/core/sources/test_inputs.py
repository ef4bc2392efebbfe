"""Datagrams, standard input and files to frames of a described sensor; every byte counted."""

import os
import socket
import subprocess
import sys
import threading
import time
from contextlib import closing

import numpy as np
import pytest

from kappaskin import Pipeline, Refusal, Setup
from kappaskin.cli.common import of_sensor
from kappaskin.errors import EndedSource, SourceError
from kappaskin.recording import Recorder, ReplayedSource, Verification
from kappaskin.sources import WireMonitor, described_source, load_description, open_source
from kappaskin.sources.inputs import Input, StandardInput
from kappaskin.sources.serial_source import SerialSource

pytestmark = pytest.mark.slow
HEAD = """
format = 1
[skin]
size = [0.06, 0.06]
rigidity = 3.7e-3
[elements]
grid = [3, 3]
[readings]
scale = 1e-3
"""
TEXT = HEAD + '[line]\nkind = "text"\ncolumns = ["time_ms", "sequence", "height:0..8"]\n'
UNTIMED = HEAD + '[line]\nkind = "text"\ncolumns = ["height:0..8"]\n'
BINARY = HEAD + '[line]\nkind = "binary"\nstruct = "<H9h"\ncolumns = ["sequence", "height:0..8"]\n'


def line(n, every=10):
    return f"{n * every},{n},{','.join(['1.5'] * 9)}\n".encode()


def written(folder, text=TEXT):
    file = folder / "board.toml"
    file.write_text(text)
    return file


def source_of(folder, url, text=TEXT):
    return closing(open_source(described_source(written(folder, text), str(url))))


def until_its_end(source, seconds=20.0):
    found, end = [], time.monotonic() + seconds
    try:
        while time.monotonic() < end:
            found += source.read(0.05)
    except EndedSource as ended:
        return found, str(ended)
    pytest.fail("the source has not ended")


def frames_of(source, count, seconds=20.0):
    found, end = [], time.monotonic() + seconds
    while len(found) < count and time.monotonic() < end:
        found += source.read(0.05)
    return found


# Files


def test_a_file_is_played_at_its_own_times_and_ends(tmp_path):
    data = tmp_path / "last-week.csv"
    data.write_bytes(b"".join(line(n, every=50) for n in range(11)))
    began = time.monotonic()
    with source_of(tmp_path, data) as source:
        found, why = until_its_end(source)
        told = source.accounting()

    assert [frame.device_time for frame in found] == pytest.approx([n / 20 for n in range(11)])
    hosts = np.array([frame.host_time for frame in found])
    np.testing.assert_allclose(np.diff(hosts), 0.05, atol=1e-6)
    assert 0.5 <= time.monotonic() - began < 5
    assert "ended, 0 of 11 messages lost" in why
    assert told.balanced
    assert told.bytes_good == data.stat().st_size


def test_a_file_without_times_is_played_at_the_told_rate(tmp_path):
    data = tmp_path / "plain.csv"
    data.write_text("1,2,3,4,5,6,7,8,9\n" * 11)
    told = UNTIMED + "rate = 40.0\n"
    with source_of(tmp_path, data, told) as source:
        found, _ = until_its_end(source)

    np.testing.assert_allclose(np.diff([frame.device_time for frame in found]), 0.025, atol=1e-6)


def test_a_file_without_times_or_a_rate_is_refused(tmp_path):
    data = tmp_path / "plain.csv"
    data.write_text("1,2,3,4,5,6,7,8,9\n")
    with pytest.raises(SourceError, match="give rate"):
        open_source(described_source(written(tmp_path, UNTIMED), str(data)))


def test_of_a_file_what_is_no_record_is_counted_and_what_is_half_is_no_frame(tmp_path):
    data = tmp_path / "log.csv"
    head, half = b"time,n,a,b,c,d,e,f,g,h,i\r\n", line(3)[:-2]
    bad = b"Booting v1.2\n1,2\n\n" + line(9).replace(b"1.5", b"x") + b"9" * 200_000 + b"\n"
    data.write_bytes(head + line(0) + bad + line(1) + line(2) + half)
    with source_of(tmp_path, data) as source:
        found, _ = until_its_end(source)
        told = source.accounting()

    assert [frame.sequence for frame in found] == [0, 1, 2]
    assert told.balanced
    assert told.buffered == 0
    reasons = dict(told.discarded)
    assert reasons["cut off"] == len(half)
    assert sum(reasons.values()) == len(head + bad + half)
    assert set(reasons) == {"cut off", "no separator", "wrong number of columns", "no number"} | (
        set(reasons) & {"too long", "half a line"}
    )


def test_a_file_that_grows_is_played_to_where_it_has_grown(tmp_path):
    data = tmp_path / "growing.csv"
    data.write_bytes(line(0) + line(30) + line(31)[:7])
    with source_of(tmp_path, data) as source:
        first = frames_of(source, 1)
        with data.open("ab") as file:
            file.write(line(31)[7:] + line(32))
        rest, _ = until_its_end(source)

    assert [frame.sequence for frame in first + rest] == [0, 30, 31, 32]


def test_times_that_begin_again_go_on_at_once(tmp_path):
    data = tmp_path / "twice.csv"
    data.write_bytes(b"".join(line(n) for n in (100, 101, 0, 1)))
    began = time.monotonic()
    with source_of(tmp_path, data) as source:
        found, _ = until_its_end(source)

    assert len(found) == 4
    assert time.monotonic() - began < 5


# Datagrams


@pytest.fixture
def port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


@pytest.fixture
def sender(port):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.connect(("127.0.0.1", port))
        yield sender


def test_a_datagram_holds_one_line_or_more(tmp_path, port, sender):
    with source_of(tmp_path, f"udp://:{port}") as source:
        sender.send(line(0) + line(1))
        sender.send(line(2)[:-1])  # whose end is that of the datagram
        sender.send(line(3)[:9])  # half a line
        sender.send(line(4))
        found = frames_of(source, 4)

    assert [frame.sequence for frame in found] == [0, 1, 2, 4]
    told = source.accounting()
    assert told.balanced
    assert dict(told.discarded) == {"wrong number of columns": 10}
    assert told.lost == 1


def test_half_a_binary_datagram_is_not_joined_to_the_next(tmp_path, port, sender):
    record = np.arange(10, dtype="<i2").tobytes()
    with source_of(tmp_path, f"udp://:{port}", BINARY) as source:
        for sent in (record[:11], record, record[:9]):
            sender.send(sent)
        found = frames_of(source, 1)
        frames_of(source, 1, seconds=0.3)

    assert len(found) == 1
    layout, read = source.sensor.layout, source.sensor.nominal(found[0])
    order = np.argsort(layout.element)  # elements count along y, those of a layout along x
    np.testing.assert_allclose(read[order].reshape(3, 3).T.ravel(), np.arange(1, 10) * 1e-3)
    told = source.accounting()
    assert told.balanced
    assert dict(told.discarded) == {"no whole number of records": 20}


@pytest.mark.parametrize("text", [BINARY, TEXT])
def test_a_replay_of_datagrams_counts_what_was_counted(tmp_path, port, sender, text):
    def whole(n):
        return np.arange(n, n + 10, dtype="<i2").tobytes() if text == BINARY else line(n)

    with source_of(tmp_path, f"udp://:{port}", text) as source:
        recorder = Recorder(tmp_path / "out.mcap", time.monotonic())
        source.record(recorder)
        for sent in (whole(0)[:11], whole(1), whole(2)[:9], whole(3), whole(4) + b"12"):
            sender.send(sent)
        found = frames_of(source, 2) + frames_of(source, 2, seconds=0.3)
        live = source.accounting()
        source.record(None)
        recorder.close()
    with closing(ReplayedSource(tmp_path / "out.mcap")) as replayed:
        again = frames_of(replayed, len(found), seconds=5) + frames_of(replayed, 1, seconds=0.3)
        told = replayed.accounting()

    assert live.balanced
    assert told.balanced
    assert len(again) == len(found)
    assert dict(told.discarded) == dict(live.discarded) != {}
    assert (told.good, told.lost) == (live.good, live.lost)
    for one, other in zip(found, again, strict=True):
        np.testing.assert_array_equal(one.counts, other.counts)


def test_of_a_flood_every_byte_that_came_is_counted(tmp_path, port, sender):
    with source_of(tmp_path, f"udp://:{port}") as source:
        for n in range(20_000):
            sender.send(line(n))
        found = frames_of(source, 20_000, seconds=2.0)
        told = source.accounting()

    assert len(found) > 100
    assert told.balanced
    assert told.accepted == len(found)
    # What the system dropped shows as a gap, up to the last one that came.
    assert told.lost == found[-1].sequence - found[0].sequence + 1 - len(found)


def test_a_port_in_use_is_refused(tmp_path, port):
    with source_of(tmp_path, f"udp://:{port}"), pytest.raises(SourceError, match="listen there"):
        open_source(described_source(written(tmp_path), f"udp://:{port}"))


@pytest.mark.parametrize("url", ["udp://", "udp://:x", "udp://:0", "udp://:99999", "udp://:1/a"])
def test_an_address_without_a_port_is_refused(tmp_path, url):
    with pytest.raises(SourceError, match="udp://:PORT"):
        open_source(described_source(written(tmp_path), url))


def test_silence_is_said_with_what_to_check(tmp_path, port, monkeypatch):
    monkeypatch.setattr("kappaskin.sources.serial_source._PATIENCE", 0.2)
    with source_of(tmp_path, f"udp://:{port}") as source:
        frames_of(source, 1, seconds=0.5)

        assert "firewall" in source.trouble


# Standard input


@pytest.fixture
def piped(monkeypatch):
    """The end of a pipe to write to, whose other one is standard input."""
    read, write = os.pipe()
    monkeypatch.setattr(StandardInput, "_DESCRIPTOR", read)
    with os.fdopen(write, "wb", buffering=0) as writer:
        yield writer
    os.close(read)


def test_standard_input_is_read_until_it_is_closed(tmp_path, piped):
    with source_of(tmp_path, "-") as source:
        piped.write(line(0) + line(1) + line(2)[:5])
        first = frames_of(source, 2)
        piped.write(line(2)[5:] + line(3)[:5])
        piped.close()
        rest, why = until_its_end(source)

    assert [frame.sequence for frame in first + rest] == [0, 1, 2]
    assert why.startswith("-: ended")
    told = source.accounting()
    assert told.balanced
    assert dict(told.discarded) == {"cut off": 5}


@pytest.mark.full
def test_of_what_is_piped_fast_nothing_is_lost(tmp_path, piped):
    count = 60_000
    data = b"".join(line(n) for n in range(count))
    writer = threading.Thread(target=lambda: (piped.write(data), piped.close()))
    with source_of(tmp_path, "-") as source:
        writer.start()
        time.sleep(0.5)  # nobody takes what comes
        found, _ = until_its_end(source, seconds=60)
        writer.join()

    assert len(found) == count
    assert source.accounting().bytes_good == len(data)


def recorded(folder, source, piped=b""):
    """What is recorded of a source by the command, whose engine is another process."""
    out = folder / "out.mcap"
    command = [sys.executable, "-m", "kappaskin", "record", str(source), str(out), "--sensor"]
    ran = subprocess.run([*command, str(written(folder))], input=piped, capture_output=True)
    assert ran.returncode == 0, ran.stderr
    *_, verdict = Verification.steps(out)
    return ran.stdout, verdict


@pytest.mark.full
def test_what_is_piped_reaches_the_engine(tmp_path):
    said, verdict = recorded(tmp_path, "-", b"".join(line(n) for n in range(200)))

    assert b"0 of 200 messages lost" in said
    assert verdict.frames == 200


@pytest.mark.full
def test_a_file_is_recorded_to_its_end_and_replayed_the_same(tmp_path):
    data = tmp_path / "data.csv"
    data.write_bytes(b"".join(line(n, every=20) for n in range(200)))

    said, verdict = recorded(tmp_path, data)

    assert b"0 of 200 messages lost" in said
    assert verdict.frames == 200
    assert verdict.passed


def test_standard_input_that_is_closed_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "stdin", None)
    with pytest.raises(Refusal, match="is closed"):
        of_sensor("-", written(tmp_path))


# The monitor


def test_the_monitor_shows_readings_and_what_is_discarded(tmp_path, port, sender):
    described = load_description(written(tmp_path))
    with closing(WireMonitor(f"udp://:{port}", description=described)) as monitor:
        sender.send(line(0) + b"Booting v1.2\n")
        end, lines = time.monotonic() + 20, []
        while len(lines) < 2 and time.monotonic() < end:
            lines += monitor.read(0.05)

    assert "9 channels" in lines[0]
    assert "0.0015" in lines[0]
    assert "Booting v1.2" in lines[1]
    assert "1 messages accepted" in monitor.summary()


def test_the_monitor_tells_no_gaps_of_what_is_not_numbered(tmp_path, port, sender):
    described = load_description(written(tmp_path, UNTIMED))
    with closing(WireMonitor(f"udp://:{port}", description=described)) as monitor:
        for _ in range(3):
            sender.send(b"1,2,3,4,5,6,7,8,9")
        end, lines = time.monotonic() + 20, []
        while monitor.accounting().accepted < 3 and time.monotonic() < end:
            lines += monitor.read(0.05)

    assert all("s  samples      9 channels" in each for each in lines)


def test_udp_without_a_description_is_refused():
    with pytest.raises(Refusal, match="--sensor FILE"):
        of_sensor("udp://:9870", None)


class Breaking(Input):
    """Ten whole lines from each connection, which then breaks off."""

    connections = 0

    def __init__(self) -> None:
        super().__init__()
        first = 10 * Breaking.connections
        Breaking.connections += 1
        self._lines = [f"{n},{',1.5' * 8}".replace(",,", ",") for n in range(first, first + 10)]

    def arriving(self) -> tuple[float, bytes]:
        time.sleep(0.02)
        if not self._lines:
            raise OSError("broken off")
        return self._clock(), f"{self._lines.pop(0)}\n".encode()


def test_after_a_break_the_first_line_is_whole_again_live_and_in_the_recording(tmp_path) -> None:
    description = load_description(written(tmp_path, UNTIMED))
    Breaking.connections, path, found = 0, tmp_path / "r.mcap", []
    source = SerialSource("breaking:", description=description, opened=Breaking)
    with closing(source), closing(Recorder(path, time.monotonic())) as recorder:
        source.record(recorder)
        pipeline = Pipeline(source.sensor, Setup(Ni=2, Nj=2))
        recorder.set_up(pipeline)
        end = time.monotonic() + 20
        while len(found) < 25 and time.monotonic() < end:
            for frame in source.read(0.05):
                estimate = pipeline(frame)
                found.append(round(1e3 * estimate.curvature.ravel()[0]))
                recorder.take(frame, estimate)

    assert found == list(range(len(found)))
    assert len(found) >= 25
    *_, verdict = Verification.steps(path)
    assert verdict.same
    assert verdict.frames == len(found)
