"""The window: builds the panels and views, wires them to the session, and nothing else."""

from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtGui import QCloseEvent, QKeyEvent, QPixmap, QResizeEvent
from PySide6.QtWidgets import (
    QHBoxLayout,
    QMainWindow,
    QVBoxLayout,
    QWidget,
)

from kappaskin.calibration import Tares, data_folder
from kappaskin.live import Engine
from kappaskin_app.adopting import settings_left
from kappaskin_app.beginning import Beginning
from kappaskin_app.calibrating import Calibrating
from kappaskin_app.columns import widen
from kappaskin_app.comparing import Comparing
from kappaskin_app.costing import Costing
from kappaskin_app.designing import Designing
from kappaskin_app.display import Display
from kappaskin_app.docks import Docks
from kappaskin_app.doing import Doing, tasks_of
from kappaskin_app.drops import Drops
from kappaskin_app.exports import Exports
from kappaskin_app.guard import log
from kappaskin_app.happenings import Happenings
from kappaskin_app.history import History
from kappaskin_app.layouts.choosing import Layouts
from kappaskin_app.layouts.keeping import Keeping
from kappaskin_app.lessons.pointing import Pointing
from kappaskin_app.lessons.reading import DOCKS
from kappaskin_app.lessons.teaching import Teaching
from kappaskin_app.logged import Logged
from kappaskin_app.looking import Looking
from kappaskin_app.map_testing import MapTesting
from kappaskin_app.menus import Menus
from kappaskin_app.mishaps import Mishaps
from kappaskin_app.naming import Naming
from kappaskin_app.news import News
from kappaskin_app.opening import Opening
from kappaskin_app.pages import Page
from kappaskin_app.panels.compare import ComparePanel
from kappaskin_app.panels.cost import CostPanel
from kappaskin_app.panels.design import DesignPanel
from kappaskin_app.panels.form import Form
from kappaskin_app.panels.guide import GuidePanel
from kappaskin_app.panels.health import HealthPanel
from kappaskin_app.panels.lesson import LessonPanel
from kappaskin_app.panels.log import LogPanel
from kappaskin_app.panels.numbers import NumbersPanel
from kappaskin_app.panels.panels import Panels
from kappaskin_app.panels.scene import ScenePanel
from kappaskin_app.panels.stability import StabilityPanel
from kappaskin_app.picking import Picking
from kappaskin_app.planning import Planning
from kappaskin_app.plugs import Plugs
from kappaskin_app.presenting import Presenting
from kappaskin_app.replaying import Replaying
from kappaskin_app.resting import Resting
from kappaskin_app.seeing import Seeing
from kappaskin_app.session import Session
from kappaskin_app.simulation import settings_for
from kappaskin_app.staging import Staging
from kappaskin_app.taping import Taping
from kappaskin_app.taring import Taring
from kappaskin_app.views.foot import Foot
from kappaskin_app.views.header import Header
from kappaskin_app.views.offer import Offer
from kappaskin_app.views.recording_mark import RecordingMark
from kappaskin_app.views.stage import Stage
from kappaskin_app.views.timeline import Timeline
from kappaskin_app.views.transport import Transport
from kappaskin_app.wiring import wire
from kappaskin_app.wishes import Wishes

_PACKED = 80  # of a picture: packs a fifth less well than Qt does, in half the time


