"""Figures of the paper, computed in the background and shown."""

from pathlib import Path

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QPixmap, QResizeEvent
from PySide6.QtWidgets import QDialog, QVBoxLayout, QWidget

from kappaskin._files import TemporaryFolder
from kappaskin.studies import write_figures
from kappaskin_app.shell.background import BackgroundTask, Tasks
from kappaskin_app.widgets.parts import Label

TITLES = {
    "fig1": "Fig. 1: the construction, and a linear sensor",
    "fig2": "Fig. 2: the patch and its elements",
    "fig6": "Fig. 6: a centred load, true and fitted",
    "fig8": "Fig. 8: hysteresis and calibration",
    "fig9": "Fig. 9: the fingertip under a line load",
    "initial-curvature": "Section 6.2: initial curvature and hysteresis",
}
_SIZE = QSize(1000, 620)


class FigureWindow(QDialog):
    """A window with one figure, computed in a temporary folder."""

    def __init__(self, name: str, tasks: Tasks, parent: QWidget) -> None:
        super().__init__(parent)
        self.setWindowTitle(TITLES.get(name, name))
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.name = name
        self._room = TemporaryFolder()
        self._picture = QPixmap()
        self.label = Label("Computing\N{HORIZONTAL ELLIPSIS}")
        self.label.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.label.setMinimumSize(320, 200)
        around = QVBoxLayout(self)
        around.addWidget(self.label)
        self.setStyleSheet("background: white; color: #16191d;")  # figures are for paper
        self.resize(_SIZE)
        self._task = BackgroundTask(tasks, "", self._take, self._refuse)
        self._task.compute(write_figures, Path(self._room.name), [name])

    def _take(self, _: object) -> None:
        self._picture = QPixmap(f"{self._room.name}/{self.name}.png")
        self._show()

    def _refuse(self, error: Exception) -> None:
        self.label.setText(str(error))

    def _show(self) -> None:
        if not self._picture.isNull():
            ratio = self.devicePixelRatioF()
            shown = self._picture.scaled(
                self.label.size() * ratio,
                Qt.AspectRatioMode.KeepAspectRatio,
                Qt.TransformationMode.SmoothTransformation,
            )
            shown.setDevicePixelRatio(ratio)
            self.label.setPixmap(shown)

    @property
    def drawn(self) -> bool:
        """Whether the figure is shown."""
        return not self._picture.isNull()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._show()

    def done(self, result: int) -> None:
        self._task.stop()
        self._room.cleanup()
        super().done(result)
