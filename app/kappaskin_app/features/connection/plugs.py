"""The serial ports of this machine, looked for again and again beside the window."""

from concurrent.futures import Future, ThreadPoolExecutor

from PySide6.QtCore import QObject, QTimer, Signal
from PySide6.QtWidgets import QApplication, QWidget

from kappaskin.sources import Port, serial_ports
from kappaskin_app.guard import guarded

_EVERY = 1000  # ms between two looks
_SOON = 50  # ms until what was found is taken


class Plugs(QObject):
    """Looks for ports each second while `watched` can be seen and used; `found` brings them."""

    found = Signal(list)

    def __init__(self, watched: QWidget, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._watched = watched
        self._thread = ThreadPoolExecutor(1, "port-finder")  # some systems take a second
        self._looking: Future[list[Port]] | None = None
        self._timer = QTimer(self, interval=_EVERY)  # pyright: ignore[reportCallIssue]
        self._timer.timeout.connect(guarded(self._look_if_seen))
        self._timer.start()

    def _look_if_seen(self) -> None:
        if self._watched.isVisible() and QApplication.activeWindow() is not None:
            self.look()

    def look(self) -> None:
        """Look now, unless that is being done."""
        if self._looking is None:
            self._looking = self._thread.submit(serial_ports)
            QTimer.singleShot(_SOON, self, guarded(self._take))

    def _take(self) -> None:
        if self._looking is None:
            return
        if not self._looking.done():
            QTimer.singleShot(_SOON, self, guarded(self._take))
            return
        done, self._looking = self._looking, None
        self.found.emit(done.result())

    def close(self) -> None:
        self._timer.stop()
        self._looking = None
        self._thread.shutdown(wait=True, cancel_futures=True)
