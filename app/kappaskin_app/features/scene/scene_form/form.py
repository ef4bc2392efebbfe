"""Scene form: editors of what the text of a scene says; every edit makes a new text."""

import tomllib
from itertools import pairwise

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QApplication, QFrame, QScrollArea, QVBoxLayout, QWidget

from kappaskin_app.features.scene.scene_form.box import SectionBox
from kappaskin_app.features.scene.scene_form.section import Change, Section
from kappaskin_app.features.scene.scene_form.sections import sections_of
from kappaskin_app.features.scene.scene_text.changes import Place

_LABEL = 14  # digits that a label has room for at least


class SceneForm(QScrollArea):
    """Forms over a text: `edited` is the whole new text whenever a person changed something."""

    edited = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
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
        """Show what a scene's TOML says; forms over what is none wait, as they were."""
        if text == self._text:
            return
        self._text = text
        self._showing = True  # a box that loses the focus meanwhile says what was typed in it
        try:
            said = tomllib.loads(text)
        except (ValueError, RecursionError):  # also of a number too long to read
            self._content.setEnabled(False)
        else:
            self._content.setEnabled(True)
            self._show(sections_of(said))
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
        """The place whose editor has the focus."""
        widget = QApplication.focusWidget()
        for box in self.boxes:
            for place, editor in box.editors.items():
                if widget is not None and (
                    widget is editor.widget or editor.widget.isAncestorOf(widget)
                ):
                    return place
        return None

    def _rebuild(self, sections: tuple[Section, ...]) -> None:
        """New boxes for what changed its structure; all others stay."""
        self._content.setUpdatesEnabled(False)
        there = {box.section.structure: box for box in self.boxes}
        self.boxes = [self._box(section, there) for section in sections]
        for box in there.values():
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

    def _box(self, section: Section, there: dict[tuple[object, ...], SectionBox]) -> SectionBox:
        box = there.pop(section.structure, None)
        if box is None:
            return SectionBox(section, self._request)
        box.show_section(section)
        return box

    def _align(self) -> None:
        """One column of labels for all boxes."""
        labels = [label.sizeHint().width() for box in self.boxes for label in box.labels]
        width = max([*labels, self.fontMetrics().horizontalAdvance("0" * _LABEL)])
        for box in self.boxes:
            box.grid.setColumnMinimumWidth(0, width)
