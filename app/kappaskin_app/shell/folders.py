"""The user's folder of recordings: what is in it, and what the next one is called."""

import shlex
from contextlib import suppress
from datetime import datetime
from pathlib import Path

import platformdirs

from kappaskin.recording import is_written, unused

_OFFERED = 8  # recent ones
_PART = ".part"


def recordings_folder() -> Path:
    """Where this user's recordings are, unless another place is chosen."""
    return platformdirs.user_documents_path() / "Kappaskin"


def proposed(folder: Path, now: datetime) -> Path:
    """What a recording that begins `now` is called: nothing that is there already."""
    return unused(folder / f"kappaskin-{now:%Y%m%d-%H%M%S}.mcap")


def newest(folder: Path) -> list[Path]:
    """The last recordings in a folder, the newest first."""
    return _found(folder, "*.mcap")[:_OFFERED]


def unfinished(folder: Path) -> list[Path]:
    """Recordings in a folder that were never ended, nor are written now, the newest first."""
    return [path for path in _found(folder, f"*.mcap{_PART}") if not is_written(path)]


def repaired(file: Path) -> Path:
    """What the recording `file` is called once it is repaired: nothing that is there already."""
    stem = Path(file.name.removesuffix(_PART)).stem
    return unused(file.with_name(f"{stem}-repaired.mcap"))


def repairing(file: Path) -> str:
    """The command that makes the recording `file` whole, as another one beside it."""
    return f"kappaskin repair {shlex.quote(str(file))} --out {shlex.quote(str(repaired(file)))}"


def _found(folder: Path, pattern: str) -> list[Path]:
    dated: list[tuple[float, Path]] = []
    with suppress(OSError):  # no such folder, or one that may not be read: then there are none
        for path in folder.glob(pattern):
            with suppress(OSError):  # it went meanwhile, or leads nowhere
                dated.append((path.stat().st_mtime, path))
    return [path for _, path in sorted(dated, reverse=True)]
