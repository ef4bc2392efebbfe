"""A recording that outlives its window: what is left to the next one, and what that says."""

from dataclasses import replace
from pathlib import Path

from kappaskin.errors import Refusal
from kappaskin.live import Engine, ResumeInfo, Status
from kappaskin_app.shell.history import History
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.settings_text import settings_in, settings_text
from kappaskin_app.shell.simulation import settings_for


class Entrusting:
    """Leaves the settings with the engine, which may outlive the window while it records."""

    def __init__(self, history: History, engine: Engine) -> None:
        self._history, self._engine = history, engine
        self._left: Settings | None = None

    def follow(self, status: Status) -> None:
        settings = self._history.settings
        if status.recording.active and settings is not self._left:
            self._left = settings
            self._engine.entrust(settings_text(settings).encode())


def settings_left(left: ResumeInfo) -> Settings:
    """The settings of the window that is gone; those to begin with where they cannot be read."""
    setup = left.requested.setup
    try:
        settings = settings_in(left.requested.entrusted.decode(errors="replace"))
    except Refusal:
        return settings_for(left.requested.source or "")
    return replace(settings, calibration=setup.calibration, tare=setup.tare)


def words(left: ResumeInfo, wanted: str) -> str:
    """What a person should know of what was `left`, who `wanted` this source."""
    file, source = Path(left.requested.recording or "").name, left.requested.source
    told = f"The recording {file}{_of(source)} {left.lasted}."
    if wanted == (source or "sim:"):
        return told
    return f"{told} You asked for {wanted}: Connect goes there, and the recording goes on with it."


def _of(source: str | None) -> str:
    if source is None:
        return ""
    return " of the simulated skin" if source.startswith("sim:") else f" of {source}"
