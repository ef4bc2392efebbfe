"""Colour bars: a scale with its limits, unit and noise, and a pin that fixes it."""

import numpy as np
from PySide6.QtCore import QEvent, QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QImage, QPainter, QPaintEvent, QPen, QPolygonF, QStaticText
from PySide6.QtWidgets import QGridLayout, QToolButton, QWidget

from kappaskin_app.widgets.lettering import read_from_afar
from kappaskin_app.widgets.parts import Label
from kappaskin_app.widgets.text import in_digits
from kappaskin_app.widgets.tint import Tint

_COLOURS, _GAP = 24, 4  # px of the bar without its numbers, and right of them
_WIDEST = "\N{MINUS SIGN}0.005"  # of the numbers, more or less
_SWATCH = 10  # px of a colour in the legend
_MARK, _LEAST_MARK = 4, 3.0  # px, width and least height of the mark of the noise
# A pin in a square of 16 x 16.
_PIN = QPolygonF(
    [
        QPointF(*at)
        for at in (
            *((4.5, 1), (11.5, 1), (11.5, 3), (10.2, 3), (10.8, 7), (13, 9), (13, 10.5)),
            *((8.7, 10.5), (8, 15.5), (7.3, 10.5)),
            *((3, 10.5), (3, 9), (5.2, 7), (5.8, 3), (4.5, 3)),
        )
    ]
)
_TILTED = 40.0  # degrees, of a pin that holds nothing


class ColourBar(QWidget):
    """A vertical scale of colours with its limits and unit, above a legend of other colours.

    A mark at its edge shows one standard deviation of the noise. Categories, such as the health of
    elements, have only the legend.
    """

    def __init__(self) -> None:
        super().__init__()
        self._tint = Tint("diverging", (-1.0, 1.0), "1/m")
        self.legend: tuple[tuple[str, str], ...] = ()
        """Colours, as #rrggbb, with their words, the lowest first."""
        self.widen()

    def minimumSizeHint(self) -> QSize:
        line = self.fontMetrics().height()
        return QSize(_COLOURS, 3 * line + 10 if self.scaled else len(self.legend) * (line + 2))

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.FontChange:
            self.widen()

    def widen(self) -> None:
        """Set the width for numbers and legend in the present font."""
        wide = self.fontMetrics().horizontalAdvance
        legend = max((_SWATCH + wide(words) for _, words in self.legend), default=0)
        numbers = max(map(wide, (_WIDEST, *self._numbers.values())))
        self.setFixedWidth(max(_COLOURS + numbers, 8 + legend) + _GAP)

    @property
    def _numbers(self) -> dict[float, str]:
        """The numbers by their shares of the scale."""
        low, high = self.limits
        span = (high - low) / 2
        return {share: in_digits(low + share * (high - low), span) for share in (0.0, 0.5, 1.0)}

    @property
    def limits(self) -> tuple[float, float]:
        return self._tint.limits

    @property
    def reach(self) -> float:
        """The limit of the colours, to which a range is locked."""
        return self._tint.limit

    @property
    def scaled(self) -> bool:
        """Whether there is a scale."""
        return not self._tint.kinds

    def show_tint(self, tint: Tint, legend: tuple[tuple[str, str], ...] = ()) -> None:
        """Show a scale, and a `legend` of other visible colours, (#rrggbb, words)."""
        was, self._tint = (self._tint, self.legend), tint
        if (was[0].limits, was[0].unit, was[1]) != (tint.limits, tint.unit, legend):
            self.legend = legend
            self.widen()
            self.updateGeometry()
            self.update()
        floor = f"{tint.noise:.2g} {tint.unit}"
        tip = f"The mark at the left is the noise floor: one standard deviation, {floor}."
        if (tip := tip if tint.noise else "") != self.toolTip():
            self.setToolTip(tip)
            self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        with QPainter(self) as painter:
            self._paint(painter)

    def _paint(self, painter: QPainter) -> None:
        painter.setPen(self.palette().windowText().color())
        line = painter.fontMetrics().height()
        bottom = float(self.height())
        for colour, words in self.legend:
            bottom -= line + 2
            painter.fillRect(
                QRectF(4, bottom + (line - _SWATCH) / 2, _SWATCH, _SWATCH), QColor(colour)
            )
            room = QRectF(8 + _SWATCH, bottom, self.width() - _SWATCH - 8, line)
            painter.drawText(room, Qt.AlignmentFlag.AlignVCenter, words)
        if self.scaled:
            self._paint_scale(painter, line, bottom)

    def _paint_scale(self, painter: QPainter, line: int, bottom: float) -> None:
        bar = QRectF(_MARK + 2, line + 4, 14, max(bottom - line - 10, 10))
        ramp = np.ascontiguousarray(self._tint.colours[::-1, None])
        image = QImage(ramp.tobytes(), 1, 256, 3, QImage.Format.Format_RGB888)
        painter.drawImage(bar, image)
        if self._tint.noise:
            low, high = (bar.bottom() - share * bar.height() for share in self._tint.floor)
            short = max(_LEAST_MARK - (low - high), 0.0) / 2
            mark = QRectF(0, high - short, _MARK, low - high + 2 * short)
            painter.fillRect(mark, painter.pen().color())
        painter.drawText(QPointF(2, painter.fontMetrics().ascent()), self._tint.unit)
        for share, text in self._numbers.items():
            if share == 0.5 and bar.height() < 3 * line:
                continue
            y = bar.bottom() - share * bar.height()
            top = min(max(y - line / 2, bar.top()), bar.bottom() - line)
            painter.drawText(QPointF(bar.right() + 4, top + painter.fontMetrics().ascent()), text)


