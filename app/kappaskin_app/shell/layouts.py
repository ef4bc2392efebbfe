"""Layouts: selected, saved, renamed and deleted, with undo."""

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
from kappaskin_app.widgets.parts import ELLIPSIS

_HELD = 50  # ms between two checks whether the mouse button is released


@dataclass(frozen=True)
class WindowArrangement:
    """The layout of the window, and the current page of each of its other tab widgets."""

    layout: Layout
    pages: tuple[int, ...]

    def differs(self, other: "WindowArrangement") -> bool:
        """Whether it differs in more than the sizes of docks."""
        return _discrete_part(self) != _discrete_part(other)


class LayoutTracker(QObject):
    """Makes changes of the docks and `tabs` of a `window` steps that can be undone.

    `apply` restores a layout; `filled` says whether a view fills the screen, which is no layout.
    What docks do within another step belongs to that one.
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
        self._last: WindowArrangement | None = None
        self._ignores, self._sized = True, False
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
        """Record what was changed since the last time as a step, if anything was."""
        window, held = self._window, bool(QApplication.mouseButtons().value)
        self._timer.stop()
        if held:
            self._timer.start(_HELD)
        elif window.isVisible() and not window.isMinimized() and not self._filled():
            self._record_step()

    def _record_step(self) -> None:
        before, now = self._last, self._now()
        settles, sized = self._ignores, self._sized
        self._last, self._ignores, self._sized = now, False, False
        # A page that cannot be seen any more is left without anybody's doing.
        if before is None or settles or not self._can_turn_to(before):
            return
        if now.differs(before) or (sized and now != before):
            self._history.step(self._step_text(before, now), self._restore, before, now)

    def _can_turn_to(self, seen: WindowArrangement) -> bool:
        """Whether those pages are enabled now."""
        return all(
            tabs.isTabEnabled(page) for tabs, page in zip(self._pages, seen.pages, strict=True)
        )

    def _now(self) -> WindowArrangement:
        layout = layout_of(self._window, self._docks, self._panels)
        return WindowArrangement(layout, tuple(tabs.currentIndex() for tabs in self._pages))

    def _restore(self, seen: WindowArrangement) -> None:
        """Restore an arrangement, unless it is the present one."""
        if seen != self._last:
            for tabs, page in zip(self._pages, seen.pages, strict=True):
                if tabs.isTabEnabled(page):
                    tabs.setCurrentIndex(page)
            self._apply(seen.layout)
            self._last = seen

    def _later(self, *_: object) -> None:
        self._timer.start(0)

    def settle(self, *_: object) -> None:
        """Take the next change as the present state, not as a step."""
        self._ignores = True
        self._timer.start(0)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        kind = event.type()
        if kind == QEvent.Type.Resize:
            self._later()
        elif kind == QEvent.Type.MouseButtonPress:  # of the window itself: on an edge of docks
            self._last = self._now()
        elif kind == QEvent.Type.MouseButtonRelease:
            self._sized = True
            self._later()
        return False

    def _step_text(self, before: WindowArrangement, after: WindowArrangement) -> str:
        """What was changed, as the text of a step."""
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


def _discrete_part(seen: WindowArrangement) -> object:
    return seen.pages, seen.layout.page, words_of(seen.layout)


_MENU = "Layo&ut"
_LONGEST = 60  # characters of a name
_LIVE = "Live"
_LIVE_TIP = "Settings and curvature beside the skin: the default layout"


class FullScreen(Protocol):
    """A view that can fill the screen, and does while it is `on`."""

    @property
    def on(self) -> bool: ...

    def enter(self) -> None: ...

    def leave(self) -> None: ...


class Layouts(QObject):
    """Arranges the docks of a `window`; `own` are the saved layouts, `changed` reports a change."""

    notified = Signal(str)
    changed = Signal()

    def __init__(self, window: QMainWindow, docks: Docks, panels: Pages, history: History) -> None:
        super().__init__(window)
        self._window, self._all, self._panels = window, docks, panels
        self._history = history
        self.full_screen: FullScreen | None = None
        """A view that may fill the screen, once a feature has one."""
        self._full = ""
        self.pages: list[QTabWidget] = []
        """Other tab widgets of the window, whose changes can be undone too."""
        self._tracker: LayoutTracker | None = None
        self._ready: dict[str, tuple[str, str]] = {}  # of each the tip and the page
        self.add(_LIVE, _LIVE_TIP)
        self.own: dict[str, Layout] = {}
        self._menu = QMenu(window)
        self._menu.aboutToShow.connect(guarded(self._list))

    def add(self, name: str, tip: str, page: str = LIVE, full: FullScreen | None = None) -> None:
        """Add a ready layout on a `page` of settings; a view may fill the screen.

        Its docks are those put with this layout's name.
        """
        self._ready[name] = tip, page
        if full is not None:
            self.full_screen, self._full = full, name

    def ready(self, name: str = _LIVE) -> Layout:
        """The ready layout of this name."""
        _, page = self._ready[name]
        return ready_layout(self._all, name, self._panels.place(page))

    def begin(self) -> None:
        """Track the docks and pages, once all are installed."""
        pages = [self._panels, *self.pages]
        self._tracker = LayoutTracker(
            *(self._window, self._docks, pages, self._history),
            *(self.apply, lambda: self.filled),
        )

    def note(self) -> None:
        """Record pending changes of the window as a step, if there are any."""
        if self._tracker is not None:
            self._tracker.note()

    @property
    def _docks(self) -> dict[str, QDockWidget]:
        return self._all.by_name()

    def add_actions(self, actions: Actions) -> None:
        """Register the actions."""
        add = partial(actions.add, menu=_MENU)
        for name, (tip, _) in self._ready.items():
            act = partial(self.choose, name)
            add(f"layout-{name.lower()}", text=f"&{name}", act=act, tip=tip)
        own = add("layout-own", text="Your &own", act=lambda: None, tip="Layouts you saved")
        own.setMenu(self._menu)
        for name, text, act, tip in (
            (
                "save",
                f"Sa&ve this layout{ELLIPSIS}",
                self.ask_name,
                "Save this layout under a name",
            ),
            (
                "rename",
                f"Re&name a layout{ELLIPSIS}",
                self.ask_rename,
                "Rename one of your layouts",
            ),
            (
                "delete",
                f"&Delete a layout{ELLIPSIS}",
                self.ask_delete,
                "Delete one of your layouts",
            ),
            ("reset", "&Reset the layout", self.reset, "All panels to their default places"),
        ):
            add(f"layout-{name}", text=text, act=act, tip=tip)

    @property
    def filled(self) -> bool:
        """Whether a view fills the screen."""
        return self.full_screen is not None and self.full_screen.on

    def leave_full_screen(self) -> None:
        if self.full_screen is not None:
            self.full_screen.leave()

    # State.

    @property
    def now(self) -> Layout:
        """The layout of the window; a full-screen view is left first."""
        self.leave_full_screen()
        return layout_of(self._window, self._docks, self._panels)

    def apply(self, layout: Layout) -> None:
        """Apply a layout, without a step."""
        if self._tracker is not None:
            self._tracker.settle()
        self.leave_full_screen()
        arrange(self._window, self._docks, self._panels, layout)

    # Requests of the user.

    def choose(self, name: str) -> None:
        """Apply the layout of this name, as a step that can be undone."""
        layout = self.own[name] if name in self.own else self.ready(name)
        if (before := self.now) != layout:
            self._history.step(f"layout {name}", self.apply, before, layout)
        if name == self._full and self.full_screen is not None:
            self.full_screen.enter()

    def reset(self) -> None:
        """Apply the default layout."""
        self.choose(_LIVE)

    def save(self, name: str) -> None:
        """Save this layout under a name; one of that name is replaced."""
        name = name.strip()
        if not name or len(name) > _LONGEST or name in self._ready:
            taken = ", ".join(self._ready)
            self.notified.emit(
                f"Expected a name of at most {_LONGEST} characters other than {taken}, got "
                f"{name!r:.80}: choose another"
            )
            return
        self._step(f"save the layout {name}", self.own | {name: self.now})
        self.notified.emit(f"Saved the layout {name}")

    def rename(self, old: str, new: str) -> None:
        """Rename a layout."""
        new = new.strip()
        if new in self.own or new in self._ready or not 0 < len(new) <= _LONGEST:
            self.notified.emit(f"{new!r:.80} is not a valid name, or is in use: choose another")
            return
        renamed = {new if name == old else name: each for name, each in self.own.items()}
        self._step(f"rename the layout {old} to {new}", renamed)

    def delete(self, name: str) -> None:
        """Delete a layout."""
        rest = {other: each for other, each in self.own.items() if other != name}
        self._step(f"delete the layout {name}", rest)
        self.notified.emit(f"Deleted the layout {name}")

    def _step(self, text: str, own: Mapping[str, Layout]) -> None:
        self._history.step(text, self._restore, self.own, own)

    def _restore(self, own: Mapping[str, Layout]) -> None:
        self.own = dict(own)
        self.changed.emit()

    # Dialogs.

    def ask_name(self) -> None:
        """Ask for a name, and save this layout under it."""
        self._ask("Save this layout", "Name:", self.save)

    def ask_rename(self) -> None:
        """Ask which layout is to be renamed."""
        self._ask_which("Rename a layout", self._ask_other_name)

    def _ask_other_name(self, old: str) -> None:
        self._ask("Rename a layout", f"New name of {old}:", partial(self.rename, old), old)

    def ask_delete(self) -> None:
        """Ask which layout is to be deleted."""
        self._ask_which("Delete a layout", self.delete)

    def _ask_which(self, title: str, act: Callable[[str], None]) -> None:
        if not self.own:
            self.notified.emit("No saved layout yet: save one first")
            return
        dialog = self._ask(title, "Layout:", act)
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
