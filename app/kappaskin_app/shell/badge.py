"""The badge, whether readings are live, simulated, replayed, stale or lost, and the header bar."""

import math

from PySide6.QtCore import QPointF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QFontInfo, QMouseEvent, QPainter, QPaintEvent
from PySide6.QtWidgets import QHBoxLayout, QSizePolicy, QToolBar, QVBoxLayout, QWidget

from kappaskin.live import Status
from kappaskin.pipeline import Setup
from kappaskin.recording import RecordingStatus, Replay
from kappaskin.sensing import Sensor
from kappaskin.skin import MeshSkin
from kappaskin_app.shell.settings.shown import METHOD_SHORT
from kappaskin_app.theme import Theme, current
from kappaskin_app.widgets.parts import Label, plain_tip, sentence
from kappaskin_app.widgets.text import elapsed, file_size

LIVE, SIM, WAITING = "LIVE", "SIM", "WAITING"
STALE, LOST, OFF = "STALE", "LOST", "OFF"
_BESIDE = " \N{MIDDLE DOT} "  # between a source and its condition
_GAP, _NOISY, _SATURATED, PAUSED = "gap", "NOISE ADDED", "saturated", "paused"
REPLAY = "REPLAY"
GAP = f"{REPLAY}{_BESIDE}{_GAP}"
LATE = "LATE"  # of a haptic cue: the badge has ages

_TIPS = {
    LIVE: "Readings of a connected sensor.",
    SIM: "Readings of a simulated sensor.",
    WAITING: "Connecting, or preparing the estimator: no reading yet.",
    STALE: "No reading for half a second: the values shown are old.",
    LOST: "Connection lost or not opened; retrying. The values shown are the last received.",
    OFF: "Nothing is connected.",
    REPLAY: "A recording is played.",
    _GAP: "Nothing was recorded here: the values shown are old.",
    _NOISY: "Noise is added to the readings of what is shown; none of it is recorded or published.",
    _SATURATED: "Elements are beyond the range of their electronics: the skin may be bent more "
    "than shown.",
    PAUSED: "Paused; Ctrl+P continues.",
}

_WIDTH, _HEIGHT, _LARGE = 8.6, 2.5, 1.54  # of the size of letters elsewhere
_ROUND, _DOT = 6, 4  # px: radius of its corners, and of the dot of a recording
_MORE = "Click, or F4: event log."


def is_now(
    word: str,
    *,
    gap: bool = False,
    noisy: bool = False,
    saturated: bool = False,
    paused: bool = False,
) -> str:
    """The state: the source `word` and its most severe condition.

    The source is always part of it: a simulation must not be taken for a sensor. A gap precedes
    added noise, that precedes saturation, and saturation precedes a pause.
    """
    true = ((_GAP, gap), (_NOISY, noisy), (_SATURATED, saturated), (PAUSED, paused))
    return _BESIDE.join([word, *[below for below, holds in true if holds][:1]])


def origin(state: str) -> str:
    """The source of a state, without its condition."""
    return state.partition(_BESIDE)[0]


class Badge(Label):
    """Shows a state in its colour, and a red dot while recording; `clicked` requests the log."""

    clicked = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Preferred)
        self.state, self.recorded = "", RecordingStatus()

    def show_state(self, state: str, recorded: RecordingStatus) -> None:
        """Show a state; below it its condition, else how long is being `recorded`."""
        if (state, recorded) == (self.state, self.recorded):
            return
        self.state, self.recorded = state, recorded
        parts, tips = state.split(_BESIDE), [_TIPS[part] for part in state.split(_BESIDE)]
        also = list[str]()
        if recorded.active:
            lost = f"{recorded.lost:,} lost"
            also = [f"REC {lost if recorded.lost else elapsed(recorded.seconds)}"]
            tips.append(
                f"Recording to {recorded.path}: {file_size(recorded.size)}, {lost} because of a "
                "slow disk. Ctrl+R stops."
            )
        self.setText("\n".join([*parts, *also][:2]))
        self.setAccessibleName(", ".join([*parts, *["recording"] * recorded.active]))
        self.setToolTip(plain_tip("\n".join([*tips, _MORE])))

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        self.clicked.emit()
        super().mouseReleaseEvent(event)

    def sizeHint(self) -> QSize:
        one = QFontInfo(self.font()).pixelSize()
        return QSize(round(_WIDTH * one), round(_HEIGHT * one))

    def minimumSizeHint(self) -> QSize:
        return self.sizeHint()

    def paintEvent(self, event: QPaintEvent) -> None:
        if not self.state:
            return
        font = self.font()
        with QPainter(self) as painter:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(QColor(colour_of(self.state, current())))
            painter.drawRoundedRect(self.rect(), _ROUND, _ROUND)
            one = QFontInfo(font).pixelSize()
            font.setPixelSize(one if "\n" in self.text() else round(_LARGE * one))
            font.setBold(True)
            painter.setFont(font)
            painter.setPen(QColor("white"))
            painter.drawText(self.rect(), Qt.AlignmentFlag.AlignCenter, self.text())
            if self.recorded.active:
                painter.setBrush(QColor(current().bad))
                painter.drawEllipse(QPointF(2.5 * _DOT, 2.5 * _DOT), _DOT, _DOT)


