"""Keys that an editor with the focus leaves to the window."""

from PySide6.QtCore import QEvent
from PySide6.QtGui import QKeyEvent, QKeySequence

_ITS = QKeySequence.StandardKey
_LEFT = (_ITS.Undo, _ITS.Redo, _ITS.DeleteEndOfLine)  # the last is Ctrl+K to an editor


def for_the_window(event: QEvent) -> bool:
    """Whether an editor is asked if it takes a key that is the window's: undo, redo, Ctrl+K."""
    return (
        event.type() == QEvent.Type.ShortcutOverride
        and isinstance(event, QKeyEvent)
        and any(event.matches(key) for key in _LEFT)
    )
