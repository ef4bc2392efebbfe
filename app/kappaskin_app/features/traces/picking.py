"""Elements that are pointed at, and picked to be told all about."""

import time

import numpy as np
from PySide6.QtCore import QObject, Signal

from kappaskin.estimation import amplitude_spectrum
from kappaskin.frames import Estimate
from kappaskin_app.features.traces.element_card import ElementCard, Traces
from kappaskin_app.features.traces.facts import facts, title
from kappaskin_app.features.traces.past import SECONDS, Past
from kappaskin_app.guard import guarded
from kappaskin_app.shell.display import Display
from kappaskin_app.shell.history import History
from kappaskin_app.shell.selection import Selection
from kappaskin_app.shell.session import Session
from kappaskin_app.shell.settings import Settings
from kappaskin_app.theme import Theme

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
        read = values[:, :, 0]
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

    def show_theme(self, theme: Theme) -> None:
        self.card.show_theme(theme)
        self.traces.show_theme(theme)
