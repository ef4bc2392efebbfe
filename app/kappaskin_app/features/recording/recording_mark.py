"""A red mark in the header while something is recorded: for how long, how much, what is lost."""

from PySide6.QtCore import QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QFont, QMouseEvent, QPainter, QPaintEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from kappaskin.recording import RecordingStatus
from kappaskin_app.theme import LIGHT, Theme

_WIDTH, _TEXT = 92, 22  # px: of all, and to where the words begin
_HOUR = 3600.0  # s, from which there is room for the time alone
_UNITS = ((1e9, "GB"), (1e6, "MB"), (1e3, "kB"))


def size_of(count: int) -> str:
    """A number of bytes in few digits."""
    for one, unit in _UNITS:
        if count >= one:
            return f"{count / one:.1f} {unit}"
    return f"{count} B"


def duration_of(seconds: float) -> str:
    """A time as m:ss, or h:mm:ss from an hour on."""
    whole = int(seconds)
    hours, rest = divmod(whole, 3600)
    below = f"{rest // 60:02d}:{rest % 60:02d}" if hours else f"{rest // 60}:{rest % 60:02d}"
    return f"{hours}:{below}" if hours else below


class RecordingMark(QWidget):
    """Shows how a recording does, and that it ended by itself until `clicked`."""

    clicked = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Preferred)
        self.head, self.below, self._bad = "", "", False
        self._theme = LIGHT

    def sizeHint(self) -> QSize:
        return QSize(_WIDTH, 2 * self.fontMetrics().height())

    minimumSizeHint = sizeHint

    def show_written(self, written: RecordingStatus, trouble: str) -> None:
        """Show what is being written, or why it ended by itself."""
        if written.active:
            head, size = duration_of(written.seconds), size_of(written.size)
            head = head if written.seconds >= _HOUR else f"REC {head}"
            self._show(head, f"{written.lost} lost" if written.lost else size, written.lost > 0)
            self.setToolTip(
                f"Recording to {written.path}: {size}, {written.lost} messages lost.\n"
                "Lost is what found too much waiting for the disk."
            )
        else:
            self._show("REC ended", "by itself", True)
            self.setToolTip(f"{trouble}\n\nClick to take this mark away.")
        self.setAccessibleName(f"{self.head}, {self.below}")

    def _show(self, head: str, below: str, bad: bool) -> None:
        if (head, below, bad) != (self.head, self.below, self._bad):
            self.head, self.below, self._bad = head, below, bad
            self.update()

    def show_theme(self, theme: Theme) -> None:
        self._theme = theme
        self.update()

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        self.clicked.emit()
        super().mouseReleaseEvent(event)

    def paintEvent(self, event: QPaintEvent) -> None:
        painter, theme = QPainter(self), self._theme
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        line = float(self.fontMetrics().height())
        top = (self.height() - 2 * line) / 2
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(theme.alert))
        painter.drawEllipse(QPointF(12, top + line / 2), 5, 5)
        left = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
        bold = painter.font()
        bold.setWeight(QFont.Weight.DemiBold)
        painter.setFont(bold)
        painter.setPen(QColor(theme.alert))
        painter.drawText(QRectF(_TEXT, top, self.width() - _TEXT, line), left, self.head)
        painter.setFont(self.font())
        painter.setPen(QColor(theme.alert if self._bad else theme.text))
        painter.drawText(QRectF(_TEXT, top + line, self.width() - _TEXT, line), left, self.below)
