"""Timeline of a scene: force over time, with a handle."""

import math

import numpy as np
from PySide6.QtCore import QPointF, QRectF, Qt, Signal
from PySide6.QtGui import QColor, QKeyEvent, QPainter, QPen, QPolygonF
from PySide6.QtWidgets import QHBoxLayout, QWidget

from kappaskin.frames import Array
from kappaskin.scenes import Scene
from kappaskin_app.guard import guarded
from kappaskin_app.theme import current, follow_look
from kappaskin_app.widgets.timeline import Clock, Course, glyph_button, icon

_SAMPLES = 200  # of the force profile
_TICK_GAP = 3.0  # px, least distance of two ticks
_FRAME = 1 / 60  # s: the shortest visible step
_TRACK_TIP = (
    "Force of the scene over its duration; ticks mark the changes of a motion. Click or drag to go "
    "to another time; Left and Right move by one frame, Page Up and Page Down by a tenth, Home and "
    "End to the ends; Space plays or pauses."
)


def profile(scene: Scene) -> Array:
    """Force of `scene` at 200 times over its duration, relative to the largest, (200,)."""
    if scene.laid is not None:
        return np.ones(_SAMPLES)
    times = np.linspace(0, np.nextafter(scene.duration, 0), _SAMPLES).tolist()
    amount = np.array([sum(s.pose_at(t).amount for s in scene.stimuli) for t in times], float)
    most = amount.max()
    return amount / most if most > 0 else amount


class Track(Course):
    """The profile of the force, with a handle."""

    def __init__(self) -> None:
        super().__init__("Time in the scene, in ms", _TRACK_TIP)
        self.frame = _FRAME
        self._profile, self._moments = np.zeros(_SAMPLES), [0.0]
        self._shaped, self._shape = QRectF(), QPolygonF()

    def show_scene(self, scene: Scene) -> None:
        self._shaped = QRectF()
        self.frame = min(max(1 / scene.rate, _FRAME), scene.duration)
        self._profile, self._moments = profile(scene), scene.moments
        self.show_duration(scene.duration, self.frame, scene.duration - self.frame)

    def paint_course(self, painter: QPainter, area: QRectF, handle: float) -> None:
        if area != self._shaped:  # cached: painted in every frame
            self._shaped, self._shape = area, self._shape_in(area)
        painter.setPen(Qt.PenStyle.NoPen)
        for part, ink in self.halves(area, handle):
            painter.save()
            painter.setClipRect(part)
            painter.setBrush(ink)
            painter.drawPolygon(self._shape)
            painter.restore()
        self._paint_ticks(painter, area)

    def _shape_in(self, area: QRectF) -> QPolygonF:
        """The outline of the profile, with a least height where the force is zero."""
        x = np.linspace(area.left(), area.right(), _SAMPLES).tolist()
        heights = 1.5 + self._profile * (area.height() - 4)
        top = [QPointF(u, area.bottom() - h) for u, h in zip(x, heights.tolist(), strict=True)]
        return QPolygonF([area.bottomLeft(), *top, area.bottomRight()])

    def _paint_ticks(self, painter: QPainter, area: QRectF) -> None:
        painter.setPen(QPen(QColor(current().text), 1))
        drawn = -math.inf
        for moment in self._moments:
            x = round(self.at(moment)) + 0.5  # else blurred over two pixels
            if x - drawn >= _TICK_GAP and 0 < moment < self.duration:
                drawn = x
                painter.drawLine(QPointF(x, area.bottom() - 5), QPointF(x, area.bottom()))


_TIP = "Time in the scene, which repeats."


class Timeline(QWidget):
    """A row that shows the time in a scene; `sought` requests another time in s.

    `play_wanted` requests to play or to pause.
    """

    sought = Signal(float)
    play_wanted = Signal(bool)

    def __init__(self) -> None:
        super().__init__()
        self.setAccessibleName("Timeline")
        self.play = glyph_button("timeline-play")
        self.track, self.clock = Track(), Clock(_TIP)
        self.setFocusProxy(self.track)
        row = QHBoxLayout(self)
        row.setContentsMargins(6, 0, 8, 0)
        row.setSpacing(6)
        for widget in (self.play, self.track, self.clock):
            row.addWidget(widget, int(widget is self.track))
        self._scene: Scene | None = None
        self._playing = True
        follow_look(self, self._show_playing)
        self.play.clicked.connect(guarded(lambda *_: self.play_wanted.emit(not self._playing)))
        self.track.sought.connect(guarded(self._seek))
        self.hide()

    def show_scene(self, scene: Scene | None) -> None:
        """Show the profile of `scene`; hidden without a scene, or with one at rest."""
        self.track.setSliderDown(False)  # the release of the mouse may be missed while hidden
        moves = scene is not None and (len(scene.laid.steps) > 1 if scene.laid else scene.moves)
        self._scene = scene if moves else None
        self.setVisible(self._scene is not None)
        if self._scene is not None:
            self.track.show_scene(self._scene)
            self._show_clock(0.0, self._scene.duration)

    def show_time(self, seconds: float, playing: bool) -> None:
        """Show a time in s since the first start of the scene, and whether it is playing."""
        if playing != self._playing:
            self._playing = playing
            self._show_playing()
        if self._scene is None or self.track.isSliderDown() or not math.isfinite(seconds):
            return
        time = seconds % self._scene.duration
        if time != self.track.time:
            self.track.show_time(time)
            self._show_clock(time, self._scene.duration)

    def _show_clock(self, seconds: float, duration: float) -> None:
        whole = f"{duration:.2f}"
        self.clock.show_text(f"{seconds:.2f} s of {whole} s", f"{whole} s of {whole} s")

    def _show_playing(self) -> None:
        verb = "Pause" if self._playing else "Play"
        self.play.setAccessibleName(verb)
        tip = "Pause the scene" if self._playing else "Continue the scene"
        self.play.setToolTip(f"{tip} (Space)")
        self.play.setIcon(icon("pause" if self._playing else "play"))

    def _seek(self, seconds: float) -> None:
        if self._scene is not None:
            self._show_clock(seconds, self._scene.duration)
            self.sought.emit(seconds)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        track, keys, scene = self.track, Qt.Key, self._scene
        if scene is None or event.modifiers() & ~Qt.KeyboardModifier.KeypadModifier:
            super().keyPressEvent(event)
            return
        to = {
            keys.Key_Left: track.time - track.frame,
            keys.Key_Right: track.time + track.frame,
            keys.Key_PageUp: track.time + scene.duration / 10,
            keys.Key_PageDown: track.time - scene.duration / 10,
            keys.Key_Home: 0.0,
            keys.Key_End: track.last,
        }.get(Qt.Key(event.key()))
        if to is not None:
            track.seek(to)
        elif event.key() == keys.Key_Space:
            self.play.click()
        else:
            super().keyPressEvent(event)
