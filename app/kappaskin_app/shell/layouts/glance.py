"""What must be known of a kept window before anything that takes long is loaded."""

import tomllib
from pathlib import Path

import platformdirs


def config_file() -> Path:
    """Where this user's window is kept."""
    return platformdirs.user_config_path("kappaskin", appauthor=False) / "window.toml"


def theme_in(path: Path) -> str:
    """The name of the theme that is kept at `path`; empty where none can be read.

    What is wrong with the file is told by who reads all of it.
    """
    try:
        with path.open("rb") as file:
            return str(tomllib.load(file)["window"]["theme"])
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        return ""
