"""The line in which a person types a few letters, and below it what they may mean."""

from collections.abc import Callable

from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QApplication,
    QDialog,
    QFrame,
    QHeaderView,
    QLabel,
    QLineEdit,
    QTreeWidget,
    QTreeWidgetItem,
    QVBoxLayout,
    QWidget,
)

from kappaskin_app.finder.matching import score
from kappaskin_app.finder.things import Thing
from kappaskin_app.guard import guarded

_KEPT = 12  # of what was done last, which comes first
_RECENT = 3.0  # points more of what was done last, less of what was before
_FAR = 0.3  # of the best one's points, below which it is not what was meant
_SIZE = (0.62, 0.66)  # of the window's
_TO_LIST = (Qt.Key.Key_Up, Qt.Key.Key_Down, Qt.Key.Key_PageUp, Qt.Key.Key_PageDown)
_HINT = "\N{UPWARDS ARROW} \N{DOWNWARDS ARROW} choose   Enter do it   Esc leave"
_NOTHING = "Nothing here is called so: try fewer letters."


class Finder(QDialog):
    """Finds one of what `things` tells, and does it; `recent` are the names of the last ones."""

    def __init__(self, things: Callable[[], list[Thing]], parent: QWidget) -> None:
        super().__init__(parent, Qt.WindowType.Dialog | Qt.WindowType.FramelessWindowHint)
        self.setObjectName("finder")
        self.setWindowTitle("Find a command")
        self._window, self._ask, self._things = parent, things, list[Thing]()
        self.recent: list[str] = []
        self.line, self.list, self.hint = QLineEdit(), QTreeWidget(), QLabel(_HINT)
        self.line.setPlaceholderText(
            "A command, a setting, a scene, a panel\N{HORIZONTAL ELLIPSIS}"
        )
        self.line.setAccessibleName("What to find")
        self.line.setToolTip(
            "A few letters of its name are enough, in their order: nogau is Noise: Gaussian."
        )
        self.line.setClearButtonEnabled(True)
        self._dress_list()
        frame = QFrame(self, frameShape=QFrame.Shape.StyledPanel)  # pyright: ignore[reportCallIssue]
        around, layout = QVBoxLayout(self), QVBoxLayout(frame)
        around.setContentsMargins(0, 0, 0, 0)
        around.addWidget(frame)
        for widget in (self.line, self.list, self.hint):
            layout.addWidget(widget)
        self.line.installEventFilter(self)
        self.line.textChanged.connect(guarded(self._list))
        self.line.returnPressed.connect(guarded(self._do))
        self.list.itemClicked.connect(guarded(lambda *_: self._do()))

    def _dress_list(self) -> None:
        self.list.setColumnCount(3)
        self.list.setHeaderHidden(True)
        self.list.setRootIsDecorated(False)
        self.list.setUniformRowHeights(True)
        self.list.setStyleSheet("QTreeView::item { padding: 2px 0px; }")
        self.list.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # the line keeps it, and leads the list
        self.list.setVerticalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.list.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.list.setAccessibleName("What was found")
        self.list.setToolTip("What was found, where it stands, and its shortcut.")
        header = self.list.header()
        header.setStretchLastSection(False)
        header.setMinimumSectionSize(60)
        header.setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
        header.setSectionResizeMode(1, QHeaderView.ResizeMode.Interactive)
        header.setSectionResizeMode(2, QHeaderView.ResizeMode.ResizeToContents)

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

    def found(self) -> list[Thing]:
        """What the letters typed may mean, the best first."""
        query = self.line.text()
        if not query.strip():
            return self._last_first()
        points = {thing.name: score(query, thing.title, thing.place) for thing in self._things}
        for age, name in enumerate(self.recent):
            if points.get(name, 0.0) > 0:
                points[name] += _RECENT * (1 - age / _KEPT)
        least = _FAR * max(points.values(), default=0.0)
        fit = [thing for thing in self._things if points[thing.name] > least]
        return sorted(fit, key=lambda thing: (-points[thing.name], bool(thing.why_not)))

    def _last_first(self) -> list[Thing]:
        ages = {name: age for age, name in enumerate(self.recent)}
        return sorted(self._things, key=lambda thing: ages.get(thing.name, _KEPT))

    def _list(self, *_: object) -> None:
        self.list.clear()
        found = self.found()
        self.list.addTopLevelItems([_row(thing) for thing in found])
        self.hint.setText(_HINT if found else _NOTHING)
        if (first := self.list.topLevelItem(0)) is not None:
            self.list.setCurrentItem(first)

    def _do(self) -> None:
        """Do what is chosen; what cannot be done says why in its row."""
        if (row := self.list.currentItem()) is None:
            return
        thing: Thing = row.data(0, Qt.ItemDataRole.UserRole)
        if thing.why_not:
            self.hint.setText(f"{thing.title}: {thing.why_not}.")
            return
        self.recent = [thing.name, *(name for name in self.recent if name != thing.name)][:_KEPT]
        self.accept()
        thing.act()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if not isinstance(event, QKeyEvent) or event.type() != QEvent.Type.KeyPress:
            return False
        leads = event.key() in _TO_LIST
        if leads:
            self.list.keyPressEvent(event)
        return leads

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.ActivationChange and not self.isActiveWindow():
            self.close()  # who clicks elsewhere has left it


def _row(thing: Thing) -> QTreeWidgetItem:
    """A thing as it is listed: grey, with why, where it cannot be done."""
    row = QTreeWidgetItem([thing.title, thing.why_not or thing.place, thing.keys])
    row.setData(0, Qt.ItemDataRole.UserRole, thing)
    for column, text in enumerate((thing.title, thing.why_not or thing.place)):
        row.setToolTip(column, text)
    faint = QApplication.palette()
    row.setForeground(1, faint.placeholderText())
    if thing.why_not:
        row.setForeground(0, faint.placeholderText())
    return row
