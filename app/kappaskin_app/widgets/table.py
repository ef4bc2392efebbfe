"""Tables of texts, to read."""

from collections.abc import Collection, Sequence

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTableWidget, QTableWidgetItem

from kappaskin._text import printable
from kappaskin_app.widgets.lettering import RIGHT
from kappaskin_app.widgets.parts import plain_tip

_ROOM = 5  # px above and below a line together


class Table(QTableWidget):
    """A table without row numbers that cannot be edited; screen readers read its `title`.

    Each of its `columns` may have a tooltip, in `tips`. Columns of the numbers `right` are
    right-aligned, those of `stretched` share the width that the other columns leave.
    """

    def __init__(
        self,
        name: str,
        title: str,
        columns: Sequence[str],
        tips: Sequence[str] = (),
        right: Collection[int] = (),
        stretched: Collection[int] = (),
    ) -> None:
        super().__init__()
        self.setObjectName(name)
        self.setAccessibleName(title)
        header = self.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        self.show_head(columns, right, stretched)
        for column, tip in enumerate(tips):
            header.model().setHeaderData(
                column, header.orientation(), tip, Qt.ItemDataRole.ToolTipRole
            )
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.setTabKeyNavigation(False)  # Tab leaves the table, the arrow keys move in it
        self.verticalHeader().hide()

    def show_head(
        self, columns: Sequence[str], right: Collection[int], stretched: Collection[int]
    ) -> None:
        """Have these columns, empty, aligned and stretched as those of a new table."""
        self.setRowCount(0)
        self.setColumnCount(len(columns))
        self.setHorizontalHeaderLabels(list(columns))
        self._right = right
        for column in stretched:
            self.horizontalHeader().setSectionResizeMode(column, QHeaderView.ResizeMode.Stretch)

    def fit_rows(self, count: int) -> None:
        """Have `count` rows, each as high as a line of the present font."""
        header, line = self.verticalHeader(), self.fontMetrics().height()
        if header.defaultSectionSize() != line + _ROOM:
            header.setMinimumSectionSize(line)
            header.setDefaultSectionSize(line + _ROOM)
        self.setRowCount(count)

    def show_rows(self, rows: Sequence[Sequence[str]]) -> None:
        """Write the changed cells of all rows; a tooltip shows what does not fit a cell."""
        self.fit_rows(len(rows))
        for row, texts in enumerate(rows):
            for column, text in enumerate(texts):
                item = self.item(row, column)
                if item is None or item.text() != text:
                    self.write(row, column, text, text)

    def write(self, row: int, column: int, text: str, tip: str = "") -> QTableWidgetItem:
        """Write one cell, and return its item."""
        item = self.item(row, column)
        if item is None:
            item = QTableWidgetItem()
            if column in self._right:
                item.setTextAlignment(RIGHT)
            self.setItem(row, column, item)
        item.setText(printable(text, keep="\n"))
        item.setToolTip(plain_tip(tip))
        return item
