"""The text file in which the window is kept from one start to the next."""

import itertools
import os
from dataclasses import dataclass
from pathlib import Path

import platformdirs

from kappaskin import Refusal
from kappaskin_app.layouts.kept import Kept, from_text, to_text

_LARGEST = 1_000_000  # bytes


def config_file() -> Path:
    """Where this user's window is kept."""
    return platformdirs.user_config_path("kappaskin", appauthor=False) / "window.toml"


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

    def theme(self) -> str:
        """The name of the theme that is kept, none where none can be read."""
        try:
            return from_text(self._text()).theme
        except (OSError, UnicodeDecodeError, Refusal):
            return ""  # told by who reads all of it

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
        part = self.path.with_name(f".{self.path.name}.part")
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            part.write_text(to_text(kept), encoding="utf-8")
            os.replace(part, self.path)
        except (OSError, UnicodeEncodeError) as error:
            return f"{self.path}: cannot be written ({error}); the window will not be as it is now"
        return ""
