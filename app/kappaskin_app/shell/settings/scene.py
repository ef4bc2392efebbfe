"""A scene that is played as it is written, instead of the one that the panels describe."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Written:
    """The TOML `text` of a scene; it is called as `file` is, and what it names lies beside that."""

    text: str
    file: Path


@dataclass(frozen=True)
class Own:
    """The scene that is `written`, or none: then the panels say what is simulated."""

    written: Written | None = None
