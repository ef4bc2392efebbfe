"""Estimates in a loop of a program: those of the pipeline, in order, until the source ends."""

import gc
import os
import threading
import time
from collections import Counter
from contextlib import contextmanager
from itertools import count, islice, pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from kappaskin import Frame, Refusal, Setup, SourceError, Status, feed, stream
from kappaskin.cli import main
from kappaskin.cli.common import UsedTare
from kappaskin.recording import Recording
from kappaskin.recording.messages import CONTACTS

pytestmark = pytest.mark.slow
BOARD = """
format = 1
title = "Board"
[skin]
size = [0.06, 0.06]
rigidity = 3.7e-3
[elements]
grid = [4, 4]
[line]
kind = "text"
columns = ["sequence", "time", "height:0..15"]
[readings]
noise = 1e-6
"""


@pytest.fixture
def board(tmp_path):
    file = tmp_path / "board.toml"
    file.write_text(BOARD)
    return file


def line(n):
    return f"{n},{n / 1000},{','.join(['0.0001'] * 16)}\n"


def test_estimates_are_those_of_the_pipeline(tmp_path, board) -> None:
    file = tmp_path / "readings.csv"
    file.write_text("".join(map(line, range(200))))

    with stream(str(file), sensor=board, setup=Setup(3, 3)) as found:
        estimates = list(found)

    assert [each.sequence for each in estimates] == list(range(200))
    assert found.dropped == 0
    assert estimates[0].coefficients.shape == (3, 3)
    # A plane of 0.1 mm, by sines that end at zero: least squares of its own.
    at = (np.arange(4) + 0.5) / 4 * np.pi
    sines = np.sin(np.outer(at, np.arange(1, 4)))
    own = np.linalg.lstsq(np.kron(sines, sines), np.full(16, 1e-4), rcond=None)[0]
    np.testing.assert_allclose(estimates[9].coefficients.ravel(), own, atol=1e-9)


@pytest.mark.parametrize("text", ["hello world\n" * 500, ""])
def test_a_file_without_a_record_raises(tmp_path, board, text) -> None:
    file = tmp_path / "garbage.csv"
    file.write_text(text)
    with (
        stream(str(file), sensor=board) as found,
        pytest.raises(SourceError, match=r"garbage.csv: ended, 0 of 0 messages lost.*got none"),
    ):
        list(found)
    assert list(found) == []


def test_without_a_setup_there_are_as_many_functions_as_the_sensor_determines(board) -> None:
    with feed("glove", board) as glove, stream("feed:glove") as found:
        glove.push([0, 0, *[1e-4] * 16])
        assert next(found).coefficients.shape == (4, 4)


def test_a_setup_that_the_sensor_does_not_allow_is_refused(board) -> None:
    with feed("glove", board), pytest.raises(Refusal, match="coefficients"):
        stream("feed:glove", setup=Setup(9, 9))


def test_of_frames_that_wait_the_newest_are_given_and_the_others_counted(board) -> None:
    with feed("glove", board) as glove, stream("feed:glove") as found:
        for n in range(200):
            glove.push([n, n / 1000, *[1e-4] * 16])
            time.sleep(1e-3)  # so that none is dropped on the way
        time.sleep(0.3)
        sequences = [next(found).sequence for _ in range(64)]

    assert glove.dropped == 0
    assert sequences == list(range(136, 200))
    assert found.dropped == 136


def test_after_a_pause_the_newest_frames_are_given(board) -> None:
    with feed("glove", board) as glove, stream("feed:glove") as found:
        for n in range(3000):  # more than one read brings
            glove.push([n, n / 1000, *[1e-4] * 16])
            if not n % 20:
                time.sleep(1e-3)
        time.sleep(0.3)
        first = next(found).sequence

    assert first == 3000 - 64
    assert found.dropped + glove.dropped == 3000 - 64


def test_a_lost_connection_is_raised_and_what_came_before_is_given(board) -> None:
    glove, found = feed("glove", board), stream("feed:glove")
    for n in range(5):
        glove.push([n, n / 1000, *[1e-4] * 16])
    time.sleep(0.1)
    glove.close()

    with pytest.raises(SourceError, match="the program that feeds it ended"):  # noqa: PT012
        for number, estimate in enumerate(found):
            assert estimate.sequence == number
    assert number == 4
    assert list(found) == []


def test_a_simulation_and_a_recording_are_streamed(recording) -> None:
    with stream("sim:centre") as simulated:
        forces = [each.contact.force for each in islice(simulated, 20)]
    with stream(f"replay:{recording}") as replayed:
        again = list(replayed)  # to its end

    assert np.isfinite(forces).all()
    assert all(later.host_time >= one.host_time for one, later in pairwise(again))
    assert replayed.sensor is not None
    with Recording(recording) as recorded:
        assert len(again) == sum(1 for _ in recorded.messages_on(CONTACTS)) > 100


