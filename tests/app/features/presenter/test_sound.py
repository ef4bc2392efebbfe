"""The sound of the force, with the presenter: when it is heard, and why it is not."""

from pathlib import Path

import numpy as np
import pytest

from kappaskin_app.shell.sound import RATE


@pytest.fixture
def player(tmp_path: Path, monkeypatch) -> Path:
    """A player that writes what it is given into a file."""
    script, kept = tmp_path / "aplay", tmp_path / "kept"
    script.write_text(f'#!/bin/sh\nexec /bin/cat > "{kept}"\n')
    script.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    return kept


@pytest.mark.full
def test_the_window_says_why_there_is_no_sound(window, monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    window.actions_by_name["sound"].trigger()
    assert window.statusBar().currentMessage().startswith("No sound")
    assert not window.actions_by_name["sound"].isChecked()


@pytest.mark.full
def test_the_window_sounds_only_while_something_is_felt(window, player, until):
    action = window.actions_by_name["sound"]
    action.trigger()
    assert action.isChecked()
    until(lambda: player.exists() and player.stat().st_size > RATE // 2)
    assert not np.frombuffer(player.read_bytes()[: RATE // 2 & ~1], np.int16).any()
    window.presenter.enter()

    def sounds() -> bool:
        data = player.read_bytes()
        return np.frombuffer(data[: len(data) // 2 * 2], np.int16)[-600:].any()

    until(sounds)
    window.presenter.leave()
    action.trigger()
    assert not action.isChecked()
