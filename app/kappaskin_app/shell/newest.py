"""What is asked for faster than it can be done, thinned: of what comes between, the newest."""

from collections.abc import Callable

from PySide6.QtCore import QObject, QTimer

from kappaskin_app.guard import guarded

_EVERY = 40  # ms between two


class Newest(QObject):
    """Does what it is given at once, and what follows at most 25 times a second."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._waiting: Callable[[], None] | None = None
        self._timer = QTimer(self, singleShot=True, interval=_EVERY)  # pyright: ignore[reportCallIssue]
        self._timer.timeout.connect(guarded(self._go_on))

    def __call__(self, act: Callable[[], None]) -> None:
        """Do this, unless something newer comes before it may be done."""
        self._waiting = act
        if not self._timer.isActive():
            self._go_on()

    def _go_on(self) -> None:
        act, self._waiting = self._waiting, None
        if act is not None:
            self._timer.start()
            act()

    def forget(self) -> None:
        """Do no more of what was given."""
        self._waiting = None
        self._timer.stop()
