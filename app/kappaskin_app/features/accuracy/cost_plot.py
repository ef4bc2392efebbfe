"""Plot of the RMS error against the computing time of each measured setting."""

import math
from collections.abc import Callable

from PySide6.QtCore import QEvent, QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QMouseEvent, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QSizePolicy, QToolTip, QWidget

from kappaskin.studies import Cost
from kappaskin_app.features.accuracy.measurement import Frontier, setting_text
from kappaskin_app.shell.settings.shown import METHOD_SHORT
from kappaskin_app.theme import current, series
from kappaskin_app.widgets.plots import LogAxis, paint_empty
from kappaskin_app.widgets.text import duration, length

_TOP = 10.0
_LEGEND_MARGIN = 28.0  # px left of the text of the legend
_SIZE = 4.0  # px, radius of a point
_NEAR = 10.0  # px, largest distance of the mouse from a point
_LABEL_GAP = 10.0  # px between two time labels
_LONGEST = "0.005 mm"  # label of the error axis
_AXES = "RMS error (up), computing time"
_ROWS = len(METHOD_SHORT) + 5  # of the legend

Point = tuple[float, float]


class CostPlot(QWidget):
    """Draws a `Frontier`: a colour and marker per estimator, a ring around the one in use."""

    chosen = Signal(object)

    def __init__(self) -> None:
        super().__init__()
        self.frontier, self._present = Frontier(), None
        self._live: Point = (math.nan, math.nan)
        self._x, self._y = LogAxis(1e-5, 1e-2), LogAxis(1e-5, 1e-4)
        self._under: Cost | None = None
        self._empty = ""
        self.setMouseTracking(True)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setAccessibleName("Error against time")

    def sizeHint(self) -> QSize:
        return QSize(800, 190)

    def minimumSizeHint(self) -> QSize:
        metrics = self.fontMetrics()
        wide = metrics.horizontalAdvance(_LONGEST + _AXES) + self._legend
        return QSize(round(wide), _ROWS * metrics.height())

    def show_costs(
        self, frontier: Frontier, present: Cost | None, live: Point, empty: str = ""
    ) -> None:
        """Draw the costs, a ring at `present` and a cross at `live`, (error in m, time in s).

        The text `empty` is shown while there are no costs.
        """
        shown = (frontier, present, live, empty)
        if shown != (self.frontier, self._present, self._live, self._empty):
            self.frontier, self._present, self._live, self._empty = shown
            self._x = LogAxis.around([c.time_per_frame for c in frontier.costs] + [live[1]])
            self._y = LogAxis.around([c.rms for c in frontier.costs] + [live[0]])
            self.update()

    # Layout

    @property
    def _area(self) -> QRectF:
        metrics = self.fontMetrics()
        left, below = metrics.horizontalAdvance(_LONGEST) + 8, 2 * metrics.height() + 2
        return QRectF(self.rect()).adjusted(left, _TOP, -self._legend, -below)

    @property
    def _legend(self) -> float:
        """Width of the legend in px."""
        return _LEGEND_MARGIN + 8 + max(map(self.fontMetrics().horizontalAdvance, _SHORT.values()))

    def at(self, error: float, time: float) -> QPointF:
        """Position of an error in m at a time in s."""
        area = self._area
        return QPointF(
            area.left() + self._x.share(time) * area.width(),
            area.bottom() - self._y.share(error) * area.height(),
        )

    def place_of(self, cost: Cost) -> QPointF:
        return self.at(cost.rms, cost.time_per_frame)

    def _cost_at(self, place: QPointF) -> Cost | None:
        """The point nearest to a position; of several, the one of least error."""
        near = [
            (round(distance / 2), cost.rms, number)
            for number, cost in enumerate(self.frontier.costs)
            if (distance := _distance(self.place_of(cost), place)) <= _NEAR
        ]
        return self.frontier.costs[min(near)[2]] if near else None

    # Mouse

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        under = self._cost_at(event.position())
        if under is not self._under:
            self._under = under
            self.setCursor(
                Qt.CursorShape.PointingHandCursor if under else Qt.CursorShape.ArrowCursor
            )
            self.update()
        if under is None:
            QToolTip.hideText()
        else:
            QToolTip.showText(event.globalPosition().toPoint(), cost_text(under), self)

    def leaveEvent(self, event: QEvent) -> None:
        self._under = None
        self.unsetCursor()
        self.update()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        cost = self._cost_at(event.position())
        if cost is not None and event.button() == Qt.MouseButton.LeftButton:
            self.chosen.emit(cost)

    # Painting

    def paintEvent(self, event: QPaintEvent) -> None:
        painter, area, theme = QPainter(self), self._area, current()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.fillRect(area, QColor(theme.base))
        if not self.frontier.costs:
            paint_empty(painter, area, self._empty)
            return
        self._paint_axes(painter, area)
        self._paint_frontier(painter, area)
        for cost in self.frontier.costs:
            self._paint_point(painter, self.place_of(cost), cost)
        self._paint_present(painter)
        self._paint_legend(painter, area)

    def _paint_axes(self, painter: QPainter, area: QRectF) -> None:
        theme, flags = current(), Qt.AlignmentFlag
        line = painter.fontMetrics().height()
        free = area.left()
        for value, written in self._x.ticks():
            x = self.at(1.0, value).x()
            painter.setPen(QPen(QColor(theme.line), 1))
            painter.drawLine(QPointF(x, area.top()), QPointF(x, area.bottom()))
            words = _tick(value, duration)
            width = painter.fontMetrics().horizontalAdvance(words) + 2.0
            left = max(min(x - width / 2, area.right() - width + 4), area.left())
            if written and left >= free:
                free = left + width + _LABEL_GAP
                painter.setPen(QColor(theme.faint))
                painter.drawText(
                    QRectF(left, area.bottom() + 1, width, line), flags.AlignCenter, words
                )
        free = math.inf
        for value, written in self._y.ticks():
            y = self.at(value, 1.0).y()
            painter.setPen(QPen(QColor(theme.line), 1))
            painter.drawLine(QPointF(area.left(), y), QPointF(area.right(), y))
            if written and free - y >= 1.1 * line:
                free = y
                painter.setPen(QColor(theme.faint))
                top = min(y - line / 2, area.bottom() - line + 3)
                box = QRectF(0, top, area.left() - 5, line)
                painter.drawText(box, flags.AlignRight | flags.AlignVCenter, _tick(value, length))
        painter.setPen(QColor(theme.faint))
        below = QRectF(area.left(), self.height() - line - 1, area.width(), line)
        painter.drawText(below, flags.AlignCenter, _AXES)
        painter.setPen(QPen(QColor(theme.line), 1))
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.drawRect(area)

    def _paint_frontier(self, painter: QPainter, area: QRectF) -> None:
        """The least error within each time: a step down at each Pareto-optimal setting."""
        best = [self.place_of(cost) for cost in self.frontier.best]
        if not best:
            return
        corners = [QPointF(best[0].x(), area.top())]
        for place in best:
            corners += [QPointF(place.x(), corners[-1].y()), place]
        corners.append(QPointF(area.right(), corners[-1].y()))
        painter.setPen(QPen(QColor(current().text), 1.4, Qt.PenStyle.DashLine))
        painter.drawPolyline(QPolygonF(corners))

    def _paint_point(self, painter: QPainter, place: QPointF, cost: Cost) -> None:
        own = self._present is None or cost.setting.elements == self._present.setting.elements
        size = _SIZE * (1.5 if cost is self._under else 1.0)
        self._paint_mark(painter, place, cost.setting.method, own, size)

    def _paint_mark(
        self, painter: QPainter, place: QPointF, method: str, filled: bool, size: float
    ) -> None:
        number = _METHODS.index(method) if method in _METHODS else len(_METHODS)
        colour = series(number)
        painter.setPen(QPen(colour, 1.5))
        painter.setBrush(colour if filled else QColor(current().base))
        _SHAPES[number % len(_SHAPES)](painter, place, size)

    def _paint_present(self, painter: QPainter) -> None:
        theme = current()
        painter.setBrush(Qt.BrushStyle.NoBrush)
        if self._present is not None:
            painter.setPen(QPen(QColor(theme.text), 2))
            painter.drawEllipse(self.place_of(self._present), 9, 9)
        error, time = self._live
        if math.isfinite(time) and math.isfinite(error):
            _cross(painter, self.at(error, time), QColor(theme.alert))

    def _paint_legend(self, painter: QPainter, area: QRectF) -> None:
        theme, flags = current(), Qt.AlignmentFlag
        left, width = area.right() + 10, self._legend - _LEGEND_MARGIN
        used = [m for m in _METHODS if any(c.setting.method == m for c in self.frontier.costs)]
        rows = [*used, "own", "other", "present", "live", "best"]
        line = min(painter.fontMetrics().height() + 3.0, (self.height() - 6.0) / len(rows))
        for number, row in enumerate(rows):
            place = QPointF(left + 4, 4 + (number + 0.5) * line)
            painter.setBrush(Qt.BrushStyle.NoBrush)
            if row in _METHODS:
                self._paint_mark(painter, place, row, True, _SIZE)
            elif row == "live":
                _cross(painter, place, QColor(theme.alert))
            elif row == "best":
                painter.setPen(QPen(QColor(theme.text), 1.4, Qt.PenStyle.DashLine))
                painter.drawLine(place - QPointF(8, 0), place + QPointF(8, 0))
            else:
                size = 7.0 if row == "present" else _SIZE
                painter.setPen(QPen(QColor(theme.text), 2 if row == "present" else 1.5))
                painter.setBrush(QColor(theme.text) if row == "own" else Qt.BrushStyle.NoBrush)
                painter.drawEllipse(place, size, size)
            painter.setPen(QColor(theme.text))
            words = _SHORT.get(row, row)
            box = QRectF(place.x() + 14, place.y() - line / 2, width, line)
            painter.drawText(box, flags.AlignLeft | flags.AlignVCenter, words)


