"""Hand: a small map of each finger; a click shows the finger in the window."""

import time
from pathlib import Path

import numpy as np
from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtGui import QMouseEvent
from PySide6.QtWidgets import QButtonGroup, QHBoxLayout, QRadioButton, QVBoxLayout, QWidget

from kappaskin._text import with_error
from kappaskin.errors import Refusal
from kappaskin.frames import Estimate
from kappaskin.hand import is_hand
from kappaskin.live import Status
from kappaskin_app.guard import guarded
from kappaskin_app.shell.badge import LIVE, SIM, origin, state_of
from kappaskin_app.shell.colouring import SteadyRange, largest
from kappaskin_app.shell.opening import Kind
from kappaskin_app.shell.session import Session
from kappaskin_app.shell.window import MainWindow
from kappaskin_app.theme import FAINT
from kappaskin_app.widgets.layout import Flow
from kappaskin_app.widgets.parts import Label, text_label
from kappaskin_app.widgets.surface_map import SurfaceMap
from kappaskin_app.widgets.text import Coverage

_ABOUT = "A map of each finger of a hand with its force; a click shows that finger in the window"
_TIP = "Displacement of the skin, with a cross at the contact"
_EVERY = 100  # ms between two pictures of the maps
_MM = 1e3
_LEAST = 0.01  # mm, of the scale


class FingerView(QWidget):
    """The map of one finger; a click on it shows the finger in the window."""

    def __init__(self, finger: str) -> None:
        super().__init__()
        self.button = QRadioButton(finger)
        self.button.setToolTip(f"Show {finger} in the window, with its settings")
        self.map, self._scale = SurfaceMap(finger, "mm", _TIP), SteadyRange(_LEAST)
        self.map.title.hide()
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self.button)
        column.addWidget(self.map, 1)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self.button.click()

    def show_finger(self, status: Status, estimate: Estimate | None) -> None:
        """Show the newest estimate, and the state of the source."""
        now, sensor = time.monotonic(), status.sensor
        state = state_of(status, estimate and estimate.host_time, now, paused=False)
        if estimate is None or sensor is None:
            self.map.show_surface(None, (0.0, 1.0), "sequential", np.full(2, np.nan), (1.0, 1.0))
            self.map.words.show_text(state)
            return
        patch, contact = sensor.layout.patch, estimate.contact
        values, sides = _MM * estimate.surface, (patch.a, patch.b)
        limit = self._scale.follow(largest(values), now)
        pulled = largest(np.minimum(values, 0.0)) > largest(np.maximum(values, 0.0))
        limits, part = ((-limit, 0.0), "pulled") if pulled else ((0.0, limit), "sequential")
        self.map.show_surface(values, limits, part, contact.position, sides)
        self.map.map.show_faded(origin(state) not in (LIVE, SIM))
        off = Coverage.now.of(contact.force_sd, contact.force_95)
        said = contact.no_force.partition(":")[0] or with_error(contact.force, off, "N")
        self.map.words.show_text(f"{state}: {said}")


class HandPanel(QWidget):
    """A row of small maps, one for each finger; `chosen` requests one to be shown."""

    chosen = Signal(str)

    def __init__(self, session: Session) -> None:
        super().__init__()
        self._session = session
        self.views = dict[str, FingerView]()
        buttons = QButtonGroup(self)
        row = QHBoxLayout(self)
        for finger in session.fingers.engines if session.fingers else ():
            self.views[finger] = view = FingerView(finger)
            buttons.addButton(view.button)
            view.button.toggled.connect(
                guarded(lambda on, finger=finger: on and self.chosen.emit(finger))
            )
            row.addWidget(view, 1)
        self._timer = QTimer(self, interval=_EVERY)  # pyright: ignore[reportCallIssue]
        self._timer.timeout.connect(guarded(self.show_fingers))
        self._timer.start()
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)

    def mark(self, finger: str) -> None:
        """Mark the finger that the window shows."""
        self.views[finger].button.setChecked(True)

    def show_fingers(self) -> None:
        """Show the newest estimate of each finger."""
        if self._session.closed or not self.isVisible() or self._session.fingers is None:
            return
        for finger, status in self._session.fingers.status().items():
            estimate = self._session.fingers.engines[finger].latest(status)
            self.views[finger].show_finger(status, estimate)


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
        self.panel = panel = HandPanel(session)
        shell.docks.put_below(
            "hand", "Hand", panel, "Ctrl+Alt+H", _ABOUT, height=0.34, layouts={"Live": 0.34}
        )
        panel.chosen.connect(guarded(session.show_finger))
        self.scope = SettingsScope()
        self.scope.changed.connect(guarded(shell.history.set_of_all))
        shell.docks.add_above("settings", self.scope)
        for show in (panel.mark, self.scope.show_finger):
            session.finger_changed.connect(guarded(show))
            show(session.finger)
        shell.begun.connect(guarded(lambda *_: shell.docks.reveal("hand")))
