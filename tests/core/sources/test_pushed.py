"""Readings that a program pushes, on a socket of this user, to frames; every record counted."""

import os
import socket
import stat
import subprocess
import sys
import threading
import time
from contextlib import closing

import numpy as np
import pytest

from kappaskin import Refusal, SourceError, feed
from kappaskin._files import machine_folder
from kappaskin.recording import Verification
from kappaskin.sources import load_description, open_source

pytestmark = pytest.mark.slow
BOARD = """
format = 1
title = "Glove"
[skin]
size = [0.06, 0.06]
rigidity = 3.7e-3
[elements]
grid = [3, 3]
[line]
kind = "text"
columns = ["", "height:0..8"]
[readings]
scale = 1e-3
offset = 2e-3
"""
JSON = BOARD.replace('kind = "text"\ncolumns = ["", "height:0..8"]', 'kind = "json"\n{}').format(
    'fields = { n = "sequence", t = "time_ms", "skin.h" = "height:0..8" }'
)
VALUES = np.arange(10.0)


@pytest.fixture
def board(tmp_path):
    file = tmp_path / "board.toml"
    file.write_text(BOARD)
    return file


def taken(source, count, seconds=20.0):
    found, end = [], time.monotonic() + seconds
    while len(found) < count and time.monotonic() < end:
        found += source.read(0.05)
    return found


def test_values_pushed_are_read_as_the_device_would_send_them(board) -> None:
    with feed("glove", board) as glove, closing(open_source("feed:glove")) as source:
        glove.push(VALUES, time=1000.5)
        glove.push([*VALUES[:9], np.nan], time=1000.75)
        first, second = taken(source, 2)
        sensor = source.sensor

    assert sensor.name == "Glove"
    assert (first.sequence, second.sequence) == (0, 1)
    assert (first.device_time, second.device_time) == (1000.5, 1000.75)
    heights = sensor.nominal(first)
    # Element k = i_x 3 + i_y of the description is i_y 3 + i_x of the layout.
    expected = (1e-3 * VALUES[1:] + 2e-3).reshape(3, 3).T.ravel()
    np.testing.assert_allclose(np.sort(heights), np.sort(expected), atol=1e-8)
    assert np.isnan(sensor.nominal(second)).sum() == 1


def test_the_identifier_of_the_sensor_is_that_of_its_file(board) -> None:
    own = load_description(board).sensor
    with feed("glove", board), closing(open_source("feed:glove")) as source:
        assert source.sensor.serial_number == own.serial_number


def test_a_column_of_the_time_and_of_the_sequence_are_used(board) -> None:
    board.write_text(JSON)
    with feed("glove", board) as glove, closing(open_source("feed:glove")) as source:
        glove.push([7, 250, *VALUES[1:]])
        with pytest.raises(Refusal, match="no time: a column"):
            glove.push([8, 260, *VALUES[1:]], time=1.0)
        (frame,) = taken(source, 1)

    assert (frame.sequence, frame.device_time) == (7, 0.25)


@pytest.mark.parametrize(
    ("values", "when", "reason"),
    [
        (VALUES[1:], None, "expected 10 values"),
        ([VALUES], None, "expected 10 values"),
        (1.0, None, "expected 10 values"),
        (VALUES, -1.0, "expected a time"),
        (VALUES, float("nan"), "expected a time"),
        (VALUES, float("inf"), "expected a time"),
        (VALUES, 1e300, "expected a time"),
    ],
)
def test_what_is_no_record_is_refused_and_the_feed_goes_on(board, values, when, reason) -> None:
    with feed("glove", board) as glove, closing(open_source("feed:glove")) as source:
        with pytest.raises(Refusal, match=reason):
            glove.push(values, when)
        glove.push(VALUES)
        (frame,) = taken(source, 1)

    assert frame.sequence == 0


@pytest.mark.parametrize("name", ["", "a b", "../glove", "x" * 25, "gl\0ve"])
def test_a_name_that_cannot_be_is_refused(board, name) -> None:
    with pytest.raises(Refusal, match="expected a name of a feed"):
        feed(name, board)
    with pytest.raises(SourceError, match="expected a name of a feed"):
        open_source(f"feed:{name}")


def test_a_sensor_of_our_own_format_is_refused(board) -> None:
    board.write_text(BOARD.split("[line]")[0])

    with pytest.raises(Refusal, match="line"):
        feed("glove", board)


