"""The rows of a table, as high as its letters."""

from PySide6.QtWidgets import QTableWidget

_ROOM = 5  # px above and below a line together


def fit_rows(table: QTableWidget) -> None:
    """Make every row of a `table` as high as a line of its letters of now."""
    header, line = table.verticalHeader(), table.fontMetrics().height()
    if header.defaultSectionSize() != line + _ROOM:
        header.setMinimumSectionSize(line)
        header.setDefaultSectionSize(line + _ROOM)
