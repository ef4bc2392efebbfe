"""Strips: keeps what the strip chart shows, and draws it."""

import math
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from PySide6.QtCore import QEvent, QMimeData, QObject, QPoint, Qt
from PySide6.QtGui import QDrag, QMouseEvent
from PySide6.QtWidgets import QApplication, QWidget

from kappaskin.contact import ContactObject
from kappaskin.frames import Array, Estimate
from kappaskin.live import Status
from kappaskin.recording import Replay, contacts_in
from kappaskin_app.features.strip_chart.history import Bins, Span, StripHistory, broken
from kappaskin_app.features.strip_chart.panel import MIME, QUANTITIES, RADIUS, StripChart
from kappaskin_app.guard import guarded
from kappaskin_app.shell.background import BackgroundTask, Tasks
from kappaskin_app.shell.display import Display
from kappaskin_app.shell.history import History
from kappaskin_app.shell.session import RECORDED, Session
from kappaskin_app.shell.settings import Settings

_PERIOD = 0.1  # s between two drawings
_PARTS = 600  # of the span shown: as many as a chart has pixels
_SHORTEST = 1e-3  # s of a recording
_MOST_EVENTS = 50  # of a recording that are marked
_OF_FRAMES = {name: of for name, of in QUANTITIES.items() if of.path}
_NEAR_RIM = "contact.near_rim"
_PATHS = sorted({p for of in _OF_FRAMES.values() for p in (of.path, of.sd) if p} | {_NEAR_RIM})
_SDS = [(name, True) for name, of in _OF_FRAMES.items() if of.sd]
_COLUMNS = {each: n for n, each in enumerate([*((name, False) for name in _OF_FRAMES), *_SDS])}
"""Number of the column of each quantity, and of its standard deviation."""
_UNRELIABLE = ("force", "displacement")  # near the rim
_READOUTS = {
    "contact": ("position_x", "position_y"),
    "force": ("force",),
    "depth": ("displacement",),
}
"""What can be dragged from the readouts at the top of the window."""


def _columns(fields: Mapping[str, Array]) -> Array:
    """All columns (T, n) of the `fields` (T, ...) at their paths."""
    found: list[Array] = []
    near_rim = fields[_NEAR_RIM].astype(bool)
    for name, is_sd in _COLUMNS:
        of = _OF_FRAMES[name]
        values = of.of(fields[of.sd] if is_sd else of.by(fields[of.path]))
        found.append(np.where(near_rim, np.nan, values) if name in _UNRELIABLE else values)
    return np.stack(found, axis=1)


def _bins(width: float) -> Bins:
    """What is kept of a recording, in parts of `width` s."""
    return Bins(len(_COLUMNS), width, 2 * _PARTS)


class Dragging(QObject):
    """Lets the user drag `names` of quantities from a `widget`."""

    def __init__(self, widget: QWidget, names: tuple[str, ...]) -> None:
        super().__init__(widget)
        self._widget, self._names = widget, names
        self._pressed: QPoint | None = None
        widget.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        kinds = QEvent.Type
        if isinstance(event, QMouseEvent) and event.type() == kinds.MouseButtonPress:
            self._pressed = event.position().toPoint()
        elif event.type() == kinds.MouseButtonRelease:
            self._pressed = None
        elif isinstance(event, QMouseEvent) and event.buttons() & Qt.MouseButton.LeftButton:
            far = QApplication.startDragDistance()
            at = event.position().toPoint()
            if self._pressed is not None and (at - self._pressed).manhattanLength() >= far:
                self._pressed = None
                self._drag()
        return False

    def _drag(self) -> None:
        drag, what = QDrag(self._widget), QMimeData()
        what.setData(MIME, " ".join(self._names).encode())
        drag.setMimeData(what)
        drag.setPixmap(self._widget.grab())
        drag.exec(Qt.DropAction.CopyAction)


