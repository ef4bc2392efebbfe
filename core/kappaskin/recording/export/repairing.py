"""A damaged recording to a whole one, by a process of its own."""

from pathlib import Path

from kappaskin._processes import BackgroundProcess
from kappaskin.recording.disk import is_written
from kappaskin.recording.repair import Repaired, check_new, repairing
from kappaskin.recording.writing import part_of


class Repairing:
    """Saves what is whole of the file `path` to the new file `out`; no call waits.

    A `Refusal` where `out` is there. It ends when it is done, when `close` is called, which leaves
    nothing of what is not whole, or when the process that started it is gone.
    """

    def __init__(self, path: Path, out: Path) -> None:
        check_new(out)
        self._part = part_of(out)
        self._beside = BackgroundProcess[float | Repaired]("kappaskin-repair", repairing, path, out)

    def poll(self) -> list[float | Repaired]:
        """The shares that are done since the last call, and in the end what was saved.

        A `Refusal` where nothing could be.
        """
        return self._beside.poll()

    def close(self) -> None:
        """End it, done or not."""
        self._beside.close()
        if not is_written(self._part):  # by another that began it meanwhile
            self._part.unlink(missing_ok=True)
