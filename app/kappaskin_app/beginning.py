"""Ways to begin, offered above the skin when a window opens."""

from typing import TYPE_CHECKING

from PySide6.QtCore import QObject

from kappaskin_app.guard import guarded
from kappaskin_app.views.offer import Offered

if TYPE_CHECKING:
    from kappaskin_app.window import MainWindow

_LASTS = 60.0  # s, unless somebody is at it
_DOTS = "\N{HORIZONTAL ELLIPSIS}"
_TIP = (
    "What moves below is a simulated skin: drag the red arrow. All of this is in the menus "
    "too, and Help > Ways to begin shows it again."
)


class Beginning(QObject):
    """Offers in a `window` what one may begin with, until something is begun."""

    def __init__(self, window: "MainWindow") -> None:
        super().__init__(window)
        self._window = window
        self._offering = False
        begun = (window.replaying.opened, window.staging.played, window.history.stack.indexChanged)
        for signal in begun:
            signal.connect(guarded(lambda *_: self._end()))

    def begin(self) -> None:
        """Offer them where a person wants it, and has not begun with something already."""
        window, session = self._window, self._window.session
        begun = window.presenting.on or not session.inside or session.engine.resumed is not None
        if window.history.settings.show_start and not begun:
            self.offer()

    def offer(self) -> None:
        """Offer them, unless something else is offered."""
        window = self._window
        if not window.offer.isVisible():
            self._offering = True
            window.offer.show_offer("To begin:", _TIP, self._ways(), _LASTS)

    def _ways(self) -> list[Offered]:
        window = self._window
        return [
            Offered(
                f"&Open a scene{_DOTS}",
                "Simulate what a file says (Ctrl+O); ready ones with pictures: Scene (F2).",
                window.staging.open,
            ),
            Offered(
                "Connec&t a sensor",
                "Choose the port of a real sensor under Connection, and connect it.",
                self._show_connection,
            ),
            Offered(
                "&Begin a lesson",
                "Eleven of ten to fifteen minutes: from what a gage feels to mending a sensor.",
                lambda: window.docks.reveal("lesson"),
            ),
            Offered(
                f"&Play a recording{_DOTS}",
                "Show what was recorded; a file dropped on the window does too.",
                window.replaying.open,
            ),
            Offered("Recentl&y opened", "What was opened or recorded last.", window.opening.menu),
            Offered(
                "Do not sho&w again",
                "Begin without this line from now on; Ways to begin, under View, brings it back.",
                lambda: window.wishes.wish("show_start", False),
            ),
        ]

    def _show_connection(self) -> None:
        self._window.docks.reveal("settings")
        self._window.panels.show_connection()

    def _end(self) -> None:
        if self._offering:
            self._offering = False
            self._window.offer.hide()
