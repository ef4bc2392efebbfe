"""The operator's view between the window that it fills, the session, and the hand that moves."""

import math
import time
from dataclasses import dataclass

from PySide6.QtCore import QByteArray, QObject, QRect, Qt
from PySide6.QtWidgets import QDockWidget, QMainWindow, QToolBar, QWidget

from kappaskin.contact import ContactObject
from kappaskin.frames import Estimate
from kappaskin.live import Status
from kappaskin_app.features.presenter.feedback import Cue, Found, cue_of
from kappaskin_app.features.presenter.indicators import REMEDIES, age_in_words
from kappaskin_app.features.presenter.pad import THINGS, Hand
from kappaskin_app.features.presenter.sound import Sound
from kappaskin_app.features.presenter.view import Stage
from kappaskin_app.guard import guarded
from kappaskin_app.shell.badge import GAP, SIM, origin
from kappaskin_app.shell.banner import Offer
from kappaskin_app.shell.display import Display
from kappaskin_app.shell.docks import drawn_once
from kappaskin_app.shell.loads import may_choose, touches_at
from kappaskin_app.shell.selection import LoadHandle
from kappaskin_app.shell.session import Session

TIP = "Fill the screen with what is felt, to be read from three metres; Escape leaves"
SOUND_TIP = "A tone that rises and swells with the force, while the presenter is shown"
_READ = 0.15  # s between two readings of the figures: faster cannot be read
_FELT = 0.03  # s between two drawings of the bar
_OLD = 1.0  # s after which an object that was found is no longer one that touches


@dataclass(frozen=True)
class _Before:
    """How the window was before it was filled."""

    layout: QByteArray
    place: QRect
    state: Qt.WindowState


class Presenting(QObject):
    """Fills the screen with the `stage` and leaves it again; shows there what comes in."""

    def __init__(
        self,
        window: QMainWindow,
        stage: Stage,
        session: Session,
        display: Display,
        load: LoadHandle,
    ) -> None:
        super().__init__(window)
        self._window, self.stage, self._session = window, stage, session
        self._display, self._load = display, load
        self._before: _Before | None = None
        self.cue: Cue | None = None
        self.sound = Sound(self)
        self._found: Found | None = None
        self._found_at = -math.inf
        self._next_figures = self._next_felt = 0.0
        pad = stage.operator.pad
        pad.grabbed.connect(load.grabbed)
        pad.dragged.connect(load.dragged)
        pad.pressed.connect(load.pressed)
        pad.released.connect(load.released)
        pad.given_up.connect(load.given_up)
        stage.operator.chosen.connect(guarded(self._choose))

    @property
    def on(self) -> bool:
        return self._before is not None

    # In and out.

    def turn(self) -> None:
        self.leave() if self.on else self.enter()

    def enter(self) -> None:
        """Fill the screen with the skin and what is felt."""
        if self.on:
            return
        window = self._window
        self._before = _Before(window.saveState(), window.geometry(), window.windowState())
        with drawn_once(window):
            for part in self._around():
                part.hide()
            self.stage.present(True)
            self._show_hand()
            window.showFullScreen()
        self.stage.operator.pad.setFocus()

    def leave(self) -> None:
        """Have the window as it was."""
        if self._before is None:
            return
        window, before = self._window, self._before
        self._before = None
        self.stage.operator.pad.let_go()
        self.sound.follow(math.nan)
        with drawn_once(window):
            self.stage.present(False)
            window.setWindowState(before.state)
            if before.state == Qt.WindowState.WindowNoState:
                window.setGeometry(before.place)
            window.menuBar().show()
            window.statusBar().show()
            window.restoreState(before.layout)

    def close(self) -> None:
        """Before the window goes: let nothing be let go later, nor go on sounding."""
        self.stage.operator.pad.give_up()
        self.sound.close()

    def _around(self) -> list[QWidget]:
        window = self._window
        docks = window.findChildren(QDockWidget, options=Qt.FindChildOption.FindDirectChildrenOnly)
        bars = window.findChildren(QToolBar, options=Qt.FindChildOption.FindDirectChildrenOnly)
        return [*docks, *bars, *window.findChildren(Offer), window.menuBar(), window.statusBar()]

    # What comes in.

    def find(self, what: ContactObject, within: Estimate) -> None:
        """Take up what was found to touch the skin `within` an estimate."""
        self._found = Found(what, within.contact) if what.probability else None
        self._found_at = time.monotonic()

    def receive(self, _: Estimate) -> None:
        """Show what is felt by now, as often as that can be seen."""
        now = time.monotonic()
        if self.on and now >= self._next_felt:
            self._feel(now)

    def _feel(self, now: float) -> None:
        self._next_felt = now + _FELT
        estimate = self._display.estimate_shown()
        found = self._found if now - self._found_at < _OLD else None
        self.cue = None if estimate is None else cue_of(estimate, found)
        self.stage.show_felt(self.cue, now)
        self.sound.follow(self.stage.bar.share)
        if now >= self._next_figures:
            self._next_figures = now + _READ
            why_none = "no reading" if estimate is None else "nothing felt"
            self.stage.show_cue(self.cue, why_none, self._session.replaying)

    def follow(self, status: Status) -> None:
        """Show how live it is, and what to do if it is not."""
        if not self.on:
            return
        state, now = self._session.badge(), time.monotonic()
        if state not in REMEDIES:
            age = "" if self._display.old else age_in_words(*self._display.age())
            self.stage.show_trouble("", "", "")
        else:
            # What was recorded has a time in the recording, and no age.
            age = "" if state == GAP else age_in_words(now - status.last_frame)
            since = self._session.alarm().partition("\n")[0].removeprefix(state).strip()
            self.stage.show_trouble(state, since, status.message.replace("`", ""))
        self._feel(now)  # a recording that stands, or has a gap, brings no estimate
        self.stage.strip.show_state(state, _called(status), age)
        self._show_hand()

    def _show_hand(self) -> None:
        """Show where the simulated hand is, if there is one."""
        session = self._session
        scene, inside = session.scene, session.inside and origin(session.badge()) == SIM
        there = touches_at(scene, session.time) if inside else []
        self.stage.show_operating(bool(there) or (inside and self.stage.operator.pad.holding))
        if there:
            load = there[0].load
            x, y = (float(value) for value in load.centre())
            self.stage.operator.pad.show_skin(scene.plate.patch)
            self.stage.operator.show_hand(Hand(x, y, load.force), session.refusal)
            things = [number for number, thing in enumerate(THINGS) if thing.is_in(scene)]
            self.stage.operator.show_choice(
                may_choose(scene) and not session.refusal, (things or [-1])[0]
            )

    def _choose(self, number: int) -> None:
        hand = self.stage.operator.pad.hand
        if hand is not None:
            self._load.replaced.emit(THINGS[number].said, *hand)


def _called(status: Status) -> str:
    """What is read, in words."""
    return status.sensor.name if status.sensor is not None else status.source
