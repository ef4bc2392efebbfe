"""What is felt of the fingers: by tones, and nothing where data are old or lost."""

import os
import signal
from pathlib import Path

import numpy as np
import pytest

from kappaskin_app.features.operator.feeling import Feeling


@pytest.fixture
def felt(shared_window):
    feeling, shares = Feeling(shared_window.session), []
    feeling.felt.connect(lambda now: shares.append(now))
    feeling.set_active(True, 0.3)
    yield shares
    feeling.set_active(False, 0.3)


def test_the_force_is_felt_as_a_share_of_the_largest(felt, until, shared_window) -> None:
    until(lambda: felt and felt[-1][0] > 0.1)
    until(lambda: all(0 <= share <= 1 for now in felt for share in now))
    shared_window.session.engine.disconnect()
    until(lambda: felt[-1] == [0.0])
    shared_window.session.connect_to("sim:")
    until(lambda: felt[-1][0] > 0.1)


def test_an_engine_that_hangs_is_felt_no_more(felt, until, shared_window) -> None:
    until(lambda: felt and felt[-1][0] > 0.1)
    engine = shared_window.session.engine
    os.kill(engine.pid, signal.SIGSTOP)
    try:
        until(lambda: felt[-1] == [0.0])
    finally:
        os.kill(engine.pid, signal.SIGCONT)


@pytest.fixture
def player(tmp_path: Path, monkeypatch) -> Path:
    """A player that writes what it is given into a file."""
    script, kept = tmp_path / "aplay", tmp_path / "kept"
    script.write_text(f'#!/bin/sh\nexec /bin/cat > "{kept}"\n')
    script.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    return kept


def sounds(player: Path) -> bool:
    data = player.read_bytes() if player.exists() else b""
    return bool(np.frombuffer(data[: len(data) // 4 * 4], np.int16)[-1200:].any())


def test_tones_are_heard_while_the_operator_is_shown(shared_window, player, until) -> None:
    window = shared_window
    window.requests.set("operator_tones", True)
    window.docks.reveal("operator")
    until(lambda: sounds(player))
    window.docks["operator"].hide()
    until(lambda: window.control.link is None)
    assert not window.tones.on
    window.requests.set("operator_tones", False)


def test_without_a_player_it_is_said_and_switched_off(shared_window, monkeypatch, tmp_path, until):
    window = shared_window
    monkeypatch.setenv("PATH", str(tmp_path))
    window.requests.set("operator_tones", True)
    window.docks.reveal("operator")
    until(lambda: window.statusBar().currentMessage().startswith("No sound"))
    assert not window.history.settings.operator_tones
    window.docks["operator"].hide()
    until(lambda: window.control.link is None)
