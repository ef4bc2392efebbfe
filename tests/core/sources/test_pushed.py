"""Readings that a program pushes, on a socket of this user, to frames; every record counted."""

import math
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
from kappaskin.sources import feeds_found, load_description, open_source

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
        (VALUES * 1j, None, "expected real numbers"),
        ([*VALUES[1:], "a"], None, "expected real numbers"),
        ([*VALUES[1:], 10**400], None, "expected real numbers"),
        ([[1.0], *VALUES[1:]], None, "expected real numbers"),
        (VALUES, "now", "expected real numbers"),
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


def test_what_is_masked_is_missing(board) -> None:
    with feed("glove", board) as glove, closing(open_source("feed:glove")) as source:
        glove.push(np.ma.masked_less(VALUES, 5.5))
        (frame,) = taken(source, 1)
        assert np.isnan(source.sensor.nominal(frame)).sum() == 5


@pytest.mark.parametrize(("place", "value"), [(0, -1.0), (0, np.nan), (1, -5.0), (1, np.inf)])
def test_a_time_or_sequence_number_that_cannot_be_is_refused(board, place, value) -> None:
    board.write_text(JSON)
    values = np.arange(11.0)
    values[place] = value
    with (
        feed("glove", board) as glove,
        pytest.raises(Refusal, match="times and sequence numbers of 0 or more"),
    ):
        glove.push(values)


@pytest.mark.parametrize("name", ["", "a b", "../glove", "x" * 25, "gl\0ve", None])
def test_a_name_that_cannot_be_is_refused(board, name) -> None:
    with pytest.raises(Refusal, match="expected a name of a feed"):
        feed(name, board)
    if name is not None:
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
        with pytest.raises(Refusal, match="there is a feed 'glove' already"):
            feed("glove", board)
        other.kill()
    with feed("glove", board) as glove, closing(open_source("feed:glove")) as source:
        glove.push(VALUES)
        assert len(taken(source, 1)) == 1


def test_feeds_are_found_by_name_with_the_sensor_that_they_are_of(board) -> None:
    with feed("knee", board), feed("hand", board):
        sensor = load_description(board).sensor
        found = {port.port: port for port in feeds_found()}
        for name in ("feed:hand", "feed:knee"):
            assert found[name].description == sensor.name
            assert found[name].serial_number == sensor.serial_number
    assert not {"feed:hand", "feed:knee"} & {port.port for port in feeds_found()}


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


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
def test_a_process_that_is_forked_leaves_the_feed_alone(board) -> None:
    with feed("glove", board) as glove, closing(open_source("feed:glove")) as source:
        if not (child := os.fork()):
            try:
                glove.push(VALUES)
            except Refusal:
                glove.close()
                os._exit(0)
            os._exit(1)
        assert os.waitpid(child, 0)[1] == 0
        glove.push(VALUES)
        assert len(taken(source, 1)) == 1
        with closing(open_source("feed:glove")):
            pass


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
def test_a_feed_that_is_ended_by_force_is_lost_at_once_though_a_worker_of_it_lives(board) -> None:
    script = f"""
import kappaskin, os, time
f = kappaskin.feed('glove', {str(board)!r})
time.sleep(1.0)
child = os.fork()
if child:
    print(child, flush=True)
    f.push(range(10))
time.sleep(60)
"""
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE) as other:
        end = time.monotonic() + 20
        while time.monotonic() < end:
            try:
                source = open_source("feed:glove")
                break
            except SourceError:
                time.sleep(0.05)
        with closing(source):
            worker = int(other.stdout.readline())
            taken(source, 1)
            other.kill()
            begun = time.monotonic()
            while not source.trouble and time.monotonic() < begun + 10:
                source.read(0.05)
            assert "start it again" in source.trouble
            assert time.monotonic() - begun < 5
            feed("glove", board).close()
        os.kill(worker, 9)


def test_who_joins_a_feed_of_many_elements_need_not_wait_for_a_push(board) -> None:
    rng = np.random.default_rng(0)
    places = np.round(rng.uniform(0.001, 0.059, (3000, 2)), 9).tolist()
    board.write_text(
        BOARD.replace("grid = [3, 3]", f"positions = {places}").replace("0..8", "0..2999")
    )
    with feed("many", board) as many, closing(open_source("feed:many")) as source:
        many.push(np.zeros(3001))  # 24 kB, more than the system holds
        assert len(taken(source, 1, 10.0)) == 1


def test_receivers_that_came_and_went_leave_nothing_though_nothing_is_pushed(board) -> None:
    with feed("glove", board):
        before = len(os.listdir("/dev/fd"))
        for _ in range(20):
            open_source("feed:glove").close()
        end = time.monotonic() + 10
        while len(os.listdir("/dev/fd")) > before + 2 and time.monotonic() < end:
            time.sleep(0.05)
        assert len(os.listdir("/dev/fd")) <= before + 2


def test_a_feed_that_pushes_nothing_is_said(board) -> None:
    with feed("glove", board), closing(open_source("feed:glove")) as source:
        end = time.monotonic() + 10
        while not source.trouble and time.monotonic() < end:
            source.read(0.05)
        assert "pushes nothing" in source.trouble


def test_a_feed_that_is_forgotten_ends(board) -> None:
    glove = feed("glove", board)
    del glove
    feed("glove", board).close()


def test_what_waits_when_a_receiver_goes_is_counted(board) -> None:
    with feed("glove", board) as glove:
        with socket.socket(socket.AF_UNIX) as deaf:
            deaf.connect(str(machine_folder("feeds") / "glove.sock"))
            deaf.recv(1)
            for _ in range(2000):
                glove.push(VALUES)
            dropped = glove.dropped
        end = time.monotonic() + 10
        while glove.dropped == dropped and time.monotonic() < end:
            time.sleep(0.02)
        assert dropped + 64 <= glove.dropped <= dropped + 65


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


def test_a_recording_over_a_break_is_verified_to_its_end(board, tmp_path) -> None:
    path = tmp_path / "glove.mcap"
    command = [sys.executable, "-m", "kappaskin", "record", "feed:glove", str(path)]
    first, again = feed("glove", board), None
    with subprocess.Popen([*command, "--seconds", "4"]) as recording:
        begun, pushed = math.inf, 0
        while recording.poll() is None:
            if first.dropped < pushed and begun == math.inf:
                begun = time.monotonic()
            if again is None and time.monotonic() > begun + 1.5:
                first.close()
                again = feed("glove", board)
            (again or first).push(VALUES)
            pushed += again is None
            time.sleep(0.01)
    again.close()

    *_, verdict = Verification.steps(path)
    assert verdict.same
    assert verdict.frames > 200
