"""Files that a person opens, whatever is in them, and the last of them in a menu."""

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QMenu

from kappaskin.errors import Refusal
from kappaskin.live import Status
from kappaskin_app.guard import guarded
from kappaskin_app.objects import may_choose
from kappaskin_app.recordings import newest, recordings_folder
from kappaskin_app.session import RECORDED
from kappaskin_app.touching import touches_at

if TYPE_CHECKING:
    from kappaskin_app.window import MainWindow

MOST_RECENT = 12
_KINDS = {
    "recording": (".mcap", ".part"),
    "scene or calibration": (".toml",),
    "mesh": (".stl", ".ply", ".obj"),
}
_SUFFIXES = tuple(suffix for suffixes in _KINDS.values() for suffix in suffixes)
_MILLIMETRE = 1e-3  # m, the unit of what is drawn for a printer
_CHECKSUM = "sha256"  # the line that a calibration has and a scene has not
_HEAD = 4096  # characters, among which it is


def opens(file: Path) -> bool:
    """Whether this is a kind of file that can be opened."""
    return file.suffix.lower() in _SUFFIXES


def is_calibration(file: Path) -> bool:
    """Whether a TOML file is a calibration; refused where it cannot be read."""
    try:
        with file.open(encoding="utf-8", errors="replace") as text:
            return any(line.startswith(_CHECKSUM) for line in text.read(_HEAD).splitlines())
    except OSError as error:
        raise Refusal(
            f"{file}: cannot be read ({error.strerror}); check its name and who may read it"
        ) from error


def _waits(file: Path) -> bool:
    """Whether a file is of use only where there is a sensor."""
    with suppress(Refusal):
        return file.suffix.lower() == ".toml" and is_calibration(file)
    return False


class Opening(QObject):
    """Opens files by what they are; `told` says what came of it, `changed` that `recent` did."""

    told = Signal(str)
    changed = Signal()

    def __init__(self, window: "MainWindow") -> None:
        super().__init__(window)
        self._replaying, self._staging = window.replaying, window.staging
        self._calibrating, self._history = window.calibrating, window.history
        self._session, self._wishes = window.session, window.wishes
        self.recent: list[Path] = []
        self._first: Path | None = None
        self.menu = QMenu(window)
        self.menu.setToolTipsVisible(True)
        self.menu.aboutToShow.connect(guarded(self._list))
        self._replaying.opened.connect(guarded(self._note_recording))
        self._staging.used.connect(guarded(self.note))
        self._calibrating.used.connect(guarded(self.note))

    def open(self, file: Path) -> None:
        """Play a recording or a scene, use a calibration, or let a mesh touch the skin."""
        try:
            self._way(file)(file)
        except Refusal as refusal:
            self.told.emit(str(refusal))

    def begin_with(self, file: Path) -> None:
        """Open `file` in a new window; a calibration once it is known which sensor there is."""
        if self._session.engine.resumed:
            self.told.emit(f"{file.name} is not opened: the recording that was left goes on")
        elif self._session.status.sensor is None and _waits(file):
            self._first = file
        else:
            self.open(file)

    def follow(self, status: Status) -> None:
        """Open what waited for a sensor."""
        if self._first is not None and status.sensor is not None:
            file, self._first = self._first, None
            self.open(file)

    def _way(self, file: Path) -> Callable[[Path], None]:
        suffix = file.suffix.lower()
        if suffix in _KINDS["recording"]:
            return self._replaying.open_file
        if suffix in _KINDS["mesh"]:
            return self._touch_with
        if suffix == ".toml":
            return self._use if is_calibration(file) else self._staging.play
        kinds = ", ".join(f"a {kind} ({' '.join(ends)})" for kind, ends in _KINDS.items())
        raise Refusal(f"{file}: expected {kinds}; choose such a file")

    def _use(self, file: Path) -> None:
        self._calibrating.load(file)
        self.told.emit(self._calibrating.file_refused or f"Using the calibration {file.name}")

    def _touch_with(self, file: Path) -> None:
        """Let the object in a mesh file press where the load is, in millimetres as it is drawn."""
        session = self._session
        touches = touches_at(session.scene, session.time) if session.inside else []
        if not touches or not may_choose(session.scene):
            raise Refusal(
                f"{file}: expected a simulated skin that one object at rest touches, to take its "
                "place; choose such a scene (F2), or run `kappaskin demo`"
            )
        load = touches[0].load
        x, y = (float(value) for value in load.centre())
        said = {"what": "mesh", "file": str(file.absolute()), "unit": _MILLIMETRE}
        self._wishes.touch_with(said, x, y, load.force)
        self.note(file)
        self.told.emit(f"{file.name} touches the skin, its numbers taken as millimetres")

    # The last ones.

    def note(self, file: Path) -> None:
        """Take a file up among the last ones."""
        file = file.absolute()
        self.recent = [file, *(other for other in self.recent if other != file)][:MOST_RECENT]
        self.changed.emit()

    def _note_recording(self, source: str) -> None:
        self.note(Path(source.removeprefix(RECORDED)))

    def clear(self) -> None:
        """Forget the last ones."""
        self._history.step("clear the files opened last", self._have, self.recent, [])

    def _have(self, recent: list[Path]) -> None:
        self.recent = recent
        self.changed.emit()

    def last_ones(self) -> list[Path]:
        """The files opened last, and the newest recordings besides."""
        others = [file for file in newest(recordings_folder()) if file not in self.recent]
        return [*self.recent, *others]

    def _list(self) -> None:
        self.menu.clear()
        for file in self.last_ones():
            self._list_one(file)
        if self.menu.isEmpty():
            self.menu.addAction("None yet").setEnabled(False)
        if self.recent:
            self.menu.addSeparator()
            clear = self.menu.addAction("&Clear this list")
            clear.triggered.connect(guarded(lambda *_: self.clear()))

    def _list_one(self, file: Path) -> None:
        there = file.is_file()
        action = self.menu.addAction(_shown(file) if there else f"{_shown(file)}  (not there)")
        action.setEnabled(there)
        action.setToolTip(str(file) if there else f"{file} is not there any more: moved or deleted")
        action.triggered.connect(guarded(lambda *_: self.open(file)))


def _shown(file: Path) -> str:
    """A file as a menu names it, where & would mark a letter."""
    return file.name.replace("&", "&&")
