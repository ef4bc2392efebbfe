"""Welcome: what one may begin with, offered above the skin when a window opens."""

from collections.abc import Callable

from PySide6.QtCore import QObject
from PySide6.QtWidgets import QMenu

from kappaskin_app.guard import guarded
from kappaskin_app.shell.centre import Offer, Offered
from kappaskin_app.shell.history import History
from kappaskin_app.shell.requests import Requests
from kappaskin_app.shell.session import Session

_LASTS = 60.0  # s, unless somebody is at it
_TIP = (
    "What moves below is a simulated skin: drag the red arrow. All of this is in the menus "
    "too, and Help > Welcome shows it again."
)


class Welcome(QObject):
    """Offers in a banner what features added, until something is begun."""

    def __init__(
        self,
        offer: Offer,
        history: History,
        session: Session,
        requests: Requests,
        recent: QMenu,
        parent: QObject,
    ) -> None:
        super().__init__(parent)
        self._offer, self._history, self._session = offer, history, session
        self._offering = False
        self._ways: dict[int, Offered] = {}
        self._last = [
            Offered("Recentl&y opened", "What was opened or recorded last.", recent),
            Offered(
                "Do not sho&w again",
                "Begin without this line from now on; Welcome, under View, brings it back.",
                lambda: requests.set("show_start", False),
            ),
        ]
        session.source_changed.connect(guarded(lambda *_: self._end()))
        history.stack.indexChanged.connect(guarded(lambda *_: self._end()))

    def add(self, place: int, words: str, tip: str, act: Callable[[], object]) -> None:
        """Offer this too, at this `place` among all."""
        self._ways[place] = Offered(words, tip, act)

    def begin(self) -> None:
        """Offer all where a person wants it, and has not begun with something already."""
        begun = not self._session.inside or self._session.engine.resumed is not None
        if self._history.settings.show_start and not begun:
            self.offer()

    def offer(self) -> None:
        """Offer all, unless something else is offered."""
        if not self._offer.isVisible():
            self._offering = True
            ways = [self._ways[place] for place in sorted(self._ways)]
            self._offer.show_offer("To begin:", _TIP, [*ways, *self._last], _LASTS)

    def _end(self) -> None:
        if self._offering:
            self._offering = False
            self._offer.hide()
