"""Charts: curves, points and bands over two axes, with zoom, cursor, legend and export."""

import csv
import io
import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from html import escape
from importlib import import_module
from itertools import zip_longest
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QBuffer, QEvent, QObject, QPoint, QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QContextMenuEvent,
    QFocusEvent,
    QGuiApplication,
    QHelpEvent,
    QMouseEvent,
    QPainter,
    QPalette,
    QShowEvent,
    QWheelEvent,
)
from PySide6.QtSvg import QSvgGenerator
from PySide6.QtWidgets import (
    QApplication,
    QFileDialog,
    QMenu,
    QMessageBox,
    QSizePolicy,
    QToolTip,
    QVBoxLayout,
    QWidget,
)

from kappaskin._files import write_whole
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin_app.guard import guarded
from kappaskin_app.theme import FAINT, current, follow_look, series
from kappaskin_app.widgets.layout import page_of
from kappaskin_app.widgets.parts import ELLIPSIS, plain_tip, text_label
from kappaskin_app.widgets.text import Coverage, in_digits, round_up

_NEAR = 12.0  # px from the mouse, within which a point is shown
_ROOM = 0.06  # of the data's extent, on either side of marks and on a logarithmic axis
_HEAD = 1.02  # times the largest value, that an upright axis reaches
_LEAST_DECADES = 0.3  # between the ends of a logarithmic axis and its values
_BAND = 60  # of 255, how opaque a band is
_BOLD = 3.0  # px
_DENSE = 500  # points, above which those that are not seen are left out
_FEW = 1.0  # decades, up to which a logarithmic axis has ticks as a linear one has
_WIDEST = "\N{MINUS SIGN}0.05"  # of most numbers beside a chart
_POWERS = str.maketrans(
    "-0123456789", "\u207b\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079"
)
# The marks of pyqtgraph as text, filled and open.
_GLYPHS = {
    **{"o": "\u25cf\u25cb", "s": "\u25a0\u25a1", "t1": "\u25b2\u25b3", "d": "\u25c6\u25c7"},
    **{"t": "\u25bc\u25bd", "p": "\u2b1f\u2b20", "t3": "\u25c4\u25c5", "t2": "\u25ba\u25bb"},
    "x": "\u2715\u2715",
}
_RING, _LARGE = "\u25ef", 12.0  # px, beyond which a circle is written as a ring
_LINES = {"solid": "\u2014", "dashed": "\u254c\u254c", "": ""}


Ticks = list[tuple[Any, list[float]]]


