"""Files to what is recorded in them, looked into beside the window."""

from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from PySide6.QtCore import QObject, QTimer, Signal

from kappaskin.errors import Refusal
from kappaskin_app.features.recording.recorded import Recorded, recorded
from kappaskin_app.guard import guarded

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
