"""A list in three columns that a line of letters leads: what, where, and its shortcut."""

from PySide6.QtCore import QEvent, QObject, QSize, Qt
from PySide6.QtGui import QFontMetrics, QKeyEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QApplication,
    QHeaderView,
    QKeySequenceEdit,
    QLineEdit,
    QToolButton,
    QTreeWidget,
    QTreeWidgetItem,
    QWidget,
)

_LED = (Qt.Key.Key_Up, Qt.Key.Key_Down, Qt.Key.Key_PageUp, Qt.Key.Key_PageDown)
_ROOM = 5  # px between two rows


def clearable(editor: QLineEdit | QKeySequenceEdit) -> None:
    """Give an `editor` a button that clears it, and the button a name."""
    editor.setClearButtonEnabled(True)
    for made in editor.findChildren(QToolButton):
        made.setAccessibleName("Clear")


class Listing(QTreeWidget):
    """Rows of three texts each; the arrows in `line` lead it."""

    def __init__(self, line: QLineEdit, parent: QWidget | None = None) -> None:
        super().__init__(parent)
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
        """List these, the first of them chosen."""
        self.clear()
        self.addTopLevelItems(rows)
        if rows:
            self.setCurrentItem(rows[0])

    def chosen(self) -> object:
        """What the chosen row is of; None where there is none."""
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
    """A row of what it is `of`, with the second text fainter, and all of it where it is `grey`."""
    made = QTreeWidgetItem(list(texts))
    made.setData(0, Qt.ItemDataRole.UserRole, of)
    made.setSizeHint(0, QSize(0, QFontMetrics(QApplication.font()).height() + _ROOM))
    faint = QApplication.palette().placeholderText()
    for column in range(2):
        made.setToolTip(column, texts[column])
        if grey or column:
            made.setForeground(column, faint)
    return made