_FREE = "The colour range follows the values shown. Click, or press Space, to fix it."
_FIXED = "The colour range is fixed. Click, or press Space, to let it follow the values shown."


class LockButton(QToolButton):
    """A pin that fixes a range of colours; `wanted` requests it."""

    wanted = Signal(bool)

    def __init__(self) -> None:
        super().__init__(checkable=True, autoRaise=True)  # pyright: ignore[reportCallIssue]
        self.setAccessibleName("Fixed colour range")
        self.clicked.connect(self._ask)
        self.show_locked(False)

    def _ask(self, locked: bool) -> None:
        self.setChecked(not locked)  # the answer comes back through show_locked
        self.wanted.emit(locked)

    def show_locked(self, locked: bool) -> None:
        self.setChecked(locked)
        self.setToolTip(_FIXED if locked else _FREE)

    def sizeHint(self) -> QSize:
        side = self.fontMetrics().height() + 8
        return QSize(side, side)

    def paintEvent(self, event: QPaintEvent) -> None:
        super().paintEvent(event)
        with QPainter(self) as painter:
            self._paint(painter)

    def _paint(self, painter: QPainter) -> None:
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        ink, scale = self.palette().buttonText().color(), self.fontMetrics().height() / 16
        painter.translate(QRectF(self.rect()).center())
        painter.scale(scale, scale)
        painter.rotate(0.0 if self.isChecked() else _TILTED)
        painter.translate(-8, -8)
        painter.setPen(QPen(ink, 1.2))
        painter.setBrush(ink if self.isChecked() else Qt.BrushStyle.NoBrush)
        painter.drawPolygon(_PIN)


class UprightLabel(Label):
    """A line of rich text that reads upwards."""

    def __init__(self) -> None:
        super().__init__(rich=True)

    def sizeHint(self) -> QSize:
        return super().sizeHint().transposed()

    def minimumSizeHint(self) -> QSize:
        return QSize(self.sizeHint().width(), 0)

    def paintEvent(self, event: QPaintEvent) -> None:
        text = QStaticText(self.text())
        text.prepare(font=self.font())
        wide, high = text.size().toTuple()
        with QPainter(self) as painter:
            painter.translate((self.width() - high) / 2, (self.height() + wide) / 2)
            painter.rotate(-90)
            painter.drawStaticText(0, 0, text)


class SkinScale(QWidget):
    """The scale of the skin: quantity, colour bar and pin."""

    lock_wanted = Signal(bool)

    def __init__(self) -> None:
        super().__init__()
        self.what, self.bar, self.lock = UprightLabel(), ColourBar(), LockButton()
        self.bar.show_tint(Tint("sequential", (0.0, 1.0), "mm"))
        self.lock.wanted.connect(self.lock_wanted)
        self._shown = "", ""
        around = QGridLayout(self)
        around.setContentsMargins(0, 4, 0, 4)
        around.setHorizontalSpacing(2)
        around.addWidget(self.what, 0, 0)
        around.addWidget(self.bar, 0, 1)
        around.addWidget(self.lock, 1, 1)

    def show_unit(self, unit: float) -> None:
        """Use large letters without controls where a unit is so many px; 0: the usual ones."""
        self.lock.setVisible(not unit)
        self.setFont(read_from_afar(unit))

    def show_what(self, name: str, symbol: str, tip: str) -> None:
        """Show what colours the skin: name, `symbol` in HTML and tooltip."""
        if (name, symbol) != self._shown:
            self._shown = name, symbol
            name = name.replace(" ", "\N{NO-BREAK SPACE}")  # one line
            self.what.setText(name if name == symbol else f"{name} <b>{symbol}</b>")
            self.what.setToolTip(tip)
