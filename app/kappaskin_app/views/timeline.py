"""A row that shows and asks where in its duration a scene is: a button, its course and a clock."""

import math

from PySide6.QtCore import QEvent, QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QFontMetricsF, QIcon, QKeyEvent, QPainter, QPaintEvent, QPixmap
from PySide6.QtWidgets import QHBoxLayout, QToolButton, QWidget

from kappaskin import Scene
from kappaskin_app.guard import guarded
from kappaskin_app.theme import LIGHT, Theme
from kappaskin_app.views.track import HEIGHT, Track


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
            math.ceil(sum(self._widths(f"{self._whole} s of {self._whole} s"))), HEIGHT
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
        self.play.setFixedSize(HEIGHT - 2, HEIGHT - 2)
        self.track, self.clock = Track(), _Clock()
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
