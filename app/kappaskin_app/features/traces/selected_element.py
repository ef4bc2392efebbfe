"""Selected element: facts, history, spectrum and traces."""

import math
import time

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QObject, Signal

from kappaskin._text import with_error
from kappaskin.calibration import Calibration
from kappaskin.estimation import amplitude_spectrum
from kappaskin.frames import COMPONENTS, Array, Estimate
from kappaskin.live import Status
from kappaskin.pipeline import REPORTED, Reported, ReportedQuantity
from kappaskin.sensing import Sensor, SensorLayout
from kappaskin_app.features.traces.element_panel import (
    SECONDS,
    TRACED,
    ElementPanel,
    Traces,
    scales_of,
)
from kappaskin_app.guard import guarded
from kappaskin_app.shell.display import Display
from kappaskin_app.shell.history import History
from kappaskin_app.shell.selection import Selection
from kappaskin_app.shell.session import Session
from kappaskin_app.shell.settings import Settings
from kappaskin_app.widgets.text import Coverage

_LEAST_PERIOD = 0.002  # s between two stored frames
_GAP = 0.5  # s without a frame, as where a replay goes elsewhere, that a curve does not cross
_ROUNDING = 1e-6  # of a period: at exactly that rate all frames are stored
_MOST_BYTES = 24e6  # of the buffer: with many elements fewer frames are stored


class ReadingBuffer:
    """Ring buffer of the readings of the last seconds."""

    def __init__(self) -> None:
        self.clear(0)

    def clear(self, elements: int, rows: int = len(COMPONENTS) * len(TRACED)) -> None:
        """Start again, empty, for so many `elements` with so many `rows` of readings."""
        self._least = max(_LEAST_PERIOD, SECONDS * 4 * rows * elements / _MOST_BYTES)
        count = round(SECONDS / self._least) + 1
        self._times = np.full(count, np.nan)
        self._read: NDArray[np.float32] = np.empty((count, rows, elements), np.float32)
        self._next, self._last = 0, -np.inf

    def append(self, times: Array, readings: Array) -> None:
        """Store `readings` (T, rows, P) at `times` (T,) in s, thinned to the buffer's period."""
        rows, elements = readings.shape[1:]
        for at, read in zip(times.tolist(), readings, strict=True):
            if (rows, elements) != self._read.shape[1:] or at < self._last:
                self.clear(elements, rows)  # another sensor, or a restarted one
            if at - self._last > _GAP and self._last >= 0:
                self._put((at + self._last) / 2, np.full_like(read, np.nan))
            if at - self._last >= (1 - _ROUNDING) * self._least:
                self._put(at, read)
                self._last = at

    def _put(self, at: float, read: Array) -> None:
        self._times[self._next], self._read[self._next] = at, read
        self._next = (self._next + 1) % len(self._times)

    def of(self, elements: list[int]) -> tuple[Array, Array]:
        """Times (T,) in s relative to the newest, and readings (T, rows, k) of k `elements`."""
        order = np.roll(np.arange(len(self._times)), -self._next)
        order = order[self._times[order] > self._last - SECONDS]
        read = self._read[order[:, None], :, np.asarray(elements, np.intp)]
        return self._times[order] - self._last, read.swapaxes(1, 2).astype(float)


_READ = tuple(quantity for quantity in REPORTED if quantity.element_head)
_PATHS = [str(quantity.value) for quantity in TRACED]


def _by_kind(values: list[Array], layout: SensorLayout) -> Array:
    """Values (T, n k, P) of k traced quantities, each in the n kinds of readings of a layout."""
    each = [v if v.ndim == 3 else layout.by_kind(v) for v in values]
    return np.concatenate(each, axis=1)


def _heads(layout: SensorLayout) -> tuple[str, ...]:
    """The heads of the table of an element."""
    unit = "1/m" if not layout.reads else scales_of(layout)[1]
    read = (f"{quantity.element_head} [{unit}]" for quantity in _READ)
    return ("", *read, "gain", f"offset [{unit}]", "channel", "health")


def facts(element: int, sensor: Sensor, status: Status, estimate: Estimate) -> str:
    """HTML table of the channels of an element."""
    channels = np.flatnonzero(sensor.layout.element == element).tolist()
    rows = [_row(channel, sensor, status, estimate) for channel in channels]
    heads = _heads(sensor.layout)
    cells = ["".join(f"<th align='left'>{head}&nbsp;&nbsp;</th>" for head in heads)]
    cells += ["".join(f"<td>{cell}&nbsp;&nbsp;</td>" for cell in row) for row in rows]
    return (
        "<table style='white-space: nowrap'>"
        + "".join(f"<tr>{row}</tr>" for row in cells)
        + "</table>"
    )