def colour_of(state: str, theme: Theme) -> str:
    """The background colour of a state, which is written in white."""
    word, _, below = state.partition(_BESIDE)
    if below in (_GAP, _NOISY, _SATURATED):
        return theme.warning
    return {
        LIVE: theme.good,
        SIM: theme.simulated,
        WAITING: theme.off,
        STALE: theme.warning,
        LATE: theme.warning,
        LOST: theme.bad,
        OFF: theme.off,
        REPLAY: theme.replayed,
    }[word]


_STALE_AFTER = 0.5  # s without a frame


def state_of(status: Status, computed: float | None, now: float, paused: bool) -> str:
    """The badge's state.

    `computed` is the host time in s of the frame of the newest estimate, None without one;
    `paused` says that a simulation is paused. No connection precedes no reading, and no reading
    precedes old readings.
    """
    if status.state == "off":
        return OFF
    if status.state == "lost":
        return LOST
    waits = status.state == "waiting" and status.replay is None
    if waits or (status.computing and computed is None):
        return WAITING
    saturated = any(finding.kind == "saturated" for finding in status.health.findings)
    if status.replay is not None:
        return _replayed(status.replay, saturated)
    last = max(status.last_frame, -math.inf if computed is None else computed)
    if status.sensor is None or now - last > _STALE_AFTER:
        return WAITING if status.computing or last == -math.inf else STALE
    word = SIM if status.sensor.simulated else LIVE
    return is_now(word, noisy=status.added_noise > 0, saturated=saturated, paused=paused)


def _replayed(replay: Replay, saturated: bool) -> str:
    gap = any(begin < replay.at < end for begin, end in replay.gaps)
    over = replay.at >= replay.length and not replay.looped
    return is_now(REPLAY, gap=gap, saturated=saturated, paused=over or not replay.speed)


def functions_of(setup: Setup, sensor: Sensor | None) -> str:
    """The number of functions: in x and y, or of all on a mesh, which has neither."""
    patch = None if sensor is None else sensor.layout.patch
    if isinstance(patch, MeshSkin):
        return str(setup.Ni * setup.Nj)
    return f"{setup.Ni} x {1 if patch is not None and patch.strip else setup.Nj}"


def in_use(status: Status) -> str:
    """Why the requested setup is not in use, and which one is; empty when it is in use."""
    if not status.refusal:
        return ""
    if status.slot is None:
        return f"No setup is in use. {sentence(status.refusal)}"
    setup, functions = status.setup, functions_of(status.setup, status.sensor)
    method = METHOD_SHORT.get(setup.method, setup.method)
    return f"In use: {method}, {functions} functions. {sentence(status.refusal)}"


class Header(QToolBar):
    """The header bar: the `badge` and other widgets in a row, and below it the `banner`."""

    def __init__(self, badge: Badge, banner: QWidget) -> None:
        super().__init__("Header")
        self.setObjectName("header")
        self.setMovable(False)
        self.toggleViewAction().setEnabled(False)
        inside, self._row = QWidget(), QHBoxLayout()
        column = QVBoxLayout(inside)
        column.setContentsMargins(0, 0, 0, 0)
        for layout in (self._row, column):
            layout.setSpacing(0)
        column.addLayout(self._row)
        column.addWidget(banner)
        self.addWidget(inside)
        self.add(badge)

    def add(self, widget: QWidget) -> None:
        """Show a widget after all others of the row."""
        self._row.addWidget(widget)
