"""What a person points at, chooses and takes hold of on the skin, for all that show it."""

from typing import Any

from PySide6.QtCore import QObject, Signal


class LoadHandle(QObject):
    """The simulated load in a person's hand: any view of the skin offers it, the scene follows.

    Places are in m on the skin; `pressed` tells how many times as hard as when it was grabbed,
    `replaced` the object that is to touch instead, as a scene's text has it, where and how hard.
    """

    grabbed = Signal(float, float)
    dragged = Signal(float, float)
    pressed = Signal(float)
    released = Signal()
    given_up = Signal()
    replaced = Signal(object, float, float, float)


class Selection(QObject):
    """The element that is pointed at and the one to be pressed (-1: none), and a chosen shape.

    `chosen` tells of an element that was clicked on a map, `over` and `clicked` of a place (x, y)
    in m of the skin that the mouse is over (None: of none) or has clicked. `mode` (ny, nx) from -1
    to 1 colours the skin instead of what is measured; `mode_words` say what it is.
    """

    pointed = Signal(int)
    asked = Signal(int)
    chosen = Signal(int)
    over = Signal(object)
    clicked = Signal(float, float)
    mode_changed = Signal()

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.load = LoadHandle(self)
        self.element = self.asked_for = -1
        self.mode: Any = None
        self.mode_words = ""

    def point(self, element: int) -> None:
        """Point at an element in every view; -1 at none."""
        if element != self.element:
            self.element = element
            self.pointed.emit(element)

    def ask_for(self, element: int) -> None:
        """Show which element is to be pressed; -1 for none."""
        self.asked_for = element
        self.asked.emit(element)

    def show_mode(self, mode: Any, words: str = "") -> None:
        """Colour the skin by a shape instead of what is measured; by what is measured if None."""
        self.mode, self.mode_words = mode, words if mode is not None else ""
        self.mode_changed.emit()