def title(element: int, sensor: Sensor, displacement: float, sd: float) -> str:
    """Number and position of an element, and the `displacement` of the skin there in mm.

    It ends with which error bars those of the element are.
    """
    x, y = 1e3 * sensor.layout.positions[element]
    bars = Coverage.now
    inward = with_error(displacement, bars.of(sd), "mm")
    at = f"<b>Element {element}</b> at ({x:.1f}, {y:.1f}) mm"
    return f"{at}; displacement {inward}; error bars: {bars.label}"


def _row(channel: int, sensor: Sensor, status: Status, estimate: Estimate) -> tuple[str, ...]:
    layout = sensor.layout
    kind = layout.kind[channel]
    scale = float(scales_of(layout)[0][kind])
    found = [f for f in status.health.findings if f.channel == channel]
    health = "; ".join(f"{f.kind}: {f.figure}" for f in found) or "OK"
    reported = Reported(estimate)
    return (
        f"<b>{layout.kind_names[kind]}</b>",
        *(_read(quantity, reported, channel, scale) for quantity in _READ),
        *_calibration_cells(status.setup.calibration, channel),
        str(_wire_channel(sensor, channel)),
        "dead: reported by the device" if layout.lacking.ravel()[channel] else health,
    )


def _read(quantity: ReportedQuantity, reported: Reported, channel: int, scale: float) -> str:
    """A quantity of a channel, `scale` times, with its error bar if it has one."""
    found = [of(reported) for suffix, _, of in quantity.forms if suffix != "_95"]
    each = np.broadcast_arrays(*found, math.nan)[:2]
    value, sd = (scale * float(one.flat[channel]) for one in each)
    return with_error(value, Coverage.now.of(sd), digits=quantity.shown[2], sign="+")


def _calibration_cells(calibration: Calibration | None, channel: int) -> tuple[str, str]:
    if calibration is None:
        return "1 (nominal)", "0 (nominal)"
    c, off = calibration, Coverage.now.of
    return (
        with_error(c.gain[channel], off(c.gain_sd[channel])),
        with_error(c.offset[channel], off(c.offset_sd[channel]), sign="+"),
    )


def _wire_channel(sensor: Sensor, channel: int) -> int:
    """The number of this channel in the device's messages."""
    wired = sensor.channel_map
    return channel if wired is None else int(np.flatnonzero(wired == channel)[0])


_PLOT_PERIOD = 0.1  # s between two drawings of the plots
_SPECTRUM_PERIOD = 1.0  # s between two spectra of the last ten
_FEWEST = 32  # readings for a spectrum
_MOST_LINES = 160  # of it at most


