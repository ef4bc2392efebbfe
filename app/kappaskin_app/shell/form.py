"""Forms: editors of settings, made from their metadata."""

import math
import re
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any

from PySide6.QtCore import QEvent, QLocale, QObject, QSignalBlocker, Qt, Signal
from PySide6.QtGui import (
    QAction,
    QKeyEvent,
    QKeySequence,
    QMouseEvent,
    QPaintEvent,
    QStandardItemModel,
    QValidator,
)
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QDoubleSpinBox,
    QFormLayout,
    QLabel,
    QLineEdit,
    QMenu,
    QSizePolicy,
    QSpinBox,
    QStyle,
    QStyleOptionComboBox,
    QStylePainter,
    QToolButton,
    QWidget,
)

from kappaskin.live import Status
from kappaskin_app.shell.panel import CornerButton, Panel
from kappaskin_app.shell.settings import LastingSettings, Settings, form_field
from kappaskin_app.shell.settings.form_fields import Choice, FormField, Range, Several, Switch, Text
from kappaskin_app.widgets.parts import Label

_ITS = QKeySequence.StandardKey
# To an editor Ctrl+K, Ctrl+E and Ctrl+U are the last ones.
_LEFT = (_ITS.Undo, _ITS.Redo, _ITS.DeleteEndOfLine, _ITS.MoveToEndOfLine, _ITS.DeleteCompleteLine)


def for_the_window(event: QEvent) -> bool:
    """Whether an event asks an editor for a shortcut of the window, as Undo or Ctrl+K."""
    return (
        event.type() == QEvent.Type.ShortcutOverride
        and isinstance(event, QKeyEvent)
        and any(event.matches(key) for key in _LEFT)
    )


Pairs = tuple[tuple[str, str], ...]  # values with their labels
_NONE = "None"
_ON_MESH = "Functions, N =", "\N{MULTIPLICATION SIGN}"
_TICKS = (Qt.Key.Key_Return, Qt.Key.Key_Enter, Qt.Key.Key_Space)


class SeveralButton(QToolButton):
    """Shows the number of selected options; `chosen` brings their values in order.

    The Down key selects one more, Up one less.
    """

    chosen = Signal(tuple)

    def __init__(self, options: Pairs) -> None:
        super().__init__()
        self.setMenu(_OpenMenu(self))
        self.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.set_options(options)

    def set_options(self, options: Pairs) -> None:
        """Have these options, none of them selected."""
        self.options = options
        self.menu().clear()
        self.ticks = {value: self._tick(words) for value, words in options}
        self.show_chosen(())

    def _tick(self, words: str) -> QAction:
        tick = self.menu().addAction(words)
        tick.setCheckable(True)
        tick.toggled.connect(self._emit_chosen)
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

    def _emit_chosen(self) -> None:
        self._write()
        self.chosen.emit(self._values())

    def show_chosen(self, values: tuple[str, ...]) -> None:
        for value, tick in self.ticks.items():
            with QSignalBlocker(tick):
                tick.setChecked(value in values)
        self._write()

    def _write(self) -> None:
        values = self._values()
        first = dict(self.options)[values[0]] if values else _NONE
        more = f" and {len(values) - 1} more" if len(values) > 1 else ""
        self.setText(first + more)


class _OpenMenu(QMenu):
    """A menu that stays open when an option is ticked."""

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


_AT_FIRST = Settings()
_BEGUN = re.compile(r"[+-]?\d*\.?(\d*|\d+e[+-]?)", re.IGNORECASE)  # the beginning of a number
_LONG, _SEEN = 22, 12  # characters: of a long choice, and at least visible


class WholeBox(QSpinBox):
    """Accepts any digits and corrects to the nearest allowed number."""

    def validate(self, text: str, position: int) -> object:
        return _typing(self, text.removesuffix(self.suffix())), text, position

    def fixup(self, text: str) -> str:
        typed = _typed(text.removesuffix(self.suffix()), self.value())
        return str(round(min(max(typed, self.minimum()), self.maximum())))

    def valueFromText(self, text: str) -> int:
        return round(_typed(text.removesuffix(self.suffix()), self.value()))


class RealBox(QDoubleSpinBox):
    """The same for decimals; a comma is read as a point."""

    def validate(self, text: str, position: int) -> object:
        text = text.replace(",", ".")
        return _typing(self, text.removesuffix(self.suffix())), text, position

    def fixup(self, text: str) -> str:
        typed = _typed(text.removesuffix(self.suffix()), self.value())
        return self.textFromValue(min(max(typed, self.minimum()), self.maximum()))

    def valueFromText(self, text: str) -> float:
        return _typed(text.removesuffix(self.suffix()), self.value())


