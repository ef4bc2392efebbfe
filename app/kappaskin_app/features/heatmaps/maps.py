"""Grid of the selected heatmaps, in one or two columns."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QGridLayout, QLabel, QScrollArea, QWidget

from kappaskin_app.features.heatmaps.heatmap import Heatmap
from kappaskin_app.shell.colouring import SHADES

_COLUMN = 3  # heatmaps at most in a single column
_NARROWEST = (270, 360)  # px, minimum width of one column and of two


class HeatmapGrid(QScrollArea):
    """Scrollable grid of the heatmaps; hidden ones are not drawn."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.heatmaps = {name: Heatmap(name) for name in SHADES}
        self._none = QLabel("Select heatmaps under View.", alignment=Qt.AlignmentFlag.AlignCenter)  # pyright: ignore[reportCallIssue]
        self._shown: tuple[str, ...] | None = None
        whole = QWidget()
        self._grid = QGridLayout(whole)
        self._grid.setContentsMargins(0, 0, 0, 0)
        self._grid.setSpacing(0)
        for widget in (*self.heatmaps.values(), self._none):
            widget.setParent(whole)
            widget.hide()
        self.setWidget(whole)
        self.setWidgetResizable(True)
        self.setFrameShape(QScrollArea.Shape.NoFrame)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setMinimumWidth(_NARROWEST[0])

    def show_selected(self, names: tuple[str, ...]) -> None:
        """Show only the heatmaps called `names`."""
        if names == self._shown:
            return
        self._shown = names
        columns = 1 if len(names) <= _COLUMN else 2
        for widget in (*self.heatmaps.values(), self._none):
            self._grid.removeWidget(widget)
            widget.hide()
        shown = [self.heatmaps[name] for name in names] or [self._none]
        for number, widget in enumerate(shown):
            self._grid.addWidget(widget, *divmod(number, columns))
            widget.show()
        for row in range(len(SHADES)):
            self._grid.setRowStretch(row, row * columns < len(shown))
        self._grid.setColumnStretch(1, columns - 1)
        self._grid.setColumnStretch(0, 1)
        self.setMinimumWidth(_NARROWEST[columns - 1])
