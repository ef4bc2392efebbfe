"""Hand: a small map of each finger; a click shows the finger in the window."""

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtGui import QMouseEvent
from PySide6.QtWidgets import QButtonGroup, QHBoxLayout, QRadioButton, QVBoxLayout, QWidget

from kappaskin._text import NONE, rounded, with_error
from kappaskin.errors import Refusal
from kappaskin.frames import Contact, Estimate
from kappaskin.hand import Grasp, HeldObject, JointReceiver, Placement, is_hand
from kappaskin.live import Status
from kappaskin_app.features.hand.grasp import FingerReading, GraspRecognition, held_text, sums_of
from kappaskin_app.features.hand.hand_view import HandView, ShownFinger
from kappaskin_app.guard import guarded
from kappaskin_app.shell.background import Tasks
from kappaskin_app.shell.badge import LIVE, REPLAY, SIM, origin, state_of
from kappaskin_app.shell.colouring import SteadyRange, largest
from kappaskin_app.shell.opening import Kind
from kappaskin_app.shell.session import Session
from kappaskin_app.shell.window import MainWindow
from kappaskin_app.theme import FAINT, follow_look
from kappaskin_app.widgets.layout import Flow
from kappaskin_app.widgets.line import Line
from kappaskin_app.widgets.parts import Label, sentence, text_label
from kappaskin_app.widgets.surface_map import SurfaceMap
from kappaskin_app.widgets.text import Coverage
from kappaskin_app.widgets.tint import Tint

_ABOUT = (
    "The hand in 3-D, a map of each finger and what is held; a click shows a finger in the window"
)
_TIP = "Displacement of the skin, with a cross at the contact"
_EVERY = 100  # ms between two pictures of the maps
_MM = 1e3
_LEAST = 0.01  # mm, of the scale
_PERIOD = 0.3  # s between two recognitions of what is held
_APART = 12  # px between two fingers
_WIDEST = "(00.00, 00.00) \N{PLUS-MINUS SIGN} 0.000 mm"
_OLD_ANGLES = 1.0  # s
_HELD = "Held"
_TEXTS = {
    _HELD: "Plane, sphere, cylinder or edge that fits the places and normals of all contacts, with "
    "the 95 % interval of its radius",
    "Sum of forces": "Sum of the normal forces on what is held, along the axes of the hand",
    "Sum of moments": "Sum of the moments of the normal forces about the origin of the hand",
}
_UNDESCRIBED = (
    "To see the hand in 3-D, and what it holds, open the file that says where its fingers are: "
    "kappaskin app hand.toml."
)


class FingerView(QWidget):
    """The map of one finger and its contact; a click on it shows the finger in the window."""

    def __init__(self, finger: str) -> None:
        super().__init__()
        self.button = QRadioButton(finger)
        self.button.setToolTip(f"Show {finger} in the window, with its settings")
        self.map = SurfaceMap(finger, "mm", _TIP)
        self.map.title.hide()
        self.tint, self._scale = Tint("sequential", (0.0, _LEAST), "mm"), SteadyRange(_LEAST)
        self.force, self.place = Line(), Line()
        self.force.setToolTip("Normal force of the contact, with its error bar")
        self.place.setToolTip(
            "Place of the contact on the skin: x and y, with the larger error bar"
        )
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(2)
        column.addWidget(self.button)
        column.addWidget(self.map, 1)
        for line in (self.force, self.place):
            column.addWidget(line)
        follow_look(self, self._widen)

    def _widen(self) -> None:
        """Leave room for the text of a place, with one more digit than usual."""
        self.setMinimumWidth(self.fontMetrics().horizontalAdvance(_WIDEST))

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self.button.click()

    def show_finger(self, seen: "SeenFinger", now: float) -> None:
        """Show the newest estimate at the time `now` in s, and the state of the source."""
        estimate, sensor = seen.estimate, seen.status.sensor
        self.map.words.show_text(seen.state)
        if estimate is None or sensor is None:
            nowhere = np.full(2, np.nan)
            self.map.show_surface(None, (0.0, 1.0), "sequential", nowhere, (1.0, 1.0))
            self.force.show_text(NONE)
            self.place.show_text(NONE)
            return
        patch, contact = sensor.layout.patch, estimate.contact
        values, sides = _MM * estimate.surface, (patch.a, patch.b)
        limit = self._scale.follow(largest(values), now)
        self.tint = Tint("sequential", (0.0, limit), "mm")
        if largest(np.minimum(values, 0.0)) > largest(np.maximum(values, 0.0)):
            self.tint = Tint("pulled", (-limit, 0.0), "mm")
        self.map.show_surface(values, self.tint.limits, self.tint.part, contact.position, sides)
        self.map.map.show_faded(seen.old)
        off = Coverage.now.of(contact.force_sd, contact.force_95)
        force = contact.no_force.partition(":")[0] or with_error(contact.force, off, "N")
        self.force.show_text(f"{contact.force_bound}{force}" if contact.present else "no contact")
        self.place.show_text(_place(contact) if contact.present else NONE)


