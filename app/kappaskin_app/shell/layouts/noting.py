"""What a person does to the docks of a window and its pages, as steps that can be undone."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from PySide6.QtCore import QEvent, QObject, QTimer
from PySide6.QtWidgets import QApplication, QDockWidget, QMainWindow, QTabWidget

from kappaskin_app.guard import guarded
from kappaskin_app.shell.actions import plain
from kappaskin_app.shell.history import History
from kappaskin_app.shell.layouts.arranging import layout_of, words_of
from kappaskin_app.shell.layouts.layout import Layout

_HELD = 50  # ms between two looks whether the mouse has let go


@dataclass(frozen=True)
class Seen:
    """How the window is arranged, and which of its other `pages` are turned to."""

    layout: Layout
    pages: tuple[int, ...]

    def differs(self, other: "Seen") -> bool:
        """Whether it is another but for the sizes of docks."""
        return _in_words(self) != _in_words(other)


class Noting(QObject):
    """Watches the docks and `tabs` of a `window`; `apply` brings back a layout that was.

    `filled` says whether a view fills the screen, which is no arrangement.

    What docks do in the turn of another step belongs to that one.
    """

    def __init__(
        self,
        window: QMainWindow,
        docks: Mapping[str, QDockWidget],
        tabs: Sequence[QTabWidget],
        history: History,
        apply: Callable[[Layout], object],
        filled: Callable[[], bool],
    ) -> None:
        super().__init__(window)
        self._window, self._docks, self._history = window, docks, history
        self._panels, *self._pages = tabs
        self._apply, self._filled = apply, filled
        self._known: Seen | None = None
        self._settles, self._sized = True, False
        self._timer = QTimer(self, singleShot=True)  # pyright: ignore[reportCallIssue]
        self._timer.timeout.connect(guarded(self.note))
        for dock in self._docks.values():
            for news in (dock.visibilityChanged, dock.topLevelChanged, dock.dockLocationChanged):
                news.connect(guarded(self._later))
        for pages in (self._panels, *self._pages):
            pages.currentChanged.connect(guarded(self._later))
        history.stack.indexChanged.connect(guarded(self.settle))
        window.installEventFilter(self)

    def note(self) -> None:
        """Make a step of what was done since the last look, if anything was."""
        window, held = self._window, bool(QApplication.mouseButtons().value)
        self._timer.stop()
        if held:
            self._timer.start(_HELD)
        elif window.isVisible() and not window.isMinimized() and not self._filled():
            self._look()

    def _look(self) -> None:
        before, now = self._known, self._now()
        settles, sized = self._settles, self._sized
        self._known, self._settles, self._sized = now, False, False
        # A page that cannot be seen any more is left without anybody's doing.
        if before is None or settles or not self._can_turn_to(before):
            return
        if now.differs(before) or (sized and now != before):
            self._history.step(self._told(before, now), self._have, before, now)

    def _can_turn_to(self, seen: Seen) -> bool:
        """Whether the pages of then can be seen now."""
        return all(
            tabs.isTabEnabled(page) for tabs, page in zip(self._pages, seen.pages, strict=True)
        )

    def _now(self) -> Seen:
        layout = layout_of(self._window, self._docks, self._panels)
        return Seen(layout, tuple(tabs.currentIndex() for tabs in self._pages))

    def _have(self, seen: Seen) -> None:
        """Have the window so, unless it is."""
        if seen != self._known:
            for tabs, page in zip(self._pages, seen.pages, strict=True):
                if tabs.isTabEnabled(page):
                    tabs.setCurrentIndex(page)
            self._apply(seen.layout)
            self._known = seen

    def _later(self, *_: object) -> None:
        self._timer.start(0)

    def settle(self, *_: object) -> None:
        """Take the next look for what is so, as nobody's step."""
        self._settles = True
        self._timer.start(0)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        kind = event.type()
        if kind == QEvent.Type.Resize:
            self._later()
        elif kind == QEvent.Type.MouseButtonPress:  # of the window itself: on an edge of docks
            self._known = self._now()
        elif kind == QEvent.Type.MouseButtonRelease:
            self._sized = True
            self._later()
        return False

    def _told(self, before: Seen, after: Seen) -> str:
        """What became of the window, in words."""
        if not after.differs(before):
            return "size of the panels"
        was, now = dict(before.layout.docks), dict(after.layout.docks)
        for change in ("shown", "area", "front"):
            of = [n for n in now if getattr(was[n], change) != getattr(now[n], change)]
            if change == "front":
                of = [n for n in of if now[n].front]
            if len(of) == 1:
                how = "move" if change == "area" else "show" if now[of[0]].shown else "hide"
                return f"{how} {self._docks[of[0]].windowTitle()}"
        if before.layout.page != after.layout.page:
            return f"page {plain(self._panels.tabText(after.layout.page))}"
        for tabs, was_on, now_on in zip(self._pages, before.pages, after.pages, strict=True):
            if was_on != now_on:
                return f"page {plain(tabs.tabText(now_on))}"
        return "arrange the panels"


def _in_words(seen: Seen) -> object:
    return seen.pages, seen.layout.page, words_of(seen.layout)
