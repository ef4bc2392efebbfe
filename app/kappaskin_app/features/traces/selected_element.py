"""The picked element: its facts, its readings of the last seconds, and traces."""

import math
import time

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QObject, Signal

from kappaskin.calibration import Calibration
from kappaskin.frames import COMPONENTS, Estimate
from kappaskin.live import Status
from kappaskin.pipeline import REPORTED, Reported, ReportedQuantity
from kappaskin.sensing import Sensor
from kappaskin_app.features.traces.element_panel import TRACED, ElementCard, Traces
from kappaskin_app.guard import guarded
from kappaskin_app.shell.display import Display
from kappaskin_app.shell.history import History
from kappaskin_app.shell.selection import Selection
from kappaskin_app.shell.session import Session
from kappaskin_app.shell.settings import Settings
from kappaskin_app.widgets.parts import with_error

Array = NDArray[np.float64]

SECONDS = 10.0
"""How far back it reaches."""
_LEAST = 0.002  # s between two that are kept
_ROUNDING = 1e-6  # of a step: frames at just that rate are all kept
_LARGEST = 24e6  # bytes: of a large skin they are kept farther apart


class Past:
    """Readings as they come, written round and round."""

    def __init__(self) -> None:
        self.forget(0)

    def forget(self, elements: int) -> None:
        """Begin anew with so many `elements`."""
        rows = len(COMPONENTS) * len(TRACED)
        self._least = max(_LEAST, SECONDS * 4 * rows * elements / _LARGEST)
        count = round(SECONDS / self._least) + 1
        self._times = np.full(count, np.nan)
        self._read: NDArray[np.float32] = np.empty((count, rows, elements), np.float32)
        self._next, self._last = 0, -np.inf

    def take(self, times: Array, readings: Array) -> None:
        """Keep `readings` (T, rows, P) at `times` (T,) in s, those not too near to another."""
        elements = readings.shape[2]
        for at, read in zip(times.tolist(), readings, strict=True):
            if elements != self._read.shape[2] or at < self._last:
                self.forget(elements)  # another sensor, or one that began anew
            if at - self._last >= (1 - _ROUNDING) * self._least:
                self._times[self._next], self._read[self._next] = at, read
                self._next, self._last = (self._next + 1) % len(self._times), at

    def of(self, elements: list[int]) -> tuple[Array, Array]:
        """Times (T,) in s before the newest, upwards, and readings (T, rows, k) of k `elements`."""
        order = np.roll(np.arange(len(self._times)), -self._next)
        order = order[self._times[order] > self._last - SECONDS]
        read = self._read[order[:, None], :, np.asarray(elements, np.intp)]
        return self._times[order] - self._last, read.swapaxes(1, 2).astype(float)


_READ = tuple(quantity for quantity in REPORTED if quantity.element_head)
_HEADS = (
    *("", *(f"{quantity.element_head} [{quantity.unit}]" for quantity in _READ)),
    *("gain", "offset [1/m]", "channel", "health"),
)


def facts(element: int, sensor: Sensor, status: Status, estimate: Estimate) -> str:
    """A table in HTML of the three channels of an element."""
    rows = [_row(element, number, sensor, status, estimate) for number in range(3)]
    cells = ["".join(f"<th align='left'>{head}&nbsp;&nbsp;</th>" for head in _HEADS)]
    cells += ["".join(f"<td>{cell}&nbsp;&nbsp;</td>" for cell in row) for row in rows]
    return (
        "<table style='white-space: nowrap'>"
        + "".join(f"<tr>{row}</tr>" for row in cells)
        + "</table>"
    )


def title(element: int, sensor: Sensor, moved: float, moved_sd: float) -> str:
    """Which element it is, where, and how far in mm the skin `moved` there."""
    x, y = 1e3 * sensor.layout.positions[element]
    inward = with_error(moved, moved_sd, 3, "mm")
    return f"<b>Element {element}</b> at ({x:.1f}, {y:.1f}) mm; the skin moved in by {inward} there"


