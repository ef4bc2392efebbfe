"""The transport bar: timeline with gaps and events, and buttons."""

import math
from collections.abc import Sequence
from html import escape

from PySide6.QtCore import QEvent, QPointF, QRectF, QSignalBlocker, Qt, Signal
from PySide6.QtGui import QColor, QHelpEvent, QKeyEvent, QPainter, QPen
from PySide6.QtWidgets import QHBoxLayout, QToolTip, QWidget

from kappaskin.frames import Event
from kappaskin.recording import Replay
from kappaskin_app.guard import guarded
from kappaskin_app.shell.form import ChoiceBox, pass_window_keys
from kappaskin_app.theme import current, follow_look, series
from kappaskin_app.widgets.timeline import Clock, Course, glyph_button, icon

_NEAR = 6.0  # px from a flag within which it is meant
_HATCH = 6.0  # px between two lines of a gap
_STEP = 1e-3  # s, for those who do not see it
_NAMED = 3  # of flags at one place, those in the tooltip
_TIP = (
    "The recording: flags are events (point at one for its text), hatched spans are gaps. Press or "
    "drag to go to another time; Left and Right, or comma and period, step by one frame, Page Up "
    "and Page Down by a tenth, Home and End go to the ends; Space plays or pauses."
)


def minutes(seconds: float) -> str:
    """A time as m:ss.mmm."""
    ms = round(1e3 * seconds)
    return f"{ms // 60_000}:{ms // 1000 % 60:02d}.{ms % 1000:03d}"


class Landmarks(Course):
    """The handle over gaps and events."""

    def __init__(self) -> None:
        super().__init__("Time in the recording, in ms", _TIP)
        self.gaps: tuple[tuple[float, float], ...] = ()
        self.events: tuple[Event, ...] = ()

    def show_replay(self, replay: Replay, events: Sequence[Event]) -> None:
        """Show a recording with these `events`, each at its time in s."""
        self.gaps, self.events = replay.gaps, tuple(events)
        length = max(replay.length, _STEP)
        self.show_duration(length, _STEP, replay.length)

    # The tooltip.

    def event(self, event: QEvent) -> bool:
        if event.type() == QEvent.Type.ToolTip and isinstance(event, QHelpEvent):
            tip = escape(self.tip_at(event.pos().x()))  # a note may contain markup
            written = f"<p style='white-space: pre-wrap'>{tip}</p>"
            QToolTip.showText(event.globalPos(), written, self)
            return True
        return super().event(event)

    def tip_at(self, x: float) -> str:
        """The tooltip x px from the left."""
        near = [event for event in self.events if abs(self.at(event.time) - x) <= _NEAR]
        near.sort(key=lambda event: abs(self.at(event.time) - x))
        if near:
            lines = [f"{minutes(e.time)}  {e.kind}: {e.text}" for e in near[:_NAMED]]
            return "\n".join(lines + [f"and {len(near) - _NAMED} more"] * (len(near) > _NAMED))
        time = self.time_at(x)
        for begin, end in self.gaps:
            if begin <= time <= end:
                return f"Gap of {end - begin:.2f} s from {minutes(begin)}."
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
        painter.fillRect(box, QColor(current().base))
        painter.setPen(QPen(QColor(current().faint), 1.2))
        for k in range(math.ceil((box.width() + box.height()) / _HATCH) + 1):
            x = box.left() + k * _HATCH
            painter.drawLine(QPointF(x, box.top()), QPointF(x - box.height(), box.bottom()))
        painter.restore()
        painter.setPen(Qt.PenStyle.NoPen)

    def _paint_flag(self, painter: QPainter, area: QRectF, x: float) -> None:
        ink = series(5)
        painter.setPen(QPen(ink, 1.5))
        painter.drawLine(QPointF(x, area.top() + 2), QPointF(x, area.bottom()))
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(ink)
        painter.drawEllipse(QPointF(x, area.top() + 3), 3.5, 3.5)


SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0)
"""Playback speeds, relative to the recorded one."""

_TIPS = {
    "previous": "Previous event (Ctrl+[)",
    "back": "One frame back (comma, Left)",
    "play": "Play (Space)",
    "pause": "Pause (Space)",
    "forward": "One frame forward (period, Right)",
    "next": "Next event (Ctrl+])",
    "loop": "Loop (Ctrl+Shift+L)",
}
_SPEED = "Playback speed (Ctrl+Shift+Up, Ctrl+Shift+Down)"