def cost_text(cost: Cost) -> str:
    """The tooltip of a point."""
    return (
        f"{setting_text(cost.setting, cost.count)}: RMS error {length(cost.rms)}, "
        f"{length(cost.rms_exact)} without noise; computing time {duration(cost.time_per_frame)} "
        f"per frame, conversion time {duration(cost.conversion_time)} for {cost.channels} "
        "channels. Click to use it."
    )


def _distance(one: QPointF, other: QPointF) -> float:
    return math.hypot(one.x() - other.x(), one.y() - other.y())


def _tick(value: float, formatted: Callable[[float], str]) -> str:
    """A round value without trailing zeros."""
    number, unit = formatted(value).split()
    return f"{float(number):g} {unit}"


_METHODS = list(METHOD_SHORT)
_SHORT = {
    **METHOD_SHORT,
    "own": "filled: own elements",
    "other": "open: other elements",
    "present": "in use, predicted",
    "live": "in use, measured",
    "best": "best for its time",
}


def _circle(painter: QPainter, at: QPointF, size: float) -> None:
    painter.drawEllipse(at, size, size)


def _polygon(*corners: Point) -> Callable[[QPainter, QPointF, float], None]:
    def draw(painter: QPainter, at: QPointF, size: float) -> None:
        painter.drawPolygon(QPolygonF([at + QPointF(size * x, size * y) for x, y in corners]))

    return draw


def _cross(painter: QPainter, at: QPointF, colour: QColor) -> None:
    for pen in (QPen(QColor("#ffffff"), 4.5), QPen(colour, 2.5)):
        painter.setPen(pen)
        for way in (QPointF(6, 6), QPointF(6, -6)):
            painter.drawLine(at - way, at + way)


_SHAPES = (
    _circle,
    _polygon((-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)),
    _polygon((0.0, -1.2), (1.1, 0.8), (-1.1, 0.8)),
    _polygon((0.0, -1.3), (1.3, 0.0), (0.0, 1.3), (-1.3, 0.0)),
    _polygon((0.0, 1.2), (1.1, -0.8), (-1.1, -0.8)),
    _polygon((-1.2, -0.5), (0.0, -1.2), (1.2, -0.5), (0.8, 1.1), (-0.8, 1.1)),
    _polygon((-1.2, 0.0), (0.8, -1.1), (0.8, 1.1)),
    _polygon((1.2, 0.0), (-0.8, -1.1), (-0.8, 1.1)),
)