def test_two_feeds_of_one_name_are_refused_and_one_left_behind_is_replaced(board) -> None:
    script = f"import kappaskin, time; f = kappaskin.feed('glove', {str(board)!r})\n"
    script += "print(1, flush=True); time.sleep(60)"
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE) as other:
        other.stdout.readline()
        with pytest.raises(Refusal, match="another program has a feed 'glove'"):
            feed("glove", board)
        other.kill()
    with feed("glove", board) as glove, closing(open_source("feed:glove")) as source:
        glove.push(VALUES)
        assert len(taken(source, 1)) == 1


def test_only_this_user_may_connect(board) -> None:
    with feed("glove", board):
        folder = machine_folder("feeds")
        assert stat.S_IMODE(os.stat(folder).st_mode) == 0o700
    assert not list(folder.iterdir())


def test_nobody_feeds_is_said(board) -> None:
    with pytest.raises(SourceError, match="no program feeds it"):
        open_source("feed:glove")


def test_what_nobody_takes_is_dropped_the_oldest_first_and_counted(board) -> None:
    glove, received = feed("glove", board), bytearray()
    for _ in range(3):
        glove.push(VALUES)
    assert glove.dropped == 3  # nobody receives
    with socket.socket(socket.AF_UNIX) as deaf:
        deaf.connect(str(machine_folder("feeds") / "glove.sock"))
        received += deaf.recv(1)
        for _ in range(2000):
            glove.push(VALUES)
        assert glove.dropped > 1000
        closing_it = threading.Thread(target=glove.close)
        closing_it.start()
        while data := deaf.recv(2**16):
            received += data
        closing_it.join()
    size = 2 + 4 + 8 + 8 * len(VALUES) + 4  # sync, sequence, time, values, checksum
    records = received[20 + int.from_bytes(received[16:20], "little") :]
    numbers = [
        int.from_bytes(records[at + 2 : at + 6], "little") for at in range(0, len(records), size)
    ]
    assert len(numbers) == 2003 - glove.dropped
    assert numbers == sorted(numbers)
    assert numbers[-64:] == list(range(2003 - 64, 2003))


def test_a_receiver_that_goes_takes_none_with_it(board) -> None:
    with feed("glove", board) as glove, closing(open_source("feed:glove")) as stays:
        goes = open_source("feed:glove")
        glove.push(VALUES)
        assert len(taken(goes, 1)) == 1
        goes.close()
        for _ in range(20):
            glove.push(VALUES)
        assert len(taken(stays, 21)) == 21
        assert glove.dropped == 0


def test_a_feed_that_ends_is_lost_and_comes_back(board) -> None:
    with closing(first := feed("glove", board)), closing(open_source("feed:glove")) as source:
        first.push(VALUES)
        taken(source, 1)
        first.close()
        end = time.monotonic() + 20
        while not source.trouble and time.monotonic() < end:
            source.read(0.05)
        assert "start it again to continue" in source.trouble
        with feed("glove", board) as again:
            found = []
            while not found and time.monotonic() < end:
                again.push(VALUES)
                found = source.read(0.05)
            assert found
            assert source.trouble == ""
        board.write_text(BOARD.replace("Glove", "Another"))
        with feed("glove", board):
            while "another sensor" not in source.trouble and time.monotonic() < end:
                source.read(0.05)
            assert "another sensor than before; connect again" in source.trouble


def test_a_closed_feed_takes_no_more(board) -> None:
    with feed("glove", board) as glove:
        glove.close()
        with pytest.raises(Refusal, match="closed"):
            glove.push(VALUES)


def test_what_sends_something_else_is_refused(board) -> None:
    folder = machine_folder("feeds")
    folder.mkdir(0o700, parents=True, exist_ok=True)
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(folder / "other.sock"))
        listener.listen()

        def answer() -> None:
            with listener.accept()[0] as connection:
                connection.sendall(b"GET / HTTP/1.1\r\n" * 9)

        answering = threading.Thread(target=answer)
        answering.start()
        with pytest.raises(SourceError, match="update the older"):
            open_source("feed:other")
        answering.join()
    (folder / "other.sock").unlink()


def test_it_is_recorded_and_verified(board, tmp_path) -> None:
    path = tmp_path / "glove.mcap"
    command = [sys.executable, "-m", "kappaskin", "record", "feed:glove", str(path)]
    with feed("glove", board) as glove, subprocess.Popen([*command, "--seconds", "2"]) as recording:
        while recording.poll() is None:
            glove.push(VALUES)
            time.sleep(0.01)

    assert recording.returncode == 0
    *_, verdict = Verification.steps(path)
    assert verdict.same
    assert verdict.frames > 50
