"""Files dropped on the window, and keys that nothing in it takes, to who wants them."""

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QEvent, QMimeData, QObject
from PySide6.QtGui import QDragEnterEvent, QDropEvent, QKeyEvent
from PySide6.QtWidgets import QWidget

from kappaskin_app.guard import guarded
from kappaskin_app.shell.opening import opens


def dropped_on(data: QMimeData) -> Path | None:
    """The file among what is dragged that can be opened, if there is one."""
    files = [Path(url.toLocalFile()) for url in data.urls() if url.isLocalFile()]
    return next((file for file in files if opens(file)), None)


class Drops(QObject):
    """Watches `window`; a file dropped there is opened, a key left over is taken."""

    def __init__(
        self,
        window: QWidget,
        open_file: Callable[[Path], None],
        take_key: Callable[[QKeyEvent], bool],
    ) -> None:
        super().__init__(window)
        self._open, self._take_key = guarded(open_file), take_key
        window.setAcceptDrops(True)
        window.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if isinstance(event, QDropEvent):  # which one that enters is too
            path = dropped_on(event.mimeData())
            if path is None:
                return False
            event.acceptProposedAction()
            if not isinstance(event, QDragEnterEvent) and event.type() == QEvent.Type.Drop:
                self._open(path)
            return True
        if event.type() == QEvent.Type.KeyPress and isinstance(event, QKeyEvent):
            return self._take_key(event)
        return False
