"""`record`, `info`, `verify` and `repair`, as they are typed."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import psutil
import pytest

from kappaskin.cli import main
from kappaskin.cli.common import ProgressLine, fingers_of
from kappaskin.cli.record import _recorded
from kappaskin.live import Status
from kappaskin.recording import Recording, RecordingStatus
from kappaskin.recording.writing import part_of

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("commands") / "press.mcap"
    command = [sys.executable, "-m", "kappaskin", "record", "sim:circle", str(path)]
    done = subprocess.run([*command, "--seconds", "1.5"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert f"{path}: " in done.stdout
    assert "messages in" in done.stdout
    assert re.search(r"^kappaskin: slopes reach 0.\d+: up to \d % too flat; use f", done.stderr)
    return path


@pytest.mark.full
def test_stopped_it_ends_its_file(tmp_path) -> None:
    path = tmp_path / "a.mcap"
    command = [sys.executable, "-m", "kappaskin", "record", "sim:circle", str(path)]
    for number in (signal.SIGINT, signal.SIGTERM):
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            end = time.monotonic() + 30
            while time.monotonic() < end:
                if part_of(path).exists() and part_of(path).stat().st_size > 50_000:
                    break
                time.sleep(0.02)
            process.send_signal(number)
            told, _ = process.communicate(timeout=30)
            assert process.returncode == 0
        with Recording(path) as recording:
            assert recording.whole
            # Who else wants the cores may cost frames before; stopping loses none of the file.
            assert f"{path}: {sum(recording.counts.values()):,} messages in " in told
        path.unlink()


def engine_of(process: subprocess.Popen[str], begun: Callable[[], bool]) -> psutil.Process:
    """The engine's process of a command, once something has `begun`."""
    end = time.monotonic() + 60
    while time.monotonic() < end:
        for child in psutil.Process(process.pid).children(recursive=True) if begun() else ():
            with suppress(psutil.NoSuchProcess):
                if "forkserver" in " ".join(child.cmdline()) and child.num_threads() > 1:
                    return child
        time.sleep(0.05)
    raise AssertionError("no engine was begun")


