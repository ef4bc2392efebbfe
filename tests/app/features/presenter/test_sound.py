"""The tone by itself, and through a player that only keeps what it is given."""

import math
from pathlib import Path

import numpy as np
import pytest

from kappaskin_app.features.presenter.sound import RATE, Sound, Tone


def pitch(samples) -> float:
    """The frequency in Hz of the strongest line."""
    spectrum = np.abs(np.fft.rfft(samples * np.hanning(len(samples))))
    return float(np.argmax(spectrum)) * RATE / len(samples)


def test_the_tone_rises_two_octaves_and_swells_with_the_force() -> None:
    heard = []
    for share in (1e-6, 0.5, 1.0):
        tone = Tone()
        tone.samples(100, share)
        heard.append(tone.samples(RATE, share))
    assert [pitch(samples) for samples in heard] == pytest.approx([220, 440, 880], abs=2)
    loud = [float(np.abs(samples).max()) for samples in heard]
    assert loud == sorted(loud)
    assert loud[-1] < 0.3 * 32767


def test_nothing_is_heard_of_nothing() -> None:
    tone = Tone()
    for share in (math.nan, 0.0, -1.0):
        assert not tone.samples(500, share).any()


def test_the_tone_never_jumps() -> None:
    tone, shares = Tone(), (math.nan, 0.1, 0.9, 5.0, 0.3, math.nan, math.nan)
    samples = np.concatenate([tone.samples(441, share) for share in shares]).astype(int)
    steepest = 2 * math.pi * 880 / RATE * 0.25 * 32767
    assert np.abs(np.diff(samples)).max() < 1.1 * steepest


@pytest.fixture
def player(tmp_path: Path, monkeypatch) -> Path:
    """A player that writes what it is given into a file."""
    script, kept = tmp_path / "aplay", tmp_path / "kept"
    script.write_text(f'#!/bin/sh\nexec /bin/cat > "{kept}"\n')
    script.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    return kept


def test_what_is_felt_is_streamed_as_it_comes_until_it_is_switched_off(player, until, qtbot):
    heard = Sound()
    heard.set_level(1.0)
    assert heard.toggle() == ""
    until(lambda: player.exists() and player.stat().st_size > RATE)  # half a second
    assert heard.toggle() == ""
    assert not heard.on
    samples = np.frombuffer(player.read_bytes()[: 2 * (RATE // 2)], np.int16)
    assert pitch(samples[2000:]) == pytest.approx(880, abs=5)


def test_a_player_that_ends_is_given_up(player, until):
    (player.parent / "aplay").write_text("#!/bin/sh\necho no device >&2\nexit 1\n")
    heard, told = Sound(), []
    heard.ended.connect(told.append)
    heard.toggle()
    until(lambda: not heard.on)
    assert told == ["No sound: the player ended. no device"]


def test_without_a_player_it_is_said(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    heard = Sound()
    assert "none of paplay, pw-cat, aplay" in heard.toggle()
    assert not heard.on


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
