"""Layouts as a person chooses and changes them, as steps that can be undone."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Protocol

from PySide6.QtCore import QEvent, QObject, Qt, QTimer, Signal
from PySide6.QtWidgets import (
    QApplication,
    QDockWidget,
    QInputDialog,
    QMainWindow,
    QMenu,
    QTabWidget,
)

from kappaskin_app.guard import guarded
from kappaskin_app.shell.actions import Actions, plain
from kappaskin_app.shell.arrangement import (
    Layout,
    arrange,
    layout_of,
    ready_layout,
    words_of,
)
from kappaskin_app.shell.docks import Docks
from kappaskin_app.shell.history import History
from kappaskin_app.shell.pages import LIVE, Pages

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


_MENU = "Layo&ut"
_DOTS = "\N{HORIZONTAL ELLIPSIS}"
_LONGEST = 60  # characters of a name
_LIVE = "Live"
_LIVE_TIP = "Settings and curvature beside the skin: how the window begins"


class FullScreen(Protocol):
    """A view that fills the screen while it is `on`."""

    @property
    def on(self) -> bool: ...

    def enter(self) -> None: ...

    def leave(self) -> None: ...


class Layouts(QObject):
    """Arranges the docks of a `window`; `own` are those saved, `changed` tells that they did."""

    told = Signal(str)
    changed = Signal()

    def __init__(self, window: QMainWindow, docks: Docks, panels: Pages, history: History) -> None:
        super().__init__(window)
        self._window, self._all, self._panels = window, docks, panels
        self._history = history
        self.full_screen: FullScreen | None = None
        """A view that may fill the screen, once a feature has one."""
        self._full = ""
        self.pages: list[QTabWidget] = []
        """Pages elsewhere in the window, whose turning can be undone too."""
        self._noting: Noting | None = None
        self._ready: dict[str, tuple[str, str]] = {}  # of each the tip and the page
        self.add(_LIVE, _LIVE_TIP)
        self.own: dict[str, Layout] = {}
        self._menu = QMenu(window)
        self._menu.aboutToShow.connect(guarded(self._list))

    def add(self, name: str, tip: str, page: str = LIVE, full: FullScreen | None = None) -> None:
        """Have a ready layout of this name, on a `page` of settings; a view may fill the screen.

        Which docks are shown in it, they say themselves.
        """
        self._ready[name] = tip, page
        if full is not None:
            self.full_screen, self._full = full, name

    def ready(self, name: str = _LIVE) -> Layout:
        """The ready layout of this name."""
        _, page = self._ready[name]
        return ready_layout(self._all, name, self._panels.place(page))

    def begin(self) -> None:
        """Watch the docks and pages, once all are there."""
        pages = [self._panels, *self.pages]
        self._noting = Noting(
            *(self._window, self._docks, pages, self._history),
            *(self.apply, lambda: self.filled),
        )

    def note(self) -> None:
        """Make a step of what a person did to the window, if anything was done."""
        if self._noting is not None:
            self._noting.note()

    @property
    def _docks(self) -> dict[str, QDockWidget]:
        return self._all.by_name()

    def add_actions(self, actions: Actions) -> None:
        """Register what a person can do."""
        add = partial(actions.add, menu=_MENU)
        for name, (tip, _) in self._ready.items():
            act = partial(self.choose, name)
            add(f"layout-{name.lower()}", text=f"&{name}", act=act, tip=tip)
        own = add("layout-own", text="Your &own", act=lambda: None, tip="Layouts you saved")
        own.setMenu(self._menu)
        for name, text, act, tip in (
            ("save", f"Sa&ve this layout{_DOTS}", self.ask_name, "Keep it under a name"),
            ("rename", f"Re&name a layout{_DOTS}", self.ask_rename, "Give it another name"),
            ("delete", f"&Delete a layout{_DOTS}", self.ask_delete, "Forget one of your own"),
            ("reset", "&Reset the layout", self.reset, "Every panel where it is at first"),
        ):
            add(f"layout-{name}", text=text, act=act, tip=tip)

    @property
    def filled(self) -> bool:
        """Whether a view fills the screen."""
        return self.full_screen is not None and self.full_screen.on

    def leave_full_screen(self) -> None:
        if self.full_screen is not None:
            self.full_screen.leave()

    # What is so.

    @property
    def now(self) -> Layout:
        """How the window is arranged, or was before it was presented."""
        self.leave_full_screen()
        return layout_of(self._window, self._docks, self._panels)

    def apply(self, layout: Layout) -> None:
        """Arrange the window so, which is no step by itself."""
        if self._noting is not None:
            self._noting.settle()
        self.leave_full_screen()
        arrange(self._window, self._docks, self._panels, layout)

    # Requests of the user.

    def choose(self, name: str) -> None:
        """Arrange the window as the layout of this name, as a step that can be undone."""
        layout = self.own[name] if name in self.own else self.ready(name)
        if (before := self.now) != layout:
            self._history.step(f"layout {name}", self.apply, before, layout)
        if name == self._full and self.full_screen is not None:
            self.full_screen.enter()

    def reset(self) -> None:
        """Arrange the window as it is at first."""
        self.choose(_LIVE)

    def save(self, name: str) -> None:
        """Keep this layout under a name, in the place of another of that name."""
        name = name.strip()
        if not name or len(name) > _LONGEST or name in self._ready:
            taken = ", ".join(self._ready)
            self.told.emit(
                f"Expected a name of at most {_LONGEST} characters other than {taken}, got "
                f"{name!r:.80}: choose another"
            )
            return
        self._step(f"save the layout {name}", self.own | {name: self.now})
        self.told.emit(f"Saved the layout {name}")

    def rename(self, old: str, new: str) -> None:
        """Call a layout otherwise."""
        new = new.strip()
        if new in self.own or new in self._ready or not 0 < len(new) <= _LONGEST:
            self.told.emit(f"{new!r:.80} cannot be its name or is another's: choose another")
            return
        renamed = {new if name == old else name: each for name, each in self.own.items()}
        self._step(f"call the layout {old} {new}", renamed)

    def delete(self, name: str) -> None:
        """Forget a layout."""
        kept = {other: each for other, each in self.own.items() if other != name}
        self._step(f"delete the layout {name}", kept)
        self.told.emit(f"Deleted the layout {name}")

    def _step(self, text: str, own: Mapping[str, Layout]) -> None:
        self._history.step(text, self._have, self.own, own)

    def _have(self, own: Mapping[str, Layout]) -> None:
        self.own = dict(own)
        self.changed.emit()

    # Asking.

    def ask_name(self) -> None:
        """Ask for a name, and keep this layout under it."""
        self._ask("Save this layout", "Its name:", self.save)

    def ask_rename(self) -> None:
        """Ask which is to be called how."""
        self._ask_which("Rename a layout", self._ask_other_name)

    def _ask_other_name(self, old: str) -> None:
        self._ask("Rename a layout", f"{old} is to be called:", partial(self.rename, old), old)

    def ask_delete(self) -> None:
        """Ask which is to be forgotten."""
        self._ask_which("Delete a layout", self.delete)

    def _ask_which(self, title: str, act: Callable[[str], None]) -> None:
        if not self.own:
            self.told.emit("There is no layout of your own yet: save one first")
            return
        dialog = self._ask(title, "Which one:", act)
        dialog.setComboBoxItems(list(self.own))

    def _ask(
        self, title: str, label: str, act: Callable[[str], None], begun: str = ""
    ) -> QInputDialog:
        dialog = QInputDialog(self._window)
        dialog.setWindowTitle(title)
        dialog.setLabelText(label)
        dialog.setTextValue(begun)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.textValueSelected.connect(guarded(act))
        dialog.open()
        return dialog

    def _list(self) -> None:
        self._menu.clear()
        for name in self.own:
            action = self._menu.addAction(name.replace("&", "&&"))
            action.triggered.connect(guarded(lambda *_, name=name: self.choose(name)))
        if self._menu.isEmpty():
            self._menu.addAction("None yet: save one").setEnabled(False)
