"""Layouts: selected, saved, renamed and deleted."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Protocol

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtWidgets import QDockWidget, QInputDialog, QMainWindow, QMenu

from kappaskin_app.guard import guarded
from kappaskin_app.shell.actions import Actions
from kappaskin_app.shell.arrangement import Layout, arrange, layout_of, ready_layout
from kappaskin_app.shell.docks import Docks
from kappaskin_app.shell.pages import LIVE, Pages
from kappaskin_app.widgets.parts import ELLIPSIS

_MENU = "Layo&ut"
_LONGEST = 60  # characters of a name
_LIVE = "Live"
_LIVE_TIP = "Settings and curvature beside the skin: the default layout"


class FullScreen(Protocol):
    """A view that can fill the screen, and does while it is `on`."""

    @property
    def on(self) -> bool: ...

    def enter(self) -> None: ...

    def leave(self, arrange: Callable[[], object] | None = None) -> None: ...


class Layouts(QObject):
    """Arranges the docks of a `window`; `own` are the saved layouts, `changed` reports a change."""

    notified = Signal(str)
    changed = Signal()

    def __init__(self, window: QMainWindow, docks: Docks, panels: Pages) -> None:
        super().__init__(window)
        self._window, self._all, self._panels = window, docks, panels
        self.full_screen: FullScreen | None = None
        """A view that may fill the screen, once a feature has one."""
        self._full = ""
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

    @property
    def _docks(self) -> dict[str, QDockWidget]:
        return self._all.by_name()

    def add_actions(self, actions: Actions) -> None:
        """Register the actions."""
        add = partial(actions.add, menu=_MENU)
        for name, (tip, _) in self._ready.items():
            act = partial(self.choose, name)
            add(f"layout-{name.lower()}", text=f"&{name}", act=act, tip=tip)
        own = add(
            "layout-own", text="Saved la&youts", act=lambda: None, tip="Layouts that you saved"
        )
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
        """Apply a layout."""
        self.leave_full_screen()
        arrange(self._window, self._docks, self._panels, layout)

    # Requests of the user.

    def choose(self, name: str) -> None:
        """Apply the layout of this name."""
        layout = self.own[name] if name in self.own else self.ready(name)
        if self.full_screen is not None and self.full_screen.on and name != self._full:
            self.full_screen.leave(partial(self.apply, layout))
        elif self.now != layout:
            self.apply(layout)
            if name not in self.own:
                self._all.share_columns()
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
        self._keep(self.own | {name: self.now})
        self.notified.emit(f"Saved the layout {name}")

    def rename(self, old: str, new: str) -> None:
        """Rename a layout."""
        new = new.strip()
        if new in self.own or new in self._ready or not 0 < len(new) <= _LONGEST:
            self.notified.emit(f"{new!r:.80} is not a valid name, or is in use: choose another")
            return
        self._keep({new if name == old else name: each for name, each in self.own.items()})

    def delete(self, name: str) -> None:
        """Delete a layout."""
        self._keep({other: each for other, each in self.own.items() if other != name})
        self.notified.emit(f"Deleted the layout {name}")

    def _keep(self, own: Mapping[str, Layout]) -> None:
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
            self._menu.addAction("No saved layout yet").setEnabled(False)