def test_a_device_that_is_unplugged_raises(board) -> None:
    tty = pytest.importorskip("tty", reason="no pseudo-terminals on this system")
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    with stream(os.ttyname(theirs), sensor=board) as found:
        os.write(ours, "".join(map(line, range(9))).encode())
        assert next(found).sequence == 1  # the first line may be half of one
        os.close(ours)
        with pytest.raises(SourceError, match="connection lost: the device was unplugged"):
            list(found)
    os.close(theirs)


def test_a_loop_that_is_left_closes_its_source(board) -> None:
    before = set(threading.enumerate())
    with feed("glove", board) as glove:
        glove.push([0, 0, *[0.0] * 16])
        for _ in stream("sim:"):
            break
        found = stream("feed:glove")
        del found
        gc.collect()
    assert set(threading.enumerate()) == before


def test_a_source_that_cannot_be_opened_says_why(board) -> None:
    with pytest.raises(SourceError, match="no program feeds it"):
        stream("feed:nobody")
    with pytest.raises(Refusal, match="a port or URL with a sensor's description, got sim:"):
        stream("sim:", sensor=board)
    with pytest.raises(SourceError, match="no such port"):
        stream(os.path.join(os.sep, "dev", "ttyNOT"))


@contextmanager
def pushed(board, numbers, every=0.005):
    """A feed of these numbers again and again."""
    over = threading.Event()
    with feed("glove", board) as glove:

        def push() -> None:
            for n in count():
                glove.push([n, n * every, *numbers[n % len(numbers)]])
                if over.wait(every):
                    return

        pushing = threading.Thread(target=push)
        pushing.start()
        try:
            yield
        finally:
            over.set()
            pushing.join()


def test_the_saved_tare_is_used_by_a_loop_and_by_publishing(board) -> None:
    rng = np.random.default_rng(3)
    offset = rng.normal(0, 1e-5, 16)
    with pushed(board, offset + rng.normal(0, 1e-6, (500, 16))):
        with stream("feed:glove") as found:
            untared = np.mean([each.curvature for each in islice(found, 50)], axis=0)
            sensor = found.sensor
        assert main(["tare", "feed:glove"]) == 0
        with stream("feed:glove") as found:
            tared = np.mean([each.curvature for each in islice(found, 50)], axis=0)
        used = list[Setup]()
        asked = SimpleNamespace(setup=Setup())
        publishing = UsedTare(SimpleNamespace(set_up=used.append, requested=asked))
        publishing(Status(connections=1, sensor=sensor))
        publishing(Status(connections=1, sensor=sensor))
        assert main(["tare", "feed:glove", "--undo"]) == 0

    assert np.sqrt(np.mean(untared**2)) > 5e-6
    assert np.sqrt(np.mean(tared**2)) < 1e-6
    assert [each.tare is not None for each in used] == [True]


# A hand.


def test_the_estimates_of_all_fingers_come_each_with_its_name() -> None:
    seen = Counter[str]()
    with stream({"thumb": "sim:circle", "index": "sim:circle"}) as hand:
        for finger, estimate in hand:
            assert abs(time.monotonic() - estimate.taken) < 5.0  # on one clock
            seen[finger] += 1
            if min(seen["thumb"], seen["index"]) >= 3:
                break
    assert set(seen) == {"thumb", "index"}


def test_a_finger_that_fails_leaves_the_others_alone(monkeypatch) -> None:
    hand = stream({"thumb": "sim:circle", "index": "sim:circle"})

    def lost(timeout: float) -> list[Frame]:
        raise SourceError("it was unplugged")

    monkeypatch.setattr(hand.streams["index"]._source, "read", lost)  # noqa: SLF001
    with hand:
        finger, _ = next(iter(hand))
        assert finger == "thumb"
        assert str(hand.failures["index"]) == "it was unplugged"


def test_where_all_fingers_fail_the_first_failure_is_raised(monkeypatch) -> None:
    hand = stream({"thumb": "sim:circle"})
    monkeypatch.setattr(
        hand.streams["thumb"]._source,  # noqa: SLF001
        "read",
        lambda _: (_ for _ in ()).throw(SourceError("it was unplugged")),
    )
    with hand, pytest.raises(SourceError, match="unplugged"):
        next(iter(hand))
    with pytest.raises(SourceError):  # what was opened is closed again
        stream({"thumb": "sim:circle", "index": "/dev/none-there"})
