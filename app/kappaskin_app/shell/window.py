"""The window: the shell's parts, and the features that are installed into them."""

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from PySide6.QtCore import Qt
from PySide6.QtGui import QCloseEvent, QKeyEvent, QResizeEvent

from kappaskin.live import Engine, Fingers, ResumeInfo, Status
from kappaskin_app import DEFAULT_SOURCE
from kappaskin_app.guard import guarded
from kappaskin_app.shell.menus import Menus
from kappaskin_app.shell.parts import Parts
from kappaskin_app.shell.pictures import write_png
from kappaskin_app.shell.recovery import settings_left
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.simulation import settings_for
from kappaskin_app.shell.window_file import WindowSaver
from kappaskin_app.theme import THEMES, apply_look
from kappaskin_app.widgets.layout import widen
from kappaskin_app.widgets.text import ERROR_BARS, Coverage

_SETTINGS = "Settings: connection, load, basis, view, skin, sensor, calibration"
_PACKED = 80  # of a picture: packs a fifth less well than Qt does, in half the time


class Feature(Protocol):
    """A feature of the app; its parts are its attributes."""

    name: str

    def install(self, shell: "MainWindow") -> None:
        """Add its docks, panels, views and actions to the shell, and connect to it."""
        ...


class MainWindow(Parts):
    """The shell that features are installed into."""

    def __init__(
        self,
        features: Sequence[Feature],
        source: str = "sim:",
        engine: Engine | Fingers | None = None,
        trusted: frozenset[Path] = frozenset(),
    ) -> None:
        handed = next(iter(engine.engines.values())).resumed if engine else None
        if handed and source in ("sim:", DEFAULT_SOURCE):  # no other source was requested
            source = handed.requested.source or source
        super().__init__(settings_left(handed) if handed else settings_for(source), engine)
        self.session.trusted = trusted
        self.setObjectName("kappaskin")
        self.setWindowTitle("Kappaskin")
        self.menus = Menus(self)
        self.saver = WindowSaver(self, self.menus)
        self.menus.quit_requested.connect(guarded(self.quit))
        self.features: dict[str, Feature] = {}
        self._lay_out()
        self._wire()
        for feature in features:
            self.features[feature.name] = feature
            feature.install(self)
        self._finish(source, handed, already=engine is not None)

    def _lay_out(self) -> None:
        self.setCentralWidget(self.display.centre)
        self.setStatusBar(self.display.status_bar)
        self.addToolBar(self.display.header)
        self.docks.put_left("settings", "Settings", self.panels, _SETTINGS, share=0.25)

    def _wire(self) -> None:
        session, tasks, activity = self.session, self.tasks, self.display.status_bar.activity
        self.panels.requested.connect(guarded(self.requests.set))
        self.panels.reset_requested.connect(guarded(self.requests.reset_panel))
        self.panels.guide_requested.connect(self.guide_requested)
        self.history.changed.connect(guarded(self._show_settings))
        session.reported.connect(guarded(self._show_status))
        session.reported.connect(guarded(tasks.report))
        tasks.notified.connect(guarded(lambda words: activity.show_work(words, tasks.may_cancel)))
        tasks.refused.connect(guarded(self.notify))
        activity.cancel_wanted.connect(guarded(tasks.cancel))
        for part in (self.opening, self.layouts):
            part.notified.connect(guarded(self.notify))

    def _finish(self, source: str, handed: ResumeInfo | None, already: bool) -> None:
        # After features, who may use a file then.
        self.session.reported.connect(guarded(self.opening.follow))
        self.display.restarted.connect(
            guarded(lambda _: self._show_settings(self.history.settings))
        )
        self.panels.build()
        self.menus.finish()
        self.display.banner.shown.connect(guarded(self.actions_by_name.update_tips))
        self._show_settings(self.history.settings, anew=True)
        self.resize(1280, 800)
        if handed:
            self.session.go_on(handed)
        else:
            self.session.connect_to(source, already=already)
        self.begun.emit(handed, source)

    def _show_settings(self, settings: Settings, anew: bool = False) -> None:
        before = None if anew else self.display.settings
        Coverage.now = ERROR_BARS[settings.error_bars]
        self.panels.show_settings(settings)
        shown = self.display.colouring.possible(settings)
        self.display.show_settings(shown)
        self.settings_shown.emit(shown)
        look = settings.theme, settings.letters, settings.colour_map
        if before is None or look != (before.theme, before.letters, before.colour_map):
            apply_look(THEMES[settings.theme], settings.letters, settings.colour_map)

    def _show_status(self, status: Status) -> None:
        self.panels.show_status(status, self.session.simulating and status.state != "off")

    # Called by features.

    def picture(self, path: Path) -> None:
        """Save the window, 3-D picture included, as a PNG; a `Refusal` where that fails."""
        write_png(self.grab().toImage(), path, _PACKED)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        banner = self.display.banner
        if event.key() == Qt.Key.Key_Escape and self.layouts.filled:
            self.layouts.leave_full_screen()
        elif event.key() == Qt.Key.Key_Escape and banner.isVisible():
            banner.hide()
        else:
            super().keyPressEvent(event)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        for dock in self.docks.right:
            widen(self, dock, event)

    def quit(self) -> None:
        """Close, unless a feature keeps the window open."""
        if self.may_close():
            self.close()

    def may_close(self) -> bool:
        """Whether no feature keeps the window open."""
        return all(may() for may in self.session.may_close)

    def closeEvent(self, event: QCloseEvent) -> None:
        # Only of a person: a run of so many seconds ends, and so does one that gets a signal.
        if event.spontaneous() and not self.session.closed and not self.may_close():
            event.ignore()
            return
        if not self.session.closed:
            self.saver.finish()
            self.history.stack.blockSignals(True)  # it emits even during destruction
            self.closing.emit()
            self.tasks.close()
            self.session.close()
            self.closed.emit()
        super().closeEvent(event)