@dataclass(frozen=True)
class ChartAxis:
    """What an axis shows, in what unit; `log` for a logarithmic axis.

    `text` writes a value with its unit. Within `limits` the axis shows its values at first; without
    them it shows all. It `shows` its title too, or the numbers alone, or nothing of both.
    """

    title: str
    unit: str = ""
    log: bool = False
    text: Callable[[float], str] | None = None
    limits: tuple[float, float] | None = None
    shows: Literal["title", "numbers", ""] = "title"

    @property
    def label(self) -> str:
        """Title and unit."""
        return f"{self.title}, {self.unit}" if self.unit else self.title

    def value_text(self, value: float, span: float) -> str:
        """A value with its unit, with digits for a hundredth of `span`."""
        if self.text is not None:
            return self.text(value)
        number = _power(value) if self.log else in_digits(value, span)
        return f"{number} {self.unit}".rstrip()

    def shown(self, values: Array) -> Array:
        """Values as positions along the axis: their logarithms on a logarithmic one."""
        return np.log10(np.where(values > 0, values, np.nan)) if self.log else values

    def ends(self, values: Array, marked: bool, upright: bool) -> tuple[float, float]:
        """Both ends along the axis, around all `values` (n,); zero is on a linear `upright` one."""
        at = self.shown(np.asarray(self.limits or values))
        at = at[np.isfinite(at)]
        low, high = (float(at.min()), float(at.max())) if len(at) else (0.0, 1.0)
        if self.limits:
            return low, high
        if upright and not self.log:
            low, high = -round_up(-_HEAD * low), round_up(_HEAD * high)
            return (low, high) if low < high else (-1.0, 1.0)
        room = _ROOM * (high - low) * (marked or self.log)
        room = max(room, _LEAST_DECADES * (1 - (high - low)) * self.log)
        return (low - room, high + room) if high + room > low - room else (low - 0.5, low + 0.5)

    def ticks(
        self, low: float, high: float, size: float, gap: float, linear: Callable[..., Ticks]
    ) -> Ticks:
        """Each level's spacing and ticks along `size` px; those of the first are `gap` px apart.

        `linear` gives those of a linear axis, also for a part of a logarithmic one.
        """
        if not self.log:
            (step, first), *finer = linear(low, high, size)
            every = math.ceil(gap * (high - low) / (size * step))
            kept = [v for v in first if not round(v / step) % every]
            # Those left out are the next level: finer ones alone would be in their place.
            left = [(step, [v for v in first if round(v / step) % every])] * (every > 1)
            return [(every * step, kept), *left, *finer]
        if high - low < _FEW:
            found = linear(10.0**low, 10.0**high, size)
            return [(step, np.log10([v for v in each if v > 0]).tolist()) for step, each in found]
        every = math.ceil(gap * (high - low) / size)
        whole = range(math.ceil(low / every) * every, math.floor(high) + 1, every)
        parts = [p + math.log10(m) for p in range(math.floor(low), math.ceil(high)) for m in (2, 5)]
        return [(1.0, list(map(float, whole))), (None, [p for p in parts if low < p < high])]

    def tick_texts(self, values: Sequence[float], spacing: float) -> list[str]:
        """What is written at ticks, on a linear axis `spacing` apart."""
        if not self.log:
            return [in_digits(value, 100 * spacing) for value in values]
        powers = [float(f"{10.0**value:.6g}") for value in values]
        if self.text is None:
            return list(map(_power, powers))
        parts = [self.text(value).split() for value in powers]
        return [f"{float(number):g} {unit}" for number, unit in parts]


def _power(value: float) -> str:
    """A value in three digits, with a power of ten instead of an e."""
    number, _, power = f"{value:.3g}".replace("-", "\N{MINUS SIGN}").partition("e")
    if not power:
        return number
    ten = "10" + str(int(power.replace("\N{MINUS SIGN}", "-"))).translate(_POWERS)
    return ten if number == "1" else f"{number}\N{MIDDLE DOT}{ten}"


@dataclass(frozen=True, eq=False)
class Series:
    """Points `x` (n,), `y` (n,) called `name`, joined by a `line`, with a `mark` each, or both.

    The legend has those with a name. `colour` is the number of a colour of `theme.SERIES` or the
    name of one of `Theme`. The `band` (n,) of standard deviations is drawn above and below the
    points as the error bars of all views. `tips` has the text of
    each point, by default its values. What is marked with the `key` is drawn boldly.
    """

    name: str
    x: Array
    y: Array
    colour: int | str = 0
    line: Literal["solid", "dashed", ""] = "solid"
    mark: str = ""
    size: float = 7.0
    filled: bool = True
    band: Array | None = None
    tips: Sequence[str] = ()
    key: Any = None

    @property
    def off(self) -> Array:
        """The band drawn, on each side of the points."""
        return np.zeros(1) if self.band is None else Coverage.now.of(self.band)

    @property
    def ink(self) -> QColor:
        """The colour in the present theme."""
        return series(self.colour) if isinstance(self.colour, int) else _role(self.colour)


@dataclass(frozen=True)
class ChartLine:
    """A dashed line through the whole chart at a value of y, or of x if it is `upright`."""

    value: float
    colour: str = "faint"
    upright: bool = False


def _role(name: str) -> QColor:
    return QColor(getattr(current(), name))


@dataclass(frozen=True)
class ChartPoint:
    """The point `index` of a series."""

    series: Series
    index: int


