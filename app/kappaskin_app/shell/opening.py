"""Opening of files by their kind, and the menu of recent files."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from PySide6.QtCore import QEvent, QMimeData, QObject, Signal
from PySide6.QtGui import QDragEnterEvent, QDropEvent, QKeyEvent
from PySide6.QtWidgets import QFileDialog, QMenu, QWidget

from kappaskin._text import printable
from kappaskin.errors import Refusal
from kappaskin.live import Status
from kappaskin_app.guard import guarded
from kappaskin_app.shell.folders import proposed
from kappaskin_app.shell.session import Session
from kappaskin_app.shell.work_dialog import with_ending
from kappaskin_app.widgets.parts import plain_tip

MOST_RECENT = 12
SCENES = "Scene (*.toml)"


@dataclass(frozen=True, eq=False)
class Kind:
    """A kind of file: its name, its `suffixes`, and the function that opens one.

    A folder has the suffix "". Of several kinds with one suffix, `is_one` selects; the one without
    it takes the rest. One that `needs_sensor` is opened once a sensor is known.
    """

    words: str
    suffixes: tuple[str, ...]
    open: Callable[[Path], object]
    is_one: Callable[[Path], bool] | None = None
    needs_sensor: bool = False


class Drops(QObject):
    """Event filter of `window`: opens files dropped there, handles keys that nothing else takes."""

    def __init__(self, window: QWidget, opening: "Opening") -> None:
        super().__init__(window)
        self._opening = opening
        self.take_key: Callable[[QKeyEvent], bool] = lambda _: False
        window.setAcceptDrops(True)
        window.installEventFilter(self)

    def dropped_on(self, data: QMimeData) -> Path | None:
        """The first dragged file that can be opened, if any."""
        files = [Path(url.toLocalFile()) for url in data.urls() if url.isLocalFile()]
        return next((file for file in files if self._opening.opens(file)), None)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if isinstance(event, QDropEvent):  # which one that enters is too
            path = self.dropped_on(event.mimeData())
            if path is None:
                return False
            event.acceptProposedAction()
            if not isinstance(event, QDragEnterEvent) and event.type() == QEvent.Type.Drop:
                guarded(self._opening.open)(path)
            return True
        if event.type() == QEvent.Type.KeyPress and isinstance(event, QKeyEvent):
            return self.take_key(event)
        return False


class Opening(QObject):
    """Opens files by their kind; `notified` brings messages, `changed` reports other `recent`."""

    notified = Signal(str)
    changed = Signal()

    def __init__(self, window: QWidget, session: Session) -> None:
        super().__init__(window)
        self._session = session
        self._kinds: list[Kind] = []
        self.others: Callable[[], list[Path]] = list
        """Files listed after the recent ones."""
        self.recent: list[Path] = []
        self._first: Path | None = None
        self.menu = QMenu(window)
        self.menu.setToolTipsVisible(True)
        self.menu.aboutToShow.connect(guarded(self._list))
        self.drops = Drops(window, self)

    def add(self, kind: Kind) -> None:
        """Register a kind of file."""
        self._kinds.append(kind)

    def opens(self, file: Path) -> bool:
        """Whether files of this suffix can be opened."""
        return any(_suffix(file) in kind.suffixes for kind in self._kinds)

    def open(self, file: Path) -> None:
        """Open a file by its kind, or report why it cannot be opened."""
        try:
            self._kind(file).open(file)
        except Refusal as refusal:
            self.notified.emit(str(refusal))

    def begin_with(self, file: Path) -> None:
        """Open `file` in a new window; one that needs a sensor once a sensor is known."""
        if self._session.engine.resumed:
            self.notified.emit(f"{file.name} is not opened: the resumed recording continues")
        elif self._session.status.sensor is None and self._waits(file):
            self._first = file
        else:
            self.open(file)

    def _waits(self, file: Path) -> bool:
        try:
            return self._kind(file).needs_sensor
        except Refusal:
            return False

    def save_scene(self, name: str, write: Callable[[Path], object]) -> None:
        """Ask for a file, `name` by default, and `write` a scene there."""
        window = self.menu.parentWidget()
        file, _ = QFileDialog.getSaveFileName(window, "Save the scene", str(proposed(name)), SCENES)
        if file:
            try:
                path = with_ending(file, ".toml")
                write(path)
                self.note(path)
                self.notified.emit(f"Saved {path}")
            except Refusal as reason:
                self.notified.emit(str(reason))

    def follow(self, status: Status) -> None:
        """Open the file that waited for a sensor."""
        if self._first is not None and status.sensor is not None:
            file, self._first = self._first, None
            self.open(file)

    def _kind(self, file: Path) -> Kind:
        """The kind of a file; refused where there is none, or it cannot be read."""
        alike = [kind for kind in self._kinds if _suffix(file) in kind.suffixes]
        for kind in sorted(alike, key=lambda kind: kind.is_one is None):
            if kind.is_one is None or kind.is_one(file):
                return kind
        kinds = ", ".join(
            f"a {kind.words} ({' '.join(kind.suffixes).strip()})" for kind in self._kinds
        )
        raise Refusal(f"{file}: expected {kinds}; choose such a file")

    # Recent files.

    def note(self, file: Path) -> None:
        """Add a file to the recent ones."""
        file = file.absolute()
        self.recent = [file, *(other for other in self.recent if other != file)][:MOST_RECENT]
        self.changed.emit()

    def clear(self) -> None:
        """Clear the list of recent files."""
        self.recent = []
        self.changed.emit()

    def last_ones(self) -> list[Path]:
        """The recent files, then the other ones."""
        others = [file for file in self.others() if file not in self.recent]
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
        action = self.menu.addAction(_shown(file) if there else f"{_shown(file)}  (missing)")
        action.setEnabled(there)
        action.setToolTip(plain_tip(str(file) if there else f"{file} was moved or deleted"))
        action.triggered.connect(guarded(lambda *_: self.open(file)))


def _suffix(file: Path) -> str:
    return "" if file.is_dir() else file.suffix.lower() or "."


def _shown(file: Path) -> str:
    """The name of a file in a menu, where & would mark a letter."""
    return printable(file.name).replace("&", "&&")
