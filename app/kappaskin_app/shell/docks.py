"""Docks beside and below the skin.

The left and right columns reach to the bottom of the window where the bottom docks fit between.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial

from PySide6.QtCore import QEvent, QObject, Qt, QTimer, Signal
from PySide6.QtGui import QCloseEvent
from PySide6.QtWidgets import (
    QDockWidget,
    QHBoxLayout,
    QMainWindow,
    QScrollArea,
    QStyle,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from kappaskin_app.guard import guarded
from kappaskin_app.shell.actions import Actions
from kappaskin_app.widgets.layout import heighten
from kappaskin_app.widgets.line import Line


@contextmanager
def drawn_once(widget: QWidget) -> Iterator[None]:
    """Suspend painting of `widget`.

    Else the 3-D view is drawn with each size in between, 15 to 40 ms each.
    """
    before = widget.updatesEnabled()
    widget.setUpdatesEnabled(False)
    try:
        yield
    finally:
        widget.setUpdatesEnabled(before)


class Title(QWidget):
    """The title bar of a `dock`; Qt's own does not follow the font of the application.

    The dock itself handles the mouse: a drag moves it, a double click floats it.
    """

    def __init__(self, dock: QDockWidget) -> None:
        super().__init__(dock)
        self.words = Line(dock.windowTitle())
        self.words.setToolTip(dock.toolTip())
        row, icons = QHBoxLayout(self), QStyle.StandardPixmap
        row.setContentsMargins(6, 1, 4, 1)
        row.setSpacing(2)
        row.addWidget(self.words, 1)
        self.float = self._button(icons.SP_TitleBarNormalButton, "Float or dock")
        self.float.clicked.connect(guarded(lambda *_: dock.setFloating(not dock.isFloating())))
        self.close_ = self._button(icons.SP_TitleBarCloseButton, "Close")
        self.close_.clicked.connect(guarded(lambda *_: dock.close()))
        for button in (self.float, self.close_):
            row.addWidget(button)

    def _button(self, icon: QStyle.StandardPixmap, words: str) -> QToolButton:
        button = QToolButton()
        button.setIcon(self.style().standardIcon(icon))
        button.setAutoRaise(True)
        button.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # the menus have both for the keyboard
        button.setToolTip(words)
        button.setAccessibleName(f"{self.words.text()}: {words.lower()}")
        return button


_HEIGHT = 0.28  # of the window's, of a dock below the skin that is shown
_NONE: Mapping[str, float] = {}
_UPPER = (0.58, 0.28)  # of it, of a dock above another in a column and of that one
_LEAST = 40  # px of a dock that is scrolled, without its title
# Of what is between the columns; of what is below, which needs another width.
_PLACED = QEvent.Type.Resize, QEvent.Type.LayoutRequest
_NARROWEST = 560  # px, of docks below the skin that are between the columns
_BELOW = Qt.DockWidgetArea.BottomDockWidgetArea
_CORNERS = {
    Qt.Corner.BottomLeftCorner: Qt.DockWidgetArea.LeftDockWidgetArea,
    Qt.Corner.BottomRightCorner: Qt.DockWidgetArea.RightDockWidgetArea,
}


class Dock(QDockWidget):
    """A dock whose `closed` reports that the user closed it, not that it was hidden or covered."""

    closed = Signal()

    def closeEvent(self, event: QCloseEvent) -> None:
        super().closeEvent(event)
        self.closed.emit()


class Docks(QObject):
    """The docks of a `window`, by name."""

    def __init__(self, window: QMainWindow) -> None:
        super().__init__(window)
        self._window = window
        self._placing = QTimer(self, singleShot=True)  # pyright: ignore[reportCallIssue]
        self._placing.timeout.connect(guarded(self._place_corners))
        self._docks: dict[str, Dock] = {}
        self._shown: dict[str, QWidget] = {}
        self._keys: dict[str, str] = {}
        self._above: dict[str, str] = {}
        self._right: list[str] = []
        self._shares: dict[str, float] = {}
        self._narrow: dict[str, float] = {}
        self._also: dict[str, str] = {}
        self._heights: dict[str, float] = {}
        self._areas: dict[str, Qt.DockWidgetArea] = {}
        self._across = 0  # px, of what is below
        self._layouts: dict[str, Mapping[str, float]] = {}

    def __getitem__(self, name: str) -> Dock:
        return self._docks[name]

    def widget(self, name: str) -> QWidget:
        """The widget of a dock, without its scroll area."""
        return self._shown[name]

    def by_name(self) -> dict[str, QDockWidget]:
        return {**self._docks}

    @property
    def below(self) -> list[QDockWidget]:
        """The docks below the skin."""
        beside = self._above.keys() | self._shares.keys()
        return [self._docks[name] for name in self._keys if name not in beside]

    @property
    def beside(self) -> list[QDockWidget]:
        """The docks that are shown in front of those right of the skin."""
        return [self._docks[name] for name in self._shares]

    @property
    def right(self) -> list[Dock]:
        """The docks that are right of the skin by default."""
        return [self._docks[name] for name in self._right]

    def at_first(self, layout: str) -> Iterator[tuple[str, Qt.DockWidgetArea, float]]:
        """Each dock, its default area, and its share of the window in a ready layout; 0: hidden."""
        for name in (*self._above, *(name for name in self._docks if name not in self._above)):
            shares = self._layouts[name]
            yield name, self._areas[name], shares.get(layout, shares.get("", 0.0))

    def put_left(self, name: str, title: str, widget: QWidget, tip: str, share: float) -> None:
        """Put a widget in a column left of the skin; `share` is that of the window's width."""
        self._put(name, title, widget, Qt.DockWidgetArea.LeftDockWidgetArea, tip, {"": share})

    def add_above(self, name: str, widget: QWidget) -> None:
        """Put a widget above that of a dock, in the same dock."""
        whole = QWidget()
        column = QVBoxLayout(whole)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(widget)
        column.addWidget(self._shown[name], 1)
        self[name].setWidget(whole)

    def put_right(self, name: str, title: str, widget: QWidget, tip: str, share: float) -> None:
        """Put a widget in a column right of the skin; `share` is that of the window's width."""
        self._put(name, title, widget, Qt.DockWidgetArea.RightDockWidgetArea, tip, {"": share})
        self._right.append(name)

    def _put(
        self,
        name: str,
        title: str,
        widget: QWidget,
        area: Qt.DockWidgetArea,
        tip: str,
        layouts: Mapping[str, float],
    ) -> None:
        self._areas[name], self._layouts[name] = area, layouts
        dock = self._docks[name] = Dock(title, self._window)
        self._shown[name] = widget
        dock.setObjectName(name)
        dock.setToolTip(tip)  # also of what in it explains nothing itself
        dock.setTitleBarWidget(Title(dock))
        dock.setWidget(widget)
        self._window.addDockWidget(area, dock)

    def put_beside(
        self, name: str, title: str, widget: QWidget, key: str, tip: str, menu: str, share: float
    ) -> None:
        """Put a widget right of the skin, hidden until shown with `key` in front of what is there.

        Its action is also in a `menu`. The column has at least this `share` of the window's width
        while it is shown.
        """
        self._put(name, title, widget, _CORNERS[Qt.Corner.BottomRightCorner], tip, {})
        self._keys[name], self._also[name], self._shares[name] = key, menu, share
        dock = self[name]
        dock.hide()
        dock.closed.connect(guarded(partial(self._narrow_again, name)))

    def _show_beside(self, name: str) -> None:
        """Show a dock in front of the others right of the skin, in a column that is wide enough."""
        dock, window = self[name], self._window
        others = [d for d in self.right if not (d.isHidden() or d.isFloating())]
        others = [d for d in others if window.dockWidgetArea(d) == window.dockWidgetArea(dock)]
        if others and not dock.isFloating():
            if dock.isHidden():
                self._narrow[name] = others[0].width() / window.width()
            window.tabifyDockWidget(others[0], dock)
        dock.show()
        wide = max(dock.width(), round(self._shares[name] * window.width()))
        window.resizeDocks([dock], [wide], Qt.Orientation.Horizontal)

    def _narrow_again(self, name: str) -> None:
        """Give the column right of the skin its width back once the dock in it is closed."""
        wide = round(self._narrow.pop(name, 0.0) * self._window.width())
        if wide:
            self._window.resizeDocks(self.right[:1], [wide], Qt.Orientation.Horizontal)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() in _PLACED:
            self._placing.start(0)
        return False

    def _place_corners(self) -> None:
        """Let the columns have the lower corners, if what is below fits between them."""
        shown = [d for d in self.below if not (d.isHidden() or d.isFloating())]
        wide = [self.widget(d.objectName()).minimumSizeHint().width() for d in shown]
        central = self._window.centralWidget()
        between = central.width() if central is not None else 0
        fits = max([_NARROWEST, *wide]) <= between
        self._across = between if fits else self._window.width()
        for corner, area in _CORNERS.items():
            self._window.setCorner(corner, area if fits else _BELOW)

    def put_below(
        self,
        name: str,
        title: str,
        widget: QWidget,
        key: str,
        tip: str,
        *,
        menu: str = "",
        height: float = _HEIGHT,
        layouts: Mapping[str, float] = _NONE,
    ) -> None:
        """Put a widget below the skin, hidden until it is shown with `key`.

        Its action is also in a `menu`, besides that of all docks. It is shown with the `height`, a
        share of the window's; the ready `layouts` that show it have their own.
        """
        self._heights[name] = height
        if menu:
            self._also[name] = menu
        before = self.below
        area = QScrollArea(widgetResizable=True)  # pyright: ignore[reportCallIssue]
        area.setFrameShape(QScrollArea.Shape.NoFrame)
        area.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # else an invisible stop of Tab
        area.setMinimumHeight(_LEAST)
        area.setWidget(widget)
        self._put(name, title, area, _BELOW, tip, layouts)
        self._shown[name] = widget
        self._keys[name] = key
        dock = self[name]
        if before:
            self._window.tabifyDockWidget(before[-1], dock)
        # Wider than a column at its side.
        dock.setAllowedAreas(Qt.DockWidgetArea.TopDockWidgetArea | _BELOW)
        dock.hide()  # so that a small window shows the skin

    def put_above(
        self,
        name: str,
        title: str,
        widget: QWidget,
        other: str,
        key: str,
        tip: str,
        layouts: Mapping[str, float],
    ) -> None:
        """Put a widget above the `other` in its column, hidden until shown with `key`.

        In the ready `layouts` that show it the column is a share of the window's width.
        """
        area = self._window.dockWidgetArea(self[other])
        self._put(name, title, widget, area, tip, layouts)
        self._keys[name], self._above[name] = key, other
        self._window.splitDockWidget(self[name], self[other], Qt.Orientation.Vertical)
        self[name].hide()

    def add_actions(self, actions: Actions, menu: str) -> None:
        """Register the actions that show and hide docks, once there is a central widget."""
        if (central := self._window.centralWidget()) is not None:
            central.installEventFilter(self)
        for dock in self.below:
            self.widget(dock.objectName()).installEventFilter(self)
        for dock in self._docks.values():
            dock.visibilityChanged.connect(guarded(lambda *_: self._placing.start(0)))
        for name, dock in self._docks.items():
            if name not in self._keys:
                action = dock.toggleViewAction()
                action.setToolTip(dock.toolTip())
                action.setStatusTip(dock.toolTip())
                actions.register(f"dock-{name}", menu, action)
        for name, key in self._keys.items():
            dock = self[name]
            turn = partial(self._turn, name)
            action = actions.add(
                f"dock-{name}", menu, dock.windowTitle(), turn, key, dock.toolTip()
            )
            action.setCheckable(True)
            dock.visibilityChanged.connect(action.setChecked)
        for name, other in self._also.items():
            actions.repeat(f"dock-{name}", other)

    def _turn(self, name: str) -> None:
        """Show a dock in front of its tabs; hide a visible one."""
        if self[name].visibleRegion().isEmpty():
            self.reveal(name)
        else:
            self[name].hide()
            self._narrow_again(name)

    def reveal(self, name: str) -> None:
        """Show a dock in front of its tabs."""
        dock = self[name]
        if not dock.visibleRegion().isEmpty():
            return
        if name in self._shares:
            self._show_beside(name)
        dock.show()
        self._place_corners()
        if dock in self.below and not dock.isFloating():
            least = self._needed(name) + dock.titleBarWidget().sizeHint().height()
            heighten(self._window, dock, self._heights[name], least)
        self.share_columns()
        dock.raise_()

    def _needed(self, name: str) -> int:
        """The height in px that the widget of a dock needs at the width that it has."""
        shown = self.widget(name)
        layout = shown.layout()
        if layout is not None and layout.hasHeightForWidth():
            return layout.totalMinimumHeightForWidth(self._across)
        return shown.minimumSizeHint().height()

    def share_columns(self) -> None:
        """Give a dock above another in a column most of the height."""
        heights = [round(share * self._window.height()) for share in _UPPER]
        for above, other in self._above.items():
            both = [self[above], self[other]]
            self._window.resizeDocks(both, heights, Qt.Orientation.Vertical)
