"""Sound of forces: a tone for each, whose pitch and loudness follow it, by a system program."""

import math
import shutil
import time
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QObject, QProcess, QTimer, Signal

from kappaskin.frames import Array
from kappaskin_app.guard import guarded

RATE = 22_050  # samples/s
_FORMAT = (f"--rate={RATE}", "--channels=2")
PLAYERS = {
    "paplay": ("--raw", "--latency-msec=40", "--format=s16le", *_FORMAT),
    "pw-cat": ("--playback", "--raw", "--latency=40ms", "--format=s16", *_FORMAT, "-"),
    "aplay": ("-q", "-t", "raw", "-f", "S16_LE", "-r", str(RATE), "-c", "2", "-B", "60000", "-"),
}
"""Programs that play samples from standard input, and their arguments: PulseAudio, PipeWire, ALSA.

Qt's audio module is in the large add-on package of PySide6, which nothing else here needs.
"""

_TICK = 20  # ms between two writes
_AHEAD = 0.06  # s of samples buffered in the player
_LOWEST, _OCTAVES = 220.0, 2.0  # Hz at the smallest force, and the range up to the largest
_LOUD, _FAINT = 0.25, 0.06  # of full scale, at the largest and the smallest force


class Tone:
    """Sine generator with continuous phase and smooth loudness."""

    def __init__(self) -> None:
        self._phase = self._loudness = 0.0

    def samples(self, count: int, share: float) -> Array:
        """The next `count` samples for a force that is `share` of the largest; NaN for none."""
        silent = not share > 0
        share = 0.0 if silent else min(share, 1.0)
        loudness = 0.0 if silent else _FAINT + (_LOUD - _FAINT) * share
        turn = 2 * math.pi * _LOWEST * 2 ** (_OCTAVES * share) / RATE
        phase = self._phase + turn * np.arange(1, count + 1)
        swell = np.linspace(self._loudness, loudness, count)
        self._phase, self._loudness = float(phase[-1]) % (2 * math.pi), loudness
        return swell * np.sin(phase)


class Voices:
    """A `Tone` of each force, from the left to the right in their order; one alone is in front."""

    def __init__(self) -> None:
        self._tones = list[Tone]()

    def samples(self, count: int, shares: Sequence[float]) -> NDArray[np.int16]:
        """The next `count` samples (count, 2), left and right, for forces that are such `shares`.

        What is no force any more fades before its voice is gone.
        """
        self._tones += [Tone() for _ in range(len(shares) - len(self._tones))]
        voices = len(self._tones)
        heard = [*shares, *[math.nan] * (voices - len(shares))]
        angles = (np.arange(voices) + 0.5 * (voices == 1)) / max(voices - 1, 1) * math.pi / 2
        tones = [tone.samples(count, share) for tone, share in zip(self._tones, heard, strict=True)]
        del self._tones[len(shares) :]
        if not tones:
            return np.zeros((count, 2), "<i2")
        sides = np.column_stack([np.cos(angles), np.sin(angles)])  # as loud wherever it is
        loudest = max(1.0, float(_LOUD * sides.sum(axis=0).max()))
        return np.rint(32767 / loudest * np.transpose(tones) @ sides).astype("<i2")


def player() -> tuple[str, tuple[str, ...]] | None:
    """The first of `PLAYERS` that this system has, with its arguments."""
    return next(((name, how) for name, how in PLAYERS.items() if shutil.which(name)), None)


class Sound(QObject):
    """Player of forces, off at first; `ended` emits the reason when the program ends."""

    ended = Signal(str)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._voices, self._shares = Voices(), ()
        self._began, self._written = 0.0, 0
        self._process: QProcess | None = None
        self._timer = QTimer(self, interval=_TICK)  # pyright: ignore[reportCallIssue]
        self._timer.timeout.connect(guarded(self._write))

    @property
    def on(self) -> bool:
        return self._process is not None

    def toggle(self) -> str:
        """Switch it on or off; the error message if it cannot be switched on."""
        if self.on:
            self.close()
            return ""
        found = player()
        if found is None:
            return f"No sound: none of {', '.join(PLAYERS)} is on this system"
        self._process = QProcess(self)
        self._process.start(found[0], list(found[1]))
        self._began, self._written = time.monotonic(), 0
        self._timer.start()
        return ""

    def set_levels(self, *shares: float) -> None:
        """Set each force as a share of the largest; NaN for none."""
        self._shares = shares

    def _write(self) -> None:
        if self._process is None:
            return
        if self._process.state() == QProcess.ProcessState.NotRunning:
            error = bytes(self._process.readAllStandardError().data()).decode(errors="replace")
            self.close()
            self.ended.emit(f"No sound: the player ended. {error.strip()}".strip())
            return
        due = round((time.monotonic() - self._began + _AHEAD) * RATE) - self._written
        if due > RATE // 2:  # after a stall of the window the missed samples are dropped
            self._written += due - RATE // 50
            due = RATE // 50
        if due > 0 and self._process.bytesToWrite() < 2 * RATE:
            self._written += due
            self._process.write(self._voices.samples(due, self._shares).tobytes())

    def close(self) -> None:
        self._timer.stop()
        if self._process is not None:
            process, self._process = self._process, None
            process.kill()
            process.waitForFinished(1000)
            process.deleteLater()
