"""Sound of the force: a tone whose pitch and loudness follow it, played by a system program."""

import math
import shutil
import time

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QObject, QProcess, QTimer, Signal

from kappaskin_app.guard import guarded

RATE = 22_050  # samples/s
_ONE_AT = (f"--rate={RATE}", "--channels=1")
PLAYERS = {
    "paplay": ("--raw", "--latency-msec=40", "--format=s16le", *_ONE_AT),
    "pw-cat": ("--playback", "--raw", "--latency=40ms", "--format=s16", *_ONE_AT, "-"),
    "aplay": ("-q", "-t", "raw", "-f", "S16_LE", "-r", str(RATE), "-c", "1", "-B", "60000", "-"),
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

    def samples(self, count: int, share: float) -> NDArray[np.int16]:
        """The next `count` samples for a force that is `share` of the largest; NaN for none."""
        silent = not share > 0
        share = 0.0 if silent else min(share, 1.0)
        loudness = 0.0 if silent else _FAINT + (_LOUD - _FAINT) * share
        turn = 2 * math.pi * _LOWEST * 2 ** (_OCTAVES * share) / RATE
        phase = self._phase + turn * np.arange(1, count + 1)
        swell = np.linspace(self._loudness, loudness, count)
        self._phase, self._loudness = float(phase[-1]) % (2 * math.pi), loudness
        return np.rint(32767 * swell * np.sin(phase)).astype("<i2")


def player() -> tuple[str, tuple[str, ...]] | None:
    """The first of `PLAYERS` that this system has, with its arguments."""
    return next(((name, how) for name, how in PLAYERS.items() if shutil.which(name)), None)


class Sound(QObject):
    """Player of the force, off at first; `ended` emits the reason when the program ends."""

    ended = Signal(str)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._tone, self._share = Tone(), math.nan
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

    def set_level(self, share: float) -> None:
        """Set the force as a share of the largest; NaN for none."""
        self._share = share

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
        if due > 0 and self._process.bytesToWrite() < RATE:
            self._written += due
            self._process.write(self._tone.samples(due, self._share).tobytes())

    def close(self) -> None:
        self._timer.stop()
        if self._process is not None:
            process, self._process = self._process, None
            process.kill()
            process.waitForFinished(1000)
            process.deleteLater()