def _place(contact: Contact) -> str:
    sd, half = (float(np.max(of)) for of in (contact.position_sd, contact.position_95))
    off = _MM * Coverage.now.of(sd, half)
    (x, bar), (y, _) = (rounded(_MM * value, off, 1) for value in contact.position.tolist())
    return f"({x}, {y}) \N{PLUS-MINUS SIGN} {bar} mm"


@dataclass(frozen=True, eq=False)
class SeenFinger:
    """The newest status and estimate of a finger, and its state in words."""

    status: Status
    estimate: Estimate | None
    state: str

    @property
    def old(self) -> bool:
        """Whether what is seen is not what is there now."""
        return origin(self.state) not in (LIVE, SIM, REPLAY)


class HandPanel(QWidget):
    """The hand in 3-D beside a row of small maps, one for each finger, above what is held.

    `chosen` requests a finger to be shown.
    """

    chosen = Signal(str)

    def __init__(self, session: Session, tasks: Tasks) -> None:
        super().__init__()
        self._session, self._next = session, 0.0
        self.views, self.hand_view = dict[str, FingerView](), HandView()
        self.hand_view.hide()
        self.hand_view.clicked.connect(guarded(self._choose))
        self.recognition = GraspRecognition(tasks, self)
        self.recognition.found.connect(guarded(self._show_grasp))
        self.held: HeldObject | None = None
        self._joints: JointReceiver | None = None
        buttons = QButtonGroup(self)
        row, column = QHBoxLayout(), QVBoxLayout(self)
        row.setSpacing(_APART)
        column.setSpacing(2)
        column.addLayout(row, 1)
        row.addWidget(self.hand_view, 2)
        for finger in session.fingers.engines if session.fingers else ():
            self.views[finger] = view = FingerView(finger)
            buttons.addButton(view.button)
            view.button.toggled.connect(
                guarded(lambda on, finger=finger: on and self.chosen.emit(finger))
            )
            row.addWidget(view, 1)
        self.texts = {name: Line() for name in _TEXTS}
        for name, line in self.texts.items():
            line.setToolTip(_TEXTS[name])
            column.addWidget(line)
        self._timer = QTimer(self, interval=_EVERY)  # pyright: ignore[reportCallIssue]
        self._timer.timeout.connect(guarded(self.show_fingers))
        self._timer.start()
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)

    def mark(self, finger: str) -> None:
        """Mark the finger that the window shows."""
        self.views[finger].button.setChecked(True)
        self.hand_view.mark(finger)

    def _choose(self, finger: str) -> None:
        self.views[finger].button.click()

    def show_fingers(self) -> None:
        """Show the newest estimate of each finger."""
        session, now = self._session, time.monotonic()
        if session.closed or not self.isVisible() or session.fingers is None:
            return
        seen = dict[str, SeenFinger]()
        for finger, status in session.fingers.status().items():
            estimate = session.fingers.engines[finger].latest(status)
            paused = not session.fingers.engines[finger].requested.speed
            state = state_of(status, estimate and estimate.host_time, now, paused=paused)
            seen[finger] = SeenFinger(status, estimate, state)
        for finger, each in seen.items():
            self.views[finger].show_finger(each, now)
        self._show_hand(seen, now)

    def _show_hand(self, seen: Mapping[str, SeenFinger], now: float) -> None:
        """Draw the hand where it is known where its fingers are, else say how it is."""
        hand, why = self._session.hand, _UNDESCRIBED
        placements: Mapping[str, Placement] = {}
        if hand is not None:
            try:
                placements = hand.placements(self._angles(hand.angles_from))
            except Refusal as refusal:
                why = sentence(str(refusal))
        self.hand_view.setVisible(bool(placements))
        if hand is None or not placements:
            self._write({"": why})
            return
        there = {
            finger.name: FingerReading(finger, placements[finger.name], each.status, each.estimate)
            for finger in hand.fingers
            if (each := seen[finger.name]).estimate is not None
        }
        drawn = {
            name: ShownFinger(
                one.where,
                one.status.sensor.layout.patch,
                one.estimate,
                self.views[name].tint,
                seen[name].old,
            )
            for name, one in there.items()
            if one.status.sensor is not None
        }
        if now >= self._next:
            self._next = now + _PERIOD
            self.recognition.start([one for name, one in there.items() if not seen[name].old])
        self.hand_view.show_hand(drawn, self.held)

    def _angles(self, url: str) -> dict[str, float] | None:
        """The values of the hand's joints, which come to `url`; None where they come nowhere."""
        if not url:
            return None
        if self._joints is None:
            self._joints = JointReceiver(url)
        angles = self._joints.angles
        if _OLD_ANGLES < self._joints.age < math.inf:
            raise Refusal(
                f"the last joint angles came to {url} {self._joints.age:.0f} s ago; check the "
                "program that sends them"
            )
        return angles

    def close(self) -> bool:
        """Let go of the port of the joints and of the drawing."""
        if self._joints is not None:
            self._joints.close()
        self.hand_view.close_plotter()
        return super().close()

    def _show_grasp(self, grasp: Grasp, held: HeldObject) -> None:
        self.held = held
        self._write({_HELD: held_text(held), **(sums_of(grasp) if grasp.contacts else {})})

    def _write(self, texts: Mapping[str, str]) -> None:
        """Show texts by their names; one without a name in the first line."""
        for name, line in self.texts.items():
            line.show_text(f"{name}: {texts[name]}" if name in texts else "")
            line.setVisible(name in texts)
        if "" in texts:
            self.texts[_HELD].show_text(texts[""])
            self.texts[_HELD].show()


