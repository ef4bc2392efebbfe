"""Recovery: settings as text, recordings that outlive a window, sessions that crashed."""

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

from kappaskin._files import user_folder, write_whole
from kappaskin.errors import Refusal
from kappaskin.live import ResumeInfo, Status
from kappaskin_app.guard import guarded
from kappaskin_app.shell.background import BackgroundSave
from kappaskin_app.shell.centre import BannerAction
from kappaskin_app.shell.history import History
from kappaskin_app.shell.parts import Parts
from kappaskin_app.shell.session import Session
from kappaskin_app.shell.settings import EstimatorSettings, Settings
from kappaskin_app.shell.settings.form_fields import settings_from
from kappaskin_app.shell.settings.scene import Written
from kappaskin_app.shell.simulation import settings_for

VERSION = 1
OF_SENSORS = ("calibration", "tare")
"""Settings that belong to a sensor and have files of their own."""
_DEFAULTS = Settings()


def settings_text(settings: Settings) -> str:
    """JSON of all settings except those that belong to a sensor."""
    data = {f.name: getattr(settings, f.name) for f in fields(settings)}
    written = data["written"]
    data["written"] = written and {
        "text": written.text,
        "file": str(written.file),
        "trust": written.trust is True or [str(file) for file in written.trust or ()],
    }
    for name in OF_SENSORS:
        del data[name]
    return json.dumps({"version": VERSION, "settings": data}, indent=1)


def settings_in(text: str) -> Settings:
    """The settings in a text; defaults for those that it does not have."""
    try:
        found = json.loads(text)
        version, data = found["version"], dict(found["settings"])
    except (ValueError, KeyError, TypeError) as error:
        raise Refusal(
            f"expected settings as JSON, got {text!r:.40}; choose another file"
        ) from error
    if version != VERSION:
        raise Refusal(
            f"expected settings of version {VERSION}, got {version!r:.20}; update Kappaskin"
        )
    known = [f.name for f in fields(Settings) if f.name not in OF_SENSORS]
    return Settings(**{name: _value(name, data[name]) for name in known if name in data})


def _value(name: str, value: Any) -> Any:
    """A setting from its JSON value."""
    was = getattr(_DEFAULTS, name)
    if name == "written":
        try:
            trust = value and value.get("trust", ())
            trusted = trust is True or frozenset(map(Path, trust or ()))
            return value and Written(str(value["text"]), Path(value["file"]), trusted or False)
        except (TypeError, KeyError, AttributeError) as error:
            raise Refusal(
                f"{name}: expected text and file, got {value!r:.40}; leave it out"
            ) from error
    if isinstance(was, tuple) and isinstance(value, list):
        return tuple(value)
    if isinstance(was, float) and type(value) is int:
        return float(value)
    limits = value.values() if isinstance(value, dict) else ()
    if type(value) is not type(was) or not all(isinstance(limit, float) for limit in limits):
        raise Refusal(f"{name}: expected {type(was).__name__}, got {value!r:.40}; leave it out")
    return value


class SettingsHandover:
    """Hands the settings to an engine that may outlive the window.

    One of this machine while it records, one in another room always.
    """

    def __init__(self, history: History, session: Session) -> None:
        self._history, self._session = history, session
        self._left: Settings | None = None

    def follow(self, status: Status) -> None:
        settings = self._history.settings
        if (status.recording.active or status.link) and settings is not self._left:
            self._left = settings
            self._session.engine.store_window_state(settings_text(settings).encode())


def settings_left(left: ResumeInfo) -> Settings:
    """The settings of the window that ended; defaults where they cannot be read."""
    setup = left.requested.setup
    try:
        settings = settings_in(left.requested.window_state.decode(errors="replace"))
    except Refusal:
        settings = settings_for(left.requested.source or "")
        if left.place:
            settings = replace(settings, **settings_from(vars(setup), EstimatorSettings))
    if left.place and settings.written:  # it names files of another machine
        settings = replace(settings, written=replace(settings.written, trust=False))
    return replace(settings, calibration=setup.calibration, tare=setup.tare)


def resume_text(left: ResumeInfo, wanted: str) -> str:
    """What is reported of a resumed recording to a user who requested the source `wanted`."""
    if left.place:
        return f"The engine at {left.place} is shown, with the settings that it had."
    file, source = Path(left.requested.recording or "").name, left.requested.source
    text = f"The recording {file}{_of(source)} {left.lasted}."
    if wanted == (source or "sim:"):
        return text
    return f"{text} You requested {wanted}: Connect opens it, and the recording continues with it."


