"""Tooltips that name shortcuts: they name those of now, whatever a person changed."""

import re
from collections.abc import Mapping

from PySide6.QtWidgets import QWidget

_OWN, _SHOWN = "own-tip", "shown-tip"  # properties of a widget: its tooltip, and as it was retold
_NONE = "no shortcut"


def retell(window: QWidget, keys: Mapping[str, str]) -> None:
    """Name in the tooltips of a `window` each of the `keys` as it is now."""
    for widget in window.findChildren(QWidget):
        tip = widget.toolTip()
        if not tip:
            continue
        own = widget.property(_OWN) if tip == widget.property(_SHOWN) else tip
        told = in_words(str(own), keys)
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
