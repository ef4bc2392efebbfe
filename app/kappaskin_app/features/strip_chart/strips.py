"""Strips: keeps what the strip chart shows, and draws it."""

import math
import time
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from PySide6.QtCore import QEvent, QMimeData, QObject, QPoint, Qt
from PySide6.QtGui import QDrag, QMouseEvent
from PySide6.QtWidgets import QApplication, QWidget

from kappaskin.contact import ContactObject
from kappaskin.estimation import Region
from kappaskin.frames import Array, Estimate, Event
from kappaskin.live import Engine, Status
from kappaskin.recording import Replay, contacts_in
from kappaskin.sensing import SHOWN_UNITS
from kappaskin_app.features.strip_chart.history import Bins, Span, StripHistory, broken
from kappaskin_app.features.strip_chart.panel import (
    MARKS,
    MIME,
    NOW,
    QUANTITIES,
    RADIUS,
    StripChart,
    StripMark,
    element_name,
    element_of,
    label_of,
)
from kappaskin_app.guard import guarded
from kappaskin_app.shell.background import BackgroundTask, Tasks
from kappaskin_app.shell.display import Display
from kappaskin_app.shell.history import History
from kappaskin_app.shell.selection import Selection
from kappaskin_app.shell.session import RECORDED, Session
from kappaskin_app.shell.settings import Settings

_PERIOD = 0.1  # s between two drawings
_UNREAD = 32  # estimates that may wait to be read, of the 64 that the engine keeps
_PARTS = 600  # of the span shown: as many as a chart has pixels
_FINEST = 20_000  # parts of a recording that are kept, to zoom in
_NEARLY = 0.2  # s between the time of an estimate and that reported by the engine
_SHORTEST = 1e-3  # s of a recording
_MOST_EVENTS = 50  # of a recording that are marked
_OF_FRAMES = {name: of for name, of in QUANTITIES.items() if of.path}
_NEAR_RIM, _HOST_TIME = "contact.near_rim", "host_time"
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
    return Bins(len(_COLUMNS), width, 2 * _FINEST)


class Dragging(QObject):
    """Lets the user drag quantities from a `widget`: `names()` when the mouse is pressed."""

    def __init__(self, widget: QWidget, names: Callable[[], Sequence[str]]) -> None:
        super().__init__(widget)
        self._widget, self._names = widget, names
        self._dragged: Sequence[str] = ()
        self._pressed: QPoint | None = None
        widget.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        kinds = QEvent.Type
        if isinstance(event, QMouseEvent) and event.type() == kinds.MouseButtonPress:
            self._pressed, self._dragged = event.position().toPoint(), self._names()
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
        what.setData(MIME, " ".join(self._dragged).encode())
        drag.setMimeData(what)
        drag.setPixmap(self._widget.grab())
        drag.exec(Qt.DropAction.CopyAction)


class _Frames:
    """The numbers of every estimate of a finger, as they are read from its engine.

    Its clock is `ahead` s of that of this machine.
    """

    def __init__(self) -> None:
        self.history, self.ahead = StripHistory(len(_COLUMNS)), math.nan
        self.key, self._number = (0, 0), 0

    def read(self, engine: Engine, status: Status, more: Sequence[str] = ()) -> list[Array]:
        """Store the numbers of new estimates; their times (T,), then what they have at `more`."""
        key = status.connections, status.generation
        if key != self.key:
            if key[0] != self.key[0]:
                self.history.clear()
            self.key, self._number = key, 0
        paths = [*_PATHS, _HOST_TIME, *more]
        times, values, self._number = engine.recent(status, self._number, paths)
        if not len(times):
            return []
        self.history.append(times, _columns(dict(zip(paths, values, strict=True))))
        self.ahead = float(times[-1] - values[len(_PATHS)][-1])
        return [times, *values[len(_PATHS) + 1 :]]


