"""A stretch of time under a handle that can be dragged: what every timeline's course has."""

from PySide6.QtCore import QEvent, QPointF, QRectF, QSignalBlocker, QSize, Qt, Signal
from PySide6.QtGui import QColor, QKeyEvent, QMouseEvent, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QAbstractSlider, QSizePolicy, QWidget

from kappaskin_app.guard import guarded
from kappaskin_app.theme import LIGHT, Theme

HEIGHT = 30  # px of the row
_SIDE = 8.0  # px beside the course, for half of the handle
_KNOB = 5.5  # px: radius of the handle
_MS = 1e3


def _whole_ms(seconds: float) -> int:
    """A time in whole ms, as far as a slider can count: 24 days."""
    return min(round(_MS * seconds), 2**31 - 1)


class Course(QAbstractSlider):
    """The handle over `paint_course`; its value is the time in ms, for those who do not see it.

    `sought` asks for a time in s, from 0 to `last`.
    """

    sought = Signal(float)

    def __init__(self, name: str, tip: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setOrientation(Qt.Orientation.Horizontal)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setFixedHeight(HEIGHT)
        self.setMinimumWidth(80)
        self.setAccessibleName(name)
        self.setToolTip(tip)
        self.time, self.last, self.duration = 0.0, 0.0, 1.0
        self.theme = LIGHT
        self.valueChanged.connect(guarded(lambda ms: self.seek(ms / _MS)))

    def sizeHint(self) -> QSize:
        return QSize(300, HEIGHT)

    def show_duration(self, duration: float, step: float, last: float) -> None:
        """Span `duration` s in steps of `step` s, up to `last`."""
        self.duration, self.last = duration, last
        with QSignalBlocker(self):
            self.setRange(0, _whole_ms(duration))
            self.setSingleStep(max(_whole_ms(step), 1))
            self.setPageStep(max(_whole_ms(duration / 10), 1))
        self.show_time(0.0)

    def show_theme(self, theme: Theme) -> None:
        self.theme = theme
        self.update()

    def show_time(self, seconds: float) -> None:
        self.time = seconds
        with QSignalBlocker(self):
            self.setValue(_whole_ms(seconds))
        self.update()

    def seek(self, seconds: float) -> None:
        """Show a time, or the nearest one that there is, and ask for it."""
        self.show_time(min(max(seconds, 0.0), self.last))
        self.sought.emit(self.time)

    # What a person does.

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self.setSliderDown(True)
            self.seek(self.time_at(event.position().x()))

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if self.isSliderDown():
            self.seek(self.time_at(event.position().x()))

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self.setSliderDown(False)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        event.ignore()  # the row's: they are whole frames there, and not whole ms

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        self.update()

    # How it is drawn.

    @property
    def area(self) -> QRectF:
        return QRectF(self.rect()).adjusted(_SIDE, 4, -_SIDE, -4)

    def at(self, seconds: float) -> float:
        """Where a time is drawn, in px from the left."""
        area = self.area
        return area.left() + area.width() * seconds / self.duration

    def time_at(self, x: float) -> float:
        """The time in s that is drawn at x px from the left."""
        area = self.area
        return (x - area.left()) / max(area.width(), 1.0) * self.duration

    def paintEvent(self, event: QPaintEvent) -> None:
        painter, theme, area = QPainter(self), self.theme, self.area
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(QPen(QColor(theme.text if self.hasFocus() else theme.line), 1))
        painter.setBrush(QColor(theme.base))
        painter.drawRoundedRect(area.adjusted(-2.5, -2.5, 2.5, 2.5), 4, 4)
        handle = self.at(self.time)
        self.paint_course(painter, area, handle)
        self._paint_handle(painter, area, handle)

    def paint_course(self, painter: QPainter, area: QRectF, handle: float) -> None:
        """Draw what happens meanwhile into `area`; the handle is `handle` px from the left."""

    def halves(self, area: QRectF, handle: float) -> tuple[tuple[QRectF, QColor], ...]:
        """What is before the handle and what behind it, each with the ink that it is drawn in."""
        passed, coming = QColor(self.theme.accent), QColor(self.theme.faint)
        passed.setAlphaF(0.55)
        coming.setAlphaF(0.45)
        height = float(self.height())
        before = QRectF(area.left(), 0, max(handle - area.left(), 0.0), height)
        behind = QRectF(handle, 0, max(area.right() - handle, 0.0), height)
        return (before, passed), (behind, coming)

    def _paint_handle(self, painter: QPainter, area: QRectF, x: float) -> None:
        theme = self.theme
        painter.setPen(QPen(QColor(theme.text), 1.5))
        painter.drawLine(QPointF(x, area.top() - 2), QPointF(x, area.bottom() + 2))
        painter.setPen(QPen(QColor(theme.base), 1.5))
        painter.setBrush(QColor(theme.accent))
        painter.drawEllipse(QPointF(x, area.center().y()), _KNOB, _KNOB)
