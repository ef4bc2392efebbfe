"""`kappaskin serve`: what it prints lets a window in."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from kappaskin.cli import REFUSED, main
from kappaskin.live import STREAMING, RemoteFingers, remote_engines
from kappaskin.publish.access import _token

pytestmark = pytest.mark.slow


@pytest.mark.skipif(os.name == "nt", reason="by a signal")
def test_what_is_printed_lets_a_window_in(tmp_path: Path) -> None:
    fingers = ["--source", "thumb=sim:circle", "--source", "index=sim:line"]
    environment = {name: each for name, each in os.environ.items() if name != "KAPPASKIN_TOKEN"}
    command = [sys.executable, "-m", "kappaskin", "serve", *fingers, "--listen", "127.0.0.1:0"]
    with subprocess.Popen(
        [*command, "--recordings", str(tmp_path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
    ) as served:
        try:
            assert served.stdout is not None
            line = served.stdout.readline()
            found = re.search(r"KAPPASKIN_TOKEN=(\S+) kappaskin app --source (engine:\S+)", line)
            assert found is not None, line
            with remote_engines(found[2], found[1]) as hand:
                assert isinstance(hand, RemoteFingers)
                end = time.monotonic() + 60
                states = set[str]()
                while states != {STREAMING} and time.monotonic() < end:
                    time.sleep(0.05)
                    states = {each.state for each in hand.status().values()}
                assert states == {STREAMING}
        finally:
            served.send_signal(signal.SIGTERM)
            _, told = served.communicate(timeout=60)
    assert served.returncode == 0
    assert "(127.0.0.1) is connected" in told
    assert "is gone; the engine goes on" in told


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["sim:", "--recordings", "no-such-folder"], "make it first"),
        (["sim:", "--listen", "a:b:c"], "HOST or HOST:PORT"),
        (["sim:no-such-scene"], "expected a scene"),
        ([], "expected a source"),
    ],
)
def test_what_cannot_be_served_is_refused(arguments, said, capsys, monkeypatch, tmp_path) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["serve", *arguments, "--seconds", "1"]) == REFUSED
    assert said in capsys.readouterr().err


def test_a_short_token_is_refused(capsys, monkeypatch) -> None:
    _token.cache_clear()
    monkeypatch.setenv("KAPPASKIN_TOKEN", "short")
    try:
        assert main(["serve", "sim:"]) == REFUSED
    finally:
        _token.cache_clear()
    assert "16 to 128 letters" in capsys.readouterr().err