_OF_ALL = (
    "Basis, estimator, noise, electronics, scan, view and publishing are set of every finger; "
    "skin, load, scene, calibration and tare of the finger that is shown"
)


class SettingsScope(QWidget):
    """What settings are of: the finger that is shown, or all; `changed` brings whether of all."""

    changed = Signal(bool)

    def __init__(self) -> None:
        super().__init__()
        self.one, self.all = QRadioButton(), QRadioButton("all fingers")
        self.one.setChecked(True)
        self.all.setToolTip(_OF_ALL)
        self.all.toggled.connect(self.changed)
        self.note = text_label(tip=_OF_ALL)
        self.note.setForegroundRole(FAINT)
        self.note.hide()
        self.all.toggled.connect(self.note.setVisible)
        row = Flow()
        for widget in (Label("Settings of"), self.one, self.all):
            row.addWidget(widget)
        column = QVBoxLayout(self)
        column.setContentsMargins(8, 4, 8, 4)
        column.addLayout(row)
        column.addWidget(self.note)

    def show_finger(self, finger: str) -> None:
        self.one.setText(finger)
        self.one.setToolTip(f"Settings are of {finger} alone")
        self.note.setText(f"Skin, load, scene, calibration and tare: of {finger} alone.")


def _begin_with(file: Path) -> None:
    raise Refusal(
        f"{file.name} describes a hand, which a window begins with: `kappaskin app {file.name}`"
    )


class HandFeature:
    name = "hand"

    def install(self, shell: MainWindow) -> None:
        session = shell.session
        shell.opening.add(Kind("hand", (".toml",), _begin_with, is_hand))
        if session.fingers is None:
            return
        self.panel = panel = HandPanel(session, shell.tasks)
        shell.docks.put_below(
            "hand", "Hand", panel, "Ctrl+Alt+H", _ABOUT, height=0.42, layouts={"Live": 0.42}
        )
        panel.chosen.connect(guarded(session.show_finger))
        self.scope = SettingsScope()
        self.scope.changed.connect(guarded(shell.history.set_of_all))
        shell.docks.add_above("settings", self.scope)
        for show in (panel.mark, self.scope.show_finger):
            session.finger_changed.connect(guarded(show))
            show(session.finger)
        shell.begun.connect(guarded(lambda *_: shell.docks.reveal("hand")))
        shell.closed.connect(guarded(panel.close))