def _row(
    element: int, number: int, sensor: Sensor, status: Status, estimate: Estimate
) -> tuple[str, ...]:
    channel = number * len(sensor.layout) + element
    found = [f for f in status.health.findings if f.channel == channel]
    health = "; ".join(f"{f.kind}: {f.figure}" for f in found) or "well"
    reported = Reported(estimate)
    return (
        f"<b>{COMPONENTS[number]}</b>",
        *(_read(quantity, reported, number, element) for quantity in _READ),
        *_calibrated(status.setup.calibration, channel),
        str(_converted(sensor, channel)),
        "dead: the device says so" if sensor.layout.lacking[number, element] else health,
    )


def _read(quantity: ReportedQuantity, reported: Reported, row: int, element: int) -> str:
    """A component of a quantity of an element, with its error bar if it has one."""
    found = [of(reported) for suffix, _, of in quantity.forms if suffix != "_95"]
    value, sd = np.broadcast_arrays(*found, math.nan)[:2]
    return with_error(value[row, element], sd[row, element], quantity.shown[2], sign="+")


def _calibrated(calibration: Calibration | None, channel: int) -> tuple[str, str]:
    if calibration is None:
        return "1 (nominal)", "0 (nominal)"
    c = calibration
    return (
        with_error(c.gain[channel], c.gain_sd[channel], 3),
        with_error(c.offset[channel], c.offset_sd[channel], 2, sign="+"),
    )


def _converted(sensor: Sensor, channel: int) -> int:
    """The number on the wire of what reads this channel."""
    wired = sensor.channel_map
    return channel if wired is None else int(np.flatnonzero(wired == channel)[0])


_PLOTS = 0.1  # s between two drawings of the plots
_WORDS = 0.25  # s between two readings of the facts
_SPECTRA = 1.0  # s between two spectra of the last ten
_ENOUGH = 32  # readings for a spectrum
_LINES = 160  # of it at most


