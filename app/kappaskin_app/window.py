"""The window: builds the panels and views, wires them to the session, and nothing else."""

import time
from functools import partial
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtGui import QCloseEvent, QKeyEvent, QPixmap, QResizeEvent
from PySide6.QtWidgets import (
    QApplication,
    QHBoxLayout,
    QMainWindow,
    QToolBar,
    QVBoxLayout,
    QWidget,
)

from kappaskin import Engine, Status, Tares, data_folder
from kappaskin_app.adopting import Entrusting, settings_left
from kappaskin_app.calibrating import Calibrating
from kappaskin_app.columns import row, widen
from kappaskin_app.comparing import Comparing
from kappaskin_app.costing import Costing
from kappaskin_app.display import Display
from kappaskin_app.docks import Docks
from kappaskin_app.doing import Doing, tasks_of
from kappaskin_app.drops import Drops
from kappaskin_app.exports import Exports
from kappaskin_app.guard import guarded
from kappaskin_app.happenings import Happenings
from kappaskin_app.history import History
from kappaskin_app.layouts.choosing import Layouts
from kappaskin_app.layouts.keeping import Keeping
from kappaskin_app.lessons.pointing import Pointing
from kappaskin_app.lessons.reading import DOCKS
from kappaskin_app.lessons.teaching import Teaching
from kappaskin_app.looking import Looking
from kappaskin_app.map_testing import MapTesting
from kappaskin_app.menus import Menus
from kappaskin_app.mishaps import Mishaps
from kappaskin_app.naming import Naming
from kappaskin_app.opening import Opening
from kappaskin_app.panels.compare import ComparePanel
from kappaskin_app.panels.cost import CostPanel
from kappaskin_app.panels.form import Form
from kappaskin_app.panels.health import HealthPanel
from kappaskin_app.panels.lesson import LessonPanel
from kappaskin_app.panels.numbers import NumbersPanel
from kappaskin_app.panels.panels import Panels
from kappaskin_app.panels.scene import ScenePanel
from kappaskin_app.panels.stability import StabilityPanel
from kappaskin_app.picking import Picking
from kappaskin_app.planning import Planning
from kappaskin_app.plugs import Plugs
from kappaskin_app.presenting import NAMED, Presenting
from kappaskin_app.replaying import Replaying
from kappaskin_app.seeing import Seeing
from kappaskin_app.session import Session
from kappaskin_app.settings import Settings
from kappaskin_app.simulation import settings_for
from kappaskin_app.staging import Staging
from kappaskin_app.taping import Taping
from kappaskin_app.taring import Taring
from kappaskin_app.theme import THEMES, letters, palette
from kappaskin_app.views.activity import Activity
from kappaskin_app.views.line import Line
from kappaskin_app.views.offer import Offer
from kappaskin_app.views.recording_mark import RecordingMark
from kappaskin_app.views.stage import Stage
from kappaskin_app.views.timeline import Timeline
from kappaskin_app.views.transport import Transport
from kappaskin_app.wishes import Wishes

_WORDS = 1.0  # s between two looks at what touches the skin: as fast as one can read
_PACKED = 80  # of a picture: packs a fifth less well than Qt does, in half the time
_BARGAIN = 1.0  # s between two looks at what a region buys


