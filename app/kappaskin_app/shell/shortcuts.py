"""The shortcut dialog: all shortcuts, to look up and to change."""

from PySide6.QtCore import QEvent, Qt, Signal
from PySide6.QtGui import QKeySequence
from PySide6.QtWidgets import (
    QDialog,
    QFormLayout,
    QKeySequenceEdit,
    QLineEdit,
    QTreeWidgetItem,
    QVBoxLayout,
    QWidget,
)

from kappaskin.errors import Refusal
from kappaskin_app.guard import guarded
from kappaskin_app.shell.actions import Actions, plain
from kappaskin_app.shell.finder import Listing, best, clearable, row, score
from kappaskin_app.widgets.parts import Label, button, in_a_row

_MOUSE = (
    "Left button on a simulated skin: press and drag, with the wheel or Shift for the force; "
    "elsewhere, or right button: turn. Wheel: zoom. Right click on the skin: its element."
)
_SIZE = 620, 640  # px
_MENU = 150  # px


class ShortcutDialog(QDialog):
    """Lists and changes the shortcuts of `actions`; `changed` reports a change."""

    changed = Signal()

    def __init__(self, actions: Actions, parent: QWidget) -> None:
        super().__init__(parent)
        self.setObjectName("cheat-sheet")
        self.setWindowTitle("Shortcuts")
        self.resize(*_SIZE)
        self._actions = actions
        self.line = QLineEdit(placeholderText="Search for a command, a menu or a key")  # pyright: ignore[reportCallIssue]
        clearable(self.line)
        self.line.setAccessibleName("Search shortcuts")
        self.line.setToolTip("A few letters of a command or its menu, or its key.")
        self.list = Listing(self.line)
        self.list.setAccessibleName("Shortcuts")
        self.list.setToolTip("Commands with their menus and shortcuts; * marks a changed one.")
        self.list.header().resizeSection(1, _MENU)
        self.edit = QKeySequenceEdit()
        self.edit.setMaximumSequenceLength(1)
        clearable(self.edit)
        self.edit.setAccessibleName("Shortcut of the selected command")
        self.edit.setToolTip("Press the new shortcut of the selected command.")
        self.name, self.message = Label(), Label(_MOUSE, wordWrap=True)  # pyright: ignore[reportCallIssue]
        self.reset = button(
            "&Reset this", "reset-key", "Restore the default shortcut of this command."
        )
        self.reset_all = button("Reset &all", "reset-keys", "Restore all default shortcuts.")
        self.close_button = button("&Close", "close", "Close; the changes are saved (Esc).")
        self._lay_out()
        self.line.textChanged.connect(guarded(self._list))
        self.line.returnPressed.connect(self.edit.setFocus)
        self.list.itemActivated.connect(lambda *_: self.edit.setFocus())
        self.list.currentItemChanged.connect(guarded(self._show_chosen))
        # Queued: it reports an empty sequence before each new key, and must not change meanwhile.
        later = Qt.ConnectionType.QueuedConnection
        self.edit.keySequenceChanged.connect(guarded(self._change), later)
        self.reset.clicked.connect(guarded(self._reset))
        self.reset_all.clicked.connect(guarded(self._reset_all))
        self.close_button.clicked.connect(self.accept)

    def _lay_out(self) -> None:
        layout, form = QVBoxLayout(self), QFormLayout()
        layout.addWidget(self.line)
        layout.addWidget(self.list, 1)
        form.addRow(self.name, self.edit)
        layout.addLayout(form)
        layout.addWidget(self.message)
        for each in (self.reset, self.reset_all, self.close_button):
            each.setAutoDefault(False)
        layout.addLayout(in_a_row(self.reset, self.reset_all, self.close_button))

    def open_all(self) -> None:
        """Show all shortcuts."""
        self.line.clear()
        self._list()
        self.message.setText(_MOUSE)
        self.show()
        self.raise_()
        self.activateWindow()
        self.line.setFocus()

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() in (QEvent.Type.PaletteChange, QEvent.Type.FontChange) and self.isVisible():
            self._list()  # its rows have the old colours and font

    def chosen(self) -> str:
        """The name of the selected action; empty where there is none."""
        return str(self.list.chosen() or "")

    def _list(self, *_: object) -> None:
        chosen, query = self.chosen(), self.line.text()
        names = best(
            {name: score(query, *self._search_text(name)) for name in self._actions.entries}
        )
        rows = [self._row(name) for name in names]
        self.list.show_rows(rows)
        if chosen in names:
            self.list.setCurrentItem(rows[names.index(chosen)])
        self._show_chosen()

    def _search_text(self, name: str) -> tuple[str, str]:
        entry = self._actions.entries[name]
        return f"{plain(entry.action.text())} {self._actions.key(name)}", plain(entry.menu)

    def _row(self, name: str) -> QTreeWidgetItem:
        entry, key = self._actions.entries[name], self._actions.key(name)
        star = " *" if key != self._actions.own_key(name) else ""
        return row((plain(entry.action.text()), plain(entry.menu), f"{key}{star}"), name)

    def _show_chosen(self, *_: object) -> None:
        name = self.chosen()
        for widget in (self.edit, self.reset):
            widget.setEnabled(bool(name))
        self.reset_all.setEnabled(bool(self._actions.changed_keys()))
        if name:
            self.name.setText(plain(self._actions[name].text()))
            self.reset.setEnabled(name in self._actions.changed_keys())
            self._show_key(self._actions.key(name))

    def _show_key(self, key: str) -> None:
        self.edit.blockSignals(True)
        self.edit.setKeySequence(QKeySequence(key))
        self.edit.blockSignals(False)

    def _change(self, *_: object) -> None:
        name, key = self.chosen(), self.edit.keySequence().toString()
        if name and key != self._actions.key(name):
            self._set_key(key)

    def _reset(self) -> None:
        self._set_key(self._actions.own_key(self.chosen()))

    def _set_key(self, key: str) -> None:
        name = self.chosen()
        try:
            self._actions.change_key(name, key)
        except Refusal as refusal:
            self.message.setText(f"{refusal}.")
            self._show_key(self._actions.key(name))
            return
        self._finish()
        words = plain(self._actions[name].text())
        self.message.setText(
            f"{words} has the shortcut {key} now." if key else f"{words} has no shortcut now."
        )

    def _reset_all(self) -> None:
        self._actions.take_keys({})
        self._finish()
        self.message.setText("All shortcuts are reset to their defaults.")

    def _finish(self) -> None:
        self._list()
        self.changed.emit()
