"""Tones by themselves, and through a player that only keeps what it is given."""

import math
from pathlib import Path

import numpy as np
import pytest

from kappaskin_app.shell.sound import RATE, Sound, Tone, Voices


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
    assert loud[-1] < 0.3


def test_nothing_is_heard_of_nothing() -> None:
    tone = Tone()
    for share in (math.nan, 0.0, -1.0):
        assert not tone.samples(500, share).any()


def test_the_tone_never_jumps() -> None:
    tone, shares = Tone(), (math.nan, 0.1, 0.9, 5.0, 0.3, math.nan, math.nan)
    samples = np.concatenate([tone.samples(441, share) for share in shares])
    steepest = 2 * math.pi * 880 / RATE * 0.25
    assert np.abs(np.diff(samples)).max() < 1.1 * steepest


def sides(samples) -> np.ndarray:
    """How loud it is left and right."""
    return np.sqrt(np.mean(samples.astype(float) ** 2, axis=0))


def test_the_fingers_are_heard_from_the_left_to_the_right_in_their_order() -> None:
    alone = np.eye(3) + np.where(np.eye(3), 0, np.nan)
    voices = [Voices() for _ in alone]
    heard = np.array([sides(v.samples(RATE, each)) for v, each in zip(voices, alone, strict=True)])
    left, middle, right = heard
    assert left[1] == right[0] == 0
    assert middle[0] == pytest.approx(middle[1])
    assert np.linalg.norm(heard, axis=1) == pytest.approx(np.linalg.norm(left), rel=1e-3)


def test_many_voices_together_are_not_clipped() -> None:
    voices = Voices()
    loudest = max(np.abs(voices.samples(441, [1.0] * 10)).max() for _ in range(50))
    assert 0.5 * 32767 < loudest <= 32767


def test_a_voice_that_is_gone_fades_first() -> None:
    voices = Voices()
    voices.samples(441, [1.0, 1.0])
    ends = voices.samples(441, []).astype(int)
    steepest = 2 * math.pi * 880 / RATE * 0.25 * 32767
    assert np.abs(np.diff(ends, axis=0)).max() < 1.1 * steepest
    assert np.abs(ends[-20:]).max() < 0.02 * 32767
    assert not voices.samples(441, []).any()


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
    heard.set_levels(1.0)
    assert heard.toggle() == ""
    until(lambda: player.exists() and player.stat().st_size > 2 * RATE)  # half a second
    assert heard.toggle() == ""
    assert not heard.on
    samples = np.frombuffer(player.read_bytes()[: 4 * (RATE // 2)], np.int16).reshape(-1, 2)
    assert pitch(samples[2000:, 0]) == pytest.approx(880, abs=5)
    np.testing.assert_array_equal(*samples.T)  # in front


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
