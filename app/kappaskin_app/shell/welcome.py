"""The welcome banner: where to start, above the skin when a window opens."""

from collections.abc import Callable

from PySide6.QtCore import QObject
from PySide6.QtWidgets import QMenu, QPushButton

from kappaskin_app.guard import guarded
from kappaskin_app.shell.centre import ActionBanner, BannerAction
from kappaskin_app.shell.history import History
from kappaskin_app.shell.requests import Requests
from kappaskin_app.shell.session import Session

_TIP = (
    "The skin below is simulated: press on it with the mouse. These actions are in the menus too; "
    "Help > Welcome shows this again."
)


class Welcome(QObject):
    """Shows the actions that features added in a banner, until one is used or a source opens."""

    def __init__(
        self,
        offer: ActionBanner,
        history: History,
        session: Session,
        requests: Requests,
        recent: QMenu,
        parent: QObject,
    ) -> None:
        super().__init__(parent)
        self._offer, self._history, self._session = offer, history, session
        self._buttons = list[QPushButton]()
        self._ways: dict[int, BannerAction] = {}
        self._last = [
            BannerAction("Recentl&y opened", "Files opened or recorded last.", recent),
            BannerAction(
                "Do not sho&w again",
                "Do not show this banner when the window opens; Settings > View turns it on again.",
                lambda: requests.set("show_start", False),
            ),
        ]
        session.source_changed.connect(guarded(lambda *_: self._end()))

    def add(self, place: int, words: str, tip: str, act: Callable[[], object]) -> None:
        """Add an action at this `place` in the order."""
        self._ways[place] = BannerAction(words, tip, act)

    def begin(self) -> None:
        """Show it where the settings ask for it, no source is open and the banner is free."""
        begun = not self._session.inside or self._session.engine.resumed is not None
        if self._history.settings.show_start and not (begun or self._offer.isVisible()):
            self.offer()

    def offer(self) -> None:
        """Show it."""
        ways = [self._ways[place] for place in sorted(self._ways)]
        self._offer.show_actions("Start with:", _TIP, [*ways, *self._last])
        self._buttons = self._offer.buttons

    def _end(self) -> None:
        if self._offer.buttons is self._buttons:  # else it shows something else
            self._offer.hide()
