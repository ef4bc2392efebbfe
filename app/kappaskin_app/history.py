"""The settings as they are, and every change a person makes as an undoable command."""

import time
from dataclasses import replace
from typing import Any

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QUndoCommand, QUndoStack

from kappaskin_app.settings import Settings

_IN_A_ROW = 1.0  # s from one change of a setting to the next


class _Change(QUndoCommand):
    """From one `Settings` to another; consecutive changes of one gesture are one command."""

    def __init__(
        self, history: "History", before: Settings, after: Settings, text: str, gesture: int
    ) -> None:
        super().__init__(text[:1].lower() + text[1:])
        self._history, self.before, self.after = history, before, after
        self._gesture = gesture

    def id(self) -> int:
        return self._gesture

    def mergeWith(self, other: QUndoCommand) -> bool:
        if not isinstance(other, _Change):
            return False
        self.after = other.after
        return True

    def redo(self) -> None:
        self._history.apply(self.after)

    def undo(self) -> None:
        self._history.apply(self.before)


class History(QObject):
    """Holds the `settings`; `changed` tells of each new one."""

    changed = Signal(Settings)

    def __init__(self, settings: Settings, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.settings = settings
        self.stack = QUndoStack(self)
        self._gesture = 0
        self._wished, self._wished_at, self._wish = "", 0.0, -1

    def wish(self, name: str, label: str, **values: Any) -> None:
        """Change the setting `name`, and others with it.

        Changes of the same one in a row are one step to undo.
        """
        now = time.monotonic()
        if name != self._wished or now - self._wished_at > _IN_A_ROW:
            self._wish = self.new_gesture()
        self._wished, self._wished_at = name, now
        self.change(f"Change of {label}", self._wish, **values)

    def new_gesture(self) -> int:
        """A number under which changes merge into one command, a drag say."""
        self._gesture += 1
        return self._gesture

    def change(self, text: str, gesture: int = -1, /, **values: Any) -> None:
        """Change settings by name, as one command called `text`; what is equal changes nothing."""
        after = replace(self.settings, **values)
        if after != self.settings:
            self.stack.push(_Change(self, self.settings, after, text, gesture))

    def cancel(self, gesture: int) -> None:
        """Take back what was changed under `gesture`, as if it had never been."""
        top = self.stack.command(self.stack.index() - 1)
        if gesture > 0 and isinstance(top, _Change) and top.id() == gesture:
            before = top.before
            top.setObsolete(True)
            self.stack.undo()  # which only removes an obsolete command
            self.apply(before)

    def apply(self, settings: Settings) -> None:
        """For commands only: make `settings` the present ones."""
        self.settings = settings
        self.changed.emit(settings)