class MainWindow(QMainWindow):
    """The desktop app's one window."""

    def __init__(self, source: str = "sim:", engine: Engine | None = None) -> None:
        super().__init__()
        self.setObjectName("kappaskin")
        self.setWindowTitle("Kappaskin")
        handed = engine.resumed if engine else None
        if handed and source == "sim:":  # nothing else was asked for
            source = handed.requested.source or source
        begun = settings_left(handed) if handed else settings_for(source)
        self.history = History(begun, self)
        self.session = Session(self.history, engine or Engine(), self)
        self.wishes = Wishes(self.history, self.session)
        self.calibrating = Calibrating(self.history, self)
        self.taring = Taring(self.history, self.session.engine, Tares(data_folder()), self)
        self.seeing = Seeing(self.history, self)
        self.costing = Costing(self.history, self.session, self.wishes, self)
        self.panels, self.display = Panels(), Display(self.session)
        self.plugs = Plugs(self.panels.connection.sources, self)
        self.happenings = Happenings(self)
        self.planning = Planning(self.session, self)
        self.cost, self.stability, self.scene = CostPanel(), StabilityPanel(), ScenePanel()
        self.health, self.testing = HealthPanel(), MapTesting(self)
        self.numbers = NumbersPanel()
        self.logged = Logged()
        self.log, self.guide = LogPanel(self.logged), GuidePanel()
        self.compare = ComparePanel()
        self.comparing = Comparing(self.history, self.session, self)
        self.design, self.designing = DesignPanel(), Designing(self.history, self)
        self.timeline, self.transport, self.mark = Timeline(), Transport(), RecordingMark()
        self.offer = Offer()
        self.taping = Taping(self.session.engine, self)
        self.replaying = Replaying(self.history, self.session, self.transport, self)
        self.staging = Staging(
            *(self.history, self.session, self.wishes, self.planning),
            *(self.scene, self.timeline, self),
        )
        self.opening = Opening(self)
        self.drops = Drops(self, self.opening.open, self.transport.take_key)
        self.picking = Picking(self.history, self.session, self.display)
        self.membrane, self.heatmaps = self.display.membrane, self.display.heatmaps
        self.badge, self.readouts = self.display.badge, self.display.readouts
        self.mishaps = Mishaps(self)
        foot = Foot(self.display.notice, self.mishaps.count)
        self.setStatusBar(foot)
        self.object, self.activity = foot.object, foot.activity
        stage = Stage(self._centre())
        self.setCentralWidget(stage)
        self.presenting = Presenting(self, stage, self.session, self.display, self.wishes)
        self.header = Header(self.badge, self.mark, self.readouts)
        self.addToolBar(self.header)
        self.lesson = LessonPanel()
        self.docks, self.naming = self._surround(), Naming(self)
        self.exports = Exports(self.session, self.membrane, self)
        self.teaching = Teaching(
            *(self.history, self.session, self.seeing, self),
            *(self.connect_to, self._seen, self.exports.caption),
        )
        self.pointing = self._pointing()
        self.looking = Looking(self.history, self.wishes, self.display)
        self.layouts = Layouts(self)
        self.beginning = Beginning(self)
        self.menus, self.keeping = Menus(self), Keeping(self)
        self.actions_by_name = self.menus.actions
        self.doing = Doing(tasks_of(self), self)
        self.resting, self.news = Resting(self.session, self.testing), News(self)
        wire(self)
        self.news.follow_settings(self.history.settings)
        self.plugs.look()
        self.resize(1280, 800)
        self.panels.connection.show_source(source)
        if handed:
            self.session.go_on(handed)
            self.taping.go_on(handed, source)
        else:
            self.session.connect_to(source, already=engine is not None)
            self.taping.offer_repair()
        self.replaying.adopt(self.session.source)

    def _centre(self) -> QWidget:
        centre = QWidget()
        beside, above = QHBoxLayout(), QVBoxLayout(centre)
        above.setContentsMargins(0, 0, 0, 0)
        for layout in (beside, above):
            layout.setSpacing(0)
        beside.addWidget(self.membrane, 1)
        beside.addWidget(self.display.scale)
        above.addWidget(self.offer)
        above.addLayout(beside, 1)
        above.addWidget(self.timeline)
        above.addWidget(self.transport)
        return centre

    def _surround(self) -> Docks:
        docks, area = Docks(self), Qt.DockWidgetArea
        docks.put_beside("settings", "Settings", self.panels, area.LeftDockWidgetArea)
        docks.put_above("lesson", "Lessons", self.lesson, "settings", "Shift+F1")
        docks.put_beside("curvature", "By element", self.display.maps, area.RightDockWidgetArea)
        docks.put_below("cost", "Cost of accuracy", self.cost, "F9")
        docks.put_below("stability", "Stability", self.stability, "F10")
        docks.put_below("scene", "Scene", self.scene, "F2")
        docks.put_below("health", "Health", self.health, "F3")
        docks.put_below("numbers", "Numbers", self.numbers, "Ctrl+Shift+T")
        docks.put_below("log", "Log", self.log, "Ctrl+Alt+G")
        docks.put_below("compare", "Compare A and B", self.compare, "Ctrl+B")
        docks.put_below("design", "Design", self.design, "Ctrl+Alt+N")
        docks.put_below("element", "Element", self.picking.card, "Ctrl+Alt+E")
        docks.put_below("traces", "Traces", self.picking.traces, "Ctrl+Alt+T")
        docks.put_below("guide", "Guide", self.guide, "Ctrl+F1")
        return docks

    def _pointing(self) -> Pointing:
        docks = {name: [self.docks.widget(name)] for name in DOCKS}
        numbers = {f"readout-{name}": parts for name, parts in self.readouts.parts.items()}
        forms = [panel for panel in self.panels.all() if isinstance(panel, Form)]
        return Pointing(forms, docks | numbers, self.docks.reveal, self)

    # Wishes that are no settings, or need what is shown.

    def connect_to(self, source: str) -> None:
        """Read from `source` from now on."""
        if self.replaying.takes(source):
            return
        self.panels.connection.show_source(source)
        self.session.connect_to(source)

    def simulate(self) -> None:
        """Simulate the panels' skin, whatever was read or written."""
        self.history.change("Simulated skin", -1, written=None)
        self.connect_to("sim:")

    def pause(self) -> None:
        """Let what is played stand, or go on: a recording, or else a scene."""
        (self.replaying.toggle if self.session.replaying else self.staging.pause)()

    def connect_chosen(self) -> None:
        """Connect what is named in the panel."""
        self.connect_to(self.panels.connection.source())

    # Small things.

    def read(self, page: Page, heading: str = "") -> None:
        """Show a page of the guide, from a heading in it on."""
        self.docks.reveal("guide")
        self.guide.read(page, heading)

    def tell(self, text: str) -> None:
        """Say something in passing."""
        self.statusBar().showMessage(text, 10_000)
        if text:
            log.info("%s", text)

    def _seen(self) -> list[QPixmap]:
        """Pictures of the numbers, and of the skin with the maps and what is shown below them."""
        docks = [self.docks["curvature"], *self.docks.below]
        whole = self.presenting.stage.geometry()
        for dock in docks:
            if not dock.visibleRegion().isEmpty():
                whole = whole.united(dock.geometry())
        return [self.readouts.grab(), self.grab(whole)]

    def picture(self, path: Path) -> bool:
        """Save the window, 3-D picture included, as a PNG; whether it could be written."""
        return self.grab().save(str(path), "PNG", _PACKED)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_Escape and self.presenting.on:
            self.presenting.leave()
        elif event.key() == Qt.Key.Key_Escape and self.offer.isVisible():
            self.offer.hide()
        else:
            super().keyPressEvent(event)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        widen(self, self.docks["curvature"], event)

    def quit(self) -> None:
        """Close, unless a recording is to go on."""
        if self.taping.may_close():
            self.close()

    def closeEvent(self, event: QCloseEvent) -> None:
        # Only of a person: a run of so many seconds ends, and so does one that gets a signal.
        if event.spontaneous() and not self.session.closed and not self.taping.may_close():
            event.ignore()
            return
        if not self.session.closed:
            self.keeping.write()
            self.mishaps.close()
            self.presenting.close()
            self.history.stack.blockSignals(True)  # it tells even while all is taken apart
            self.exports.close()
            self.plugs.close()
            self.replaying.close()
            self.taping.close()
            self.costing.close()
            self.planning.close()
            self.designing.close()
            self.scene.gallery.close()
            self.seeing.close()
            self.session.close()
            self.naming.close()
            self.display.close()
            self.logged.close()
        super().closeEvent(event)
