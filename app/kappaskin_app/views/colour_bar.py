"""What the colours mean: a scale with its limits and unit, which may be locked."""

import numpy as np
from PySide6.QtCore import QPointF, QRectF, Qt, Signal
from PySide6.QtGui import QImage, QPainter, QPaintEvent
from PySide6.QtWidgets import QLabel, QToolButton, QVBoxLayout, QWidget

from kappaskin_app.theme import DIVERGING, SEQUENTIAL, Colours


class ColourBar(QWidget):
    """A vertical scale of colours with its limits and unit."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._colours, self.limits, self._unit = DIVERGING, (-1.0, 1.0), "1/m"
        self.setFixedWidth(70)

    def show_scale(self, colours: Colours, limits: tuple[float, float], unit: str) -> None:
        if (self.limits, self._unit) != (limits, unit) or self._colours is not colours:
            self._colours, self.limits, self._unit = colours, limits, unit
            self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        metrics = painter.fontMetrics()
        line = metrics.height()
        bar = QRectF(4, line + 4, 14, max(self.height() - line - 10, 10))
        ramp = np.ascontiguousarray(self._colours[::-1, None])
        image = QImage(ramp.tobytes(), 1, 256, 3, QImage.Format.Format_RGB888)
        painter.drawImage(bar, image)
        painter.setPen(self.palette().windowText().color())
        painter.drawText(QPointF(2, metrics.ascent()), self._unit)
        low, high = self.limits
        for share in (0.0, 0.5, 1.0):
            y = bar.bottom() - share * bar.height()
            text = f"{low + share * (high - low):.3g}".replace("-", "\N{MINUS SIGN}")
            top = min(max(y - line / 2, bar.top()), bar.bottom() - line)
            painter.drawText(QPointF(bar.right() + 4, top + metrics.ascent()), text)


class LockButton(QToolButton):
    """Says whether a range of colours is locked; `wanted` says that it should be, or not."""

    wanted = Signal(bool)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setCheckable(True)
        self.setToolTip("Keep the colours' range as it is now; else it follows what is shown.")
        self.clicked.connect(self._ask)
        self.show_locked(False)

    def _ask(self, locked: bool) -> None:
        self.setChecked(not locked)  # the answer comes back through show_locked
        self.wanted.emit(locked)

    def show_locked(self, locked: bool) -> None:
        self.setChecked(locked)
        self.setText("Locked" if locked else "Lock")


class SkinScale(QWidget):
    """The colours of the skin, with their lock, and how many times larger it is drawn."""

    lock_wanted = Signal(bool)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.bar, self.lock = ColourBar(), LockButton()
        self.bar.show_scale(SEQUENTIAL, (0.0, 1.0), "mm")
        self.lock.wanted.connect(self.lock_wanted)
        self.times = QLabel(alignment=Qt.AlignmentFlag.AlignHCenter)  # pyright: ignore[reportCallIssue]
        self.times.setToolTip(
            "How many times the displacement is drawn larger: what Height asks for, or as much of "
            "it as fits into the picture."
        )
        around = QVBoxLayout(self)
        around.setContentsMargins(0, 4, 0, 4)
        around.addWidget(self.bar, 1)
        around.addWidget(self.lock, 0, Qt.AlignmentFlag.AlignHCenter)
        around.addWidget(self.times)

    def show_times(self, times: float) -> None:
        """Say how many `times` higher the skin is drawn."""
        text = f"height\n\N{MULTIPLICATION SIGN} {times:.3g}"
        if text != self.times.text():
            self.times.setText(text)