class Chart(QWidget):
    """Series over two axes; an empty chart says what to do.

    The wheel zooms, dragging pans, a double click shows all. On a page that scrolls the wheel
    scrolls it, and zooms with Ctrl. Where it `brushes`, dragging with the left button selects a
    part of the x axis to be shown, and the middle one pans. `pointed` emits the `ChartPoint` next
    to the mouse, or None; `clicked` the one that is clicked, `clicked_at` the x of any click,
    `zoomed` both ends of the x axis when the user has changed them, None for all.
    """

    pointed = Signal(object)
    clicked = Signal(object)
    clicked_at = Signal(float)
    zoomed = Signal(object)

    def __init__(self, y: ChartAxis, x: ChartAxis, tip: str, brushes: bool = False) -> None:
        super().__init__()
        self.x_axis, self.y_axis, self._brushes = x, y, brushes
        self._part: tuple[float, float] | None = None
        self._lines: tuple[ChartLine, ...] = ()
        self._key: object = None
        self._view: _View | None = None
        self._under: ChartPoint | None = None
        self._mouse: tuple[QPointF, QPoint] | None = None
        self._pressed: QPointF | None = None
        self.heading, self.message = text_label(rich=True), text_label()
        self.message.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.message.setForegroundRole(FAINT)
        self._around = QVBoxLayout(self)
        self._around.setContentsMargins(6, 3, 6, 3)
        self._around.setSpacing(2)
        self._around.addWidget(self.heading)
        self._around.addWidget(self.message, 1)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setAutoFillBackground(True)
        self.setBackgroundRole(QPalette.ColorRole.Base)
        self.show_axes(y, x, tip)
        follow_look(self, self._dress)

    def sizeHint(self) -> QSize:
        return QSize(18, 12) * self.fontMetrics().height()

    def minimumSizeHint(self) -> QSize:
        lines = {"title": 7, "numbers": 5, "": 4}[self.x_axis.shows]
        return QSize(9, lines) * self.fontMetrics().height()

    def show_axes(self, y: ChartAxis, x: ChartAxis, tip: str) -> None:
        """Show other quantities from now on."""
        self.x_axis, self.y_axis, self.series, self._fits, self._part = x, y, (), True, None
        self.setAccessibleName(y.title)
        self.setToolTip(tip)
        self._dress()

    def show_series(
        self, shown: Sequence[Series], empty: str = "", lines: Sequence[ChartLine] = ()
    ) -> None:
        """Draw the series; the text `empty` is shown while they have no points."""
        self.series, self._lines = tuple(shown), tuple(lines)
        self.message.setText(empty)
        self._draw()

    def mark(self, key: object) -> None:
        """Draw the series with this key boldly; None for none."""
        if key != self._key:
            self._key = key
            self._draw()

    @property
    def is_empty(self) -> bool:
        """Whether there are no points."""
        return not any(np.isfinite(each.y).any() for each in self.series)

    @property
    def canvas(self) -> QWidget:
        """The widget that the mouse is over when it is over axes and points."""
        return self if self._view is None else self._view.widget.viewport()

    def place_of(self, x: float, y: float) -> QPointF:
        """Position of values on the canvas, in px."""
        view = self._view
        return QPointF(*map(float, view.places(np.array(x), np.array(y)))) if view else QPointF()

    # Drawing

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        self._draw()

    def _dress(self) -> None:
        """Follow theme, letters and axes."""
        if self._view is not None:
            self._view.dress(self.x_axis, self.y_axis)
        self._draw()

    def _draw(self) -> None:
        heading = "&nbsp;&nbsp;&nbsp; ".join([escape(self.y_axis.label), *self._legend()])
        if heading != self.heading.text():
            self.heading.setText(heading)
        self.message.setVisible(self.is_empty)
        if self.isVisible() and self._view is None and not self.is_empty:
            self._view = _View(self, self._hold, self._brush if self._brushes else None)
            self._around.addWidget(self._view.widget, 1)
            for watched in (self.canvas, self._view.widget):
                watched.installEventFilter(self)
            self._view.dress(self.x_axis, self.y_axis)
        if self.isVisible() and self._view is not None:
            self._view.widget.setVisible(not self.is_empty)
            self._view.draw(self.series, self._lines, self._key)
            if self._fits:
                self._view.show_ranges(*self._ranges())
            self._point()

    def _legend(self) -> list[str]:
        entries = []
        for each in () if self.is_empty else self.series:
            glyph = _GLYPHS[each.mark][not each.filled] if each.mark else _LINES[each.line]
            glyph = _RING if each.mark == "o" and each.size > _LARGE else glyph
            name = escape(each.name).replace(" ", "\N{NO-BREAK SPACE}")
            ink = f"<span style='color:{each.ink.name()}'>{glyph}</span>"
            entries += [f"{ink}\N{NO-BREAK SPACE}{name}"] if each.name else []
        return entries

    def _ranges(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """The ends of both axes at which all is shown, or all of a part of the x axis."""
        marked = any(each.mark for each in self.series)
        x = np.concatenate([each.x for each in self.series] or [np.empty(0)])
        low, high = self._part or (-np.inf, np.inf)
        shown = [(each, (each.x >= low) & (each.x <= high)) for each in self.series]
        bands = [(each.y[on], np.broadcast_to(each.off, each.y.shape)[on]) for each, on in shown]
        y = [part for y, off in bands for part in (y - off, y + off)]
        y += [np.array([line.value]) for line in self._lines if not line.upright]
        return self._part or self.x_axis.ends(x, marked, False), self.y_axis.ends(
            np.concatenate(y or [np.empty(0)]), marked, True
        )

    def focusInEvent(self, event: QFocusEvent) -> None:
        super().focusInEvent(event)
        self._dress()

    def focusOutEvent(self, event: QFocusEvent) -> None:
        super().focusOutEvent(event)
        self._dress()

    # Mouse

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        kinds, left = QEvent.Type, Qt.MouseButton.LeftButton
        if isinstance(event, QWheelEvent):
            return self._scrolls(event)
        if watched is not self.canvas:
            return False
        if isinstance(event, QHelpEvent):
            return self._under is not None  # whose text is shown, not that of the chart
        if isinstance(event, QMouseEvent) and event.type() == kinds.MouseMove:
            at = event.position(), event.globalPosition().toPoint()
            self._mouse = None if event.buttons() else at
            self._point()
        elif event.type() in (kinds.Leave, kinds.Hide, kinds.WindowDeactivate):
            self._mouse = None  # else the next values would show the tip of a point again
            self._point()
        elif isinstance(event, QMouseEvent) and event.button() == left:
            if event.type() == kinds.MouseButtonDblClick:
                self.fit()
            elif event.type() == kinds.MouseButtonRelease and self._pressed is not None:
                self._click(self._pressed, event.position())
            pressed = event.type() == kinds.MouseButtonPress
            self._pressed = event.position() if pressed else None
        return False

    def _scrolls(self, event: QWheelEvent) -> bool:
        """Whether the wheel scrolls the page of the chart, which then gets the `event`."""
        page = page_of(self)
        scrolls = page is not None and page.verticalScrollBar().maximum() > 0
        scrolls &= not event.modifiers() & Qt.KeyboardModifier.ControlModifier
        event.setAccepted(not scrolls)
        return scrolls

    def _click(self, began: QPointF, at: QPointF) -> None:
        if (at - began).manhattanLength() >= QApplication.startDragDistance():
            return
        if point := self.nearest(at):
            self.clicked.emit(point)
        if self._view is not None:
            self.clicked_at.emit(self._view.value_at(at.x()))

    def _hold(self) -> None:
        """Leave the ranges as the user has set them."""
        self._fits = False
        self._point()
        if self._view is not None:
            self.zoomed.emit(self._view.x_range)

    def _brush(self, low: float, high: float) -> None:
        self.show_part((low, high))
        self.zoomed.emit((low, high))

    def show_part(self, part: tuple[float, float] | None) -> None:
        """Show a part of the x axis between two positions along it, or all (None)."""
        self._fits, self._part = True, part
        self._draw()

    def fit(self) -> None:
        """Show all, also of what comes."""
        self.show_part(None)
        self.zoomed.emit(None)

    def nearest(self, at: QPointF) -> ChartPoint | None:
        """The point next to a position on the canvas, in px, if one is near: a mark, or a curve."""
        if (view := self._view) is None:
            return None
        best: tuple[tuple[bool, float], ChartPoint | None] = ((True, _NEAR), None)
        for each in self.series:
            away, index = _nearest(*view.places(each.x, each.y), at, bool(each.line))
            if away < _NEAR and (not each.mark, away) < best[0]:
                best = (not each.mark, away), ChartPoint(each, index)
        return best[1]

    def _point(self) -> None:
        """Show the point under the mouse."""
        point = self.nearest(self._mouse[0]) if self._mouse else None
        if self._view is not None:
            self._view.ring(point)
        if point is not None and self._mouse:
            QToolTip.showText(self._mouse[1], plain_tip(self.point_text(point)), self.canvas)
        elif self._under is not None:
            QToolTip.hideText()
        if point != self._under:
            self._under = point
            self.pointed.emit(point)

    def point_text(self, point: ChartPoint) -> str:
        """Its tip, or its name and its values with their units."""
        each, index = point.series, point.index
        if index < len(each.tips):
            return each.tips[index]
        spans = self._view.spans if self._view else (1.0, 1.0)
        x, y = (
            self.x_axis.value_text(float(each.x[index]), spans[0]),
            self.y_axis.value_text(float(each.y[index]), spans[1]),
        )
        if each.band is not None:
            band = self.y_axis.value_text(float(each.off[index]), spans[1])
            y += f" \N{PLUS-MINUS SIGN} {band} ({Coverage.now.label})"
        rows = (each.name, f"{self.y_axis.title}: {y}", f"{self.x_axis.title}: {x}")
        return "\n".join(filter(None, rows))

    # Menu

    def contextMenuEvent(self, event: QContextMenuEvent) -> None:
        self.menu().popup(event.globalPos())

    def menu(self) -> QMenu:
        """The context menu."""
        menu = QMenu(self)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        for text, act in (
            ("&Show all (double click)", self.fit),
            ("&Copy data", lambda: QGuiApplication.clipboard().setText(self.table("\t"))),
            (f"Save &data as CSV{ELLIPSIS}", partial(self._save, "csv", lambda: self.table(","))),
            (f"Save picture as &PNG{ELLIPSIS}", partial(self._save, "png", self._png)),
            (f"Save picture as S&VG{ELLIPSIS}", partial(self._save, "svg", self._svg)),
        ):
            action = menu.addAction(text)
            action.setEnabled(not self.is_empty)
            action.triggered.connect(guarded(lambda *_, act=act: act()))
        return menu

    def table(self, separator: str) -> str:
        """Columns of each series, x and y and its band if any; x once where it is shared."""
        columns: list[list[object]] = []
        last: Array | None = None
        for each in self.series:
            name = f"{each.name}: " if each.name else ""
            if each.x is not last:
                columns.append([self.x_axis.label, *each.x.tolist()])
            columns.append([f"{name}{self.y_axis.label}", *each.y.tolist()])
            if each.band is not None:
                head = f"{name}standard deviation, {self.y_axis.unit}"
                columns.append([head, *each.band.tolist()])
            last = each.x
        text = io.StringIO()
        lines = csv.writer(text, delimiter=separator, lineterminator="\n")
        lines.writerows(zip_longest(*columns, fillvalue=""))
        return text.getvalue()

    def _save(self, kind: str, content: Callable[[], str | bytes]) -> None:
        """Ask for a file, and write the content to it."""
        made = content()  # of now, not of when the file is selected
        proposed = f"{self.y_axis.title or 'chart'}.{kind}".replace("/", " per ")
        name, _ = QFileDialog.getSaveFileName(
            self, f"Save {self.y_axis.title}", proposed, f"{kind.upper()} (*.{kind})"
        )
        if not name:
            return
        path = Path(name) if name.lower().endswith(f".{kind}") else Path(f"{name}.{kind}")
        try:
            write_whole(path, made)
        except Refusal as refusal:
            box = QMessageBox(QMessageBox.Icon.Warning, "Not saved", str(refusal), parent=self)
            box.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
            box.open()

    def _png(self) -> bytes:
        packed = QBuffer()
        self.grab().save(packed, "PNG")  # pyright: ignore[reportArgumentType, reportCallIssue]
        return bytes(packed.data().data())

    def _svg(self) -> bytes:
        drawing, drawn = QSvgGenerator(), QBuffer()
        drawing.setOutputDevice(drawn)
        drawing.setSize(self.size())
        drawing.setViewBox(self.rect())
        drawing.setTitle(self.y_axis.title)
        with QPainter(drawing) as painter:
            self.render(painter, QPoint(0, 0))
        return bytes(drawn.data().data())


def _nearest(x: Array, y: Array, at: QPointF, joined: bool) -> tuple[float, int]:
    """The distance of points (n,) in px, or of the lines that join them, and which is the next."""
    if not len(x):
        return math.inf, 0
    x, y = x - at.x(), y - at.y()
    away = np.nan_to_num(np.hypot(x, y), nan=np.inf, posinf=np.inf)
    index = int(np.argmin(away))
    if joined and len(x) > 1:
        dx, dy = np.diff(x), np.diff(y)
        with np.errstate(invalid="ignore"):
            along = -(x[:-1] * dx + y[:-1] * dy) / np.maximum(dx**2 + dy**2, 1e-12)
            along = along.clip(0.0, 1.0)
        between = np.hypot(x[:-1] + along * dx, y[:-1] + along * dy)
        between = np.nan_to_num(between, nan=np.inf, posinf=np.inf)
        nearest = int(np.argmin(between))
        if between[nearest] < away[index]:
            return float(between[nearest]), nearest + round(float(along[nearest]))
    return float(away[index]), index


def _enclosed(x: Array, low: Array, high: Array) -> tuple[Array, Array, NDArray[np.int32]]:
    """The outline (2 n,) around what lies between `low` and `high` (n,), broken at unknown points.

    And whether each point of it is joined to the next.
    """
    known = np.flatnonzero(np.isfinite(x + low + high))
    runs = np.split(known, np.flatnonzero(np.diff(known) > 1) + 1)
    around = np.concatenate([np.concatenate([x[run], x[run][::-1]]) for run in runs])
    edge = np.concatenate([np.concatenate([low[run], high[run][::-1]]) for run in runs])
    joined = np.ones(len(around), np.int32)
    joined[2 * np.cumsum([len(run) for run in runs if len(run)], dtype=np.intp) - 1] = 0
    return around, edge, joined


def load_charts() -> None:
    """Load what charts draw with, in 0.3 s of any thread: it makes no objects of Qt meanwhile."""
    os.environ.setdefault("PYQTGRAPH_QT_LIB", "PySide6")
    import_module("pyqtgraph")


@cache
def _axis_class() -> type:
    """The class of the axes, made with the first chart that has points."""
    load_charts()
    from pyqtgraph import AxisItem

    class _Axis(AxisItem):
        """An axis with the ticks and texts of a `ChartAxis`, in letters of `line` px."""

        shown, line = ChartAxis(""), 0

        def tickValues(self, low: float, high: float, size: float) -> Ticks:
            gap = self.line * (4 if self.orientation == "bottom" else 1.2)
            return self.shown.ticks(low, high, size, gap, super().tickValues)

        def tickStrings(self, values: Sequence[float], scale: float, spacing: float) -> list[str]:
            return self.shown.tick_texts(values, spacing)

        def boundingRect(self) -> QRectF:
            # With room for the texts at both ends; pyqtgraph leaves them out where there is a grid.
            return super().boundingRect().adjusted(-self.line, -self.line, self.line, self.line)

    return _Axis


@cache
def _box_class() -> type:
    """The class of what lies between the axes."""
    from pyqtgraph import LinearRegionItem, ViewBox

    class _Box(ViewBox):
        """Calls `brushed` with both ends of the part that is selected with the left button."""

        brushed: Callable[[float, float], None] | None = None
        region: Any = None

        def mouseDragEvent(self, event: Any, axis: int | None = None) -> None:
            if self.brushed is None or axis is not None or event.button().value != 1:
                super().mouseDragEvent(event, axis)
                return
            event.accept()
            ends = sorted(self.mapToView(at).x() for at in (event.buttonDownPos(), event.pos()))
            if self.region is None:
                self.region = LinearRegionItem(movable=False)
                self.addItem(self.region, ignoreBounds=True)
            self.region.setRegion(ends)
            self.region.setVisible(not event.isFinish())
            if event.isFinish() and ends[0] < ends[1]:
                self.brushed(*ends)

    return _Box


class _View:
    """The axes and curves of a chart; `moved` is called when the user zooms or pans.

    With `brushed`, that is called when the user has selected a part of the x axis.
    """

    def __init__(
        self,
        chart: QWidget,
        moved: Callable[[], None],
        brushed: Callable[[float, float], None] | None,
    ) -> None:
        self._chart = chart
        axis_class = _axis_class()
        import pyqtgraph

        self._pg = pyqtgraph
        self.widget = pyqtgraph.GraphicsView(chart)
        self.widget.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.widget.viewport().setMouseTracking(True)
        self.widget.setCacheMode(self.widget.CacheModeFlag.CacheNone)  # else a pixmap in an SVG
        inside: Any = pyqtgraph.GraphicsLayout()
        inside.layout.setSpacing(0)
        self.widget.setCentralItem(inside)
        self._grid = inside.layout
        # No menus: pyqtgraph's crash when they are deleted, once in a while.
        self._box = _box_class()(enableMenu=False)
        self._box.brushed = brushed and guarded(brushed)
        self._left, self._bottom = (axis_class(side) for side in ("left", "bottom"))
        for item, row, column in ((self._left, 0, 0), (self._box, 0, 1), (self._bottom, 1, 1)):
            inside.addItem(item, row, column)
        for axis in (self._left, self._bottom):
            axis.linkToView(self._box)
            axis.setZValue(-1000)
            axis.setGrid(255)
            # Never narrower again: the curves would shift with each number.
            axis.setStyle(tickLength=0, maxTickLevel=1, autoReduceTextSpace=False)
            axis.enableAutoSIPrefix(False)
        self._curves, self._bands, self._lines = list[Any](), list[Any](), list[Any]()
        self._ring = self._pooled([], 1)[0]
        self._box.sigRangeChangedManually.connect(guarded(lambda *_: moved()))

    def _pooled(self, pool: list[Any], count: int, made: Callable[[], Any] | None = None) -> Any:
        """The first `count` items of a pool, which grows as needed; the others are hidden."""
        make = made or partial(self._pg.PlotDataItem, antialias=True, downsampleMethod="peak")
        while len(pool) < count:
            pool.append(make())
            self._box.addItem(pool[-1], ignoreBounds=True)
        for number, item in enumerate(pool):
            item.setVisible(number < count)
        return pool

    def dress(self, x: ChartAxis, y: ChartAxis) -> None:
        """Use the letters, the colours of the theme, and the titles and texts of the axes.

        The frame is bold where the chart has the keyboard.
        """
        self._axes, font, letters = (x, y), self._chart.font(), self._chart.fontMetrics()
        pen, line = self._pg.mkPen(_role("line")), letters.height()
        self.widget.setBackground(_role("base"))
        bold = self._pg.mkPen(_role("accent"), width=_BOLD)
        self._box.setBorder(bold if self._chart.hasFocus() else pen)
        self._grid.setContentsMargins(0, line / 2, line, line / 4 if x.shows else line / 2)
        for axis, item in ((x, self._bottom), (y, self._left)):
            item.shown, item.line = axis, line
            item.setTickFont(font)
            item.label.setFont(font)
            item.setPen(pen)
            item.setTickPen(pen)
            item.setTextPen(_role("faint"))
        self._left.textWidth = letters.horizontalAdvance(_WIDEST)
        self._left.setWidth(None)
        self._bottom.setLabel(escape(x.label))
        self._bottom.showLabel(bool(x.title) and x.shows == "title")
        self._bottom.setStyle(showValues=bool(x.shows))

    def draw(self, shown: Sequence[Series], lines: Sequence[ChartLine], key: object) -> None:
        """Draw the series, boldly what has the `key`, and the lines."""
        for item, each in zip(self._pooled(self._curves, len(shown)), shown, strict=False):
            self._draw_series(item, each, key is not None and each.key == key)
        x, y = self._axes
        banded = [each for each in shown if each.band is not None]
        bands = self._pooled(self._bands, len(banded), self._pg.PlotCurveItem)
        for item, each in zip(bands, banded, strict=False):
            ink = each.ink
            ink.setAlpha(_BAND)
            at, low, high = x.shown(each.x), y.shown(each.y - each.off), y.shown(each.y + each.off)
            around, edge, joined = _enclosed(at, low, high)
            item.setData(around, edge, connect=joined, pen=None, fillLevel="enclosed", brush=ink)
            item.setZValue(-1)
        drawn = self._pooled(self._lines, len(lines), self._pg.InfiniteLine)
        for item, line in zip(drawn, lines, strict=False):
            item.setAngle(90 if line.upright else 0)
            item.setValue(float((x if line.upright else y).shown(np.array(line.value))))
            item.setPen(self._pg.mkPen(_role(line.colour), style=Qt.PenStyle.DashLine))

    def _draw_series(self, item: Any, each: Series, bold: bool = False) -> None:
        style = Qt.PenStyle.DashLine if each.line == "dashed" else Qt.PenStyle.SolidLine
        pen = self._pg.mkPen(each.ink, width=_BOLD if bold else 1.0, style=style)
        x, y = self._axes[0].shown(each.x), self._axes[1].shown(each.y)
        if not each.line:
            x, y = (values[np.isfinite(x + y)] for values in (x, y))
        dense = len(x) > _DENSE and bool((np.diff(x) > 0).all())
        item.setData(
            x,
            y,
            pen=pen if each.line else None,
            connect="finite",
            symbol=each.mark or None,
            symbolSize=each.size,
            symbolPen=self._pg.mkPen(each.ink, width=1.5),
            symbolBrush=each.ink if each.filled else None,
            autoDownsample=dense,
            clipToView=dense,
        )
        item.setZValue(1 if bold else 0)

    def ring(self, point: ChartPoint | None) -> None:
        """Draw a ring around a point, or none."""
        self._ring.setVisible(point is not None)
        if point is not None:
            each, at = point.series, slice(point.index, point.index + 1)
            ring = Series("", each.x[at], each.y[at], "text", "", "o", each.size + 5, False)
            self._draw_series(self._ring, ring)

    def show_ranges(self, x: tuple[float, float], y: tuple[float, float]) -> None:
        """Show this much along each axis."""
        self._box.setRange(xRange=x, yRange=y, padding=0.0)

    @property
    def x_range(self) -> tuple[float, float]:
        """Both ends of the x axis."""
        low, high = self._box.viewRange()[0]
        return low, high

    @property
    def spans(self) -> tuple[float, float]:
        """How much is shown along each axis."""
        (left, right), (low, high) = self._box.viewRange()
        return right - left, high - low

    def value_at(self, x: float) -> float:
        """The position along the x axis that is seen x px from the left of the view."""
        (left, _), _ = self._box.viewRange()
        area = self._box.sceneBoundingRect()
        return left + (x - area.left()) / area.width() * self.spans[0]

    def places(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Where values are seen on the canvas, in px."""
        x, y = self._axes[0].shown(x), self._axes[1].shown(y)
        (left, _), (low, _) = self._box.viewRange()
        area, (wide, high) = self._box.sceneBoundingRect(), self.spans
        return (
            area.left() + (x - left) / wide * area.width(),
            area.bottom() - (y - low) / high * area.height(),
        )