class ChoiceBox(QComboBox):
    """Has `options`, and elides a text that does not fit."""

    options: Pairs = ()

    def set_options(self, options: Pairs) -> None:
        """Have these options, the first of them selected."""
        self.options = options
        self.clear()
        for value, words in options:
            self.addItem(words, value)
        if max(len(words) for _, words in options) > _LONG:
            # Else one long option would take its width from the skin.
            self.view().setMinimumWidth(self.sizeHint().width())
            policy = QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon
            self.setSizeAdjustPolicy(policy)
            self.setMinimumContentsLength(_SEEN)
            self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)

    def words_shown(self) -> str:
        option = QStyleOptionComboBox()
        self.initStyleOption(option)
        field = QStyle.SubControl.SC_ComboBoxEditField
        kind = QStyle.ComplexControl.CC_ComboBox
        room = self.style().subControlRect(kind, option, field, self).width() - 2
        words = self.currentText()
        return self.fontMetrics().elidedText(words, Qt.TextElideMode.ElideRight, room)

    def paintEvent(self, event: QPaintEvent) -> None:
        painter, option = QStylePainter(self), QStyleOptionComboBox()
        self.initStyleOption(option)
        option.currentText = self.words_shown()  # pyright: ignore[reportAttributeAccessIssue]
        painter.drawComplexControl(QStyle.ComplexControl.CC_ComboBox, option)
        painter.drawControl(QStyle.ControlElement.CE_ComboBoxLabel, option)


def _typed(text: str, before: float) -> float:
    """The number typed, or `before` where there is none yet: no error, which would end the app."""
    try:
        value = float(text)
    except ValueError:
        return before
    return value if math.isfinite(value) else before


def _typing(box: QSpinBox | QDoubleSpinBox, text: str) -> QValidator.State:
    try:
        value = float(text)
    except ValueError:
        begun = _BEGUN.fullmatch(text.strip())
        return QValidator.State.Intermediate if begun else QValidator.State.Invalid
    inside = box.minimum() <= value <= box.maximum()
    return QValidator.State.Acceptable if inside else QValidator.State.Intermediate


class _WindowKeyFilter(QObject):
    """Passes an editor's shortcuts to the window, and the wheel to the page it scrolls in."""

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if for_the_window(event):
            event.ignore()  # else a line edit would take it for its own text
            return True
        if (
            event.type() == QEvent.Type.Wheel
            and isinstance(watched, QWidget)
            and not watched.hasFocus()
        ):
            event.ignore()
            return True
        return False


def pass_window_keys(editor: QWidget) -> None:
    manners = _WindowKeyFilter(editor)
    editor.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
    for widget in (editor, *editor.findChildren(QLineEdit)):
        widget.installEventFilter(manners)


@dataclass(frozen=True)
class _Editor:
    """A widget and the function that shows a value in it."""

    widget: QWidget
    show: Callable[[Any], None]


def _whole(how: Range, changed: Callable[[Any], None]) -> _Editor:
    box = WholeBox()
    box.setRange(int(how.least), int(how.most))
    box.setSingleStep(int(how.step))
    box.valueChanged.connect(changed)
    return _Editor(_dressed(box, how), lambda value: box.setValue(int(value)))


def _range(how: Range, changed: Callable[[Any], None]) -> _Editor:
    if not how.decimals and how.scale == 1:
        return _whole(how, changed)
    box = RealBox()
    box.setLocale(QLocale.c())
    box.setDecimals(how.decimals)
    box.setRange(how.least * how.scale, how.most * how.scale)
    box.setSingleStep(how.step * how.scale)
    box.valueChanged.connect(lambda value: changed(value / how.scale))
    return _Editor(_dressed(box, how), lambda value: box.setValue(value * how.scale))


def _dressed(box: QSpinBox | QDoubleSpinBox, how: Range) -> QWidget:
    if how.unit:
        box.setSuffix(f" {how.unit}")
    box.setToolTip(_tip_of(how, how.most))
    box.setKeyboardTracking(False)
    box.setAlignment(Qt.AlignmentFlag.AlignRight)
    return box


def _tip_of(how: Range, most: float) -> str:
    low, high = round(how.least * how.scale, 6), round(most * how.scale, how.decimals)
    return f"{how.tip} From {low:g} to {high:g} {how.unit}".rstrip() + "."


def _choice(how: Choice, changed: Callable[[Any], None]) -> _Editor:
    box = ChoiceBox()
    box.set_options(how.options)
    box.activated.connect(lambda index: changed(box.itemData(index)))
    return _Editor(box, lambda value: box.setCurrentIndex(box.findData(value)))


def _several(how: Several, changed: Callable[[Any], None]) -> _Editor:
    button = SeveralButton(how.options)
    button.chosen.connect(changed)
    return _Editor(button, button.show_chosen)


def _switch(how: FormField, changed: Callable[[Any], None]) -> _Editor:
    box = QCheckBox(how.label)
    box.toggled.connect(changed)
    return _Editor(box, box.setChecked)


def _text(changed: Callable[[Any], None]) -> _Editor:
    box = QLineEdit()
    box.editingFinished.connect(lambda: changed(box.text().strip()))
    return _Editor(box, box.setText)