class Transport(QWidget):
    """Shows a replay; `sought` requests a time in s, `step_wanted` a number of frames.

    `jump_wanted` requests the next (1) or previous (-1) event, `play_wanted` play or pause.
    """

    sought = Signal(float)
    step_wanted = Signal(int)
    jump_wanted = Signal(int)
    play_wanted = Signal(bool)
    speed_wanted = Signal(float)
    loop_wanted = Signal(bool)

    def __init__(self) -> None:
        super().__init__()
        self.setAccessibleName("Transport of the recording")
        self.buttons = {name: glyph_button(name) for name in _TIPS if name != "pause"}
        self.play, self.loop = self.buttons["play"], self.buttons["loop"]
        self.loop.setCheckable(True)
        self.course = Landmarks()
        self.clock = Clock("Time in the recording, and its duration.")
        self.speed = self._made_speed()
        self.setFocusProxy(self.course)
        row = QHBoxLayout(self)
        row.setContentsMargins(6, 0, 8, 0)
        row.setSpacing(2)
        names = ("previous", "back", "play", "forward", "next")
        before = [self.buttons[name] for name in names]
        for widget in (*before, self.course, self.clock, self.speed, self.loop):
            row.addWidget(widget, int(widget is self.course))
        row.insertSpacing(row.indexOf(self.speed), 6)
        self._shown: tuple[object, ...] = ()
        self._playing, self.there = True, False
        self._wire()
        follow_look(self, self._show_signs)
        self.hide()

    def _made_speed(self) -> ChoiceBox:
        box = ChoiceBox()
        box.setObjectName("speed")
        box.setAccessibleName("Speed of the replay")
        for speed in SPEEDS:
            box.addItem(f"\N{MULTIPLICATION SIGN} {speed:g}", speed)
        box.setToolTip(_SPEED)
        pass_window_keys(box)
        return box

    def _wire(self) -> None:
        buttons = self.buttons
        for name, frames in (("back", -1), ("forward", 1)):
            buttons[name].setAutoRepeat(True)
            buttons[name].clicked.connect(
                guarded(lambda *_, frames=frames: self.step_wanted.emit(frames))
            )
        for name, way in (("previous", -1), ("next", 1)):
            buttons[name].clicked.connect(guarded(lambda *_, way=way: self.jump_wanted.emit(way)))
        self.play.clicked.connect(guarded(lambda *_: self.play_wanted.emit(not self._playing)))
        self.loop.clicked.connect(guarded(lambda *_: self.loop_wanted.emit(self.loop.isChecked())))
        self.speed.activated.connect(
            guarded(lambda index: self.speed_wanted.emit(self.speed.itemData(index)))
        )
        self.course.sought.connect(guarded(self._seek))

    def _seek(self, seconds: float) -> None:
        self._show_clock(seconds)
        self.sought.emit(seconds)

    # State.

    def show_recording(self, replay: Replay | None, events: Sequence[Event] = ()) -> None:
        """Show a recording with these `events`, or none."""
        there = replay is not None
        if there != self.there:
            self.there = there
            self.course.setSliderDown(False)  # the mouse may be let go where this is not seen
            self.setVisible(there)
        if replay is None:
            self._shown = ()
            return
        shown = replay.begun, replay.length, replay.gaps, tuple(events)
        if shown != self._shown:
            self._shown = shown
            self.course.show_replay(replay, events)
            self._show_clock(0.0)
            for name in ("previous", "next"):
                self.buttons[name].setEnabled(bool(events))

    def show_time(self, seconds: float, playing: bool) -> None:
        """Show the time in s, and whether it is playing."""
        if playing != self._playing:
            self._playing = playing
            self._show_playing()
        if not self.course.isSliderDown() and seconds != self.course.time:
            self.course.show_time(seconds)
            self._show_clock(seconds)

    def show_speed(self, speed: float, looped: bool) -> None:
        """Show the speed, and whether it is looped."""
        self.loop.setChecked(looped)
        with QSignalBlocker(self.speed):
            self.speed.setCurrentIndex(self.speed.findData(speed))

    def _show_clock(self, seconds: float) -> None:
        whole = minutes(self.course.last)
        self.clock.show_text(f"{minutes(seconds)} of {whole}", f"{whole} of {whole}")

    def _show_signs(self) -> None:
        for name, button in self.buttons.items():
            button.setIcon(icon(name))
            button.setToolTip(_TIPS[name])
            button.setAccessibleName(_TIPS[name].partition(" (")[0])
        self._show_playing()

    def _show_playing(self) -> None:
        name = "pause" if self._playing else "play"
        self.play.setIcon(icon(name))
        self.play.setToolTip(_TIPS[name])
        self.play.setAccessibleName(name.capitalize())

    # Keys.

    def take_key(self, event: QKeyEvent) -> bool:
        """Handle a key; whether it was one of the transport."""
        plain = Qt.KeyboardModifier.KeypadModifier
        if not self.there or event.modifiers() & ~plain:
            return False
        keys, key, course = Qt.Key, Qt.Key(event.key()), self.course
        steps = {keys.Key_Left: -1, keys.Key_Comma: -1, keys.Key_Right: 1, keys.Key_Period: 1}
        to = {
            keys.Key_PageUp: course.time + course.duration / 10,
            keys.Key_PageDown: course.time - course.duration / 10,
            keys.Key_Home: 0.0,
            keys.Key_End: course.last,
        }
        if key in steps:
            self.step_wanted.emit(steps[key])
        elif key in to:
            course.seek(to[key])
        elif key == keys.Key_Space and not event.isAutoRepeat():
            self.play.click()
        return key in steps or key in to or key == keys.Key_Space

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if not self.take_key(event):
            super().keyPressEvent(event)
