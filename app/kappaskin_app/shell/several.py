"""Some of several values, chosen in a menu that stays open while one chooses."""

from PySide6.QtCore import QEvent, QObject, QSignalBlocker, Qt, Signal
from PySide6.QtGui import QAction, QKeyEvent, QMouseEvent
from PySide6.QtWidgets import QMenu, QSizePolicy, QToolButton, QWidget

_NONE = "None"
_TICKS = (Qt.Key.Key_Return, Qt.Key.Key_Enter, Qt.Key.Key_Space)


class SeveralButton(QToolButton):
    """Says how many are chosen; `chosen` brings the values, in the order that they are offered.

    The Down key takes one more, Up one less.
    """

    chosen = Signal(tuple)

    def __init__(self, options: tuple[tuple[str, str], ...], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._options = options
        self.setMenu(_OpenMenu(self))
        self.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.ticks = {value: self._tick(words) for value, words in options}
        self.show_chosen(())

    def _tick(self, words: str) -> QAction:
        tick = self.menu().addAction(words)
        tick.setCheckable(True)
        tick.toggled.connect(self._tell)
        return tick

    def keyPressEvent(self, event: QKeyEvent) -> None:
        on = [tick for tick in self.ticks.values() if tick.isChecked()]
        off = [tick for tick in self.ticks.values() if not tick.isChecked()]
        if event.key() == Qt.Key.Key_Down and off:
            off[0].setChecked(True)
        elif event.key() == Qt.Key.Key_Up and on:
            on[-1].setChecked(False)
        else:
            super().keyPressEvent(event)

    def _values(self) -> tuple[str, ...]:
        return tuple(value for value, tick in self.ticks.items() if tick.isChecked())

    def _tell(self) -> None:
        self._write()
        self.chosen.emit(self._values())

    def show_chosen(self, values: tuple[str, ...]) -> None:
        for value, tick in self.ticks.items():
            with QSignalBlocker(tick):
                tick.setChecked(value in values)
        self._write()

    def _write(self) -> None:
        values = self._values()
        first = dict(self._options)[values[0]] if values else _NONE
        more = f" and {len(values) - 1} more" if len(values) > 1 else ""
        self.setText(first + more)


class _OpenMenu(QMenu):
    """A menu in which a tick is set without closing it."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        pressed = isinstance(event, QMouseEvent) and event.type() == QEvent.Type.MouseButtonRelease
        typed = (
            isinstance(event, QKeyEvent)
            and event.type() == QEvent.Type.KeyPress
            and event.key() in _TICKS
        )
        action = self.activeAction()
        if (pressed or typed) and action is not None:
            action.toggle()
            return True
        return super().eventFilter(watched, event)
