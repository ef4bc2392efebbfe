"""Tooltips that name shortcuts: they name those of now, whatever a person changed."""

import re
from collections.abc import Mapping

from PySide6.QtCore import QEvent, QObject
from PySide6.QtWidgets import QWidget

_OWN, _SHOWN = "own-tip", "shown-tip"  # properties of a widget: its tooltip, and as it was retold
_NONE = "no shortcut"


class KeyTips(QObject):
    """Has the tooltips of a `window` name its keys as they are now."""

    def __init__(self, window: QWidget) -> None:
        super().__init__(window)
        self._window = window
        self._keys: Mapping[str, str] = {}

    def retell(self, keys: Mapping[str, str]) -> None:
        """Name each of the `keys` as it is now, in what tooltips say next too."""
        if not keys and not self._keys:
            return  # of a window whose keys are its own no event is looked at
        self._keys = keys
        for widget in self._window.findChildren(QWidget):
            if widget.toolTip():
                self._retell(widget)
                widget.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.ToolTipChange and isinstance(watched, QWidget):
            self._retell(watched)
        return False

    def _retell(self, widget: QWidget) -> None:
        tip = widget.toolTip()
        own = widget.property(_OWN) if tip == widget.property(_SHOWN) else tip
        told = in_words(str(own), self._keys)
        if told != tip:
            widget.setProperty(_OWN, own)
            widget.setProperty(_SHOWN, told)
            widget.setToolTip(told)


def in_words(text: str, keys: Mapping[str, str]) -> str:
    """A text with each of the `keys` that it names as it is now."""
    named = sorted(filter(None, keys), key=len, reverse=True)
    if not named:
        return text
    any_of = "|".join(map(re.escape, named))
    return re.sub(rf"(?<![\w+])({any_of})(?!\w)", lambda found: keys[found[1]] or _NONE, text)
