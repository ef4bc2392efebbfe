"""The line in which a person types a few letters, and below it what they may mean."""

from collections.abc import Callable

from PySide6.QtCore import QEvent, Qt
from PySide6.QtWidgets import (
    QDialog,
    QFrame,
    QLabel,
    QLineEdit,
    QTreeWidgetItem,
    QVBoxLayout,
    QWidget,
)

from kappaskin_app.guard import guarded
from kappaskin_app.shell.finder.listing import Listing, clearable, row
from kappaskin_app.shell.finder.matching import best, score
from kappaskin_app.shell.finder.things import FinderEntry

_KEPT = 12  # of what was done last, which comes first
_RECENT = 3.0  # points more of what was done last, less of what was before
_SIZE = (0.62, 0.66)  # of the window's
_HINT = "\N{UPWARDS ARROW} \N{DOWNWARDS ARROW} choose   Enter do it   Esc leave"
_NOTHING = "Nothing here is called so: try fewer letters."


class Finder(QDialog):
    """Finds one of what `things` tells, and does it; `recent` are the names of the last ones."""

    def __init__(self, things: Callable[[], list[FinderEntry]], parent: QWidget) -> None:
        super().__init__(parent, Qt.WindowType.Dialog | Qt.WindowType.FramelessWindowHint)
        self.setObjectName("finder")
        self.setWindowTitle("Find a command")
        self._window, self._ask, self._things = parent, things, list[FinderEntry]()
        self.recent: list[str] = []
        self.line, self.hint = QLineEdit(), QLabel(_HINT)
        self.list = Listing(self.line)
        self.line.setPlaceholderText(
            "A command, a setting, a scene, a panel, a file\N{HORIZONTAL ELLIPSIS}"
        )
        self.line.setAccessibleName("What to find")
        self.line.setToolTip(
            "A few letters of its name are enough, in their order: nogau is Noise: Gaussian."
        )
        clearable(self.line)
        self.list.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # the line keeps it
        self.list.setAccessibleName("What was found")
        self.list.setToolTip("What was found, where it stands, and its shortcut.")
        frame = QFrame(self, frameShape=QFrame.Shape.StyledPanel)  # pyright: ignore[reportCallIssue]
        around, layout = QVBoxLayout(self), QVBoxLayout(frame)
        around.setContentsMargins(0, 0, 0, 0)
        around.addWidget(frame)
        for widget in (self.line, self.list, self.hint):
            layout.addWidget(widget)
        self.line.textChanged.connect(guarded(self._list))
        self.line.returnPressed.connect(guarded(self._do))
        self.list.itemClicked.connect(guarded(lambda *_: self._do()))

    def open_empty(self) -> None:
        """Show all there is, the last ones first."""
        window = self._window
        self._things = self._ask()
        wide, high = (
            round(s * n) for s, n in zip(_SIZE, (window.width(), window.height()), strict=True)
        )
        corner = window.mapToGlobal(window.rect().topLeft())
        self.setGeometry(corner.x() + (window.width() - wide) // 2, corner.y() + 60, wide, high)
        self.list.header().resizeSection(1, round(0.3 * wide))
        self.line.clear()
        self._list()
        self.show()
        self.raise_()
        self.activateWindow()
        self.line.setFocus()

    def found(self) -> list[FinderEntry]:
        """What the letters typed may mean, the best first."""
        query = self.line.text()
        if not query.strip():
            return self._last_first()
        points = {thing.name: score(query, thing.title, thing.place) for thing in self._things}
        for age, name in enumerate(self.recent):
            if points.get(name, 0.0) > 0:
                points[name] += _RECENT * (1 - age / _KEPT)
        things = {thing.name: thing for thing in self._things}
        return [things[name] for name in best(points)]

    def _last_first(self) -> list[FinderEntry]:
        ages = {name: age for age, name in enumerate(self.recent)}
        return sorted(self._things, key=lambda thing: ages.get(thing.name, _KEPT))

    def _list(self, *_: object) -> None:
        found = self.found()
        self.list.show_rows([_row(thing) for thing in found])
        self.hint.setText(_HINT if found else _NOTHING)

    def _do(self) -> None:
        """Do what is chosen; what cannot be done says why in its row."""
        thing = self.list.chosen()
        if not isinstance(thing, FinderEntry):
            return
        if thing.why_not:
            self.hint.setText(f"{thing.title}: {thing.why_not}.")
            return
        self.recent = [thing.name, *(name for name in self.recent if name != thing.name)][:_KEPT]
        self.accept()
        thing.act()

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.ActivationChange and not self.isActiveWindow():
            self.close()  # who clicks elsewhere has left it


def _row(thing: FinderEntry) -> QTreeWidgetItem:
    """A thing as it is listed: grey, with why, where it cannot be done."""
    texts = thing.title, thing.why_not or thing.place, thing.keys
    return row(texts, thing, grey=bool(thing.why_not))
