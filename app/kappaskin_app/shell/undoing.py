"""The two actions that undo and redo, which say what they would."""

from collections.abc import Callable

from PySide6.QtCore import QObject
from PySide6.QtGui import QUndoStack

from kappaskin_app.guard import guarded
from kappaskin_app.shell.actions import Actions
from kappaskin_app.shell.tips import tip_of

_LONGEST = 60  # characters of a step in a menu


class Undoing(QObject):
    """Keeps the actions on `stack` true; `settle` first brings in what a person has just done."""

    def __init__(
        self, stack: QUndoStack, settle: Callable[[], object], actions: Actions, menu: str
    ) -> None:
        super().__init__(stack)
        self._stack, self._settle, self._actions = stack, settle, actions
        actions.add("undo", menu, "&Undo", self._undo, "Ctrl+Z")
        actions.add("redo", menu, "&Redo", self._redo, "Ctrl+Shift+Z")
        stack.indexChanged.connect(guarded(self._show))
        self._show()

    def _undo(self) -> None:
        self._settle()
        self._stack.undo()

    def _redo(self) -> None:
        self._settle()
        self._stack.redo()

    def _show(self, *_: object) -> None:
        for name, text in (("undo", self._stack.undoText()), ("redo", self._stack.redoText())):
            word, action = name.capitalize(), self._actions[name]
            cut = (
                text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}\N{HORIZONTAL ELLIPSIS}"
            )
            action.setText(f"&{word}: {cut.replace('&', '&&')}" if text else f"&{word}")
            action.setToolTip(f"{word}: {text}" if text else tip_of(name, word))
            self._actions.allow(name, "" if text else f"there is nothing to {name}")
