"""The lessons to choose from, with how long each takes and what one learns."""

from collections.abc import Mapping

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QListWidget, QListWidgetItem, QVBoxLayout, QWidget

from kappaskin_app.features.lessons.progress import Progress
from kappaskin_app.guard import guarded
from kappaskin_app.theme import Theme
from kappaskin_app.widgets.parts import ELLIPSIS, button, in_a_row, text_label

_NAME = Qt.ItemDataRole.UserRole
_DONE = "\N{CHECK MARK}"


class _List(QListWidget):
    """A list whose row Enter takes, as a double click does."""

    taken = Signal()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            self.taken.emit()
        else:
            super().keyPressEvent(event)


class ListPage(QWidget):
    """Lists the lessons; `taken` names the one to take, `open_wanted` asks for a file."""

    taken = Signal(str)
    open_wanted = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.list = _List()
        self.list.setAccessibleName("Lessons")
        self.list.setSpacing(2)
        self.list.setTextElideMode(Qt.TextElideMode.ElideRight)
        self.list.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.about, self.message = text_label(), text_label()
        self.message.setTextFormat(Qt.TextFormat.PlainText)
        self.about.setTextFormat(Qt.TextFormat.PlainText)
        self.about.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.about.setMinimumHeight(5 * self.about.fontMetrics().lineSpacing())
        self.begin = button(
            "&Take this lesson",
            "take-lesson",
            "Begin it, or go on where you left it (Enter, or double-click). It changes the "
            "settings; leaving it gives them back.",
        )
        self.open = button(
            f"&Open file{ELLIPSIS}", "open-lesson", "Take a lesson from a file of your own."
        )
        stack = QVBoxLayout(self)
        stack.setContentsMargins(8, 6, 8, 8)
        stack.addWidget(self.list, 1)
        stack.addWidget(self.about)
        stack.addWidget(self.message)
        stack.addLayout(in_a_row(self.begin, self.open))
        self._progress: Mapping[str, Progress] = {}
        self.list.currentItemChanged.connect(guarded(self._describe))
        self.list.itemDoubleClicked.connect(guarded(self._take))
        self.list.taken.connect(guarded(self._take))
        self.begin.clicked.connect(guarded(self._take))
        self.open.clicked.connect(guarded(lambda *_: self.open_wanted.emit()))

    def show_lessons(self, progress: Mapping[str, Progress], message: str) -> None:
        """Show the lessons by file, how far each is, and why a file was no lesson."""
        self._progress = progress
        self.message.setText(message)
        self.message.setVisible(bool(message))
        for row, (name, one) in enumerate(progress.items()):
            if row == self.list.count():
                self.list.addItem(QListWidgetItem())
            item = self.list.item(row)
            item.setData(_NAME, name)
            mark = f"   {_DONE}" if one.describe().startswith("done") else ""
            item.setText(f"{row + 1}  {one.lesson.title}{mark}")
        if self.list.currentRow() < 0 and progress:
            self.list.setCurrentRow(0)
        self._describe()

    @property
    def selected(self) -> str:
        item = self.list.currentItem()
        return "" if item is None else item.data(_NAME)

    def show_theme(self, theme: Theme) -> None:
        self.message.setStyleSheet(f"color: {theme.alert};")

    def _describe(self, *_: object) -> None:
        one = self._progress.get(self.selected)
        self.begin.setEnabled(one is not None)
        if one is None:
            self.about.setText("")
            return
        far = one.describe()
        self.begin.setText("&Go on" if far.startswith("step") else "&Take this lesson")
        said = f"{one.lesson.minutes} min{', ' + far if far else ''}. {one.lesson.learn}"
        self.about.setText(said)

    def _take(self, *_: object) -> None:
        if self.selected:
            self.taken.emit(self.selected)
