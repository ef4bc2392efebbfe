"""Where in its duration a scene is, drawn over how hard it presses; asks for other times."""

import math

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QPointF, QRectF, QSignalBlocker, QSize, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QFontMetricsF,
    QIcon,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QPen,
    QPixmap,
    QPolygonF,
)
from PySide6.QtWidgets import QAbstractSlider, QHBoxLayout, QSizePolicy, QToolButton, QWidget

from kappaskin import Scene
from kappaskin_app.guard import guarded
from kappaskin_app.theme import LIGHT, Theme

Array = NDArray[np.float64]

_HEIGHT = 30  # px of the row
_SAMPLES = 200  # of how hard it presses
_SIDE = 8.0  # px beside the track, for half of the handle
_KNOB = 5.5  # px: radius of the handle
_APART = 3.0  # px that two ticks are apart at least
_FRAME = 1 / 60  # s: the shortest step that is seen
_MS = 1e3
_TIP = (
    "How hard the scene presses over its duration; ticks where a motion changes. Press or drag to "
    "go to another time; Left and Right go by one frame, Page Up and Page Down by a tenth, Home "
    "and End to the ends; Space plays or pauses."
)


def profile(scene: Scene) -> Array:
    """How hard `scene` presses at 200 times over its duration, as shares of the hardest, (200,)."""
    if scene.laid is not None:
        return np.ones(_SAMPLES)
    times = np.linspace(0, np.nextafter(scene.duration, 0), _SAMPLES).tolist()
    amount = np.array([sum(s.pose_at(t).amount for s in scene.stimuli) for t in times], float)
    most = amount.max()
    return amount / most if most > 0 else amount


def _whole_ms(seconds: float) -> int:
    """A time in whole ms, as far as a slider can count: 24 days."""
    return min(round(_MS * seconds), 2**31 - 1)


class _Track(QAbstractSlider):
    """The handle over the profile; its value is the time in ms, for those who do not see it."""

    sought = Signal(float)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setOrientation(Qt.Orientation.Horizontal)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setFixedHeight(_HEIGHT)
        self.setMinimumWidth(80)
        self.setAccessibleName("Time in the scene, in ms")
        self.setToolTip(_TIP)
        self.time, self.last, self.frame = 0.0, 0.0, _FRAME
        self._duration, self._profile, self._moments = 1.0, np.zeros(_SAMPLES), [0.0]
        self._theme = LIGHT
        self.valueChanged.connect(guarded(lambda ms: self.seek(ms / _MS)))

    def sizeHint(self) -> QSize:
        return QSize(300, _HEIGHT)

    def show_scene(self, scene: Scene) -> None:
        self._duration = scene.duration
        self.frame = min(max(1 / scene.rate, _FRAME), scene.duration)
        self.last = scene.duration - self.frame
        self._profile, self._moments = profile(scene), scene.moments
        with QSignalBlocker(self):
            self.setRange(0, _whole_ms(scene.duration))
            self.setSingleStep(max(_whole_ms(self.frame), 1))
            self.setPageStep(max(_whole_ms(scene.duration / 10), 1))
        self.show_time(0.0)

    def show_theme(self, theme: Theme) -> None:
        self._theme = theme
        self.update()

    def show_time(self, seconds: float) -> None:
        self.time = seconds
        with QSignalBlocker(self):
            self.setValue(_whole_ms(seconds))
        self.update()

    def seek(self, seconds: float) -> None:
        """Show a time, or the nearest one that the scene has, and ask for it."""
        self.show_time(min(max(seconds, 0.0), self.last))
        self.sought.emit(self.time)

    # What a person does.

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self.setSliderDown(True)
            self.seek(self._time_at(event.position().x()))

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if self.isSliderDown():
            self.seek(self._time_at(event.position().x()))

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
    def _area(self) -> QRectF:
        return QRectF(self.rect()).adjusted(_SIDE, 4, -_SIDE, -4)

    def at(self, seconds: float) -> float:
        """Where a time is drawn, in px from the left."""
        area = self._area
        return area.left() + area.width() * seconds / self._duration

    def _time_at(self, x: float) -> float:
        area = self._area
        return (x - area.left()) / max(area.width(), 1.0) * self._duration

    def paintEvent(self, event: QPaintEvent) -> None:
        painter, theme, area = QPainter(self), self._theme, self._area
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(QPen(QColor(theme.text if self.hasFocus() else theme.line), 1))
        painter.setBrush(QColor(theme.base))
        painter.drawRoundedRect(area.adjusted(-2.5, -2.5, 2.5, 2.5), 4, 4)
        handle = self.at(self.time)
        shape = self._shape(area)
        painter.setPen(Qt.PenStyle.NoPen)
        for left, right, colour, share in (
            (area.left(), handle, theme.accent, 0.55),
            (handle, area.right(), theme.faint, 0.45),
        ):
            painter.save()
            painter.setClipRect(QRectF(left, 0, max(right - left, 0.0), self.height()))
            ink = QColor(colour)
            ink.setAlphaF(share)
            painter.setBrush(ink)
            painter.drawPolygon(shape)
            painter.restore()
        self._paint_ticks(painter, area)
        self._paint_handle(painter, area, handle)

    def _shape(self, area: QRectF) -> QPolygonF:
        """The profile, with a little of it where nothing presses."""
        x = np.linspace(area.left(), area.right(), _SAMPLES).tolist()
        heights = 1.5 + self._profile * (area.height() - 4)
        top = [QPointF(u, area.bottom() - h) for u, h in zip(x, heights.tolist(), strict=True)]
        return QPolygonF([area.bottomLeft(), *top, area.bottomRight()])

    def _paint_ticks(self, painter: QPainter, area: QRectF) -> None:
        painter.setPen(QPen(QColor(self._theme.text), 1))
        drawn = -math.inf
        for moment in self._moments:
            x = round(self.at(moment)) + 0.5  # or it would be blurred over two px
            if x - drawn >= _APART and 0 < moment < self._duration:
                drawn = x
                painter.drawLine(QPointF(x, area.bottom() - 5), QPointF(x, area.bottom()))

    def _paint_handle(self, painter: QPainter, area: QRectF, x: float) -> None:
        theme = self._theme
        painter.setPen(QPen(QColor(theme.text), 1.5))
        painter.drawLine(QPointF(x, area.top() - 2), QPointF(x, area.bottom() + 2))
        painter.setPen(QPen(QColor(theme.base), 1.5))
        painter.setBrush(QColor(theme.accent))
        painter.drawEllipse(QPointF(x, area.center().y()), _KNOB, _KNOB)


