"""A layout read from the docks of a window, and put into them."""

from collections.abc import Iterable, Iterator, Mapping

from PySide6.QtCore import QRect, Qt
from PySide6.QtWidgets import QDockWidget, QMainWindow, QTabBar

from kappaskin_app.drawn_once import drawn_once
from kappaskin_app.layouts.layout import BOTTOM, FLOATING, LEFT, RIGHT, TOP, Layout, Place
from kappaskin_app.panels.panels import Panels

_SIDES = {
    LEFT: Qt.DockWidgetArea.LeftDockWidgetArea,
    RIGHT: Qt.DockWidgetArea.RightDockWidgetArea,
    TOP: Qt.DockWidgetArea.TopDockWidgetArea,
    BOTTOM: Qt.DockWidgetArea.BottomDockWidgetArea,
}
_BESIDE = (LEFT, RIGHT)
Docks = Mapping[str, QDockWidget]


def layout_of(window: QMainWindow, docks: Docks, panels: Panels) -> Layout:
    """How the docks of a window are arranged now."""
    shown = [dock for dock in docks.values() if not dock.isHidden()]
    placed = [(d.objectName(), _floating(d)) for d in shown if d.isFloating()]
    for area, side in _SIDES.items():
        here = [d for d in shown if not d.isFloating() and window.dockWidgetArea(d) == side]
        placed += _along(window, here, area)
    hidden = [d for d in docks.values() if d.isHidden()]
    away = [(d.objectName(), Place(_area(window, d), shown=False)) for d in hidden]
    # In a column a hidden one comes back above the others, else as a tab of the last.
    above = [each for each in away if each[1].area in _BESIDE]
    return Layout(
        panels.currentIndex(),
        (*above, *placed, *(each for each in away if each not in above)),
    )


def _area(window: QMainWindow, dock: QDockWidget) -> str:
    side = window.dockWidgetArea(dock)
    return next(area for area, known in _SIDES.items() if known == side)


def _floating(dock: QDockWidget) -> Place:
    place = dock.geometry()
    return Place(FLOATING, at=(place.x(), place.y(), place.width(), place.height()))


def _along(window: QMainWindow, here: list[QDockWidget], area: str) -> Iterator[tuple[str, Place]]:
    """The docks of an area one after the other, tabs together."""
    stacks = _stacks(window, here)
    beside = area in _BESIDE
    stacks.sort(key=lambda stack: stack[0].y() if beside else stack[0].x())
    for front, *behind in stacks:
        whole = window.width() if beside else window.height()
        share = round((front.width() if beside else front.height()) / whole, 3)
        members = [dock for dock in here if dock is front or dock in behind]
        for dock in members:
            seen = dock is front and len(members) > 1
            tabbed = dock is not members[0]
            yield dock.objectName(), Place(area, True, tabbed, seen, share)


def _stacks(window: QMainWindow, here: list[QDockWidget]) -> list[list[QDockWidget]]:
    """Docks that share a place, the one in front first: only that has its present geometry."""
    stacks: list[list[QDockWidget]] = []
    for dock in here:
        if any(dock in stack for stack in stacks):
            continue
        stack = [dock, *(d for d in window.tabifiedDockWidgets(dock) if d in here)]
        stacks.append(sorted(stack, key=lambda d: d.visibleRegion().isEmpty()))
    return stacks


def arrange(window: QMainWindow, docks: Docks, panels: Panels, layout: Layout) -> None:
    """Arrange the docks of a window so; one that the layout does not name is hidden."""
    placed = [(docks[name], place) for name, place in layout.docks if name in docks]
    with drawn_once(window):
        _place(window, docks, placed)
        panels.setCurrentIndex(min(layout.page, panels.count() - 1))


def _place(window: QMainWindow, docks: Docks, placed: list[tuple[QDockWidget, Place]]) -> None:
    for dock in docks.values():
        dock.hide()
    for dock, _ in placed:
        dock.setFloating(False)
        window.removeDockWidget(dock)
    last: dict[str, QDockWidget] = {}
    for dock, place in placed:
        area = _taken(dock, place)
        window.addDockWidget(_SIDES[area], dock)
        # A hidden one comes back before the others above or below the skin, where they share one
        # place.
        joins = place.tabbed if place.shown else area not in _BESIDE
        if joins and area in last:
            window.tabifyDockWidget(last[area], dock)
        dock.setVisible(place.shown)
        if place.area == FLOATING:
            _float(dock, place)
        else:
            last[area] = dock
    _size(window, [(dock, place) for dock, place in placed if place.shown])
    for dock, place in placed:
        if place.front:
            dock.raise_()


def _taken(dock: QDockWidget, place: Place) -> str:
    """The area wished, or the first that the dock may be in."""
    wished = [place.area] if place.area in _SIDES else []
    return next(area for area in (*wished, *_SIDES) if dock.isAreaAllowed(_SIDES[area]))


def _float(dock: QDockWidget, place: Place) -> None:
    dock.setFloating(True)
    if place.at is not None:
        dock.setGeometry(QRect(*place.at))


def _size(window: QMainWindow, shown: Iterable[tuple[QDockWidget, Place]]) -> None:
    for dock, place in shown:
        if not place.share or place.area == FLOATING:
            continue
        if place.area in _BESIDE:
            wide = round(place.share * window.width())
            window.resizeDocks([dock], [wide], Qt.Orientation.Horizontal)
        else:
            high = round(place.share * window.height()) + _tabs_of(window, dock)
            window.resizeDocks([dock], [high], Qt.Orientation.Vertical)


def _tabs_of(window: QMainWindow, dock: QDockWidget) -> int:
    """px that the tabs below a dock take of its height, where there are any."""
    if all(other.isHidden() for other in window.tabifiedDockWidgets(dock)):
        return 0
    only_its_own = Qt.FindChildOption.FindDirectChildrenOnly
    bars = window.findChildren(QTabBar, options=only_its_own)
    return max((bar.sizeHint().height() for bar in bars), default=0)
