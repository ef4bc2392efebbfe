"""Presenter controller: full screen, estimates, and the simulated hand."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

from PySide6.QtCore import QEvent, QObject, QRect, Qt, QTimer
from PySide6.QtWidgets import QDockWidget, QMainWindow, QScrollBar, QToolBar, QWidget

from kappaskin.contact import ContactObject
from kappaskin.frames import Estimate
from kappaskin.live import Status
from kappaskin_app.features.presenter.feedback import Feedback, Recognised, feedback_of
from kappaskin_app.features.presenter.indicators import REMEDIES, age_in_words
from kappaskin_app.features.presenter.view import DEMO_OBJECTS, Hand, PresenterView
from kappaskin_app.guard import guarded
from kappaskin_app.shell.badge import GAP, PAUSED, SIM, origin
from kappaskin_app.shell.display import Display
from kappaskin_app.shell.docks import drawn_once
from kappaskin_app.shell.loads import loads_at, object_replaceable
from kappaskin_app.shell.selection import LoadHandle
from kappaskin_app.shell.session import Session
from kappaskin_app.shell.sound import Sound

TIP = "Estimates in full screen, legible from three metres; Esc ends"
SOUND_TIP = "A tone whose pitch and loudness follow the force, while the presenter is shown"
_DRAWING_PERIOD = 0.03  # s between two drawings of the force bar
_SETTLES = 1.0  # s in which a window that left full screen gets its size back
_OLD = 1.0  # s after which a recognised object is discarded
_FADED = 0.5  # scale of a haptic cue below which that is shown
_SHOWN = 1.0  # s for which it is at least: it may last a twentieth of that


_CUE_FADED = "The operator feels nothing: the haptic cue has faded."


@dataclass(frozen=True)
class _WindowState:
    """State of the window before full screen; `arrange` puts its docks in their places."""

    arrange: Callable[[], object]
    place: QRect
    state: Qt.WindowState
    shown: list[QWidget]
    scrolled: dict[QScrollBar, int]


class PresenterController(QObject):
    """Shows the `view` in full screen, with the estimates and the state of the session."""

    def __init__(
        self,
        window: QMainWindow,
        view: PresenterView,
        session: Session,
        display: Display,
        load: LoadHandle,
    ) -> None:
        super().__init__(window)
        self._window, self.view, self._session = window, view, session
        self._display, self._load = display, load
        self._before: _WindowState | None = None
        self._left: _WindowState | None = None
        self._left_at, self._resized = -math.inf, False
        self._restoring = QTimer(self, singleShot=True)  # pyright: ignore[reportCallIssue]
        self._restoring.timeout.connect(guarded(self._restore))
        window.installEventFilter(self)
        self.feedback: Feedback | None = None
        self.sound = Sound(self)
        self._recognised: Recognised | None = None
        self._recognised_at = -math.inf
        self._next_drawing = 0.0
        self._faded, self._faded_at = ("", ""), -math.inf
        view.controls.chosen.connect(guarded(self._select_object))

    @property
    def on(self) -> bool:
        return self._before is not None

    # Full screen.

    def toggle(self) -> None:
        self.leave() if self.on else self.enter()

    def enter(self) -> None:
        """Show the skin and the estimates in full screen."""
        if self.on:
            return
        window = self._window
        shown = [part for part in self._surroundings() if part.isVisible()]
        self._before = _WindowState(
            partial(window.restoreState, window.saveState()),
            *(window.geometry(), window.windowState(), shown),
            {bar: bar.value() for dock in shown for bar in dock.findChildren(QScrollBar)},
        )
        with drawn_once(window):
            for part in shown:
                part.hide()
            self.view.present(True)
            self._show_hand()
            window.showFullScreen()
        self._display.show_numbers_soon()
        self._display.centre.setFocus()  # for the keys that move and press

    def leave(self, arrange: Callable[[], object] | None = None) -> None:
        """Restore the window, with its docks where they were or where `arrange` puts them."""
        if self._before is None:
            return
        window, before = self._window, self._before
        if arrange is not None:
            rest = [part for part in before.shown if not isinstance(part, QDockWidget)]
            before = replace(before, arrange=arrange, shown=rest)
        self._before = None
        self.sound.set_levels()
        with drawn_once(window):
            self.view.present(False)
            window.setWindowState(before.state)
            if before.state == Qt.WindowState.WindowNoState:
                window.setGeometry(before.place)
            for part in before.shown:
                part.show()
            before.arrange()
        self._left, self._left_at, self._resized = before, time.monotonic(), False
        self._restoring.start(0)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        # A window manager may resize the window a while after it was asked to.
        if event.type() == QEvent.Type.Resize and time.monotonic() - self._left_at < _SETTLES:
            self._resized = True
            self._restoring.start(0)
        return False

    def _restore(self) -> None:
        """Restore the sizes of docks and the scrolled positions in a window of its old size."""
        if self._left is not None and not self.on:
            if self._resized:
                self._left.arrange()
                self._resized = False
            for bar in self._window.findChildren(QScrollBar):  # without those deleted since
                bar.setValue(self._left.scrolled.get(bar, bar.value()))

    def close(self) -> None:
        """Stop the sound before the window closes."""
        self.sound.close()

    def _surroundings(self) -> list[QWidget]:
        window = self._window
        docks = window.findChildren(QDockWidget, options=Qt.FindChildOption.FindDirectChildrenOnly)
        bars = window.findChildren(QToolBar, options=Qt.FindChildOption.FindDirectChildrenOnly)
        return [*docks, *bars, window.menuBar(), window.statusBar()]

    # Input.

    def set_object(self, what: ContactObject, within: Estimate) -> None:
        """Store the object that was recognised `within` an estimate."""
        self._recognised = Recognised(what, within.contact) if what.probability else None
        self._recognised_at = time.monotonic()

    def receive(self, _: Estimate) -> None:
        """Show the present estimate, at a visible rate."""
        now = time.monotonic()
        if self.on and now >= self._next_drawing:
            self._show_estimate(now)

    def _show_estimate(self, now: float) -> None:
        self._next_drawing = now + _DRAWING_PERIOD
        estimate = self._display.estimate_shown()
        recognised = self._recognised if now - self._recognised_at < _OLD else None
        self.feedback = None if estimate is None else feedback_of(estimate, recognised)
        self.view.show_graphics(self.feedback, now)
        self.sound.set_levels(self.view.bar.share)

    def show_numbers(self, estimate: Estimate | None) -> None:
        """Write the estimate whose numbers are shown elsewhere, too."""
        if self.on:
            self._show_estimate(time.monotonic())
            why_none = "no reading" if estimate is None else "no contact"
            self.view.show_feedback(self.feedback, why_none, self._session.replaying)

    def follow(self, status: Status) -> None:
        """Show the state and age of the data, and a remedy where no data arrives."""
        if not self.on:
            return
        state, now = self._session.badge(), time.monotonic()
        latency = self._follow_cues(status, now)
        if state not in REMEDIES:
            age = "" if self._display.old else age_in_words(*self._display.age())
            shown = now - self._faded_at < _SHOWN and PAUSED not in state
            self.view.show_trouble(*(self._faded if shown else ("", "")), _CUE_FADED)
        else:
            # Recorded data has a time in the recording, and no age.
            age = "" if state == GAP else age_in_words(now - status.last_frame)
            latency = ""
            since = self._session.alarm().partition("\n")[0].removeprefix(state).strip()
            self.view.show_trouble(state, since, status.message.replace("`", ""))
        self._show_estimate(now)  # a paused recording, or a gap, emits no estimate
        self.view.strip.show_state(state, _source_name(status), age, latency)
        self._show_hand()

    def _follow_cues(self, status: Status, now: float) -> str:
        """The latency of the haptic cues of all fingers, in words; a faded one is kept for a while.

        A cue fades before the badge says that there are no data.
        """
        fingers = self._session.fingers
        cues = [
            (finger, target.cue)
            for finger, each in (fingers.status() if fingers else {"": status}).items()
            for target in each.publishing.targets
            if target.cue is not None
        ]
        for finger, cue in cues:
            if cue.scale < _FADED and cue.state.upper() in REMEDIES:
                self._faded, self._faded_at = (cue.state.upper(), finger), now
        known = [cue for _, cue in cues if math.isfinite(cue.most)]
        if not known:
            return ""
        half, most = (1e3 * max(getattr(cue, name) for cue in known) for name in ("half", "most"))
        return f"haptic cue {half:.1f} ms after the data, 99 % within {most:.1f} ms"

    def _show_hand(self) -> None:
        """Show the position of the simulated hand, if there is one."""
        session = self._session
        scene, inside = session.scene, session.inside and origin(session.badge()) == SIM
        there = loads_at(scene, session.time) if inside else []
        self.view.show_controls(bool(there))
        if there:
            load = there[0].load
            x, y = (float(value) for value in load.centre())
            self.view.controls.show_hand(Hand(x, y, load.force), session.refusal)
            present = [n for n, made in enumerate(DEMO_OBJECTS) if made.is_in(scene)]
            self.view.controls.show_objects(
                object_replaceable(scene) and not session.refusal, (present or [-1])[0]
            )

    def _select_object(self, number: int) -> None:
        hand = self.view.controls.hand_text.hand
        if hand is not None:
            self._load.replaced.emit(DEMO_OBJECTS[number].settings, *hand)


def _source_name(status: Status) -> str:
    return status.sensor.name if status.sensor is not None else status.source
