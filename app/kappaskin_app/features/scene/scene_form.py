"""Forms of a scene: a box for each section of its text."""

import tomllib
from collections.abc import Callable
from itertools import pairwise

from PySide6.QtCore import QPoint, Qt, Signal
from PySide6.QtGui import QAction, QPaintEvent, QResizeEvent
from PySide6.QtWidgets import (
    QApplication,
    QFrame,
    QGridLayout,
    QGroupBox,
    QHBoxLayout,
    QLabel,
    QMenu,
    QScrollArea,
    QSizePolicy,
    QStyleOptionToolButton,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from kappaskin_app.features.scene import scene_text
from kappaskin_app.features.scene.editors import Editor, editor_for
from kappaskin_app.features.scene.scene_text import Place
from kappaskin_app.features.scene.sections import (
    Addition,
    Change,
    Row,
    Section,
    sections_of,
)
from kappaskin_app.guard import guarded
from kappaskin_app.widgets.parts import Label

_BUTTON, _EDGE = 20, 9  # px: size of a small button, margin of the last one

Request = Callable[[Change], None]
_ADDING = "Select from a list what to add to the scene."


class SectionBox(QGroupBox):
    """Shows a section; calls `request` with every change of the text by the user."""

    def __init__(self, section: Section, request: Request) -> None:
        super().__init__(section.title)
        self._request, self.section = request, section
        self.editors: dict[Place, Editor] = {}
        self.stops: list[QWidget] = []
        self.labels: list[QLabel] = []
        self.grid = QGridLayout(self)
        self.grid.setColumnStretch(1, 1)
        self.grid.setVerticalSpacing(5)
        self.grid.setHorizontalSpacing(10)
        self.grid.setContentsMargins(*((8, 6, 8, 8) if section.title else (8, 0, 8, 0)))
        self._fill(section)
        # A label without text has no size; an empty widget would take the clicks of a button below.
        self._corner = self._buttons(section) if section.title else Label()
        self._corner.setParent(self)
        if not (section.rows or section.sections or section.adding):
            default = Label("Default")
            default.setEnabled(False)
            self.grid.addWidget(default, 0, 0)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._corner.adjustSize()
        self._corner.move(QPoint(self.width() - self._corner.width() - _EDGE, -1))

    def paintEvent(self, event: QPaintEvent) -> None:
        if self.title():  # a single button needs no frame
            super().paintEvent(event)

    def show_section(self, section: Section) -> None:
        """Show other values of the same structure."""
        self.section = section
        for row in section.all_rows():
            self.editors[row.place].show(row.value)

    def _fill(self, section: Section) -> None:
        for row in section.rows:
            self._add_row(row)
        for part in section.sections:
            if not part.step:
                self._add_across(self._heading(part))
                self._fill(part)
        if steps := [part for part in section.sections if part.step]:
            self._add_across(self._steps(steps))
        if section.adding:
            self.grid.addWidget(
                self._menu_button(f"+ {section.adding}", section.tip or _ADDING, section.more),
                *(self.grid.rowCount(), 0, 1, 2),
                Qt.AlignmentFlag.AlignLeft,
            )

    def _add_across(self, widget: QWidget) -> None:
        self.grid.addWidget(widget, self.grid.rowCount(), 0, 1, 2)

    def _add_row(self, row: Row) -> None:
        editor = self._editor(row)
        label = Label(row.key.label)
        label.setToolTip(row.key.explained)
        label.setBuddy(editor.stops[0])
        self.labels.append(label)
        at = self.grid.rowCount()
        self.grid.addWidget(label, at, 0)
        across = QHBoxLayout()
        across.addWidget(editor.widget, 1000)  # an editor of limited width leaves the rest
        across.addStretch(1)
        self.grid.addLayout(across, at, 1)

    def _editor(self, row: Row, small: bool = False) -> Editor:
        editor = editor_for(
            row, lambda value: self._request(lambda t: row.changed(t, value)), small
        )
        for number, stop in enumerate(editor.stops, 1):
            which = f", {number} of {len(editor.stops)}" if len(editor.stops) > 1 else ""
            stop.setAccessibleName(stop.accessibleName() or f"{row.key.label}{which}")
        self.editors[row.place] = editor
        self.stops += editor.stops
        return editor

    def _heading(self, part: Section) -> QWidget:
        heading = QWidget()
        across = QHBoxLayout(heading)
        across.setContentsMargins(0, 4, 0, 0)
        label = Label(part.title)
        font = label.font()
        font.setBold(True)
        label.setFont(font)
        label.setToolTip(part.tip)
        across.addWidget(label)
        across.addStretch(1)
        across.addWidget(self._buttons(part))
        return heading

    def _steps(self, steps: list[Section]) -> QWidget:
        """The steps, one per line; the easing is below."""
        holder = QWidget()
        grid = QGridLayout(holder)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setHorizontalSpacing(4)
        grid.setVerticalSpacing(3)
        for column, stretch in enumerate((0, 2, 5)):
            grid.setColumnStretch(column, stretch)
        for step in steps:
            line = grid.rowCount()
            for column, row in enumerate(step.rows):
                below, across = divmod(column, 3)
                grid.addWidget(self._editor(row, small=True).widget, line + below, across)
            grid.addWidget(self._buttons(step), line, 3, Qt.AlignmentFlag.AlignRight)
        return holder

    def _buttons(self, section: Section) -> QWidget:
        holder = QWidget()
        across = QHBoxLayout(holder)
        across.setContentsMargins(0, 0, 0, 0)
        across.setSpacing(0)
        if section.offers:
            across.addWidget(self._menu_button("+", "Add a value", section.offers))
        if section.removable:
            across.addWidget(self._removing(section.place))
        return holder

    def _removing(self, place: Place) -> QToolButton:
        button = _tool("\N{MULTIPLICATION SIGN}", "Remove", place)
        button.clicked.connect(
            guarded(lambda: self._request(lambda text: scene_text.remove(text, place)))
        )
        self.stops.append(button)
        return button

    def _menu_button(self, text: str, tip: str, offers: tuple[Addition, ...]) -> QToolButton:
        button = _tool(text, tip, ("add",))
        button.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        button.setMenu(self._menu(offers, button))
        button.setEnabled(bool(offers))
        self.stops.append(button)
        return button

    def _menu(self, offers: tuple[Addition, ...], parent: QWidget) -> QMenu:
        menu = QMenu(parent)
        menu.setToolTipsVisible(True)
        for offer in offers:
            if offer.inside:
                inside = self._menu(offer.inside, menu)
                inside.setTitle(offer.words)
                menu.addMenu(inside)
                continue
            # Not the one that `addAction` makes: PySide may take it for an object of another kind
            # that was there before.
            action = QAction(offer.words, menu)
            menu.addAction(action)
            action.setToolTip(offer.tip)
            action.triggered.connect(guarded(lambda *_, o=offer: self._request(o.change)))
        return menu


class _Arrowless(QToolButton):
    """A button without the arrow of its menu; a style sheet would keep the ink of another theme."""

    def initStyleOption(self, option: QStyleOptionToolButton) -> None:
        super().initStyleOption(option)
        option.features &= ~QStyleOptionToolButton.ToolButtonFeature.HasMenu  # pyright: ignore


def _tool(text: str, tip: str, place: Place) -> QToolButton:
    button = _Arrowless(text=text, toolTip=tip, autoRaise=len(text) == 1)  # pyright: ignore[reportCallIssue]
    button.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
    if len(text) == 1:
        button.setFixedSize(_BUTTON, _BUTTON)
    button.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
    return button


_LABEL = 14  # digits, least width of a label


class SceneForm(QScrollArea):
    """Forms over a text: `edited` sends the whole new text after a change by the user."""

    edited = Signal(str)

    def __init__(self) -> None:
        super().__init__()
        self._text = ""
        self._showing = False
        self._content = QWidget()
        self._column = QVBoxLayout(self._content)
        self._column.setContentsMargins(6, 6, 6, 6)
        self._column.addStretch(1)
        self.boxes: list[SectionBox] = []
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setWidgetResizable(True)
        self.setWidget(self._content)

    def show_text(self, text: str) -> None:
        """Show the values of a scene's TOML; the forms are disabled while it is invalid."""
        if text == self._text:
            return
        self._text = text
        self._showing = True  # a box that loses the focus meanwhile reports its text
        try:
            values = tomllib.loads(text)
        except (ValueError, RecursionError):  # also of a number too long to read
            self._content.setEnabled(False)
        else:
            self._content.setEnabled(True)
            self._show(sections_of(values))
        finally:
            self._showing = False

    def editor(self, *place: str | int) -> QWidget:
        """The editor of the value at `place`."""
        return next(b.editors[place].widget for b in self.boxes if place in b.editors)

    def _request(self, change: Change) -> None:
        if self._showing or not self._content.isEnabled():
            return
        text = change(self._text)
        if text != self._text:
            self.show_text(text)
            self.edited.emit(text)

    def _show(self, sections: tuple[Section, ...]) -> None:
        if [box.section.structure for box in self.boxes] == [s.structure for s in sections]:
            for box, section in zip(self.boxes, sections, strict=True):
                box.show_section(section)
            return
        focus = self._focus()
        self._rebuild(sections)
        if focus is not None:
            for box in self.boxes:
                if focus in box.editors:
                    box.editors[focus].stops[0].setFocus()

    def _focus(self) -> Place | None:
        """The place of the editor with the focus."""
        widget = QApplication.focusWidget()
        for box in self.boxes:
            for place, editor in box.editors.items():
                if widget is not None and (
                    widget is editor.widget or editor.widget.isAncestorOf(widget)
                ):
                    return place
        return None

    def _rebuild(self, sections: tuple[Section, ...]) -> None:
        """Replace the boxes of sections whose structure changed."""
        self._content.setUpdatesEnabled(False)
        existing = {box.section.structure: box for box in self.boxes}
        self.boxes = [self._box(section, existing) for section in sections]
        for box in existing.values():
            self._column.removeWidget(box)
            box.hide()
            box.deleteLater()
        for index, box in enumerate(self.boxes):
            self._column.insertWidget(index, box)
        stops = [stop for box in self.boxes for stop in box.stops]
        for one, next_ in pairwise(stops):
            QWidget.setTabOrder(one, next_)
        self._align()
        self._content.setUpdatesEnabled(True)

    def _box(self, section: Section, existing: dict[tuple[object, ...], SectionBox]) -> SectionBox:
        box = existing.pop(section.structure, None)
        if box is None:
            return SectionBox(section, self._request)
        box.show_section(section)
        return box

    def _align(self) -> None:
        """Align the labels of all boxes in one column."""
        labels = [label.sizeHint().width() for box in self.boxes for label in box.labels]
        width = max([*labels, self.fontMetrics().horizontalAdvance("0" * _LABEL)])
        for box in self.boxes:
            box.grid.setColumnMinimumWidth(0, width)
