"""Many changes of how a window is laid out, drawn once."""

from collections.abc import Iterator
from contextlib import contextmanager

from PySide6.QtWidgets import QWidget


@contextmanager
def drawn_once(widget: QWidget) -> Iterator[None]:
    """Draw nothing of `widget` until the end.

    The 3-D view is else drawn anew with every size it has in between, 15 to 40 ms each.
    """
    before = widget.updatesEnabled()
    widget.setUpdatesEnabled(False)
    try:
        yield
    finally:
        widget.setUpdatesEnabled(before)
