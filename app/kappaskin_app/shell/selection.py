"""Selection on the skin: elements, positions, the load and maps, shared by all views."""

from typing import NamedTuple

from PySide6.QtCore import QObject, Signal

from kappaskin.frames import Array
from kappaskin_app.widgets.tint import Tint


class LoadHandle(QObject):
    """The handle of the simulated load, which views of the skin drag.

    Positions are in m on the skin. `pressed` brings the force relative to that when grabbed,
    `replaced` another object as a table of a scene, its position and its force.
    """

    grabbed = Signal(float, float)
    dragged = Signal(float, float)
    pressed = Signal(float)
    released = Signal()
    cancelled = Signal()
    replaced = Signal(object, float, float, float)


class SkinMap(NamedTuple):
    """What colours the skin instead of the estimate: `values` (ny, nx) by a `tint`.

    `words` describe it, `label` stands at its scale. `positions` (P, 2) in m are those of its own
    elements, if any.
    """

    values: Array
    tint: Tint
    words: str
    label: str = ""
    positions: Array | None = None


class Selection(QObject):
    """The element under the mouse, the target of the press test, and a map that is shown.

    `chosen` brings an element that was clicked on a map, `over` and `clicked` a position (x, y) in
    m on the skin under the mouse (None: none) or clicked. `map` colours the skin, if any.
    """

    pointed = Signal(int)
    target_changed = Signal(int)
    chosen = Signal(int)
    over = Signal(object)
    clicked = Signal(float, float)
    map_changed = Signal()

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.load = LoadHandle(self)
        self.element = self.target = -1
        self.map: SkinMap | None = None

    def point(self, element: int) -> None:
        """Highlight an element in every view; -1 none."""
        if element != self.element:
            self.element = element
            self.pointed.emit(element)

    def mark_target(self, element: int) -> None:
        """Mark the element to be pressed in every view; -1 none."""
        self.target = element
        self.target_changed.emit(element)

    def show_map(self, shown: SkinMap | None) -> None:
        """Colour the skin by a map, or by the estimate if None."""
        self.map = shown
        self.map_changed.emit()
