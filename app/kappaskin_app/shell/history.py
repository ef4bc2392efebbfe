"""The settings as they are, and every change a person makes as an undoable command."""

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, TypeVar

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QUndoCommand, QUndoStack

from kappaskin_app.shell.settings import Settings, change_text

_IN_A_ROW = 1.0  # s from one change of a setting to the next
_MOST = 500  # steps that can be undone: a scene's text may be a megabyte
_Some = TypeVar("_Some")
Said = Callable[[_Some, _Some], str]


class _Step(QUndoCommand):
    """From one value to another, which `apply` makes so; those of one gesture are one command."""

    def __init__(
        self, apply: Callable[[Any], object], before: Any, after: Any, said: Said[Any], gesture: int
    ) -> None:
        super().__init__()
        self._apply, self._said, self._gesture = apply, said, gesture
        self.before, self.after = before, after
        self._name()

    def _name(self) -> None:
        text = self._said(self.before, self.after)
        self.setText(text[:1].lower() + text[1:])

    def id(self) -> int:
        return self._gesture

    def mergeWith(self, other: QUndoCommand) -> bool:
        if not isinstance(other, _Step):
            return False
        self.after = other.after
        self.setObsolete(self.after == self.before)
        self._name()
        return True

    def redo(self) -> None:
        self._apply(self.after)

    def undo(self) -> None:
        self._apply(self.before)


class History(QObject):
    """Holds the `settings`; `changed` tells of each new one.

    Its `stack` has also the steps that are no settings.
    """

    changed = Signal(Settings)

    def __init__(self, settings: Settings, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.settings = settings
        self.stack = QUndoStack(self)
        self.stack.setUndoLimit(_MOST)
        self._gesture = 0
        self._wished, self._wished_at, self._wish = "", 0.0, -1

    def wish(self, name: str, **values: Any) -> None:
        """Change the setting `name`, and others with it.

        Changes of the same one in a row are one step to undo.
        """
        now = time.monotonic()
        if name != self._wished or now - self._wished_at > _IN_A_ROW:
            self._wish = self.new_gesture()
        self._change(partial(change_text, name), self._wish, values)
        self._wished, self._wished_at = name, now

    def new_gesture(self) -> int:
        """A number under which changes merge into one command, a drag say."""
        self._gesture += 1
        return self._gesture

    def change(self, text: str, gesture: int = -1, /, **values: Any) -> None:
        """Change settings by name, as one command called `text`; what is equal changes nothing."""
        self._change(lambda *_: text, gesture, values)

    def _change(self, said: Said[Settings], gesture: int, values: dict[str, Any]) -> None:
        after = replace(self.settings, **values)
        if after != self.settings:
            self.stack.push(_Step(self.apply, self.settings, after, said, gesture))

    def step(
        self, text: str, apply: Callable[[_Some], object], before: _Some, after: _Some
    ) -> None:
        """Have `apply` make so what is no setting, as one command called `text`."""
        self.stack.push(_Step(apply, before, after, lambda *_: text, -1))

    def cancel(self, gesture: int) -> None:
        """Take back what was changed under `gesture`, as if it had never been."""
        top = self.stack.command(self.stack.index() - 1)
        if gesture > 0 and isinstance(top, _Step) and top.id() == gesture:
            before = top.before
            top.setObsolete(True)
            self.stack.undo()  # which only removes an obsolete command
            self.apply(before)

    def apply(self, settings: Settings) -> None:
        """For commands only: make `settings` the present ones."""
        self._wished = ""  # what was undone or redone meanwhile ends a row
        self.settings = settings
        self.changed.emit(settings)
