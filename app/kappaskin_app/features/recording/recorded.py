"""What is in a recording, read in the background before it is played."""

from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from PySide6.QtCore import QObject, QTimer, Signal

from kappaskin.errors import Refusal
from kappaskin.frames import Event
from kappaskin.pipeline import Setup
from kappaskin.recording import Recording, Replay, recorded_setups
from kappaskin_app.features.recording.transport import minutes
from kappaskin_app.guard import guarded
from kappaskin_app.shell.folders import repairing
from kappaskin_app.widgets.text import day


@dataclass(frozen=True)
class Recorded:
    """What there is to know of the recording at `path` before it is played.

    `setups` it was made with, each from a time in s on, and why they cannot be told.
    """

    path: Path
    length: float = 0.0
    whole: bool = True
    setups: tuple[tuple[float, Setup], ...] = ()
    trouble: str = ""

    def setup_at(self, at: float) -> Setup | None:
        """The one in use at `at` s; before the first, that."""
        used = [setup for since, setup in self.setups if since <= at] or [
            setup for _, setup in self.setups[:1]
        ]
        return used[-1] if used else None

    def title(self, replay: Replay) -> str:
        """What the window is called while it is played."""
        return f"{self.path.name}, recorded {day(replay.begun)} \N{EN DASH} Kappaskin"

    def changes(self) -> list[Event]:
        """Where another setup came into use, in words."""
        return [
            Event(since, "settings", f"{now.Ni} x {now.Nj} functions, {now.method}")
            for (_, was), (since, now) in zip(self.setups, self.setups[1:], strict=False)
            if now != was
        ]


def recorded(path: Path) -> Recorded:
    """Look into the file at `path`; a `Refusal` where it is no recording."""
    with Recording(path) as recording:
        length = (recording.last - recording.first) * 1e-9
        try:
            setups = tuple(recorded_setups(recording))
        except Refusal as refusal:
            return Recorded(path, length, recording.whole, (), str(refusal))
        return Recorded(path, length, recording.whole, setups)


def told_of(found: Recorded) -> str:
    """What a person should know of a recording that is opened, or nothing."""
    told: list[str] = []
    if not found.whole:
        told.append(
            f"The recording {found.path.name} was never ended: it is played up to "
            f"{minutes(found.length)}, where it breaks off. To make it whole: "
            f"`{repairing(found.path)}`."
        )
    if found.trouble:
        told.append(f"The settings recorded cannot be used: {found.trouble}")
    return " ".join(told)


_LOOK = 20  # ms between two looks whether a file has been read


class Peeking(QObject):
    """Looks into one file at a time: `found` brings what is in it, `refused` why nothing is.

    With either comes what was said of the file when it was to be looked into.
    """

    found = Signal(Recorded, bool)
    refused = Signal(object, Refusal)

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self._thread = ThreadPoolExecutor(1, "recording-reader")
        self._looking: tuple[Future[Recorded], Path, bool] | None = None

    @property
    def busy(self) -> bool:
        return self._looking is not None

    def look(self, path: Path, connects: bool) -> None:
        """Look into the file at `path` instead of any other."""
        self._looking = self._thread.submit(recorded, path), path, connects
        self._wait()

    def stop(self) -> None:
        """Look no further."""
        self._looking = None

    def _wait(self) -> None:
        QTimer.singleShot(_LOOK, self, guarded(self._take))

    def _take(self) -> None:
        if self._looking is None:
            return
        future, path, connects = self._looking
        if not future.done():
            self._wait()
            return
        self._looking = None
        try:
            found = future.result()
        except Refusal as refusal:
            self.refused.emit(path, refusal)
            return
        self.found.emit(found, connects)

    def close(self) -> None:
        self._looking = None
        self._thread.shutdown(wait=True, cancel_futures=True)
