"""A recording that outlives its window: what is left to the next one, and what that says."""

import pickle
from pathlib import Path

from kappaskin import Engine, Left, Status
from kappaskin_app.history import History
from kappaskin_app.settings import Settings
from kappaskin_app.simulation import settings_for

_UNREADABLE = (pickle.UnpicklingError, AttributeError, EOFError, ImportError, IndexError, TypeError)


class Entrusting:
    """Leaves the settings with the engine, which may outlive the window while it records."""

    def __init__(self, history: History, engine: Engine) -> None:
        self._history, self._engine = history, engine
        self._left: Settings | None = None

    def follow(self, status: Status) -> None:
        settings = self._history.settings
        if status.recording.active and settings is not self._left:
            self._left = settings
            self._engine.entrust(pickle.dumps(settings))


def settings_left(left: Left) -> Settings:
    """The settings of the window that is gone; those to begin with where they cannot be read."""
    try:
        settings = pickle.loads(left.asked.entrusted)  # a window's, by way of our own process
    except _UNREADABLE:
        settings = None
    return settings if isinstance(settings, Settings) else settings_for(left.asked.source or "")


def words(left: Left, wanted: str) -> str:
    """What a person should know of what was `left`, who `wanted` this source."""
    file, source = Path(left.asked.recording or "").name, left.asked.source
    told = f"The recording {file}{_of(source)} {left.lasted}."
    if wanted == (source or "sim:"):
        return told
    return f"{told} You asked for {wanted}: Connect goes there, and the recording goes on with it."


def _of(source: str | None) -> str:
    if source is None:
        return ""
    return " of the simulated skin" if source.startswith("sim:") else f" of {source}"
