"""The folder of the user's files: recordings in it, and names of new files."""

import shlex
from contextlib import suppress
from datetime import datetime
from pathlib import Path

import platformdirs

from kappaskin.recording import is_written, unused

RECORDINGS = "Recording (*.mcap)"
_OFFERED = 8  # recent ones
_PART = ".part"


def recordings_folder() -> Path:
    """The folder of this user's recordings and other files: here, without a home directory."""
    try:
        documents = platformdirs.user_documents_path()
    except RuntimeError:
        documents = Path.cwd()
    return documents / "Kappaskin"


def proposed(name: str) -> Path:
    """The unused path of a new file `name` in the user's folder, which is made if it can be."""
    folder = recordings_folder()
    with suppress(OSError):  # reported when the file is written
        folder.mkdir(parents=True, exist_ok=True)
    return unused(folder / name)


def dated(now: datetime, suffix: str) -> Path:
    """The proposed path of a new file that is named by the time `now`."""
    return proposed(f"kappaskin-{now:%Y%m%d-%H%M%S}{suffix}")


def newest(folder: Path) -> list[Path]:
    """The last recordings in a folder, the newest first."""
    return _found(folder, "*.mcap")[:_OFFERED]


def unfinished(folder: Path) -> list[Path]:
    """Unfinished recordings in a folder that are not being written, the newest first."""
    return [path for path in _found(folder, f"*.mcap{_PART}") if not is_written(path)]


def repaired(file: Path) -> Path:
    """The unused path of the repaired recording `file`."""
    stem = Path(file.name.removesuffix(_PART)).stem
    return unused(file.with_name(f"{stem}-repaired.mcap"))


def repairing(file: Path) -> str:
    """The command that repairs the recording `file` to a new one in the same folder."""
    return f"kappaskin repair {shlex.quote(str(file))} --out {shlex.quote(str(repaired(file)))}"


def _found(folder: Path, pattern: str) -> list[Path]:
    dated: list[tuple[float, Path]] = []
    with suppress(OSError):  # no such folder, or one that may not be read: then there are none
        for path in folder.glob(pattern):
            with suppress(OSError):  # it went meanwhile, or leads nowhere
                dated.append((path.stat().st_mtime, path))
    return [path for _, path in sorted(dated, reverse=True)]