class Picking(QObject):
    """Shows the card of the element that is picked, and traces of those chosen.

    `picked` says that one was.
    """

    picked = Signal(int)

    def __init__(
        self, history: History, session: Session, display: Display, selection: Selection
    ) -> None:
        super().__init__(display)
        self._selection = selection
        self._history, self._session, self._display = history, session, display
        self.card, self.traces = ElementCard(), Traces()
        self.element = -1
        self._past, self._met = Past(), 0
        self._of, self._after = (0, 0), 0
        self._next_plots = self._next_words = self._next_spectrum = 0.0
        session.estimated.connect(guarded(self.receive))
        history.changed.connect(guarded(self._follow))
        selection.over.connect(guarded(self._point))
        selection.clicked.connect(guarded(self._click))
        self.card.traced.connect(guarded(self._trace))
        self.traces.pointed.connect(guarded(selection.point))
        selection.pointed.connect(self.traces.mark)
        selection.chosen.connect(guarded(self._choose))

    def pick(self, element: int) -> None:
        """Tell all about an element."""
        self.picked.emit(element)
        if element != self.element:
            self._history.step(f"pick element {element}", self._have, self.element, element)

    def _have(self, element: int) -> None:
        """Tell all about an element, or about none: of another skin there may be fewer."""
        sensor = self._session.status.sensor
        self.element = element if sensor is not None and element < len(sensor.layout) else -1
        self._next_plots = self._next_words = self._next_spectrum = 0.0
        if self.element < 0:
            self.card.show_facts("", "")
        self._show_tracing()

    def _choose(self, element: int) -> None:
        if self._history.settings.region != "elements":  # or a click chooses what is scanned
            self.pick(element)

    def _click(self, x: float, y: float) -> None:
        self.pick(self._nearest((x, y)))

    def _point(self, place: "np.ndarray[tuple[int], np.dtype[np.float64]] | None") -> None:
        self._selection.point(-1 if place is None else self._nearest(place))

    def _nearest(self, place: object) -> int:
        """The element next to a place (2,) in m; -1 without a sensor."""
        sensor = self._session.status.sensor
        if sensor is None:
            return -1
        return int(np.argmin(np.linalg.norm(sensor.layout.positions - np.asarray(place), axis=1)))

    def _trace(self) -> None:
        traced = self._history.settings.traced
        if self.element in traced:
            kept = tuple(one for one in traced if one != self.element)
            self._history.change("Trace no more", -1, traced=kept)
        elif self.element >= 0:
            self._history.change("Trace an element", -1, traced=(*traced, self.element))

    # What comes in.

    def receive(self, estimate: Estimate) -> None:
        """Keep what is read, and show it as often as it can be seen."""
        status, now = self._session.status, time.monotonic()
        if status.meetings != self._met:
            self._met, self.element = status.meetings, -1
            self._past.forget(0)  # another skin may have as many elements, on a clock that goes on
            self.card.show_facts("", "")
        key = status.meetings, estimate.generation
        if key != self._of:
            self._of, self._after = key, 0
        times, readings, self._after = self._session.engine.recent(status, self._after)
        self._past.take(times, readings)
        if self.card.isVisible() and self.element >= 0:
            self._show_card(estimate, now)
        if now >= self._next_plots:
            self._next_plots = now + _PLOTS
            if self.traces.isVisible():
                self._show_traces(estimate.curvature.shape[1])

    def _show_card(self, estimate: Estimate, now: float) -> None:
        if now >= self._next_plots:
            times, values = self._past.of([self.element])
            self.card.show_past(times, values[:, :, 0], SECONDS)
        if now >= self._next_words:
            self._next_words = now + _WORDS
            self._show_facts(estimate)
        if now >= self._next_spectrum:
            self._next_spectrum = now + _SPECTRA
            self._show_spectrum()

    def _show_facts(self, estimate: Estimate) -> None:
        status, colouring = self._session.status, self._display.colouring
        if status.sensor is None or self.element >= len(status.sensor.layout):
            return
        moved, sure = (
            float(colouring.of_elements(name, estimate)[self.element])
            for name in ("displacement", "error_bar")
        )
        told = facts(self.element, status.sensor, status, estimate)
        self.card.show_facts(title(self.element, status.sensor, moved, sure), told)

    def _show_spectrum(self) -> None:
        times, values = self._past.of([self.element])
        read = values[:, : len(COMPONENTS), 0]
        # A component that a dead channel lacks is nothing; a frame that lacks any is left out.
        there = np.isfinite(read).any(axis=0)
        whole = np.isfinite(read[:, there]).all(axis=1)
        if whole.sum() < _ENOUGH or not there.any():
            self.card.show_spectrum(np.empty(0), np.empty((3, 0)))
            return
        times, read = times[whole], np.where(there, read[whole], 0.0)
        span = float(times[-1] - times[0])
        highest = (len(times) - 1) / span / 2
        count = min(_LINES, max(round(highest * span), 2))
        frequencies = np.linspace(highest / count, highest, count)
        self.card.show_spectrum(frequencies, amplitude_spectrum(times, read.T, frequencies))

    def _show_traces(self, elements: int) -> None:
        traced = [one for one in self._history.settings.traced if one < elements]
        self.traces.show_past(traced, *self._past.of(traced), SECONDS)

    # How it is shown.

    def _follow(self, settings: Settings) -> None:
        self._show_tracing()
        self._next_plots = 0.0

    def _show_tracing(self) -> None:
        self.card.show_tracing(self.element in self._history.settings.traced)


_VANISHING = 1e-9  # of a wave's mean square: a sine of half the rate is zero at even steps


def amplitude_spectrum(times: Array, values: Array, frequencies: Array) -> Array:
    """Amplitudes (..., F) of sines of `frequencies` (F,) in Hz in `values` (..., T), in their unit.

    By least squares at the `times` (T,) in s, after subtraction of the mean: the Lomb-Scargle
    spectrum (doi:10.1007/BF00648343), which needs no even steps.
    """
    centred = values - values.mean(axis=-1, keepdims=True)
    turn = 2 * np.pi * np.multiply.outer(frequencies, times)
    waves = np.cos(turn) + 1j * np.sin(turn)
    # At this shift of time sine and cosine are orthogonal over the times there are.
    twice = np.einsum("ft,ft->f", waves, waves)
    shifted = centred @ waves.T * np.exp(-0.5j * np.angle(twice))
    squares = (len(times) + np.abs(twice)) / 2, (len(times) - np.abs(twice)) / 2
    cosine, sine = (np.where(s > _VANISHING * len(times), s, np.inf) for s in squares)
    return np.hypot(shifted.real / cosine, shifted.imag / sine)