class SelectedElement(QObject):
    """The selected `element` (-1: none), its `panel`, and the `traces` of plotted elements.

    `selected` emits the element that a user selects.
    """

    selected = Signal(int)

    def __init__(
        self, history: History, session: Session, display: Display, selection: Selection
    ) -> None:
        super().__init__(display)
        self._selection = selection
        self._history, self._session, self._display = history, session, display
        self.panel, self.traces = ElementPanel(), Traces()
        self.element = -1
        self._buffer, self._connection = ReadingBuffer(), 0
        self._key, self._last_number = (0, 0), 0
        self._next_plots = self._next_spectrum = 0.0
        session.estimated.connect(guarded(self.receive))
        session.source_changed.connect(guarded(lambda *_: self._begin_anew()))
        display.numbers.connect(guarded(self._show_facts))
        history.changed.connect(guarded(self._show_settings))
        selection.over.connect(guarded(self._point))
        selection.clicked.connect(guarded(self._click))
        self.panel.plot_toggled.connect(guarded(self._toggle_plot))
        self.traces.pointed.connect(guarded(selection.point))
        selection.pointed.connect(self.traces.mark)
        selection.chosen.connect(guarded(self._select_chosen))

    def select(self, element: int) -> None:
        """Select an element; -1 for none."""
        self.selected.emit(element)
        self.element = element
        self._next_plots = self._next_spectrum = 0.0
        self._display.show_numbers_soon()
        if self.element < 0:
            self.panel.show_facts("", "")
        self._update_button()

    def _select_chosen(self, element: int) -> None:
        if self._history.settings.region != "elements":  # else a click selects the scan region
            self.select(element)

    def _click(self, x: float, y: float) -> None:
        self.select(self._nearest((x, y)))

    def _point(self, place: "np.ndarray[tuple[int], np.dtype[np.float64]] | None") -> None:
        self._selection.point(-1 if place is None else self._nearest(place))

    def _nearest(self, place: object) -> int:
        """The element next to a place (2,) in m; -1 without a sensor."""
        sensor = self._session.status.sensor
        if sensor is None:
            return -1
        return int(np.argmin(np.linalg.norm(sensor.layout.positions - np.asarray(place), axis=1)))

    def _toggle_plot(self) -> None:
        traced = self._history.settings.traced
        if self.element in traced:
            others = tuple(one for one in traced if one != self.element)
            self._history.change("Stop plotting an element", -1, traced=others)
        elif self.element >= 0:
            self._history.change("Plot an element", -1, traced=(*traced, self.element))

    # Input.

    def receive(self, estimate: Estimate) -> None:
        """Store the readings of new frames, and update the visible plots."""
        status, now = self._session.status, time.monotonic()
        if status.connections != self._connection:
            self._connection = status.connections
            if status.sensor is not None:
                self.panel.show_layout(status.sensor.layout)
                self.traces.show_layout(status.sensor.layout)
            self._begin_anew()
        key = status.connections, estimate.generation
        if key != self._key:
            self._key, self._last_number = key, 0
        engine = self._session.engine
        times, traced, self._last_number = engine.recent(status, self._last_number, _PATHS)
        if traced and status.sensor is not None:
            self._buffer.append(times, _by_kind(traced, status.sensor.layout))
        if self.panel.isVisible() and self.element >= 0:
            self._show_panel(now)
        if now >= self._next_plots:
            self._next_plots = now + _PLOT_PERIOD
            if self.traces.isVisible():
                self._show_traces(len(estimate.suspect))

    def _begin_anew(self) -> None:
        """Show nothing of another source: it may have as many elements and a later clock."""
        self.element = -1
        self._buffer.clear(0)
        self.panel.show_facts("", "")
        for plot in (*self.panel.histories, self.panel.spectrum, *self.traces.plots):
            plot.show_series(())

    def _show_panel(self, now: float) -> None:
        if now >= self._next_plots:
            times, values = self._buffer.of([self.element])
            self.panel.show_history(times, values[:, :, 0])
        if now >= self._next_spectrum:
            self._next_spectrum = now + _SPECTRUM_PERIOD
            self._show_spectrum()

    def _show_facts(self, estimate: Estimate | None) -> None:
        """Write the facts of the frame of all other numbers."""
        status, colouring = self._session.status, self._display.colouring
        if estimate is None or self.element < 0 or not self.panel.isVisible():
            return
        if status.sensor is None or self.element >= len(status.sensor.layout):
            return
        displacement, sd = (
            float(colouring.of_elements(name, estimate)[self.element])
            for name in ("displacement", "error_bar")
        )
        head = title(self.element, status.sensor, displacement, sd)
        self.panel.show_facts(head, facts(self.element, status.sensor, status, estimate))

    def _show_spectrum(self) -> None:
        times, values = self._buffer.of([self.element])
        kinds = values.shape[1] // len(TRACED)
        read = values[:, :kinds, 0]
        # A dead channel counts as zero; frames that lack any other reading are excluded.
        known = np.isfinite(read).any(axis=0)
        whole = np.isfinite(read[:, known]).all(axis=1)
        if whole.sum() < _FEWEST or not known.any():
            self.panel.show_spectrum(np.empty(0), np.empty((kinds, 0)))
            return
        times, read = times[whole], np.where(known, read[whole], 0.0)
        span = float(times[-1] - times[0])
        highest = (len(times) - 1) / span / 2
        count = min(_MOST_LINES, max(round(highest * span), 2))
        frequencies = np.linspace(highest / count, highest, count)
        self.panel.show_spectrum(frequencies, amplitude_spectrum(times, read.T, frequencies))

    def _show_traces(self, elements: int) -> None:
        traced = [one for one in self._history.settings.traced if one < elements]
        self.traces.show_history(traced, *self._buffer.of(traced))

    # Display.

    def _show_settings(self, settings: Settings) -> None:
        self._update_button()
        self._next_plots = 0.0

    def _update_button(self) -> None:
        self.panel.show_plotted(self.element in self._history.settings.traced)
