"""The command finder: actions, settings, panels, files and pages, by a few letters."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache, partial

from PySide6.QtCore import QEvent, QObject, QSize, Qt
from PySide6.QtGui import QFontMetrics, QKeyEvent, QStandardItemModel
from PySide6.QtWidgets import (
    QAbstractItemView,
    QApplication,
    QComboBox,
    QDialog,
    QDockWidget,
    QFrame,
    QHeaderView,
    QKeySequenceEdit,
    QLineEdit,
    QTabWidget,
    QToolButton,
    QTreeWidget,
    QTreeWidgetItem,
    QVBoxLayout,
    QWidget,
)

from kappaskin_app.guard import guarded
from kappaskin_app.shell.actions import plain
from kappaskin_app.shell.form import ChoiceBox, Form
from kappaskin_app.shell.panel import Panel
from kappaskin_app.shell.parts import Parts
from kappaskin_app.shell.settings import form_field
from kappaskin_app.widgets.layout import scroll_to
from kappaskin_app.widgets.parts import Label, plain_tip

_NOT_NOW = "not available with the present settings"


@dataclass(frozen=True)
class FinderEntry:
    """An entry of the finder: its title, its place, its function, why it is disabled."""

    name: str
    title: str
    place: str
    act: Callable[[], object]
    keys: str = ""
    why_not: str = ""


EntrySource = Callable[[], Iterable[FinderEntry]]


def entries_in(window: Parts, others: Iterable[EntrySource]) -> list[FinderEntry]:
    """All entries of the window now, with those of `others`."""
    return [
        *_actions(window),
        *_panels(window),
        *_settings(window),
        *_layouts(window),
        *_files(window),
        *(entry for entries in others for entry in entries()),
    ]


def reveal(widget: QWidget) -> None:
    """Show a widget, with its dock and page, and give it the focus."""
    for around in _around(widget):
        if isinstance(around, QTabWidget):
            around.setCurrentIndex(_page(around, widget))
        elif isinstance(around, Panel):
            around.fold.setChecked(False)
        else:
            around.show()
            around.raise_()
    scroll_to(widget)
    widget.setFocus(Qt.FocusReason.ShortcutFocusReason)


def _around(widget: QWidget) -> Iterator[QTabWidget | QDockWidget | Panel]:
    """The panel, pages and docks that a widget is in, the nearest first."""
    around = widget.parentWidget()
    while around is not None:
        if isinstance(around, QTabWidget | QDockWidget | Panel):
            yield around
        around = around.parentWidget()


def _page(pages: QTabWidget, widget: QWidget) -> int:
    """The index of the page that a widget is on."""
    page: QWidget | None = widget
    while page is not None and pages.indexOf(page) < 0:
        page = page.parentWidget()
    return -1 if page is None else pages.indexOf(page)


def _where(widget: QWidget) -> str:
    """The page or dock that a widget is on."""
    around = next(_around(widget))
    if isinstance(around, QTabWidget):
        return f"{plain(around.tabText(_page(around, widget)))} page"
    return around.windowTitle()


def _actions(window: Parts) -> Iterator[FinderEntry]:
    for name, entry in window.actions_by_name.entries.items():
        if entry.action.menu() is None:
            yield FinderEntry(
                f"action:{name}",
                plain(entry.action.text()),
                f"{plain(entry.menu)} menu",
                entry.action.trigger,
                entry.action.shortcut().toString(),
                window.actions_by_name.why_not(name),
            )


def _panels(window: Parts) -> Iterator[FinderEntry]:
    for panel in window.findChildren(Panel):
        title = panel.title()
        show, why_not = partial(enter, panel), _why_hidden(panel)
        yield FinderEntry(f"panel:{title}", f"{title} panel", _where(panel), show, "", why_not)


def _why_hidden(panel: Panel) -> str:
    """Why a panel is hidden; empty where it is not."""
    return panel.message.text() or _NOT_NOW if panel.isHidden() else ""


def enter(panel: QWidget) -> None:
    """Show a panel, with the focus on the first of its widgets that takes it."""
    reveal(panel)
    takes = (w for w in panel.findChildren(QWidget) if w.focusPolicy() & Qt.FocusPolicy.TabFocus)
    if (first := next((w for w in takes if w.isEnabled() and w.isVisible()), None)) is not None:
        reveal(first)


def _settings(window: Parts) -> Iterator[FinderEntry]:
    for form in window.findChildren(Form):
        place = f"{_where(form)}, {form.title()}"
        for editor in form.editors():
            yield from _setting(window, form, editor, place)


def _setting(window: Parts, form: Form, editor: QWidget, place: str) -> Iterator[FinderEntry]:
    """The setting of `editor`, and each value of a choice."""
    name = editor.objectName()
    how = form_field(name)
    why_not = _why_hidden(form) or ("" if form.has_row(name) else _NOT_NOW)
    if not editor.isEnabled():
        why_not = form.message.text() or _NOT_NOW
    title = how.label if how.label == form.title() else f"{form.title()}: {how.label}"
    yield FinderEntry(f"setting:{name}", title, place, partial(reveal, editor), "", why_not)
    if isinstance(editor, ChoiceBox):
        for value, words in editor.options:
            refused = why_not or _refused(editor, value)
            select = partial(window.requests.set, name, value)
            yield FinderEntry(
                f"setting:{name}={value}", f"{title}: {words}", place, select, "", refused
            )


def _refused(box: QWidget, value: str) -> str:
    """Why a choice cannot have a value now; empty where it can."""
    model = box.model() if isinstance(box, QComboBox) else None
    if isinstance(box, QComboBox) and isinstance(model, QStandardItemModel):
        return "" if model.item(box.findData(value)).isEnabled() else _NOT_NOW
    return ""


def _files(window: Parts) -> Iterator[FinderEntry]:
    for file in window.opening.last_ones():
        why_not = "" if file.is_file() else "moved or deleted"
        act = partial(window.opening.open, file)
        yield FinderEntry(f"file:{file}", f"Open {file.name}", f"{file.parent}", act, "", why_not)


def _layouts(window: Parts) -> Iterator[FinderEntry]:
    for name in window.layouts.own:
        yield FinderEntry(
            f"layout:{name}",
            name,
            "Layout menu, Saved layouts",
            partial(window.layouts.choose, name),
        )


_BEGINS, _FOLLOWS, _SKIPS = 8, 5, 0.2  # points of a letter that begins a word, or has its neighbour
_WHOLE = 4  # points more where the text begins so
_FAR = 0.3  # of the best one's points, below which an entry is not listed
_ELSEWHERE = 0.4  # of the points, for what is found only in the place of an entry or in a synonym
_SYNONYMS = {
    "baud": "connection",
    "capture": "record picture",
    "confidence": "error",
    "csv": "export copy",
    "dark": "theme",
    "data": "export",
    "device": "connect connection",
    "font": "text",
    "graph": "chart traces cost",
    "help": "guide lessons",
    "image": "picture",
    "manual": "guide lessons",
    "movie": "film",
    "offset": "tare",
    "parquet": "export",
    "performance": "cost frame",
    "plot": "chart traces cost",
    "port": "connect connection",
    "ros": "publish",
    "screenshot": "picture",
    "serial": "connect connection",
    "sigma": "error",
    "stream": "publish",
    "table": "export numbers",
    "udp": "publish",
    "uncertainty": "error",
    "usb": "connect connection",
    "video": "film",
    "zero": "tare",
    "zoom": "camera text",
}
"""What others call what a word of a title means."""
_TYPED = 3  # letters of such a word that are enough


def score(query: str, text: str, place: str = "") -> float:
    """Points of `text`, at `place`, for all words of `query`; 0 where one is not found.

    The words may come in any order. Each is a part of the text, or the beginnings of its words.
    """
    points = [_best(word, text.lower(), place.lower()) for word in query.lower().split()]
    if not points:
        return 1.0
    return sum(points) - 0.01 * len(text) if min(points) > 0 else 0.0


def best(points: Mapping[str, float]) -> list[str]:
    """The best names, in falling order of their points."""
    least = _FAR * max(points.values(), default=0.0)
    return sorted((name for name in points if points[name] > least), key=lambda name: -points[name])


def _best(word: str, text: str, place: str) -> float:
    typed = len(word) >= _TYPED
    meant = [m for other, m in _SYNONYMS.items() if typed and other.startswith(word)]
    elsewhere = [_points(m, text) for each in meant for m in each.split() if m in text]
    return max(_points(word, text), _ELSEWHERE * max(_points(word, place), *elsewhere, 0.0))


@lru_cache(maxsize=20_000)
def _points(word: str, text: str) -> float:
    """Points of the best way to find a `word` in `text`; 0 where there is none."""
    begins = [at == 0 or not text[at - 1].isalnum() for at in range(len(text))]
    # best[j]: of the letters so far, the last of them at j.
    best = {at: 1.0 + _BEGINS for at, here in enumerate(text) if here == word[0] and begins[at]}
    for letter in word[1:]:
        best = {
            at: max(
                points
                + (1.0 + _FOLLOWS if at == before + 1 else 1.0 + _BEGINS)
                - _SKIPS * (at - before - 1)
                for before, points in best.items()
                if before == at - 1 or (before < at and begins[at])
            )
            for at in range(min(best, default=0) + 1, len(text))
            if text[at] == letter
            and (at - 1 in best or (begins[at] and any(before < at for before in best)))
        }
    inside = len(word) + _FOLLOWS * (len(word) - 1) if word in text else 0.0
    most = max(inside, *(max(points, 0.1) for points in best.values()), 0.0)
    return most + _WHOLE * text.startswith(word)


_LED = (Qt.Key.Key_Up, Qt.Key.Key_Down, Qt.Key.Key_PageUp, Qt.Key.Key_PageDown)
_ROOM = 5  # px between two rows


def clearable(editor: QLineEdit | QKeySequenceEdit) -> None:
    """Add a button that clears an `editor`, with an accessible name."""
    editor.setClearButtonEnabled(True)
    for made in editor.findChildren(QToolButton):
        made.setAccessibleName("Clear")


class Listing(QTreeWidget):
    """Rows of three texts; the arrow keys in `line` select one."""

    def __init__(self, line: QLineEdit) -> None:
        super().__init__()
        self.setColumnCount(3)
        self.setHeaderHidden(True)
        self.setRootIsDecorated(False)
        self.setUniformRowHeights(True)
        self.setVerticalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        header, how = self.header(), QHeaderView.ResizeMode
        header.setStretchLastSection(False)
        for column, mode in enumerate((how.Stretch, how.Interactive, how.ResizeToContents)):
            header.setSectionResizeMode(column, mode)
        line.installEventFilter(self)

    def show_rows(self, rows: list[QTreeWidgetItem]) -> None:
        """List these rows, and select the first."""
        self.clear()
        self.addTopLevelItems(rows)
        if rows:
            self.setCurrentItem(rows[0])

    def chosen(self) -> object:
        """The object of the selected row; None where there is none."""
        row = self.currentItem()
        return row.data(0, Qt.ItemDataRole.UserRole) if row is not None else None

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if not isinstance(event, QKeyEvent) or event.type() != QEvent.Type.KeyPress:
            return False
        leads = event.key() in _LED
        if leads:
            self.keyPressEvent(event)
        return leads


def row(texts: tuple[str, str, str], of: object, grey: bool = False) -> QTreeWidgetItem:
    """A row for the object `of`, its second text fainter, or all where it is `grey`."""
    made = QTreeWidgetItem(list(texts))
    made.setData(0, Qt.ItemDataRole.UserRole, of)
    made.setSizeHint(0, QSize(0, QFontMetrics(QApplication.font()).height() + _ROOM))
    faint = QApplication.palette().placeholderText()
    for column in range(2):
        made.setToolTip(column, plain_tip(texts[column]))
        if grey or column:
            made.setForeground(column, faint)
    return made


_KEPT = 12  # recent entries, which are listed first
_RECENT = 3.0  # points more of the last entry, less of earlier ones
_SIZE = (0.62, 0.66)  # of the window's
_HINT = "\N{UPWARDS ARROW} \N{DOWNWARDS ARROW} select   Enter run   Esc close"
_NOTHING = "No match: try fewer letters."


class Finder(QDialog):
    """Finds and runs one of the `entries`; `recent` are the names of the last ones."""

    def __init__(self, entries: Callable[[], list[FinderEntry]], parent: QWidget) -> None:
        super().__init__(parent, Qt.WindowType.Dialog | Qt.WindowType.FramelessWindowHint)
        self.setObjectName("finder")
        self.setWindowTitle("Find a command")
        self._window, self._get_entries, self._entries = parent, entries, list[FinderEntry]()
        self.recent: list[str] = []
        self.line, self.hint = QLineEdit(), Label(_HINT)
        self.list = Listing(self.line)
        self.line.setPlaceholderText(
            "A command, a setting, a scene, a panel, a file\N{HORIZONTAL ELLIPSIS}"
        )
        self.line.setAccessibleName("Search")
        self.line.setToolTip("Part of a name, or how its words begin: nogau finds Noise: Gaussian.")
        clearable(self.line)
        self.list.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # the line keeps it
        self.list.setAccessibleName("Matches")
        self.list.setToolTip("Matches, with their places and shortcuts.")
        frame = QFrame(self, frameShape=QFrame.Shape.StyledPanel)  # pyright: ignore[reportCallIssue]
        around, layout = QVBoxLayout(self), QVBoxLayout(frame)
        around.setContentsMargins(0, 0, 0, 0)
        around.addWidget(frame)
        for widget in (self.line, self.list, self.hint):
            layout.addWidget(widget)
        self.line.textChanged.connect(guarded(self._list))
        self.line.returnPressed.connect(guarded(self._run))
        self.list.itemClicked.connect(guarded(lambda *_: self._run()))

    def open_empty(self) -> None:
        """Show all entries, the recent ones first."""
        window = self._window
        self._entries = self._get_entries()
        wide, high = (
            round(s * n) for s, n in zip(_SIZE, (window.width(), window.height()), strict=True)
        )
        corner = window.mapToGlobal(window.rect().topLeft())
        self.setGeometry(corner.x() + (window.width() - wide) // 2, corner.y() + 60, wide, high)
        self.list.header().resizeSection(1, round(0.36 * wide))
        self.line.clear()
        self._list()
        self.show()
        self.raise_()
        self.activateWindow()
        self.line.setFocus()

    def found(self) -> list[FinderEntry]:
        """The entries that match the text typed, the best first, and disabled ones last."""
        query = self.line.text()
        if not query.strip():
            return self._last_first()
        points = {entry.name: score(query, entry.title, entry.place) for entry in self._entries}
        for age, name in enumerate(self.recent):
            if points.get(name, 0.0) > 0:
                points[name] += _RECENT * (1 - age / _KEPT)
        entries = {entry.name: entry for entry in self._entries}
        found = [entries[name] for name in best(points)]
        return sorted(found, key=lambda entry: bool(entry.why_not))

    def _last_first(self) -> list[FinderEntry]:
        ages = {name: age for age, name in enumerate(self.recent)}
        return sorted(self._entries, key=lambda entry: ages.get(entry.name, _KEPT))

    def _list(self, *_: object) -> None:
        found = self.found()
        self.list.show_rows([_row(entry) for entry in found])
        self.hint.setText(_HINT if found else _NOTHING)

    def _run(self) -> None:
        """Run the selected entry, or show why it is disabled."""
        entry = self.list.chosen()
        if not isinstance(entry, FinderEntry):
            return
        if entry.why_not:
            self.hint.setText(f"{entry.title}: {entry.why_not}.")
            return
        self.recent = [entry.name, *(name for name in self.recent if name != entry.name)][:_KEPT]
        self.accept()
        entry.act()

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.ActivationChange and not self.isActiveWindow():
            self.close()  # a click elsewhere closes it


def _row(entry: FinderEntry) -> QTreeWidgetItem:
    """The row of an entry: grey, with the reason, where it is disabled."""
    texts = entry.title, entry.why_not or entry.place, entry.keys
    return row(texts, entry, grey=bool(entry.why_not))
