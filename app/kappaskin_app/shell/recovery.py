"""Recovery: settings as text, recordings that outlive a window, and what a crash left."""

import json
import os
import platform
import time
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import platformdirs
from PySide6.QtCore import QLockFile, QObject

from kappaskin.errors import Refusal
from kappaskin.live import Engine, ResumeInfo, Status
from kappaskin_app.guard import guarded
from kappaskin_app.shell.centre import Offered
from kappaskin_app.shell.history import History
from kappaskin_app.shell.parts import Parts
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.settings.scene import Written
from kappaskin_app.shell.simulation import settings_for

VERSION = 1
OF_SENSORS = ("calibration", "tare")
"""They belong to a sensor, and have files of their own."""
_BEGUN = Settings()


def settings_text(settings: Settings) -> str:
    """JSON of all settings but those that belong to a sensor."""
    said = {f.name: getattr(settings, f.name) for f in fields(settings)}
    written = said["written"]
    said["written"] = written and {"text": written.text, "file": str(written.file)}
    for name in OF_SENSORS:
        del said[name]
    return json.dumps({"version": VERSION, "settings": said}, indent=1)


def settings_in(text: str) -> Settings:
    """The settings that a text says; the ready ones for what it does not say."""
    try:
        found = json.loads(text)
        version, said = found["version"], dict(found["settings"])
    except (ValueError, KeyError, TypeError) as error:
        raise Refusal(
            f"expected settings as JSON, got {text!r:.40}; choose another file"
        ) from error
    if version != VERSION:
        raise Refusal(
            f"expected settings of version {VERSION}, got {version!r:.20}; update Kappaskin"
        )
    known = [f.name for f in fields(Settings) if f.name not in OF_SENSORS]
    return Settings(**{name: _value(name, said[name]) for name in known if name in said})


def _value(name: str, value: Any) -> Any:
    """What a setting is from what JSON made of it."""
    was = getattr(_BEGUN, name)
    if name == "written":
        try:
            return value and Written(str(value["text"]), Path(value["file"]))
        except (TypeError, KeyError) as error:
            raise Refusal(
                f"{name}: expected text and file, got {value!r:.40}; leave it out"
            ) from error
    if isinstance(was, tuple) and isinstance(value, list):
        return tuple(value)
    if isinstance(was, float) and type(value) is int:
        return float(value)
    if type(value) is not type(was):
        raise Refusal(f"{name}: expected {type(was).__name__}, got {value!r:.40}; leave it out")
    return value


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


_FILES = "window-*.json"
_EVERY = 1.0  # s between two looks at what is to be kept
_TIP = (
    "The program was ended, by itself or by the system, before it was closed. What you take up of "
    "it can be undone (Ctrl+Z); Report saves what helps to find out why."
)
_SETTINGS = "Every setting as it was then, but for the calibration and tare of a sensor."


@dataclass(frozen=True)
class Last:
    """What a window was at: its `settings`, and what it read or `recording` it wrote, if any."""

    settings: Settings
    source: str = ""
    recording: str = ""


class Running:
    """Keeps in a `folder` what an open window is at, until it is closed in order."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._file = folder / f"window-{os.getpid()}.json"
        self._lock = _lock(self._file)
        self._lock.tryLock(0)
        self._kept: Last | None = None

    def keep(self, last: Last) -> None:
        """Write down what is so now, if it is something else."""
        if last == self._kept:
            return
        self._kept = last
        said = {
            "settings": json.loads(settings_text(last.settings)),
            "source": last.source,
            "recording": last.recording,
        }
        part = self._file.with_suffix(".part")
        part.write_text(json.dumps(said, indent=1), encoding="utf-8")
        part.replace(self._file)  # whole, or not at all

    def close(self) -> None:
        self._file.unlink(missing_ok=True)
        self._lock.unlock()


def crashed(folder: Path) -> Last | None:
    """What the last window was at that did not close in order; told once."""
    left: list[tuple[float, Last]] = []
    for file in folder.glob(_FILES):
        lock = _lock(file)
        if lock.tryLock(0):  # nobody holds it who is alive
            with suppress(OSError, ValueError, KeyError, TypeError, Refusal):
                left.append((file.stat().st_mtime, _read(file)))
            file.unlink(missing_ok=True)
            lock.unlock()
    return max(left, key=lambda one: one[0])[1] if left else None


def _read(file: Path) -> Last:
    said = json.loads(file.read_text(encoding="utf-8"))
    settings = settings_in(json.dumps(said["settings"]))
    return Last(settings, str(said["source"]), str(said["recording"]))


def _lock(file: Path) -> QLockFile:
    lock = QLockFile(str(file.with_suffix(".lock")))
    lock.setStaleLockTime(0)  # however long its window has been open
    return lock


class Recovering(QObject):
    """Keeps in a `folder` what a `window` is at, and offers what one was at that crashed."""

    def __init__(self, window: Parts, folder: Path) -> None:
        super().__init__(window)
        self._window, last = window, crashed(folder)
        self._running, self._next = Running(folder), 0.0
        window.session.reported.connect(guarded(self._keep))
        # What went on recording by itself was taken over with its settings already.
        if last is not None and window.session.engine.resumed is None:
            self.offer(last)

    def _keep(self, status: Status) -> None:
        now = time.monotonic()
        if now >= self._next:
            self._next = now + _EVERY
            recording = str(status.recording.path) if status.recording.active else ""
            window = self._window
            self._running.keep(Last(window.history.settings, window.session.source, recording))

    def offer(self, last: Last) -> None:
        """Offer what is left of the last session: whoever wants none of it goes on."""
        window = self._window
        offered = [Offered("Its se&ttings", _SETTINGS, partial(self._use, last))]
        if last.source and not last.source.startswith("sim:"):
            connect = partial(window.session.request_source, last.source)
            offered.append(Offered("Its s&ource", f"Connect {last.source} again.", connect))
        if (recording := _left(last.recording)) is not None:
            play = partial(window.opening.open, recording)
            offered.append(Offered("Its recordin&g", f"Play {recording}.", play))
        if (report := window.actions_by_name.entries.get("report")) is not None:
            words, act = report.action.text(), report.action.trigger
            offered.append(Offered(words, report.action.toolTip(), act))
        window.display.centre.offer.show_offer(
            "The last session ended unexpectedly. Take up:", _TIP, offered
        )

    def _use(self, last: Last) -> None:
        names = (f.name for f in fields(Settings) if f.name not in OF_SENSORS)
        values = {name: getattr(last.settings, name) for name in names}
        self._window.history.change("Settings of the last session", -1, **values)

    def close(self) -> None:
        self._running.close()


def _left(recording: str) -> Path | None:
    """The file that is left of a recording, whole or not."""
    there = [Path(name) for name in (recording, f"{recording}.part") if recording]
    return next((path for path in there if path.exists()), None)


def state_folder() -> Path:
    """Where open windows of this user and machine keep what they are at."""
    state = platformdirs.user_state_path("kappaskin", appauthor=False)
    return state / "open" / platform.node()