@pytest.mark.full
def test_an_engine_that_is_killed_is_told_and_what_it_recorded_is_completed(tmp_path) -> None:
    path = tmp_path / "a.mcap"
    command = [sys.executable, "-m", "kappaskin", "record", "sim:circle", str(path)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        part = part_of(path)
        engine = engine_of(process, lambda: part.exists() and part.stat().st_size > 50_000)
        engine.kill()
        told, why = process.communicate(timeout=60)
    assert process.returncode == 1
    assert told == ""
    assert "the engine process ended unexpectedly; saved up to then: " in why.splitlines()[-1]
    with Recording(path) as recording:
        assert recording.whole
        assert f"{sum(recording.counts.values()):,} messages" in why
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.full
@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="no process can be stopped")
def test_an_engine_that_hangs_is_ended_and_what_it_recorded_is_completed(tmp_path) -> None:
    path = tmp_path / "a.mcap"
    # No less: it is also how long a busy machine may take until the first reading.
    patched = "import sys; from kappaskin.cli import main, record; record._BEGIN = 6.0; "
    patched += f"sys.exit(main(['record', 'sim:circle', {str(path)!r}]))"
    with subprocess.Popen(
        [sys.executable, "-c", patched], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        part = part_of(path)
        # Long after the first reading, which the command has seen then too.
        begun = lambda: part.exists() and part.stat().st_size > 400_000  # noqa: E731
        engine_of(process, begun).suspend()
        told, why = process.communicate(timeout=60)
    assert (process.returncode, told) == (1, "")
    assert "the engine process did not respond and was ended; saved up to" in why.splitlines()[-1]
    with Recording(path) as recording:
        assert recording.whole
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.full
def test_publishing_ends_where_its_engine_is_killed_again_and_again() -> None:
    command = [sys.executable, "-m", "kappaskin", "publish", "sim:circle", "--udp", "127.0.0.1:9"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        for _ in range(3):
            engine_of(process, lambda: True).kill()
        _, why = process.communicate(timeout=60)
    assert process.returncode == 2
    assert "the engine process ended 3 times within 10 s" in why.splitlines()[-1]


@pytest.mark.parametrize(
    ("source", "seconds", "why"),
    [
        ("sim:", "0", "expected a time above 0 s"),
        ("sim:", "nan", "expected a time above 0 s"),
        ("sim:none", "1", "expected a scene among"),
        ("replay:x.mcap", "1", "expected a live source"),
        ("/dev/there/is/none", "1", "there is no such port"),
    ],
)
def test_what_cannot_be_recorded_leaves_nothing(source, seconds, why, tmp_path, capsys) -> None:
    out = tmp_path / "a.mcap"
    assert main(["record", source, str(out), "--seconds", seconds]) == 2
    assert why in capsys.readouterr().err
    assert os.listdir(tmp_path) == []


def test_a_recording_is_not_named_as_a_table(tmp_path, capsys) -> None:
    assert main(["record", "sim:", str(tmp_path / "a.csv"), "--seconds", "1"]) == 2
    remedy = "record to a.mcap, then kappaskin export a.mcap --to a.csv"
    assert remedy in capsys.readouterr().err
    assert os.listdir(tmp_path) == []


def test_no_file_is_written_over(tmp_path, capsys) -> None:
    out = tmp_path / "a.mcap"
    out.write_bytes(b"mine")
    assert main(["record", "sim:", str(out), "--seconds", "1e-9"]) == 2
    assert "already exists" in capsys.readouterr().err
    assert out.read_bytes() == b"mine"


@pytest.mark.full
def test_info_tells_what_is_in_it(recorded, capsys) -> None:
    assert main(["info", str(recorded)]) == 0
    told = capsys.readouterr().out
    skin = "elements on a hinged patch of 0.1 x 0.1 m, firmware"
    for words in ("Simulated skin SIM-0001", skin, "scene-0.toml", "/kappaskin/line", "kappaskin "):
        assert words in told
    assert main(["info", str(recorded), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["whole"]
    assert 1.0 < said["seconds"] < 5.0
    assert said["messages"]["/kappaskin/line"] > 100


def test_verify_says_that_all_are_the_same(recorded, capsys) -> None:
    assert main(["verify", str(recorded)]) == 0
    assert "the same bit for bit" in capsys.readouterr().out


def test_repair_tells_by_its_exit_code_what_was_lost(recorded, tmp_path, capsys) -> None:
    part, data = tmp_path / "press.mcap.part", recorded.read_bytes()
    with Recording(recorded) as recording:
        place = recording.chunks[len(recording.chunks) // 2].at
    cases = (
        (data, 0, "nothing was lost"),
        (data[:place], 0, "nothing was lost"),
        (data[: place + 500], 1, "bytes could not be read"),
        (data[:60], 3, "no message could be saved"),
        (b"something else", 2, "expected a recording"),
    )
    for n, (left, code, words) in enumerate(cases):
        part.write_bytes(left)
        out = tmp_path / f"{n}.mcap"
        assert main(["repair", str(part), "--out", str(out)]) == code
        told = capsys.readouterr()
        assert words in told.out + told.err
        assert out.exists() == (code < 2)
        if code < 2:
            assert main(["info", str(out)]) == 0
            assert "not ended" not in capsys.readouterr().out
    assert main(["info", str(recorded.with_name("none.mcap"))]) == 2


class StuckEngine:
    """An engine that records and computes after `prepared` s, and reports nothing more."""

    alive, silent = True, 0.0

    def __init__(self, prepared: float = 0.0) -> None:
        self._ready = time.monotonic() + prepared

    def status(self) -> Status:
        slot = np.dtype([]) if time.monotonic() >= self._ready else None
        return Status(recording=RecordingStatus("a.mcap", active=True), slot=slot)


def test_the_seconds_are_over_even_if_the_engine_reports_no_more() -> None:
    began = time.monotonic()
    with ProgressLine() as show_progress:
        _recorded(StuckEngine(), 0.3, [], show_progress)  # type: ignore[arg-type]
    assert 0.3 <= time.monotonic() - began < 5.0


def test_the_seconds_begin_once_frames_are_computed() -> None:
    began = time.monotonic()
    with ProgressLine() as show_progress:
        _recorded(StuckEngine(0.5), 0.2, [], show_progress)  # type: ignore[arg-type]
    assert 0.6 <= time.monotonic() - began < 5.0


# A hand.


@pytest.fixture(scope="module")
def hand(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A thumb and an index; the port of a ring finger is not there."""
    path = tmp_path_factory.mktemp("hand") / "hand.mcap"
    command = [sys.executable, "-m", "kappaskin", "record", str(path), "--seconds", "3"]
    for finger, source in (("thumb", "sim:circle"), ("ring", "/dev/none"), ("index", "sim:circle")):
        command += ["--source", f"{finger}={source}"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 1
    assert "kappaskin: ring: /dev/none: there is no such port" in done.stderr
    assert f"{path}: " in done.stdout
    assert re.search(r"^  ring: 0 of 0 messages lost$", done.stdout, re.MULTILINE)
    return path


def test_a_hand_is_recorded_but_for_the_finger_that_is_lost(hand, capsys) -> None:
    assert main(["info", str(hand), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["fingers"]
    assert list(told) == ["thumb", "ring", "index"]
    assert [len(told[finger]["devices"]) for finger in told] == [1, 0, 1]
    assert main(["info", str(hand)]) == 0
    assert f"{hand} (index): " in capsys.readouterr().out


def test_each_finger_is_verified(hand, capsys) -> None:
    assert main(["verify", str(hand)]) == 1  # there is nothing of the ring finger
    thumb, ring, index = capsys.readouterr().out.splitlines()
    assert thumb.startswith(f"{hand} (thumb): ")
    assert ring.endswith("nothing to compare")
    assert all(line.endswith("the same bit for bit") for line in (thumb, index))


def test_each_finger_is_exported_or_the_one_that_is_named(hand, tmp_path, capsys) -> None:
    out = tmp_path / "press.csv"
    assert main(["export", str(hand), "--to", str(out), "--finger", "index"]) == 0
    assert '# finger: "index"' in out.read_text("utf-8")
    assert main(["export", str(hand), "--to", str(out)]) == 1  # of the ring finger there is none
    assert "kappaskin: ring: " in capsys.readouterr().err
    assert sorted(os.listdir(tmp_path)) == ["press-index.csv", "press-thumb.csv", "press.csv"]
    assert (tmp_path / "press-index.csv").read_bytes() == out.read_bytes()


def test_a_hand_is_named_by_its_description(tmp_path) -> None:
    hand = tmp_path / "hand.toml"
    fingers = (f'[[finger]]\nname = "{n}"\nsource = "sim:{n}"\nposition = [0, 0, 0]' for n in "ab")
    hand.write_text("\n".join(["format = 1", *fingers]))
    named = {"a": "sim:a", "b": "sim:b"}
    assert fingers_of(str(hand), None, None) == fingers_of(None, [str(hand)], None) == named
    assert list(fingers_of("hand:three-fingertips", None, None)) == ["thumb", "index", "middle"]
    assert fingers_of("hand:three-fingertips#thumb", None, None) == {
        "": "hand:three-fingertips#thumb"
    }


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (["--source", "a=sim:", "--source", "a=sim:"], "one source for the finger a, got two"),
        (["--source", "a=sim:", "--source", "sim:"], "a name for each of several sources"),
        (["sim:", "--source", "a=sim:", "--out", "a.mcap"], "NAME=SOURCE .* got both"),
        (["--out", "a.mcap"], "expected a source such as sim:.* got none"),
        (["--source", "a=replay:x.mcap"], "expected a live source to record"),
        (["--source", "hand:mine"], "expected a hand among .*three-fingertips"),
    ],
)
def test_a_hand_that_is_none_is_refused(arguments, why, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    by_place = [] if "--out" in arguments else ["hand.mcap"]
    assert main(["record", *by_place, *arguments]) == 2
    assert re.search(why, capsys.readouterr().err)
    assert os.listdir(tmp_path) == []


def test_a_hand_is_published_with_its_fingers_named_but_for_the_one_that_is_lost() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(60)
        port = receiver.getsockname()[1]
        command = [sys.executable, "-m", "kappaskin", "publish", "--udp", f"127.0.0.1:{port}"]
        for finger, source in (("thumb", "sim:"), ("ring", "/dev/none"), ("index", "sim:")):
            command += ["--source", f"{finger}={source}"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
            seen = set[tuple[str, str]]()
            wanted = {("thumb", "contact"), ("index", "contact"), ("ring", "status")}
            while not wanted <= seen:
                message = json.loads(receiver.recv(65536))
                seen.add((message["finger"], message["kind"]))
            process.send_signal(signal.SIGINT)
            _, told = process.communicate(timeout=60)
            assert process.returncode == 1
    assert ("ring", "contact") not in seen
    assert b"kappaskin: ring: /dev/none: there is no such port" in told