def _editor(name: str, changed: Callable[[Any], None]) -> _Editor:
    how = form_field(name)
    if isinstance(how, Text):
        return _text(changed)
    if isinstance(how, Range):
        return _range(how, changed)
    if isinstance(how, Several):
        return _several(how, changed)
    return _choice(how, changed) if isinstance(how, Choice) else _switch(how, changed)


class Form(Panel):
    """A panel with an editor of each setting; `reset_wanted` brings the settings to reset."""

    reset_wanted = Signal(str, tuple)

    def __init__(self, title: str, names: tuple[str, ...], parent: QWidget | None = None) -> None:
        super().__init__(title, parent)
        self.form = QFormLayout()
        self.form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.ExpandingFieldsGrow)
        self.form.setVerticalSpacing(5)
        self.body.addLayout(self.form)
        self._editors: dict[str, _Editor] = {}
        self._fields: dict[str, QWidget] = {}
        for name in names:
            self._add(name)
        self.reset = CornerButton(text="Reset")  # pyright: ignore[reportCallIssue]
        self.reset.setAccessibleName(f"Reset {title}")
        self.reset.setToolTip("Reset the settings of this panel; Ctrl+Z undoes it.")
        self._undoable = tuple(name for name in names if not hasattr(LastingSettings, name))
        self.reset.clicked.connect(lambda: self.reset_wanted.emit(title, self._undoable))
        self.reset.hide()
        self._corner.insertWidget(0, self.reset)

    def _add(self, name: str) -> None:
        how = form_field(name)
        editor = _editor(name, lambda value: self.requested.emit(name, value))
        if not isinstance(how, Range):
            editor.widget.setToolTip(how.tip)
        editor.widget.setObjectName(name)
        pass_window_keys(editor.widget)
        self._editors[name] = editor
        label = Label("" if isinstance(how, Switch) else how.label)
        label.setBuddy(editor.widget)
        label.setToolTip(how.tip)
        self._fields[name] = self.field(name, editor.widget)
        self.form.addRow(label, self._fields[name])

    def field(self, name: str, editor: QWidget) -> QWidget:
        """The widget beside the label of a setting: its editor, or more."""
        return editor

    @property
    def names(self) -> tuple[str, ...]:
        """The settings of the form."""
        return tuple(self._editors)

    def editors(self) -> list[QWidget]:
        return [editor.widget for editor in self._editors.values()]

    def editor(self, name: str) -> QWidget:
        return self._editors[name].widget

    def show_settings(self, settings: Settings) -> None:
        for name, editor in self._editors.items():
            with QSignalBlocker(editor.widget):
                editor.show(getattr(settings, name))
        self.reset.setVisible(
            any(getattr(settings, name) != getattr(_AT_FIRST, name) for name in self._undoable)
        )
        self.place_corner()

    def show_rows(self, names: set[str]) -> None:
        """Show only the rows of these settings."""
        for name, field in self._fields.items():
            self.form.setRowVisible(field, name in names)

    def has_row(self, name: str) -> bool:
        """Whether the row of a setting is shown."""
        return self.form.isRowVisible(self._fields[name])

    def show_functions(self, along_x: str, along_y: str, on_mesh: bool) -> None:
        """Name both numbers of functions: their product is N on a mesh, which has no x and y."""
        names = _ON_MESH if on_mesh else [form_field(name).label for name in (along_x, along_y)]
        for name, words in zip((along_x, along_y), names, strict=True):
            if isinstance(label := self.form.labelForField(self._fields[name]), QLabel):
                label.setText(words)

    def offer(self, name: str, values: Collection[str]) -> None:
        """Enable only these values of the choice called `name`."""
        box = self.editor(name)
        model = box.model() if isinstance(box, QComboBox) else None
        if isinstance(box, QComboBox) and isinstance(model, QStandardItemModel):
            for index in range(box.count()):
                model.item(index).setEnabled(box.itemData(index) in values)

    def show_options(self, name: str, options: Pairs, value: Any) -> None:
        """Have these options of the choice called `name`, and show one, or several."""
        editor = self._editors[name]
        box = editor.widget
        with QSignalBlocker(box):
            if isinstance(box, ChoiceBox | SeveralButton) and options != box.options:
                box.set_options(options)
            editor.show(value)

    def show_limit(self, name: str, most: float) -> None:
        """Limit the number called `name` to `most`, in SI units."""
        how, box = form_field(name), self.editor(name)
        if isinstance(how, Range) and isinstance(box, QDoubleSpinBox):
            with QSignalBlocker(box):
                box.setMaximum(most * how.scale)
            box.setToolTip(_tip_of(how, most))


_OTHER = "Available only for the simulated skin (Ctrl+M)"


class SimulationForm(Form):
    """A form of the simulation, hidden while another source is in use."""

    def show_status(self, status: Status, simulating: bool) -> None:
        self.setVisible(simulating)
        self.show_message(self.alarm(status) if simulating else _OTHER)

    def alarm(self, status: Status) -> str:
        """An error of these settings, while they are simulated; empty without one."""
        return ""
