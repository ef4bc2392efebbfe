"""The window: builds the views and panels, wires them to the session, and nothing else."""

import math
import time
from functools import partial
from pathlib import Path

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtGui import QCloseEvent
from PySide6.QtWidgets import (
    QApplication,
    QDockWidget,
    QHBoxLayout,
    QLabel,
    QMainWindow,
    QMessageBox,
    QToolBar,
    QWidget,
)

from kappaskin import COMPONENTS, Engine, Estimate, Status, serial_ports
from kappaskin_app import guard
from kappaskin_app.actions import Actions
from kappaskin_app.columns import column, scrolled
from kappaskin_app.guard import guarded
from kappaskin_app.history import History
from kappaskin_app.panels.basis import BasisPanel
from kappaskin_app.panels.connection import ConnectionPanel
from kappaskin_app.panels.load import LoadPanel, NoisePanel
from kappaskin_app.panels.view import ViewPanel
from kappaskin_app.scale import Ranges
from kappaskin_app.session import Session
from kappaskin_app.settings import COLOURS, Settings, ask_of
from kappaskin_app.simulation import dragged, scene_of, settings_for
from kappaskin_app.theme import (
    DARK_INK,
    DIVERGING,
    LIGHT_INK,
    PULLED,
    SEQUENTIAL,
    THEMES,
    palette,
)
from kappaskin_app.views.badge import LOST, OFF, STALE, Badge
from kappaskin_app.views.heatmap import ColourBar, Heatmap
from kappaskin_app.views.membrane import MembraneView
from kappaskin_app.views.readouts import Health, Readouts

_HEATMAPS = 0.06  # s between two drawings of the heatmaps
_NUMBERS = 0.2  # s between two readouts: faster cannot be read
_HINT = "Drag the red arrow to move the load, drag elsewhere to turn, wheel to zoom; F1: shortcuts"
_TIPS = {
    "xx": "Bending along x as each element reads it (Eq. 3).",
    "yy": "Bending along y as each element reads it (Eq. 4).",
    "xy": "Twist as each element reads it (Eq. 5).",
}