class _Clock(QWidget):
    """Time and duration, every digit in a place of its own width, so that nothing jitters."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.text, self._whole = "", ""
        self.setToolTip("The time in the scene, which begins anew when it is over.")

    def show_time(self, seconds: float, duration: float) -> None:
        whole = f"{duration:.2f}"
        text = f"{seconds:.2f} s of {whole} s"
        if len(whole) != len(self._whole):
            self._whole = whole
            self._fit()
        if text != self.text:
            self.text = text
            self.update()

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        self._fit()

    def _fit(self) -> None:
        self.setFixedSize(
            math.ceil(sum(self._widths(f"{self._whole} s of {self._whole} s"))), _HEIGHT
        )

    def _widths(self, text: str) -> list[float]:
        metrics = QFontMetricsF(self.font())
        digit = max(metrics.horizontalAdvance(c) for c in "0123456789")
        return [digit if c.isdigit() else metrics.horizontalAdvance(c) for c in text]

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setPen(self.palette().windowText().color())
        widths = self._widths(self.text)
        x = self.width() - sum(widths)
        for character, width in zip(self.text, widths, strict=True):
            place = QRectF(x - 1, 0, width + 2, self.height())
            painter.drawText(place, Qt.AlignmentFlag.AlignCenter, character)
            x += width


class Timeline(QWidget):
    """A row that shows the time in a scene; `sought` asks for another one, in s.

    `play_wanted` asks to play, or to pause.
    """

    sought = Signal(float)
    play_wanted = Signal(bool)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setAccessibleName("Timeline")
        self.play = QToolButton(autoRaise=True)  # pyright: ignore[reportCallIssue]
        self.play.setObjectName("timeline-play")
        self.play.setIconSize(QSize(16, 16))
        self.play.setFixedSize(_HEIGHT - 2, _HEIGHT - 2)
        self.track, self.clock = _Track(), _Clock()
        self.setFocusProxy(self.track)
        row = QHBoxLayout(self)
        row.setContentsMargins(6, 0, 8, 0)
        row.setSpacing(6)
        for widget in (self.play, self.track, self.clock):
            row.addWidget(widget, int(widget is self.track))
        self._scene: Scene | None = None
        self._playing, self._theme = True, LIGHT
        self._show_playing()
        self.play.clicked.connect(guarded(lambda *_: self.play_wanted.emit(not self._playing)))
        self.track.sought.connect(guarded(self._seek))
        self.hide()

    def show_scene(self, scene: Scene | None) -> None:
        """Show the course of `scene`; nothing of none, or of one in which nothing moves."""
        self.track.setSliderDown(False)  # the mouse may be let go where this is not seen
        goes = scene is not None and (len(scene.laid.steps) > 1 if scene.laid else scene.moves)
        self._scene = scene if goes else None
        self.setVisible(self._scene is not None)
        if self._scene is not None:
            self.track.show_scene(self._scene)
            self.clock.show_time(0.0, self._scene.duration)

    def show_time(self, seconds: float, playing: bool) -> None:
        """Show a time in s since the scene began for the first time, and whether it goes on."""
        if playing != self._playing:
            self._playing = playing
            self._show_playing()
        if self._scene is None or self.track.isSliderDown() or not math.isfinite(seconds):
            return
        time = seconds % self._scene.duration
        if time != self.track.time:
            self.track.show_time(time)
            self.clock.show_time(time, self._scene.duration)

    def show_theme(self, theme: Theme) -> None:
        self._theme = theme
        self.track.show_theme(theme)
        self._show_playing()

    def _show_playing(self) -> None:
        verb = "Pause" if self._playing else "Play"
        self.play.setAccessibleName(verb)
        what = "Hold the scene as it is now" if self._playing else "Let the scene go on from here"
        self.play.setToolTip(f"{what} (Space)")
        self.play.setIcon(_icon(self._playing, self._theme))

    def _seek(self, seconds: float) -> None:
        if self._scene is not None:
            self.clock.show_time(seconds, self._scene.duration)
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


def _icon(playing: bool, theme: Theme) -> QIcon:
    """Two bars, or a triangle, fine enough for every screen."""
    picture = QPixmap(64, 64)
    picture.fill(Qt.GlobalColor.transparent)
    painter = QPainter(picture)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(QColor(theme.text))
    if playing:
        painter.drawRoundedRect(QRectF(14, 8, 13, 48), 3, 3)
        painter.drawRoundedRect(QRectF(37, 8, 13, 48), 3, 3)
    else:
        painter.drawConvexPolygon([QPointF(14, 6), QPointF(56, 32), QPointF(14, 58)])
    painter.end()
    return QIcon(picture)
