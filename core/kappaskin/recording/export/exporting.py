"""What is wanted of a recording to files, by a process of its own: all of them, or none."""

import shutil
import tempfile
from collections.abc import Generator
from pathlib import Path

from kappaskin._processes import BackgroundProcess
from kappaskin.errors import Refusal
from kappaskin.recording.export.wanted import Wanted
from kappaskin.recording.export.writing import Exported, exported


class Exporting:
    """Writes what is `wanted`, beside its place until it is whole; no call but `wait` waits.

    Refused where there is no place. It ends when it is done, when `close` is called, which leaves
    nothing of what is not whole, or when the process that started it is gone.
    """

    def __init__(self, wanted: Wanted) -> None:
        self.wanted = wanted
        try:
            room = tempfile.mkdtemp(prefix=f".{wanted.to.name}.", dir=wanted.to.parent)
        except OSError as error:
            raise _unwritable(wanted.to, error) from error
        self._room = Path(room)
        try:
            self._beside = BackgroundProcess[float | Exported](
                "kappaskin-export", exported, wanted, self._room
            )
        except BaseException:  # Ctrl+C, while it begins
            shutil.rmtree(self._room, ignore_errors=True)
            raise

    @property
    def done(self) -> bool:
        return self._beside.done

    def poll(self) -> list[float | Exported]:
        """The shares that are done since the last call, and in the end what came of it.

        A `Refusal` where that is nothing.
        """
        over, told = self.done, self._beside.poll()
        if self.done and not over:
            self._give()
        return told

    def wait(self) -> Generator[float | Exported]:
        """Each share as soon as it is done, and in the end what came of it."""
        for told in self._beside.wait():
            if isinstance(told, Exported):
                self._give()
            yield told

    @property
    def files(self) -> tuple[Path, ...]:
        """What is there when it is done: files, and the folder of a series."""
        return self.wanted.files

    def _give(self) -> None:
        """Give what is whole its place; nothing, where one is taken."""
        given: list[tuple[Path, Path]] = []
        try:
            for place in self.files:
                if place.exists():
                    raise FileExistsError(17, "it has appeared meanwhile")
                made = self._room / place.name
                made.rename(place)
                given.append((place, made))
        except OSError as error:
            for place, made in given:
                place.rename(made)
            raise _unwritable(self.wanted.to, error) from error

    def close(self) -> None:
        """End it, done or not."""
        self._beside.close()
        shutil.rmtree(self._room, ignore_errors=True)

    def __enter__(self) -> "Exporting":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _unwritable(path: Path, error: OSError) -> Refusal:
    return Refusal(f"{path}: cannot be written ({error.strerror or error}); choose another place")