class MainWindow(QMainWindow):
    """The desktop app's one window."""

    def __init__(self, source: str = "sim:", engine: Engine | None = None) -> None:
        super().__init__()
        self.setObjectName("kappaskin")
        self.setWindowTitle("Kappaskin")
        handed = engine.adopted if engine else None
        if handed and source == "sim:":  # nothing else was asked for
            source = handed.asked.source or source
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
        self.compare = ComparePanel()
        self.comparing = Comparing(self.history, self.session, self)
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
        self._next_bargain = self._next_words = 0.0
        self._held_still = False
        # There from the start, or its first message would push the rest up.
        self.statusBar().addWidget(self.display.notice)
        self.object = Line()
        self.object.setToolTip(
            "What the readings say touches the skin, with 95 % interval and the runner-up's "
            "probability; and the principal curvatures of the skin at the contact."
        )
        self.statusBar().addPermanentWidget(self.object, 1)
        self.activity, self.mishaps = Activity(), Mishaps(self)
        foot = row(self.activity, self.mishaps.count)
        # As high from the start: a bar that grows shows all again that a message hides.
        foot.setMinimumHeight(max(w.sizeHint().height() for w in (foot, self.mishaps.count)))
        self.statusBar().addPermanentWidget(foot)
        # What it takes of the bar, all that the rest leaves, a passing message needs.
        self.statusBar().messageChanged.connect(lambda text: self.object.setHidden(bool(text)))
        stage = Stage(self._centre())
        self.setCentralWidget(stage)
        self.presenting = Presenting(self, stage, self.session, self.display, self.wishes)
        self._make_header()
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
        self.menus, self.keeping = Menus(self), Keeping(self)
        self.actions_by_name = self.menus.actions
        self.doing = Doing(tasks_of(self), self)
        self._wire()
        self._follow(self.history.settings)
        self.plugs.look()
        self.resize(1280, 800)
        self.panels.connection.show_source(source)
        self.naming.named.connect(guarded(self.object.show_text))
        self.naming.found.connect(guarded(self.presenting.find))
        self.naming.found.connect(guarded(lambda what, _: self.display.overlays.find(what)))
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

    def _make_header(self) -> None:
        """The badge and the numbers, across the whole window."""
        header = QToolBar("Header", self)
        header.setObjectName("header")
        header.setMovable(False)
        header.toggleViewAction().setEnabled(False)
        header.addWidget(self.badge)
        self._mark = header.addWidget(self.mark)
        self._mark.setVisible(False)
        header.addWidget(self.readouts)
        self.addToolBar(header)

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
        docks.put_below("compare", "Compare A and B", self.compare, "Ctrl+B")
        docks.put_below("element", "Element", self.picking.card, "Ctrl+Alt+E")
        docks.put_below("traces", "Traces", self.picking.traces, "Ctrl+Alt+T")
        return docks

    def _pointing(self) -> Pointing:
        docks = {name: [self.docks[name].widget()] for name in DOCKS}
        numbers = {f"readout-{name}": parts for name, parts in self.readouts.parts.items()}
        forms = [panel for panel in self.panels.all() if isinstance(panel, Form)]
        return Pointing(forms, docks | numbers, self.docks.reveal, self)

    def _wire(self) -> None:
        panels, wishes, session, drag = self.panels, self.wishes, self.session, self.membrane.drag
        panels.wished.connect(guarded(wishes.wish))
        panels.connection.connect_wanted.connect(guarded(self.connect_to))
        panels.connection.disconnect_wanted.connect(guarded(session.disconnect_from))
        panels.connection.ports_wanted.connect(guarded(self.plugs.look))
        self.plugs.found.connect(guarded(panels.connection.show_ports))
        session.reported.connect(guarded(self.happenings.follow))
        self.happenings.told.connect(guarded(self.tell))
        self.badge.clicked.connect(guarded(self.happenings.open_list))
        self.history.changed.connect(guarded(self._follow))
        session.estimated.connect(guarded(self.display.show_estimate))
        session.reported.connect(guarded(self._show_status))
        session.estimated.connect(guarded(self.presenting.receive))
        session.reported.connect(guarded(self.presenting.follow))
        self.calibrating.laid.connect(guarded(session.lay))
        session.reported.connect(guarded(self.calibrating.follow))
        session.estimated.connect(guarded(self.calibrating.receive))
        panels.calibrate.attend(self.calibrating)
        panels.in_use.attend(self.calibrating)
        session.reported.connect(guarded(self.taring.follow))
        self.taring.told.connect(guarded(self.tell))
        self.taring.changed.connect(guarded(self._allow_tare))
        calibrating = self.calibrating
        calibrating.changed.connect(
            guarded(lambda: self.taring.stand_aside(calibrating.procedure is not None))
        )
        panels.tare.attend(self.taring)
        self.docks["cost"].visibilityChanged.connect(guarded(self.costing.watch))
        session.reported.connect(guarded(self.costing.follow))
        session.estimated.connect(guarded(self.costing.receive))
        self.cost.attend(self.costing)
        self.docks["stability"].visibilityChanged.connect(guarded(self.seeing.watch))
        session.reported.connect(guarded(self.seeing.follow))
        self.stability.attend(self.seeing)
        self.stability.demonstrated.connect(guarded(wishes.demonstrate))
        self._attend_health()
        self._attend_recording()
        self.lesson.attend(self.teaching)
        self.teaching.pointed.connect(guarded(self.pointing.point))
        self.teaching.told.connect(guarded(self.tell))
        self.staging.told.connect(guarded(self.tell))
        self.opening.told.connect(guarded(self.tell))
        self.layouts.told.connect(guarded(self.tell))
        self.exports.told.connect(guarded(self.tell))
        self.staging.played.connect(guarded(panels.connection.show_source))
        session.reported.connect(guarded(wishes.follow))
        self.stability.back.connect(guarded(self.history.stack.undo))
        self.stability.shown.connect(guarded(self._show_shape))
        self.history.stack.canUndoChanged.connect(guarded(self.stability.show_undo))
        self.stability.show_undo(self.history.stack.canUndo())
        session.refused.connect(guarded(panels.shape.show_refusal))
        session.refused.connect(guarded(panels.load.show_refusal))
        session.unsent.connect(guarded(panels.publish.show_refusal))
        session.preparing.connect(guarded(panels.shape.show_preparing))
        # Queued: the next look comes after the picture is out, and need not wait for the timer.
        self.membrane.drawn.connect(session.tick, Qt.ConnectionType.QueuedConnection)
        drag.grabbed.connect(guarded(wishes.grab))
        drag.dragged.connect(guarded(wishes.drag))
        drag.released.connect(guarded(wishes.release))
        drag.given_up.connect(guarded(wishes.give_up))
        for name, heatmap in self.heatmaps.items():
            heatmap.pointed.connect(guarded(self.display.point))
            heatmap.chosen.connect(guarded(wishes.choose))
            heatmap.lock_wanted.connect(guarded(partial(wishes.wish, f"range_{name}")))
        self.picking.picked.connect(guarded(lambda _: self.docks.reveal("element")))
        self.display.scale.lock_wanted.connect(guarded(self._lock))
        session.reported.connect(guarded(self.doing.follow))
        self.doing.told.connect(guarded(self._show_work))
        self.activity.cancel_wanted.connect(guarded(self.doing.cancel))

    def _show_work(self, words: str) -> None:
        """Show what takes long, and whether it can be ended."""
        task = self.doing.task
        self.activity.show_work(words, task is not None and task.cancel is not None)

    def _attend_recording(self) -> None:
        session, taping, replaying = self.session, self.taping, self.replaying
        session.reported.connect(guarded(taping.follow))
        entrusting = Entrusting(self.history, session.engine)
        session.reported.connect(guarded(entrusting.follow))
        taping.changed.connect(guarded(self._show_mark))
        self.mark.clicked.connect(guarded(taping.dismiss))
        replaying.opened.connect(guarded(self.panels.connection.show_source))
        replaying.offered.connect(guarded(self.panels.show_recording))
        taping.repairs.saved.connect(guarded(replaying.open_file))
        for news in (taping, replaying):
            news.told.connect(guarded(self.tell))
        self.panels.recording.attend(taping, replaying)
        self.docks["compare"].visibilityChanged.connect(guarded(self.comparing.watch))
        session.reported.connect(guarded(self.comparing.follow))
        self.compare.form.wished.connect(guarded(self.wishes.wish))
        self.compare.attend(self.comparing)

    def _show_mark(self) -> None:
        """Show in the header that something is recorded, or that it ended by itself."""
        written, ended = self.taping.written, self.taping.ended
        self._mark.setVisible(written.active or bool(ended))
        self.mark.show_written(written, ended)

    def _attend_health(self) -> None:
        session, testing = self.session, self.testing
        session.reported.connect(guarded(testing.follow))
        session.estimated.connect(guarded(testing.receive))
        testing.begun.connect(guarded(self._hold_still))
        session.playing.connect(guarded(lambda *_: testing.running and self._hold_still()))
        testing.changed.connect(guarded(self._let_go))
        testing.asked.connect(guarded(self.display.ask_for))
        self.health.pointed.connect(guarded(self.display.point))
        self.health.attend(testing)

    def _hold_still(self) -> None:
        """Let a simulated load rest, so that it is moved by who presses with it alone."""
        if self.session.inside and self.session.running:
            self._held_still = True
            self.session.run(False)

    def _let_go(self) -> None:
        """Let a simulation that was held still for a test go on after it."""
        if self._held_still and not self.testing.running:
            self._held_still = False
            self.session.run(True)

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

    def _lock(self, locked: bool) -> None:
        limit = self.display.limit_shown() if locked else 0.0
        self.wishes.wish(f"range_{self.history.settings.colour_by}", limit)

    # News: settings and status on their way to panels and views.

    def _follow(self, settings: Settings) -> None:
        self.panels.show_settings(settings)
        self.staging.show_settings(settings)
        self.display.show_settings(settings)
        theme = THEMES[settings.theme]
        application = QApplication.instance()
        if isinstance(application, QApplication):
            application.setPalette(palette(theme))
            if (font := letters(settings.letters)) != application.font():
                application.setFont(font)
        self.panels.show_theme(theme)
        self.cost.show_theme(theme)
        self.scene.show_theme(theme)
        for view in (self.timeline, self.transport, self.mark, self.offer, self.mishaps):
            view.show_theme(theme)
        self.stability.show_settings(settings)
        self.compare.show_settings(settings)
        self.compare.show_theme(theme)
        self.stability.show_theme(theme)
        self.health.show_theme(theme)
        self.lesson.show_theme(theme)
        self.pointing.show_theme(theme)
        self.display.show_theme(theme)
        self.presenting.show_theme(theme)
        self.picking.show_theme(theme)

    def _show_shape(self) -> None:
        """Draw the shape that is looked at on the skin, while somebody looks and wants it."""
        if self.session.closed:
            return  # the last panel hides while the window closes
        seen, setup = self.seeing.telling(), self.session.status.setup
        if seen is None or not self.stability.on_skin.isChecked():
            self.display.show_mode(None)
            return
        number, count = self.seeing.chosen, len(seen.values)
        words = f"Colours: shape {number} of {count}, no measurement"
        self.display.show_mode(seen.surface(number, setup.nx, setup.ny), words)

    def _show_status(self, status: Status) -> None:
        self.display.show_status(status)
        simulating = self.session.simulating and status.state == "streaming"
        now = time.monotonic()
        if now >= self._next_words:
            self._next_words = now + (NAMED if self.presenting.on else _WORDS)
            self.naming.look(status, self.display.estimate_shown())
        if now >= self._next_bargain:
            self._next_bargain = now + _BARGAIN
            self.panels.region.show_bargain(self.session.bargain())
        self.panels.show_status(status, simulating)
        self.stability.show_status(status, self.session.inside)
        self.health.show_status(status, self.session.inside)
        shown = self.display.estimate_shown()
        self.numbers.show_estimate(shown, status.sensor, self.object.text())
        self.compare.show_status(status, self.display.old)

    def _allow_tare(self) -> None:
        self.actions_by_name.allow("tare", self.taring.why_not)

    # Small things.

    def tell(self, text: str) -> None:
        """Say something in passing."""
        self.statusBar().showMessage(text, 10_000)

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
            self.scene.gallery.close()
            self.seeing.close()
            self.session.close()
            self.naming.close()
            self.display.close()
        super().closeEvent(event)
