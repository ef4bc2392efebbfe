"""Editors for the values of a scene, by kind of value."""

import math
import re
import tomllib
from collections.abc import Callable
from dataclasses import dataclass, field
from decimal import Decimal
from typing import Any

import tomlkit
from PySide6.QtCore import QLocale, QRegularExpression, QSignalBlocker, Qt
from PySide6.QtGui import QRegularExpressionValidator
from PySide6.QtWidgets import (
    QCheckBox,
    QHBoxLayout,
    QLineEdit,
    QSizePolicy,
    QSpinBox,
    QWidget,
)

from kappaskin._schema import Key, Unit
from kappaskin_app.features.scene.sections import MOST, MOST_WHOLE, Row
from kappaskin_app.guard import guarded
from kappaskin_app.shell.form import ChoiceBox, RealBox, WholeBox, pass_window_keys

_DIGITS = 6  # of a number that are shown


def shown(value: float, unit: Unit) -> str:
    """A value in its display unit, with as few digits as it needs."""
    text = f"{value / unit.scale:.{_DIGITS}g}"
    plain = f"{Decimal(text):f}" if "e" in text else text
    return "0" if float(plain) == 0 else plain


def value_of(number: float, unit: Unit) -> float:
    """The value of a displayed number, without the rounding error of its scale."""
    return float(f"{number * unit.scale:.10g}")


def read_numbers(text: str, before: list[Any], unit: Unit, whole: bool) -> list[Any]:
    """The numbers of a text; unchanged ones keep all their digits."""
    befores = [*before, *([None] * len(text))]
    found = list[Any]()
    for word, old in zip(filter(None, re.split(r"[,;\s]+", text)), befores, strict=False):
        if old is not None and word == shown(old, unit):
            found.append(old)
        else:
            number = float(word)
            found.append(int(number) if whole and number.is_integer() else value_of(number, unit))
    if not all(map(math.isfinite, found)):
        raise ValueError("expected finite numbers")
    return found


class NumberBox(RealBox):
    """A number box with as few digits as needed and steps in proportion to the value."""

    def __init__(self, key: Key, usual: Any) -> None:
        super().__init__()
        self._unit = unit = key.unit
        size = abs(usual / unit.scale) if isinstance(usual, int | float) and usual else 1.0
        self._step = _tenth(size)
        self.setLocale(QLocale.c())
        self.setDecimals(12)
        self.setRange(*(min(max(end / unit.scale, -MOST), MOST) for end in key.bounds))

    def show_value(self, value: float) -> None:
        """Show a value in its display unit; a value outside the range extends the range."""
        at = float(shown(value, self._unit))
        self.setRange(min(self.minimum(), at), max(self.maximum(), at))
        self.setValue(at)

    def textFromValue(self, value: float) -> str:
        return shown(value * self._unit.scale, self._unit)

    def stepBy(self, steps: int) -> None:
        value = self.value()
        # By the direction of the step: below 10 the steps are those of 9.
        size = abs(value) * (1 - 1e-9 * math.copysign(1, -value * steps))
        step = max(_tenth(size), self._step / 10) if value else self._step
        self.setValue(float(f"{value + steps * step:.10g}"))


def _tenth(size: float) -> float:
    return 10.0 ** (math.floor(math.log10(size)) - 1)


class WholeNumberBox(WholeBox):
    """A box for a whole number."""

    def __init__(self, key: Key) -> None:
        super().__init__()
        low, high = (min(max(end, -MOST_WHOLE), MOST_WHOLE) for end in key.bounds)
        self.setRange(int(low), int(high))

    def show_value(self, value: int) -> None:
        """Show a value; a value outside the range extends the range."""
        self.setRange(min(self.minimum(), value), max(self.maximum(), value))
        self.setValue(value)


_WIDEST = 300  # px of an editor, except lines of text
_TYPED = QRegularExpression(r"[-+0-9.eE,; ]*")

Report = Callable[[Any], None]


@dataclass
class Editor:
    """A widget, the function that fills it, and the `value` shown.

    It consists of several widgets if `parts` are given.
    """

    widget: QWidget
    fill: Callable[[Any], None]
    parts: tuple[QWidget, ...] = ()
    value: Any = field(default=None, init=False)

    @property
    def stops(self) -> tuple[QWidget, ...]:
        """The widgets that take the keyboard focus, in order."""
        return self.parts or (self.widget,)

    def show(self, value: Any) -> None:
        """Show a value; the present one does not change a text that is being typed."""
        if value != self.value or type(value) is not type(self.value):
            self.value = value
            self.fill(value)


def editor_for(row: Row, report: Report, small: bool = False) -> Editor:
    """An editor that calls `report` with each value entered by the user."""
    count, _, kind = row.kind.rpartition(" ")
    if count:
        editor = _several(row, kind, int(count), report, small)
    elif kind in _MAKERS:
        editor = _MAKERS[kind](row, report)
    else:
        editor = _spin(row, kind, row.usual, report, small)
    tip = row.key.explained + (" Separate pairs by semicolons." if kind == "pairs" else "")
    for widget in editor.stops:
        pass_window_keys(widget)
        widget.setToolTip(tip)
    editor.widget.setObjectName(".".join(map(str, row.place)))
    editor.show(row.value)
    return editor


