"""The text file in which the window is kept from one start to the next."""

import itertools
import os
import tempfile
from dataclasses import dataclass
from pathlib import Path

from PySide6.QtCore import QLockFile

from kappaskin.errors import Refusal
from kappaskin_app.shell.layouts.kept import Kept, from_text, merged, to_text

_LARGEST = 1_000_000  # bytes
_PATIENCE = 500  # ms that another window may take to write


@dataclass(frozen=True)
class KeptFile:
    """What is kept at `path`; whatever is wrong with it is told, and never raised."""

    path: Path

    def read(self) -> tuple[Kept, str]:
        """What is kept, and what went wrong: then the file is put aside, and nothing is kept."""
        try:
            if not self.path.exists():
                return Kept(), ""
            return from_text(self._text()), ""
        except (OSError, UnicodeDecodeError, Refusal) as error:
            return Kept(), f"{self.path}: {error}; {self._put_aside()}, the window begins anew"

    def _text(self) -> str:
        if self.path.stat().st_size > _LARGEST:
            raise Refusal(f"expected at most {_LARGEST} bytes")
        return self.path.read_text(encoding="utf-8")

    def _put_aside(self) -> str:
        """Give the file another name, so that it is not written over; what was done."""
        numbered = (self.path.with_suffix(f".toml.{n}.aside") for n in itertools.count(1))
        try:
            aside = next(path for path in numbered if not path.exists())
            os.replace(self.path, aside)
        except OSError as error:
            return f"it cannot be put aside ({error.strerror})"
        return f"it is {aside.name} now"

    def write(self, kept: Kept) -> str:
        """Write the file whole or not at all; what went wrong."""
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._write(to_text(kept).encode())
        except (OSError, UnicodeEncodeError) as error:
            return f"{self.path}: cannot be written ({error}); the window will not be as it is now"
        return ""

    def merge(self, kept: Kept, before: Kept) -> str:
        """Write what was changed since `before`, and leave the rest as another window wrote it."""
        if not self.path.exists():
            return self.write(kept)
        lock = QLockFile(f"{self.path}.lock")
        lock.tryLock(_PATIENCE)  # or without: the file is whole at any time
        theirs, wrong = self.read()
        wrong = self.write(kept if wrong else merged(kept, before, theirs)) or wrong
        lock.unlock()
        return wrong

    def _write(self, data: bytes) -> None:
        # Each under a name of its own: another window may be writing the same file.
        opened, name = tempfile.mkstemp(".part", f".{self.path.name}.", self.path.parent)
        try:
            with os.fdopen(opened, "wb") as part:
                part.write(data)
            os.replace(name, self.path)
        except OSError:
            Path(name).unlink(missing_ok=True)
            raise
