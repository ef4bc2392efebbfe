"""A figure of the paper, drawn anew by the command line beside the window and then shown."""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from PySide6.QtCore import QProcess, QSize, Qt
from PySide6.QtGui import QPixmap, QResizeEvent
from PySide6.QtWidgets import QDialog, QLabel, QVBoxLayout, QWidget

from kappaskin_app.guard import guarded

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
    """One figure, as large as the window; the files it came from are the window's own."""

    def __init__(self, name: str, parent: QWidget) -> None:
        super().__init__(parent)
        self.setWindowTitle(TITLES.get(name, name))
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.name = name
        self._room = TemporaryDirectory(prefix="kappaskin-figure-")
        self._picture = QPixmap()
        self.label = QLabel("Computing\N{HORIZONTAL ELLIPSIS}")
        self.label.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.label.setMinimumSize(320, 200)
        around = QVBoxLayout(self)
        around.addWidget(self.label)
        self.setStyleSheet("background: white; color: #16191d;")  # figures are for paper
        self.resize(_SIZE)
        # Another process: drawing takes a second or two, and the window goes on meanwhile.
        self._process = QProcess(self)
        self._process.finished.connect(guarded(self._done))
        self._process.errorOccurred.connect(guarded(self._failed))
        arguments = ["-m", "kappaskin", "figures", "--out", self._room.name, "--only", name]
        self._process.start(sys.executable, arguments)

    def _done(self, code: int, _: object) -> None:
        path = Path(self._room.name) / f"{self.name}.png"
        if code or not path.exists():
            why = bytes(self._process.readAllStandardError().data()).decode(errors="replace")
            self.label.setText(why.strip() or "The figure could not be drawn.")
            return
        self._picture = QPixmap(str(path))
        self._show()

    def _failed(self, _: object) -> None:
        self.label.setText(self._process.errorString())

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
        """Whether the figure is there."""
        return not self._picture.isNull()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._show()

    def done(self, result: int) -> None:
        if self._process.state() != QProcess.ProcessState.NotRunning:
            self._process.finished.disconnect()
            self._process.errorOccurred.disconnect()
            self._process.kill()
            self._process.waitForFinished(2000)
        self._room.cleanup()
        super().done(result)