def _spin(row: Row, kind: str, usual: Any, report: Report, small: bool) -> Editor:
    key = row.key
    box = _whole_box(key, report) if kind == "whole" else _number_box(key, usual, report)
    box.setSuffix(key.unit.suffix)
    box.setKeyboardTracking(False)
    box.setAlignment(Qt.AlignmentFlag.AlignRight)
    if small:
        box.setButtonSymbols(QSpinBox.ButtonSymbols.NoButtons)
    room = box.fontMetrics().horizontalAdvance(f"{'00.00' if small else '00.0000'}{box.suffix()}")
    box.setMinimumWidth(room + (10 if small else 30))
    _limit_width(box)

    def fill(value: Any) -> None:
        with QSignalBlocker(box):
            box.show_value(value)

    return Editor(box, fill)


def _number_box(key: Key, usual: Any, report: Report) -> NumberBox:
    box = NumberBox(key, usual)
    box.valueChanged.connect(guarded(lambda value: report(value_of(value, key.unit))))
    return box


def _whole_box(key: Key, report: Report) -> WholeNumberBox:
    box = WholeNumberBox(key)
    box.valueChanged.connect(guarded(report))
    return box


def _several(row: Row, kind: str, count: int, report: Report, small: bool) -> Editor:
    holder = QWidget()
    across = QHBoxLayout(holder)
    across.setContentsMargins(0, 0, 0, 0)
    across.setSpacing(4)
    usual = row.usual if isinstance(row.usual, list) and len(row.usual) == count else []
    largest = max((one for one in usual if isinstance(one, int | float)), default=None)

    def report_one(index: int) -> Report:
        def report_value(value: Any) -> None:
            report([*editor.value[:index], value, *editor.value[index + 1 :]])

        return report_value

    each = [_spin(row, kind, largest, report_one(index), True) for index in range(count)]
    for one in each:
        across.addWidget(one.widget)

    def fill(values: Any) -> None:
        for one, value in zip(each, values, strict=True):
            one.show(value)

    _limit_width(holder)
    editor = Editor(holder, fill, tuple(one.widget for one in each))
    return editor


def _limit_width(widget: QWidget) -> None:
    widget.setMaximumWidth(_WIDEST)
    widget.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)


def _switch(row: Row, report: Report) -> Editor:
    box = QCheckBox()
    box.toggled.connect(guarded(report))
    return Editor(box, _quietly(box, box.setChecked))


def _choice(row: Row, report: Report) -> Editor:
    box = ChoiceBox()
    for value, words in row.key.choices:
        box.addItem(words, value)
    _limit_width(box)
    box.activated.connect(guarded(lambda index: report(box.itemData(index))))

    def fill(value: Any) -> None:
        if box.findData(value) < 0:
            box.addItem(value, value)  # an unknown value is shown unchanged
        box.setCurrentIndex(box.findData(value))

    return Editor(box, fill)


def _quietly(widget: QWidget, fill: Callable[[Any], None]) -> Callable[[Any], None]:
    def quiet(value: Any) -> None:
        with QSignalBlocker(widget):
            fill(value)

    return quiet


def _line(
    line: QLineEdit, words: Callable[[Any], str], read: Callable[[str, Any], Any], report: Report
) -> Editor:
    """A one-line editor; an invalid text is reset."""
    line.setMinimumWidth(60)

    def fill(value: Any) -> None:
        if line.text() != words(value):
            line.setText(words(value))
            line.setCursorPosition(0)

    def finished() -> None:
        text = line.text()
        if text == words(editor.value):
            return
        try:
            value = read(text, editor.value)
        except ValueError:
            value = editor.value
        fill(value)
        if value != editor.value:
            report(value)

    line.editingFinished.connect(guarded(finished))
    editor = Editor(line, fill)
    return editor


def _text(row: Row, report: Report) -> Editor:
    return _line(QLineEdit(), str, lambda text, _: text, report)


def _texts(row: Row, report: Report) -> Editor:
    def read(text: str, _: Any) -> list[str]:
        return [one.strip() for one in text.split(",") if one.strip()]

    return _line(QLineEdit(), ", ".join, read, report)


def _literal(row: Row, report: Report) -> Editor:
    """An editor of TOML, for values without their own editor."""

    def words(value: Any) -> str:
        return tomlkit.item(value).as_string()

    def read(text: str, _: Any) -> Any:
        found = tomllib.loads(f"value = {text}")
        if len(found) != 1:
            raise ValueError("expected one value")
        return found["value"]

    return _line(QLineEdit(), words, read, report)


def _numbers_line() -> QLineEdit:
    line = QLineEdit()
    line.setValidator(QRegularExpressionValidator(_TYPED, line))
    return line


def _numbers(row: Row, report: Report) -> Editor:
    def words(values: list[Any]) -> str:
        return ", ".join(shown(value, row.key.unit) for value in values)

    def read(text: str, before: list[Any]) -> list[Any]:
        return read_numbers(text, before, row.key.unit, whole=row.kind == "wholes")

    return _line(_numbers_line(), words, read, report)


def _pairs(row: Row, report: Report) -> Editor:
    def words(pairs: list[list[Any]]) -> str:
        return "; ".join(", ".join(shown(one, row.key.unit) for one in pair) for pair in pairs)

    def read(text: str, before: list[list[Any]]) -> list[list[Any]]:
        each = [part for part in text.split(";") if part.strip(" ,")]
        befores = [*before, *([[]] * len(each))]
        return [
            read_numbers(*both, row.key.unit, whole=False)
            for both in zip(each, befores, strict=False)
        ]

    return _line(_numbers_line(), words, read, report)


_MAKERS: dict[str, Callable[[Row, Report], Editor]] = {
    "switch": _switch,
    "choice": _choice,
    "text": _text,
    "texts": _texts,
    "literal": _literal,
    "numbers": _numbers,
    "wholes": _numbers,
    "pairs": _pairs,
}