class MainWindow(QMainWindow):
    """The desktop app's one window."""

    def __init__(self, source: str = "sim:", engine: Engine | None = None) -> None:
        super().__init__()
        self.setObjectName("kappaskin")
        self.setWindowTitle("Kappaskin")
        self.history = History(settings_for(source), self)
        self.session = Session(self.history, engine or Engine(), self)
        self.membrane, self.badge, self.readouts = MembraneView(), Badge(), Readouts()
        self.colour_bar = ColourBar()
        self.heatmaps = {name: Heatmap(name, _TIPS[name]) for name in COMPONENTS}
        self.connection, self.basis = ConnectionPanel(), BasisPanel()
        self.load, self.noise, self.view = LoadPanel(), NoisePanel(), ViewPanel()
        self.ranges = Ranges()
        self._met = 0
        self._colours: object = None
        self._shortcuts: QMessageBox | None = None
        # There from the start, or its first message would push the rest up.
        self.statusBar().addWidget(QLabel(_HINT))
        self._next_heatmaps = self._next_numbers = 0.0
        self._gesture, self._grabbed_end = -1, False
        self.setCentralWidget(self._centre())
        self._make_header()
        self._make_docks()
        self.actions_by_name = Actions(self)
        self._make_actions()
        self._wire()
        self._follow(self.history.settings)
        self._find_ports()
        self.resize(1280, 800)
        self.connection.show_source(source)
        self.session.connect_to(source, already=engine is not None)

    def _centre(self) -> QWidget:
        centre = QWidget()
        beside = QHBoxLayout(centre)
        beside.setContentsMargins(0, 0, 0, 0)
        beside.setSpacing(0)
        beside.addWidget(self.membrane, 1)
        beside.addWidget(self.colour_bar)
        return centre

    def _make_header(self) -> None:
        """The badge and the numbers, across the whole window."""
        header = QToolBar("Header", self)
        header.setObjectName("header")
        header.setMovable(False)
        header.toggleViewAction().setEnabled(False)
        header.addWidget(self.badge)
        header.addWidget(self.readouts)
        self.addToolBar(header)

    def _make_docks(self) -> None:
        scroll = scrolled(self.connection, self.load, self.noise, self.basis, self.view)
        maps = column(*self.heatmaps.values())
        left = Qt.DockWidgetArea.LeftDockWidgetArea
        right = Qt.DockWidgetArea.RightDockWidgetArea
        self._docks = [
            self._dock("settings", "Settings", scroll, left),
            self._dock("curvature", "Curvature, by element", maps, right),
        ]

    def _dock(self, name: str, title: str, widget: QWidget, area: Qt.DockWidgetArea) -> QDockWidget:
        dock = QDockWidget(title, self)
        dock.setObjectName(name)
        dock.setWidget(widget)
        self.addDockWidget(area, dock)
        return dock

    def _make_actions(self) -> None:
        add, stack = self.actions_by_name.add, self.history.stack
        toggle = self._toggle
        file, edit, source, view, help_ = "&File", "&Edit", "&Source", "&View", "&Help"
        add("picture", file, "Save &picture", self._save_picture, "Ctrl+S")
        add("quit", file, "&Quit", self.close, "Ctrl+Q")
        undo, redo = stack.createUndoAction(self), stack.createRedoAction(self)
        undo.setShortcut("Ctrl+Z")
        redo.setShortcut("Ctrl+Shift+Z")
        self.actions_by_name.register("undo", edit, undo)
        self.actions_by_name.register("redo", edit, redo)
        add("reset", edit, "&Reset settings", self._reset)
        add("simulate", source, "&Simulated skin", lambda: self._connect("sim:"), "Ctrl+M")
        add("connect", source, "&Connect", self._connect_chosen, "Ctrl+Return")
        add("disconnect", source, "&Disconnect", self.session.disconnect_from, "Ctrl+D")
        add("ports", source, "&Look for ports", self._find_ports, "F5")
        for number, (value, words) in enumerate(COLOURS, 1):
            colour = partial(self._wish, "colour_by", value)
            add(f"colour-{value}", view, f"Colour by {words.lower()}", colour, f"Ctrl+{number}")
        add("higher", view, "Draw &higher", lambda: self._exaggerate(1), "Ctrl++")
        add("lower", view, "Draw &lower", lambda: self._exaggerate(-1), "Ctrl+-")
        add("elements", view, "Show or hide &elements", partial(toggle, "show_elements"), "Ctrl+E")
        add("truth", view, "Show or hide &true surface", partial(toggle, "show_truth"), "Ctrl+U")
        add("camera", view, "Reset &camera", self.membrane.reset_camera, "Ctrl+R")
        add("theme", view, "Light or &dark", self._switch_theme, "Ctrl+T")
        for dock in self._docks:
            name = f"dock-{dock.objectName()}"
            self.actions_by_name.register(name, view, dock.toggleViewAction())
        add("shortcuts", help_, "&Shortcuts", self._show_shortcuts, "F1")

    def _wire(self) -> None:
        for panel in (self.load, self.noise, self.basis, self.view):
            panel.wished.connect(guarded(self._wish))
        self.connection.connect_wanted.connect(guarded(self._connect))
        self.connection.disconnect_wanted.connect(guarded(self.session.disconnect_from))
        self.connection.ports_wanted.connect(guarded(self._find_ports))
        self.history.changed.connect(guarded(self._follow))
        self.session.estimated.connect(guarded(self._show_estimate))
        self.session.reported.connect(guarded(self._show_status))
        # Queued: the next look comes after the picture is out, and need not wait for the timer.
        self.membrane.drawn.connect(self.session.tick, Qt.ConnectionType.QueuedConnection)
        self.membrane.drag.grabbed.connect(guarded(self._grab))
        self.membrane.drag.dragged.connect(guarded(self._drag))
        self.membrane.drag.released.connect(guarded(self._release))
        for name, heatmap in self.heatmaps.items():
            heatmap.pointed.connect(guarded(self._point))
            heatmap.lock_wanted.connect(guarded(partial(self._wish, f"range_{name}")))
        guard.on_failure(self._tell)

    # Wishes: a person wants something; a change of settings is always a command.

    def _wish(self, name: str, value: object) -> None:
        label = ask_of(name).label if not name.startswith("range_") else "colour range"
        self.history.wish(name, label, value)

    def _toggle(self, name: str) -> None:
        self._wish(name, not getattr(self.history.settings, name))

    def _switch_theme(self) -> None:
        self._wish("theme", "light" if self.history.settings.theme == "dark" else "dark")

    def _exaggerate(self, step: int) -> None:
        wanted = self.history.settings.exaggeration + step
        self._wish("exaggeration", float(min(max(wanted, 1), 50)))

    def _reset(self) -> None:
        fresh = Settings()
        self.history.change("Reset settings", -1, **vars(fresh))

    def _connect(self, source: str) -> None:
        self.connection.show_source(source)
        self.session.connect_to(source)

    def _connect_chosen(self) -> None:
        self._connect(self.connection.source())

    def _find_ports(self) -> None:
        found = [(port["port"], port["description"]) for port in serial_ports()]
        self.connection.show_ports([(port, f"{port}  {words}") for port, words in found])

    def _grab(self, x: float, y: float) -> None:
        settings = self.history.settings
        second = math.dist((x, y), (settings.x_end, settings.y_end))
        self._grabbed_end = second < math.dist((x, y), (settings.x, settings.y))
        self._gesture = self.history.new_gesture()

    def _drag(self, x: float, y: float) -> None:
        moved = dragged(self.history.settings, x, y, self._grabbed_end)
        self.history.change("Drag the load", self._gesture, **moved)

    def _release(self) -> None:
        self._gesture = -1

    def _point(self, element: int) -> None:
        for heatmap in self.heatmaps.values():
            heatmap.show_element(element)
        self._next_numbers = 0.0

    # News: settings, status and estimates on their way to the views.

    def _follow(self, settings: Settings) -> None:
        for panel in (self.load, self.noise, self.basis, self.view):
            panel.show_settings(settings)
        for name, heatmap in self.heatmaps.items():
            heatmap.show_lock(getattr(settings, f"range_{name}") > 0)
        self.membrane.show_options(
            settings.exaggeration, settings.show_elements, settings.show_truth
        )
        scene = scene_of(settings)
        self._loads, self._moving = scene.loads, scene.motion is not None
        self._show_theme(settings.theme)

    def _show_theme(self, name: str) -> None:
        theme = THEMES[name]
        application = QApplication.instance()
        if isinstance(application, QApplication):
            application.setPalette(palette(theme))
        panels = (self.connection, self.load, self.noise, self.basis)
        views = (self.membrane, self.badge, self.readouts, *self.heatmaps.values())
        for widget in (*panels, *views):
            widget.show_theme(theme)

    def _show_status(self, status: Status) -> None:
        if status.sensor is not None and status.meetings != self._met:
            self._meet(status)
        state = self.session.badge()
        self.badge.show_state(state)
        lost = state in (LOST, OFF, STALE)
        for view in (self.membrane, *self.heatmaps.values()):
            view.show_lost(lost)
        self.connection.show_status(status)
        self.basis.show_status(status)
        simulating = self.session.simulating and status.state == "streaming"
        self.load.show_simulating(simulating)
        self.noise.show_simulating(simulating)
        self._show_health(status, lost)

    def _meet(self, status: Status) -> None:
        sensor, setup = status.sensor, status.setup
        if sensor is None:
            return
        self._met = status.meetings
        self.membrane.show_skin(sensor, setup.nx, setup.ny)
        self.ranges = Ranges(1e3 * max(sensor.layout.patch.a, sensor.layout.patch.b))
        settings = self.history.settings
        self.membrane.show_options(
            settings.exaggeration, settings.show_elements, settings.show_truth
        )
        for heatmap in self.heatmaps.values():
            heatmap.show_layout(sensor.layout)

    def _show_health(self, status: Status, lost: bool) -> None:
        now = time.monotonic()
        if now < self._next_numbers:
            return
        self._next_numbers = now + _NUMBERS
        recent = [age for when, age in self.membrane.ages if when > now - 1.0 and not lost]
        counts = status.accounting
        self.readouts.show_health(
            Health(
                status.rate,
                len(recent),
                float(np.median(recent)) if recent else math.nan,
                counts.lost,
                counts.bytes_discarded,
                status.skipped,
            )
        )
        estimate = None if lost else self.session.estimate
        self.readouts.show_estimate(estimate)
        for row, heatmap in enumerate(self.heatmaps.values()):
            heatmap.show_reading(np.empty(0) if estimate is None else estimate.curvature[row])

    def _show_estimate(self, estimate: Estimate) -> None:
        if not self.membrane.ready:
            return  # a picture is due; the next tick brings a newer estimate
        settings = self.history.settings
        colour = settings.colour_by
        values = self.session.surface_values(estimate, colour)
        now = time.monotonic()
        due = now >= self._next_heatmaps
        if colour == "displacement":
            top = self.ranges.limit(colour, values, settings, now)
            pulled = self.ranges.pulled(values)
            limits = (-top, 0.0) if pulled else (0.0, top)
            colours, unit = PULLED if pulled else SEQUENTIAL, "mm"
        else:
            readings = estimate.curvature[COMPONENTS.index(colour)]
            limit = self.ranges.limit(colour, readings, settings, now)
            limits, colours, unit = (-limit, limit), DIVERGING, "1/m"
        if colours is not self._colours:
            self._colours = colours
            self.membrane.show_colours(colours, DARK_INK if colours is DIVERGING else LIGHT_INK)
        self.membrane.show_estimate(estimate, values, limits)
        simulated = self.session.simulating
        self.membrane.show_loads(
            self._loads if simulated else (), estimate.true_contact if self._moving else None
        )
        self.colour_bar.show_scale(colours, limits, unit)
        if due:
            self._next_heatmaps = now + _HEATMAPS
            for row, (name, heatmap) in enumerate(self.heatmaps.items()):
                readings = estimate.curvature[row]
                limit = self.ranges.limit(name, readings, settings, now)
                heatmap.show_values(readings, limit)

    # Small things.

    def _tell(self, text: str) -> None:
        self.statusBar().showMessage(text, 10_000)

    def picture(self, path: Path) -> bool:
        """Save the window, 3-D picture included, as a PNG; whether it could be written."""
        return self.grab().save(str(path), "PNG")

    def _save_picture(self) -> None:
        path = Path(time.strftime("kappaskin-%Y%m%d-%H%M%S.png"))
        done = self.picture(path)
        self._tell(f"Saved {path.resolve()}" if done else f"Could not write {path.resolve()}")

    def _show_shortcuts(self) -> None:
        if self._shortcuts is None:
            text = self.actions_by_name.cheat_sheet()
            self._shortcuts = QMessageBox(QMessageBox.Icon.NoIcon, "Shortcuts", text)
            self._shortcuts.setParent(self, Qt.WindowType.Dialog)
            self._shortcuts.setModal(False)
        self._shortcuts.show()
        self._shortcuts.raise_()

    def closeEvent(self, event: QCloseEvent) -> None:
        if not self.session.closed:
            guard.forget(self._tell)
            self.session.close()
            self.membrane.close_plotter()
        super().closeEvent(event)