def _of(source: str | None) -> str:
    if source is None:
        return ""
    return " of the simulated skin" if source.startswith("sim:") else f" of {source}"


_FILES = "window-*.json"
_EVERY = 1.0  # s between two saves
_TIP = (
    "The program ended before its window was closed. What you restore can be undone (Ctrl+Z); "
    "Report saves a file that helps to find the cause."
)
_NOT_KEPT = "after a crash the settings of this window could not be restored"
_SETTINGS = "All settings of that session except a sensor's calibration and tare."


@dataclass(frozen=True)
class LastSession:
    """The state of a window: its `settings`, its source, and its `recording`, if any."""

    settings: Settings
    source: str = ""
    recording: str = ""


class OpenWindow:
    """Saves in a `folder` the state of an open window, until it is closed."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._file = folder / f"window-{os.getpid()}.json"
        self._lock = _lock(self._file)
        self._lock.tryLock(0)

    def keep(self, last: LastSession) -> str:
        """Save the state; returns an error text."""
        data = {
            "settings": json.loads(settings_text(last.settings)),
            "source": last.source,
            "recording": last.recording,
        }
        try:
            write_whole(self._file, json.dumps(data, indent=1), _NOT_KEPT)
        except Refusal as refusal:
            return str(refusal)
        return ""

    def close(self) -> None:
        self._file.unlink(missing_ok=True)
        self._lock.unlock()


def crashed(folder: Path) -> LastSession | None:
    """The state of the last window that was not closed; returned once."""
    left: list[tuple[float, LastSession]] = []
    for file in folder.glob(_FILES):
        lock = _lock(file)
        if lock.tryLock(0):  # nobody holds it who is alive
            with suppress(OSError, ValueError, KeyError, TypeError, Refusal):
                left.append((file.stat().st_mtime, _read(file)))
            file.unlink(missing_ok=True)
            lock.unlock()
    return max(left, key=lambda one: one[0])[1] if left else None


def _read(file: Path) -> LastSession:
    data = json.loads(file.read_text(encoding="utf-8"))
    settings = settings_in(json.dumps(data["settings"]))
    return LastSession(settings, str(data["source"]), str(data["recording"]))


def _lock(file: Path) -> QLockFile:
    lock = QLockFile(str(file.with_suffix(".lock")))
    lock.setStaleLockTime(0)  # however long its window has been open
    return lock


class Recovery(QObject):
    """Saves in a `folder` the state of a `window`, and offers to restore that of a crashed one."""

    def __init__(self, window: Parts, folder: Path) -> None:
        super().__init__(window)
        self._window, last = window, crashed(folder)
        self._open_window, self._next = OpenWindow(folder), 0.0
        self._save = BackgroundSave(window.tasks, self._open_window.keep, window.notify)
        self._kept: LastSession | None = None
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
            last = LastSession(window.history.settings, window.session.source, recording)
            if last != self._kept:
                self._kept = last
                self._save(last)

    def offer(self, last: LastSession) -> None:
        """Offer what is left of the last session in the banner."""
        window = self._window
        offered = [BannerAction("Its se&ttings", _SETTINGS, partial(self._use, last))]
        if last.source and not last.source.startswith("sim:"):
            connect = partial(window.session.request_source, last.source)
            offered.append(BannerAction("Its s&ource", f"Connect {last.source} again.", connect))
        if (recording := _left(last.recording)) is not None:
            play = partial(window.opening.open, recording)
            offered.append(BannerAction("Its recordin&g", f"Play {recording}.", play))
        if (report := window.actions_by_name.entries.get("report")) is not None:
            words, act = report.action.text(), report.action.trigger
            offered.append(BannerAction(words, report.action.toolTip(), act))
        window.display.banner.show_actions(
            "The last session ended unexpectedly. Restore:", _TIP, offered
        )

    def _use(self, last: LastSession) -> None:
        names = (f.name for f in fields(Settings) if f.name not in OF_SENSORS)
        values = {name: getattr(last.settings, name) for name in names}
        self._window.history.change("Settings of the last session", -1, **values)

    def close(self) -> None:
        self._save.finish()  # or a thread might still write it
        self._open_window.close()


def _left(recording: str) -> Path | None:
    """The file that is left of a recording, whole or not."""
    there = [Path(name) for name in (recording, f"{recording}.part") if recording]
    return next((path for path in there if path.exists()), None)


def state_folder() -> Path:
    """Where open windows of this user and machine save their state."""
    return user_folder(platformdirs.user_state_path) / "open" / platform.node()
