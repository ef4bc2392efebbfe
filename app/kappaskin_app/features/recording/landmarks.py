"""The course of a recording: where nothing came, hatched, and what happened, as flags."""

import math
from collections.abc import Sequence
from html import escape

from PySide6.QtCore import QEvent, QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QHelpEvent, QPainter, QPen
from PySide6.QtWidgets import QToolTip, QWidget

from kappaskin.frames import Event
from kappaskin.recording import Replay
from kappaskin_app.theme import SERIES
from kappaskin_app.widgets.course import Course

_NEAR = 6.0  # px from a flag within which it is meant
_HATCH = 6.0  # px between two lines of a gap
_STEP = 1e-3  # s, for those who do not see it
_NAMED = 3  # of flags at one place, those that are told
_TIP = (
    "The recording: flags where something happened (point at one to read it), hatched where "
    "nothing came. Press or drag to go to another time; Left and Right, or comma and period, go "
    "by one frame, Page Up and Page Down by a tenth, Home and End to the ends; Space plays or "
    "pauses."
)


def minutes(seconds: float) -> str:
    """A time as m:ss.mmm."""
    ms = round(1e3 * seconds)
    return f"{ms // 60_000}:{ms // 1000 % 60:02d}.{ms % 1000:03d}"


class Landmarks(Course):
    """The handle over gaps and events."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Time in the recording, in ms", _TIP, parent)
        self.gaps: tuple[tuple[float, float], ...] = ()
        self.events: tuple[Event, ...] = ()

    def show_replay(self, replay: Replay, events: Sequence[Event]) -> None:
        """Show what is in a recording, with these `events`, each at its time in s."""
        self.gaps, self.events = replay.gaps, tuple(events)
        length = max(replay.length, _STEP)
        self.show_duration(length, _STEP, replay.length)

    # What is told of a place.

    def event(self, event: QEvent) -> bool:
        if event.type() == QEvent.Type.ToolTip and isinstance(event, QHelpEvent):
            tip = escape(self.tip_at(event.pos().x()))  # a note may have anything in it
            written = f"<p style='white-space: pre-wrap'>{tip}</p>"
            QToolTip.showText(event.globalPos(), written, self)
            return True
        return super().event(event)

    def tip_at(self, x: float) -> str:
        """What there is to read x px from the left."""
        near = [event for event in self.events if abs(self.at(event.time) - x) <= _NEAR]
        near.sort(key=lambda event: abs(self.at(event.time) - x))
        if near:
            told = [f"{minutes(e.time)}  {e.kind}: {e.text}" for e in near[:_NAMED]]
            return "\n".join(told + [f"and {len(near) - _NAMED} more"] * (len(near) > _NAMED))
        time = self.time_at(x)
        for begin, end in self.gaps:
            if begin <= time <= end:
                return f"Nothing came for {end - begin:.2f} s, from {minutes(begin)} on."
        return f"{minutes(min(max(time, 0.0), self.duration))}\n\n{_TIP}"

    # How it is drawn.

    def paint_course(self, painter: QPainter, area: QRectF, handle: float) -> None:
        middle = QRectF(area.left(), area.center().y() - 3, area.width(), 6)
        painter.setPen(Qt.PenStyle.NoPen)
        for part, ink in self.halves(area, handle):
            painter.setBrush(ink)
            painter.drawRect(middle.intersected(part))
        for begin, end in self.gaps:
            self._paint_gap(painter, area, self.at(begin), self.at(end))
        drawn = -math.inf
        for event in sorted(self.events, key=lambda event: event.time):
            x = round(self.at(event.time)) + 0.5
            if x - drawn >= 2:  # or thousands at one place would take long
                drawn = x
                self._paint_flag(painter, area, x)

    def _paint_gap(self, painter: QPainter, area: QRectF, left: float, right: float) -> None:
        box = QRectF(left, area.top(), max(right - left, 2.0), area.height())
        painter.save()
        painter.setClipRect(box)
        painter.fillRect(box, QColor(self.theme.base))
        painter.setPen(QPen(QColor(self.theme.faint), 1.2))
        for k in range(math.ceil((box.width() + box.height()) / _HATCH) + 1):
            x = box.left() + k * _HATCH
            painter.drawLine(QPointF(x, box.top()), QPointF(x - box.height(), box.bottom()))
        painter.restore()
        painter.setPen(Qt.PenStyle.NoPen)

    def _paint_flag(self, painter: QPainter, area: QRectF, x: float) -> None:
        dark = QColor(self.theme.window).lightness() < 128
        ink = QColor(SERIES[5][dark])
        painter.setPen(QPen(ink, 1.5))
        painter.drawLine(QPointF(x, area.top() + 2), QPointF(x, area.bottom()))
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(ink)
        painter.drawEllipse(QPointF(x, area.top() + 3), 3.5, 3.5)