class Strips(QObject):
    """Keeps the numbers of every estimate, and draws those selected in its `panel`."""

    def __init__(self, history: History, session: Session, display: Display, tasks: Tasks) -> None:
        super().__init__(display)
        self._history, self._session = history, session
        self.panel = StripChart()
        self._frames, self._objects = StripHistory(len(_COLUMNS)), StripHistory(1)
        self._key, self._last_number, self._next = (0, 0), 0, 0.0
        self._recorded, self._length, self._last = _bins(1.0), 0.0, 0.0
        self._reading = BackgroundTask(tasks, "Reading the contacts", self._take_recorded)
        session.estimated.connect(guarded(self.receive))
        session.reported.connect(guarded(self.follow))
        session.source_changed.connect(guarded(self._open))
        self.panel.sought.connect(guarded(session.time_requested.emit))
        self.panel.toggled.connect(guarded(self._toggle))
        self.panel.added.connect(guarded(self._add))
        self.panel.spanned.connect(guarded(self._set_span))
        for readout, names in _READOUTS.items():
            for widget in display.places.get(f"readout-{readout}", []):
                Dragging(widget, names)

    # Requests

    def _toggle(self, name: str) -> None:
        shown = self._history.settings.strips
        if name not in shown:
            self._add([name])
            return
        others = tuple(one for one in shown if one != name)
        self._history.change(f"Hide {QUANTITIES[name].label} over time", -1, strips=others)

    def _add(self, names: list[str]) -> None:
        shown = self._history.settings.strips
        if new := [name for name in names if name not in shown]:
            text = f"Show {QUANTITIES[new[0]].label} over time"
            self._history.change(text, -1, strips=(*shown, *new))

    def _set_span(self, seconds: float) -> None:
        self._history.change("Time of the strip chart", -1, strip_seconds=seconds)

    def show_settings(self, settings: Settings) -> None:
        self.panel.show_choice(settings.strips, settings.strip_seconds, self._length)
        self._next = 0.0

    # Input

    def receive(self, estimate: Estimate) -> None:
        """Store the numbers of new estimates."""
        status = self._session.status
        key = status.connections, estimate.generation
        if key != self._key:
            if key[0] != self._key[0]:
                self._frames.clear()
                self._objects.clear()
            self._key, self._last_number = key, 0
        engine = self._session.engine
        times, values, self._last_number = engine.recent(status, self._last_number, _PATHS)
        if len(times):
            self._frames.append(times, _columns(dict(zip(_PATHS, values, strict=True))))

    def _open(self, source: str) -> None:
        """Begin with another source: read the contacts of a recording."""
        self._reading.stop()
        self._length = 0.0
        if self._session.replaying:
            self._reading.compute(contacts_in, Path(source.removeprefix(RECORDED)))
        self.show_settings(self._history.settings)

    def _take_recorded(self, found: tuple[float, Array, dict[str, Array]]) -> None:
        """Store contacts of a recording."""
        length, times, fields = found
        if not self._length:
            self._length, self._last = max(length, _SHORTEST), 0.0
            self._recorded = _bins(self._length / _PARTS)
            self.show_settings(self._history.settings)
        if len(times):
            unknown = np.full(len(times), np.nan)
            each = {path: fields.get(path.rpartition(".")[2], unknown) for path in _PATHS}
            self._recorded.append(*broken(times, _columns(each), self._last))
            self._last = float(times[-1])

    def follow(self, status: Status) -> None:
        """Draw what is selected, some times a second."""
        now = time.monotonic()
        if now >= self._next and self.panel.isVisible():
            self._next = now + _PERIOD
            if self._length:
                self._draw_recorded(status.replay)
            else:
                self._draw()

    def take_object(self, what: ContactObject, estimate: Estimate) -> None:
        """Store the radius of the object in contact, of an estimate."""
        known = bool(what.probability) and what.fits
        radius = what.radius if known else math.nan
        self._objects.append(np.array([estimate.device_time]), np.array([[radius]]))

    def _draw(self) -> None:
        until, seconds = self._frames.last, self._history.settings.strip_seconds
        if not math.isfinite(until):
            return
        begin = until - seconds
        for name in self.panel.charts:
            sd = None
            if name == RADIUS:
                span = self._objects.span(0, begin, _PARTS)
            else:
                span = self._frames.span(_COLUMNS[name, False], begin, _PARTS)
                if (name, True) in _COLUMNS:
                    sd = self._frames.span(_COLUMNS[name, True], begin, _PARTS)
            self.panel.show_span(name, span, sd, until, {})

    def _draw_recorded(self, replay: Replay | None) -> None:
        events = replay.events[:_MOST_EVENTS] if replay else ()
        marks = {event.time: "faint" for event in events}
        if replay:
            marks[replay.at] = "accent"

        def span(column: int) -> Span:
            return Span(*self._recorded.between(column, 0.0, math.inf))

        for name in self.panel.charts:
            of = _COLUMNS.get((name, False))
            sd = _COLUMNS.get((name, True))
            shown = Span(np.empty(0), np.empty((3, 0))) if of is None else span(of)
            self.panel.show_span(name, shown, None if sd is None else span(sd), 0.0, marks)