class Strips(QObject):
    """Keeps the numbers of every estimate, and draws those selected in its `panel`.

    Of a hand it keeps those of all fingers.
    """

    def __init__(
        self,
        history: History,
        session: Session,
        display: Display,
        tasks: Tasks,
        selection: Selection,
    ) -> None:
        super().__init__(display)
        self._history, self._session, self._display = history, session, display
        self.panel = StripChart()
        self._fingers, self._objects = defaultdict[str, _Frames](_Frames), StripHistory(1)
        self._elements: dict[str, StripHistory] = {}
        self._element = -1
        self._zero = math.nan
        """Device's clock minus the time in a recording, in s."""
        self._connection, self._next, self._next_read = 0, 0.0, 0.0
        self.panel.of_hand = session.fingers is not None
        self.panel.all_fingers.clicked.connect(guarded(lambda *_: self._draw()))
        self._recorded, self._length, self._last = _bins(1.0), 0.0, 0.0
        self._reading = BackgroundTask(tasks, "Reading the contacts", self._take_recorded)
        session.estimated.connect(guarded(self.receive))
        session.reported.connect(guarded(self.follow))
        session.source_changed.connect(guarded(self._open))
        self.panel.sought.connect(guarded(session.time_requested.emit))
        self.panel.toggled.connect(guarded(self._toggle))
        self.panel.added.connect(guarded(self._add))
        self.panel.spanned.connect(guarded(self._set_span))
        self._selection = selection
        selection.chosen.connect(guarded(self._select))
        selection.clicked.connect(guarded(self._select_at))
        display.restarted.connect(guarded(self._restart))
        for readout, names in _READOUTS.items():
            for widget in display.places.get(f"readout-{readout}", []):
                Dragging(widget, partial(tuple[str, ...], names))
        self._drag_elements()

    def _drag_elements(self) -> None:
        """Let the user drag the element under the mouse from every heatmap."""
        for widget in self._display.places.get("heatmaps", []):
            if widget.findChild(Dragging) is None:
                Dragging(widget, lambda: [element_name(self._selection.element)])

    # Requests

    def _select(self, element: int) -> None:
        """Offer the readings of an element."""
        if self._history.settings.region != Region.ELEMENTS:  # else a click selects what is scanned
            self._element = element
            self.show_settings(self._history.settings)

    def _select_at(self, x: float, y: float) -> None:
        sensor = self._session.status.sensor
        if sensor is not None:
            away = np.linalg.norm(sensor.layout.positions - (x, y), axis=1)
            self._select(int(np.argmin(away)))

    def _toggle(self, name: str) -> None:
        shown = self._history.settings.strips
        if name not in shown:
            self._add([name])
            return
        others = tuple(one for one in shown if one != name)
        self._history.change(f"Hide {label_of(name)} over time", -1, strips=others)

    def _add(self, names: list[str]) -> None:
        shown = self._history.settings.strips
        if new := [name for name in names if name not in shown]:
            text = f"Show {label_of(new[0])} over time"
            self._history.change(text, -1, strips=(*shown, *new))

    def _set_span(self, seconds: float) -> None:
        self._history.change("Time of the strip chart", -1, strip_seconds=seconds)

    def show_settings(self, settings: Settings) -> None:
        self.panel.show_choice(
            self._shown(settings), settings.strip_seconds, self._length, self._element
        )
        for name in self.panel.charts:
            if element_of(name) >= 0 and name not in self._elements:
                self._elements[name] = StripHistory(self._kinds)
        self._next = 0.0

    def _shown(self, settings: Settings) -> list[str]:
        """What is selected, without elements that the sensor does not have."""
        sensor = self._session.status.sensor
        count = len(sensor.layout) if sensor else 0
        return [name for name in settings.strips if element_of(name) < count]

    @property
    def _kinds(self) -> int:
        sensor = self._session.status.sensor
        return len(sensor.layout.kind_names) if sensor else 1

    def _restart(self, status: Status) -> None:
        """Begin with another sensor."""
        self._elements, self._element = {}, -1
        if status.sensor is not None:
            layout = status.sensor.layout
            shown = [SHOWN_UNITS[unit] for unit in layout.kind_units]
            units = dict.fromkeys(unit for _, unit in shown)
            unit = ", ".join(units) if layout.reads else "1/m"
            scales = np.array([scale for scale, _ in shown])
            self.panel.show_readings(layout.kind_names, scales, unit)
            self.show_settings(self._history.settings)
        self._drag_elements()

    # Input

    def receive(self, estimate: Estimate) -> None:
        """Store the numbers of new estimates, before the engine drops them."""
        status, now = self._session.status, time.monotonic()
        frames = self._fingers[self._session.finger]
        if now < self._next_read and (status.connections, estimate.generation) == frames.key:
            return
        self._next_read = now + min(_PERIOD, _UNREAD / max(status.rate, 1.0))
        if status.connections != self._connection:
            self._connection = status.connections
            for history in (self._objects, *self._elements.values()):
                history.clear()
        elements = list(self._elements) if status.sensor is not None else []
        found = frames.read(self._session.engine, status, ["curvature"] * bool(elements))
        if found and elements and status.sensor is not None:
            times, read = found
            read = read if read.ndim == 3 else status.sensor.layout.by_kind(read)
            for name in elements:
                self._elements[name].append(times, read[:, :, element_of(name)])

    def _read_others(self) -> None:
        """Store the numbers of new estimates of the fingers that are not shown."""
        for finger in self._session.fingers.engines if self._session.fingers else ():
            if finger != self._session.finger:
                status = self._session.status_of(finger)
                self._fingers[finger].read(self._session.engine_of(finger), status)

    def _open(self, source: str) -> None:
        """Begin with another source: read the contacts of a recording."""
        self._reading.stop()
        self._length, self._zero = 0.0, math.nan
        if self._session.replaying:
            self._reading.compute(contacts_in, Path(source.removeprefix(RECORDED)))
        self.show_settings(self._history.settings)

    def _take_recorded(self, found: tuple[float, Array, dict[str, Array]]) -> None:
        """Store contacts of a recording."""
        length, times, fields = found
        if not self._length:
            self._length, self._last = max(length, _SHORTEST), 0.0
            self._recorded = _bins(self._length / _FINEST)
            self.show_settings(self._history.settings)
        if len(times):
            unknown = np.full(len(times), np.nan)
            each = {path: fields.get(path.rpartition(".")[2], unknown) for path in _PATHS}
            self._recorded.append(*broken(times, _columns(each), self._last))
            self._last = float(times[-1])

    def follow(self, status: Status) -> None:
        """Draw what is selected, some times a second."""
        now = time.monotonic()
        self._read_others()
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
        shown = self._fingers[self._session.finger]
        until, seconds = shown.history.last, self._history.settings.strip_seconds
        if not math.isfinite(until):
            return
        begin = until + (self.panel.part[0] if self.panel.part else -seconds)
        marks = _marks(self._session.status.events, shown.ahead)
        for name in self.panel.charts:
            if name in self._elements:
                self._draw_element(name, begin, until, marks)
            elif name == RADIUS:
                self.panel.show_span(name, self._objects.span(0, begin, _PARTS), None, until, marks)
            elif self._session.fingers is not None and self.panel.all_fingers.isChecked():
                self._draw_fingers(name, begin - until, until, marks)
            else:
                span = shown.history.span(_COLUMNS[name, False], begin, _PARTS)
                self.panel.show_span(name, span, self._sd(name, begin), until, marks)

    def _sd(self, name: str, begin: float) -> Span | None:
        """The standard deviation of a quantity of the finger shown, where it has one."""
        history, column = self._fingers[self._session.finger].history, (name, True)
        return history.span(_COLUMNS[column], begin, _PARTS) if column in _COLUMNS else None

    def _draw_fingers(
        self, name: str, since: float, until: float, marks: Sequence[StripMark]
    ) -> None:
        """Draw a quantity of all fingers, from `since` s ago, by the clock of this machine.

        For the finger shown that is until the time `until` of its device.
        """
        spans, session, column = (
            dict[str, tuple[Span, float]](),
            self._session,
            _COLUMNS[name, False],
        )
        ahead = self._fingers[session.finger].ahead
        for finger in session.fingers.engines if session.fingers else ():
            frames = self._fingers[finger]
            zero = until if finger == session.finger else until - ahead + frames.ahead
            if math.isfinite(zero):
                spans[finger] = frames.history.span(column, zero + since, _PARTS), zero
        sd = self._sd(name, until + since)
        self.panel.show_fingers(name, spans, session.finger, sd, marks)

    def _draw_element(self, name: str, begin: float, zero: float, marks: list[StripMark]) -> None:
        history = self._elements[name]
        spans = [history.span(column, begin, _PARTS) for column in range(history.columns)]
        self.panel.show_element(name, spans, zero, marks)

    def _draw_recorded(self, replay: Replay | None) -> None:
        marks = _marks(replay.events[:_MOST_EVENTS] if replay else (), 0.0)
        estimate = self._session.estimate
        if replay:
            marks.append(StripMark(replay.at, NOW))
        if replay and estimate is not None:
            zero = estimate.device_time - replay.at
            # Both are of nearly the same time: the curve is not to tremble.
            self._zero = self._zero if abs(zero - self._zero) < _NEARLY else zero
        begin, end = self.panel.part or (0.0, math.inf)

        def span(column: int) -> Span:
            return self._recorded.span(column, begin, end, _PARTS)

        for name in self.panel.charts:
            if name in self._elements:
                each = [replace(mark, time=mark.time + self._zero) for mark in marks]
                self._draw_element(name, begin + self._zero, self._zero, each)
                continue
            of = _COLUMNS.get((name, False))
            sd = _COLUMNS.get((name, True))
            shown = Span(np.empty(0), np.empty((3, 0))) if of is None else span(of)
            self.panel.show_span(name, shown, None if sd is None else span(sd), 0.0, marks)


def _marks(events: Sequence[Event], ahead: float) -> list[StripMark]:
    """Marks of `events` on a clock that is so many s `ahead` of theirs."""
    return [
        StripMark(event.time + ahead, event.kind if event.kind in MARKS else "event", event.text)
        for event in events
    ]
