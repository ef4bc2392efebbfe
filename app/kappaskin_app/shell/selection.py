"""Selection on the skin: elements, positions, the load and modes, shared by all views."""

from typing import Any

from PySide6.QtCore import QObject, Signal


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


class Selection(QObject):
    """The element under the mouse, the target of the press test, and a mode that is shown.

    `chosen` brings an element that was clicked on a map, `over` and `clicked` a position (x, y) in
    m on the skin under the mouse (None: none) or clicked. `mode` (ny, nx) from -1 to 1 colours the
    skin instead of the estimate; `mode_words` describe it.
    """

    pointed = Signal(int)
    target_changed = Signal(int)
    chosen = Signal(int)
    over = Signal(object)
    clicked = Signal(float, float)
    mode_changed = Signal()

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.load = LoadHandle(self)
        self.element = self.target = -1
        self.mode: Any = None
        self.mode_words = ""

    def point(self, element: int) -> None:
        """Highlight an element in every view; -1 none."""
        if element != self.element:
            self.element = element
            self.pointed.emit(element)

    def mark_target(self, element: int) -> None:
        """Mark the element to be pressed in every view; -1 none."""
        self.target = element
        self.target_changed.emit(element)

    def show_mode(self, mode: Any, words: str = "") -> None:
        """Colour the skin by a mode, or by the estimate if None."""
        self.mode, self.mode_words = mode, words if mode is not None else ""
        self.mode_changed.emit()
