"""Settings and status of a session, on their way to the panels and views of its window."""

import time
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject
from PySide6.QtWidgets import QApplication

from kappaskin.live import Status
from kappaskin_app.features.presenter.presenting import NAMED
from kappaskin_app.shell.settings import Settings
from kappaskin_app.theme import THEMES, bar_palette, letters, palette

if TYPE_CHECKING:
    from kappaskin_app.shell.window import MainWindow

_WORDS = 1.0  # s between two looks at what touches the skin: as fast as one can read
_BARGAIN = 1.0  # s between two looks at what a region buys


class News(QObject):
    """Brings what is new to all in a `window` that shows it."""

    def __init__(self, window: "MainWindow") -> None:
        super().__init__(window)
        self._window = window
        self._next_bargain = self._next_words = 0.0
        self._look: tuple[str, float] | None = None
        self._set = (
            *(window.panels, window.staging, window.display),
            *(window.stability, window.compare, window.design),
        )
        self._themed = (
            *(window.panels, window.cost, window.scene, window.timeline, window.transport),
            *(window.mark, window.mishaps, window.compare, window.stability),
            *(window.log, window.health, window.lesson, window.pointing, window.display),
            *(window.design, window.presenting, window.picking, window.guide),
        )

    def follow_settings(self, settings: Settings) -> None:
        for each in self._set:
            each.show_settings(settings)
        if (look := (settings.theme, settings.letters)) != self._look:
            self._look = look
            self._show_look(settings)

    def _show_look(self, settings: Settings) -> None:
        theme = THEMES[settings.theme]
        application = QApplication.instance()
        if isinstance(application, QApplication):
            application.setPalette(palette(theme))
            application.setPalette(
                bar_palette(theme),
                "QScrollBar",  # pyright: ignore[reportArgumentType]
            )
            if (font := letters(settings.letters)) != application.font():
                application.setFont(font)
        for each in self._themed:
            each.show_theme(theme)

    def show_shape(self) -> None:
        """Draw the shape that is looked at on the skin, while somebody looks and wants it."""
        window = self._window
        if window.session.closed:
            return  # the last panel hides while the window closes
        seen, setup = window.seeing.telling(), window.session.status.setup
        if seen is None or not window.stability.on_skin.isChecked():
            window.display.show_mode(None)
            return
        number, count = window.seeing.chosen, len(seen.values)
        words = f"Colours: shape {number} of {count}, no measurement"
        window.display.show_mode(seen.surface(number, setup.nx, setup.ny), words)

    def follow(self, status: Status) -> None:
        window, session = self._window, self._window.session
        window.display.show_status(status)
        simulating = session.simulating and status.state == "streaming"
        shown, now = window.display.estimate_shown(), time.monotonic()
        if now >= self._next_words:
            self._next_words = now + (NAMED if window.presenting.on else _WORDS)
            window.naming.look(status, shown)
        if now >= self._next_bargain:
            self._next_bargain = now + _BARGAIN
            window.panels.region.show_bargain(session.bargain())
        window.panels.show_status(status, simulating)
        window.stability.show_status(status, session.inside)
        window.health.show_status(status, session.inside)
        window.numbers.show_estimate(shown, status.sensor, window.object.text())
        window.log.look()
        window.compare.show_status(status, window.display.old)
