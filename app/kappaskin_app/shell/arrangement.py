"""Arrangement of docks: read from a window and applied to it."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from PySide6.QtCore import QRect, Qt
from PySide6.QtWidgets import QDockWidget, QMainWindow, QTabBar, QTabWidget

from kappaskin_app.shell.docks import Docks, drawn_once

LEFT, RIGHT, TOP, BOTTOM, FLOATING = "left", "right", "top", "bottom", "floating"
AREAS = (LEFT, RIGHT, TOP, BOTTOM, FLOATING)


@dataclass(frozen=True)
class Place:
    """The place of a dock.

    In an area the docks follow one another, are `tabbed` with the one before, or stand across:
    `beside` it in a column, below it in a row. Of tabs the one in `front` is visible. `share` is
    that of the window's width, or of its height above and below the skin; `along` its share of
    the other dimension. A floating dock is `at` (x, y, width, height) in px.
    """

    area: str
    shown: bool = True
    tabbed: bool = False
    front: bool = False
    beside: bool = False
    share: float = 0.0
    along: float = 0.0
    at: tuple[int, int, int, int] | None = None


@dataclass(frozen=True)
class Layout:
    """The page of settings, counted from 0, and the `docks` by name, in order within an area."""

    page: int
    docks: tuple[tuple[str, Place], ...]


_SIDES = {
    LEFT: Qt.DockWidgetArea.LeftDockWidgetArea,
    RIGHT: Qt.DockWidgetArea.RightDockWidgetArea,
    TOP: Qt.DockWidgetArea.TopDockWidgetArea,
    BOTTOM: Qt.DockWidgetArea.BottomDockWidgetArea,
}
_BESIDE = (LEFT, RIGHT)
_ALIGNED = 4  # px between the edges of two docks that are in one line
_ACROSS, _DOWN = Qt.Orientation.Horizontal, Qt.Orientation.Vertical
Named = Mapping[str, QDockWidget]
Placed = Sequence[tuple[QDockWidget, Place]]


# From the window.


def ready_layout(docks: Docks, name: str, page: int) -> Layout:
    """The ready layout of this name, with each dock in its default place."""
    placed = [
        (dock, Place(_called(area), shown=share > 0, share=share))
        for dock, area, share in docks.at_first(name)
    ]
    # As `layout_of` lists them: hidden ones of columns before all others, those below after them.
    above = [(d, p) for d, p in placed if p.area in _BESIDE and not p.shown]
    rest = [each for each in placed if each not in above]
    rest.sort(key=lambda each: (AREAS.index(each[1].area), not each[1].shown))
    return Layout(page, (*above, *rest))


def layout_of(window: QMainWindow, docks: Named, panels: QTabWidget) -> Layout:
    """The present layout of the docks of a window."""
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
    return _called(window.dockWidgetArea(dock))


def _called(side: Qt.DockWidgetArea) -> str:
    return next(area for area, known in _SIDES.items() if known == side)


def _floating(dock: QDockWidget) -> Place:
    place = dock.geometry()
    return Place(FLOATING, at=(place.x(), place.y(), place.width(), place.height()))


def _along(window: QMainWindow, here: list[QDockWidget], area: str) -> Iterator[tuple[str, Place]]:
    """The docks of an area in order, those of a line and of tabs together."""
    begins = -_ALIGNED
    for front, members in _lines(window, here, area):
        start = front.y() if area in _BESIDE else front.x()
        beside, begins = start < begins + _ALIGNED, start
        wide, high = front.width() / window.width(), front.height() / window.height()
        share, along = (wide, high) if area in _BESIDE else (high, wide)
        for dock in members:
            first = dock is members[0]
            yield (
                dock.objectName(),
                Place(
                    area,
                    tabbed=not first,
                    front=dock is front and len(members) > 1,
                    beside=first and beside,
                    share=round(share, 3),
                    along=round(along, 3),
                ),
            )


def _lines(
    window: QMainWindow, here: list[QDockWidget], area: str
) -> list[tuple[QDockWidget, list[QDockWidget]]]:
    """The stacks of an area in order, each with its front dock, which alone has the geometry."""
    stacks = [(min(s, key=lambda d: d.visibleRegion().isEmpty()), s) for s in _stacks(window, here)]
    if area in _BESIDE:
        return sorted(stacks, key=lambda stack: (stack[0].y() // _ALIGNED, stack[0].x()))
    return sorted(stacks, key=lambda stack: (stack[0].x() // _ALIGNED, stack[0].y()))


def _stacks(window: QMainWindow, here: list[QDockWidget]) -> list[list[QDockWidget]]:
    """Stacks of tabbed docks, in the order of their tabs."""
    orders = [[bar.tabText(n) for n in range(bar.count())] for bar in _bars(window)]
    stacks: list[list[QDockWidget]] = []
    for dock in here:
        if any(dock in stack for stack in stacks):
            continue
        stack = [dock, *(d for d in window.tabifiedDockWidgets(dock) if d in here)]
        titled = {d.windowTitle(): d for d in stack}
        order = next((each for each in orders if set(each) == set(titled)), list(titled))
        stacks.append([titled[title] for title in order])
    return stacks


def _bars(window: QMainWindow) -> list[QTabBar]:
    """The tab bars of docks."""
    only_its_own = Qt.FindChildOption.FindDirectChildrenOnly
    return window.findChildren(QTabBar, options=only_its_own)


# Into the window.


def arrange(window: QMainWindow, docks: Named, panels: QTabWidget, layout: Layout) -> None:
    """Apply a layout to the docks of a window; docks that it does not name are hidden."""
    placed = [(docks[name], place) for name, place in layout.docks if name in docks]
    with drawn_once(window):
        if not _only_show(window, docks, panels, layout):
            for dock in docks.values():
                dock.hide()
            _put(window, placed)
        panels.setCurrentIndex(min(layout.page, panels.count() - 1))
    _size(window, [(dock, place) for dock, place in placed if place.shown])
    for dock, place in placed:
        if place.front:
            dock.raise_()


def words_of(layout: Layout) -> list[tuple[object, ...]]:
    """A layout without the sizes of docks."""
    return [
        (name, p.area, p.shown, p.tabbed, p.beside, p.front and p.shown) for name, p in layout.docks
    ]


def _only_show(window: QMainWindow, docks: Named, panels: QTabWidget, layout: Layout) -> bool:
    """Show and hide docks only; whether that gives the layout."""
    for name, place in layout.docks:
        if name in docks and docks[name].isHidden() == place.shown:
            docks[name].setVisible(place.shown)
        if name in docks and place.front:
            docks[name].raise_()
    return words_of(layout_of(window, docks, panels)) == words_of(layout)


@dataclass
class _Plan:
    """Docks that begin a line of their area, split the line of another, or join its tabs."""

    begin: list[tuple[str, QDockWidget]] = field(default_factory=list)
    split: list[tuple[str, QDockWidget, QDockWidget]] = field(default_factory=list)
    join: list[tuple[QDockWidget, QDockWidget]] = field(default_factory=list)


def _plan(placed: Placed) -> _Plan:
    plan, last, head = _Plan(), dict[str, QDockWidget](), dict[str, QDockWidget]()
    for dock, place in placed:
        area = _taken(dock, place)
        # A hidden one comes back before the others above or below the skin, where they share one
        # place.
        joins = place.tabbed if place.shown else area not in _BESIDE
        if joins and area in last:
            plan.join.append((last[area], dock))
        elif place.beside and area in head:
            plan.split.append((area, head[area], dock))
            head[area] = dock
        else:
            plan.begin.append((area, dock))
            if place.area != FLOATING:
                head[area] = dock
        if place.area != FLOATING:
            last[area] = dock
    return plan


def _put(window: QMainWindow, placed: Placed) -> None:
    for dock, _ in placed:
        dock.setFloating(False)
        window.removeDockWidget(dock)
    plan = _plan(placed)
    # In this order, or Qt would turn an area around, or make a tab of what is beside tabs.
    for area, dock in plan.begin:
        window.addDockWidget(_SIDES[area], dock)
    for area, other, dock in plan.split:
        window.splitDockWidget(other, dock, _ACROSS if area in _BESIDE else _DOWN)
    for other, dock in plan.join:
        window.tabifyDockWidget(other, dock)
    for dock, place in placed:
        dock.setVisible(place.shown)
        if place.area == FLOATING:
            _float(dock, place)


def _taken(dock: QDockWidget, place: Place) -> str:
    """The area of `place`, or the first that the dock allows."""
    preferred = [place.area] if place.area in _SIDES else []
    return next(area for area in (*preferred, *_SIDES) if dock.isAreaAllowed(_SIDES[area]))


def _float(dock: QDockWidget, place: Place) -> None:
    dock.setFloating(True)
    if place.at is not None:
        dock.setGeometry(QRect(*place.at))


def _size(window: QMainWindow, shown: Placed) -> None:
    for dock, place in shown:
        if not place.share or place.area == FLOATING:
            continue
        if place.area in _BESIDE:
            window.resizeDocks([dock], [round(place.share * window.width())], _ACROSS)
        else:
            high = round(place.share * window.height()) + _tabs_of(window, dock)
            window.resizeDocks([dock], [high], _DOWN)
    for area in _SIDES:
        sized = [(d, p.along) for d, p in shown if p.area == area and p.along and not p.tabbed]
        way, whole = (_DOWN, window.height()) if area in _BESIDE else (_ACROSS, window.width())
        window.resizeDocks([d for d, _ in sized], [round(s * whole) for _, s in sized], way)


def _tabs_of(window: QMainWindow, dock: QDockWidget) -> int:
    """The height in px of the tab bar below a dock; 0 without one."""
    if all(other.isHidden() for other in window.tabifiedDockWidgets(dock)):
        return 0
    return max((bar.sizeHint().height() for bar in _bars(window)), default=0)
