"""Scene panel: gallery, editor with forms and text, effect plan."""

import re

from PySide6.QtCore import QEvent, QRect, QSize, Qt, QTimer, Signal
from PySide6.QtGui import (
    QColor,
    QFocusEvent,
    QFontDatabase,
    QHideEvent,
    QPainter,
    QPaintEvent,
    QResizeEvent,
    QShowEvent,
    QTextCharFormat,
    QTextFormat,
)
from PySide6.QtWidgets import (
    QHBoxLayout,
    QPlainTextEdit,
    QSplitter,
    QTabWidget,
    QTextEdit,
    QVBoxLayout,
    QWidget,
)

from kappaskin._text import printable
from kappaskin_app.features.scene.gallery import GalleryPanel
from kappaskin_app.features.scene.plan import EffectsPanel
from kappaskin_app.features.scene.scene_form import SceneForm
from kappaskin_app.guard import guarded
from kappaskin_app.shell.form import for_the_window
from kappaskin_app.theme import ALERT, current, follow_look
from kappaskin_app.widgets.parts import Label, button, text_label

_PAUSE = 300  # ms without a key until a typed text is used
_NUMBER_MARGIN = 6  # px


class _Numbers(QWidget):
    """The line numbers."""

    def __init__(self, text: "SceneText") -> None:
        super().__init__(text)
        self._text = text

    def sizeHint(self) -> QSize:
        return QSize(self._text.numbers_width(), 0)

    def paintEvent(self, event: QPaintEvent) -> None:
        self._text.paint_numbers(self, event)


class SceneText(QPlainTextEdit):
    """A text editor whose undo is the window's; `edited` sends the text after a pause."""

    edited = Signal(str)

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("scene-text")
        self.setAccessibleName("The scene as text")
        self.setFont(QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont))
        self.setLineWrapMode(QPlainTextEdit.LineWrapMode.NoWrap)
        self.setUndoRedoEnabled(False)
        self.setTabChangesFocus(True)
        self._numbers, self._error_line = _Numbers(self), 0
        self._showing, self._shown = False, ""
        self._pause = QTimer(self, singleShot=True, interval=_PAUSE)  # pyright: ignore[reportCallIssue]
        self._pause.timeout.connect(guarded(self.send))
        self.textChanged.connect(guarded(self._typed))
        self.blockCountChanged.connect(self._make_room)
        self.updateRequest.connect(self._scroll_numbers)
        self._make_room()
        follow_look(self, self._mark)

    def show_text(self, text: str) -> None:
        """Show the text of the scene; cursor and scroll position are preserved.

        A text that is being typed is replaced only by another scene's.
        """
        if self._pause.isActive() and text == self._shown:
            return
        self._pause.stop()
        self._shown = text
        if text == self.toPlainText():
            return
        place, bars = (
            self.textCursor().position(),
            (self.verticalScrollBar(), self.horizontalScrollBar()),
        )
        scrolled = [bar.value() for bar in bars]
        self._showing = True
        self.setPlainText(text)
        self._showing = False
        cursor = self.textCursor()
        cursor.setPosition(min(place, len(text)))
        self.setTextCursor(cursor)
        for bar, value in zip(bars, scrolled, strict=True):
            bar.setValue(value)

    def send(self) -> None:
        """Send the typed text without the pause."""
        self._pause.stop()
        self._shown = self.toPlainText()
        self.edited.emit(self._shown)

    def show_error(self, line: int) -> None:
        """Mark the line of an error, counted from one; none with 0."""
        if line != self._error_line:
            self._error_line = line
            self._mark()

    def _typed(self) -> None:
        if not self._showing:
            self._pause.start()

    def _mark(self) -> None:
        marks: list[QTextEdit.ExtraSelection] = []
        block = self.document().findBlockByNumber(self._error_line - 1)
        if self._error_line and block.isValid():
            mark, colour = QTextEdit.ExtraSelection(), QColor(current().bad)
            colour.setAlphaF(0.25)
            how = QTextCharFormat()
            how.setBackground(colour)
            how.setProperty(QTextFormat.Property.FullWidthSelection, True)
            mark.format, mark.cursor = how, self.textCursor()  # pyright: ignore[reportAttributeAccessIssue]
            mark.cursor.setPosition(block.position())  # pyright: ignore[reportAttributeAccessIssue]
            marks.append(mark)
        self.setExtraSelections(marks)
        self._numbers.update()

    def event(self, event: QEvent) -> bool:
        if for_the_window(event):
            if self._pause.isActive():
                self.send()  # before undo, or the typed text would follow it
            event.ignore()
            return True
        return super().event(event)

    def focusOutEvent(self, event: QFocusEvent) -> None:
        super().focusOutEvent(event)
        if self._pause.isActive():
            self.send()  # before another editor changes the previous text

    # Line numbers

    def numbers_width(self) -> int:
        digits = len(str(self.blockCount()))
        return 2 * _NUMBER_MARGIN + digits * self.fontMetrics().horizontalAdvance("9")

    def _make_room(self) -> None:
        self.setViewportMargins(self.numbers_width(), 0, 0, 0)

    def _scroll_numbers(self, rect: QRect, dy: int) -> None:
        if dy:
            self._numbers.scroll(0, dy)
        else:
            self._numbers.update(0, rect.y(), self._numbers.width(), rect.height())

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        around = self.contentsRect()
        self._numbers.setGeometry(
            around.left(), around.top(), self.numbers_width(), around.height()
        )

    def paint_numbers(self, where: QWidget, event: QPaintEvent) -> None:
        """Paint the numbers of the visible lines, for the line number widget only."""
        theme = current()
        with QPainter(where) as painter:
            painter.fillRect(event.rect(), QColor(theme.window))
            painter.setFont(self.font())
            block, offset = self.firstVisibleBlock(), self.contentOffset()
            height = self.fontMetrics().height()
            while block.isValid():
                top = round(self.blockBoundingGeometry(block).translated(offset).top())
                if top > event.rect().bottom():
                    break
                number = block.blockNumber() + 1
                painter.setPen(QColor(theme.alert if number == self._error_line else theme.faint))
                area = QRect(0, top, where.width() - _NUMBER_MARGIN, height)
                painter.drawText(area, Qt.AlignmentFlag.AlignRight, str(number))
                block = block.next()


_LINE = re.compile(r"\bline (\d+)")
_FORM = 420  # px: the forms, at least
_EDIT, _EFFECTS = 1, 2  # the pages
_SHARES = (5, 6)  # of the width: the forms, and the text


class SceneEditor(QWidget):
    """Forms and text of one scene; `edited` sends the text after a change of either."""

    edited = Signal(str)
    save_wanted = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.form, self.text = SceneForm(), SceneText()
        self.name, self.message = Label(), text_label()
        self.message.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.save = button(
            "Save as\N{HORIZONTAL ELLIPSIS}",
            "save-scene",
            "Write the scene to a file (Ctrl+Shift+S), for `kappaskin plan` and `simulate`.",
        )
        self.message.setForegroundRole(ALERT)
        above = QHBoxLayout()
        above.addWidget(self.name, 1)
        above.addWidget(self.save)
        right = QWidget()
        stack = QVBoxLayout(right)
        stack.setContentsMargins(6, 0, 0, 0)
        stack.addLayout(above)
        stack.addWidget(self.text, 1)
        stack.addWidget(self.message)
        both = QSplitter(Qt.Orientation.Horizontal)
        both.addWidget(self.form)
        both.addWidget(right)
        for index, share in enumerate(_SHARES):
            both.setStretchFactor(index, share)
        both.setChildrenCollapsible(False)
        self.form.setMinimumWidth(_FORM)
        QVBoxLayout(self).addWidget(both)
        self.form.edited.connect(self.edited)
        self.text.edited.connect(self.edited)
        self.save.clicked.connect(self.save_wanted)
        self.show_refusal("")

    def show_scene(self, text: str, name: str) -> None:
        """Show the text of the scene `name`."""
        self.name.setText(printable(name))
        self.text.show_text(text)
        self.form.show_text(text)

    def show_refusal(self, why: str) -> None:
        """Show why the text is refused, and mark its line; nothing if it is not."""
        line = _LINE.search(why)
        self.text.show_error(int(line[1]) if line else 0)
        said = printable(f"The previous scene is still simulated: {why}")
        self.message.setText(said if why else "")
        self.message.setVisible(bool(why))


class ScenePanel(QTabWidget):
    """Pages of gallery, editor and effect plan; `plan_visible` reports when the plan is."""

    plan_visible = Signal(bool)

    def __init__(self) -> None:
        super().__init__()
        self.gallery = GalleryPanel()
        self.editor, self.effects = SceneEditor(), EffectsPanel()
        for page, title in (
            (self.gallery, "&Gallery"),
            (self.editor, "&Edit"),
            (self.effects, "E&ffects"),
        ):
            self.addTab(page, title)
        self.setDocumentMode(True)
        self.currentChanged.connect(self._report_visible)

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        self._report_visible()

    def hideEvent(self, event: QHideEvent) -> None:
        super().hideEvent(event)
        self._report_visible()

    def _report_visible(self) -> None:
        self.plan_visible.emit(self.isVisible() and self.currentWidget() is self.effects)

    def show_refusal(self, why: str) -> None:
        """Show why the text is not simulated; its effects cannot be forced then."""
        self.editor.show_refusal(why)
        self.setTabText(_EDIT, "&Edit (refused)" if why else "&Edit")
        self.effects.table.setEnabled(not why)

    def show_simulated(self, simulated: bool) -> None:
        """Disable all pages but the gallery while the readings are not simulated."""
        if simulated == self.isTabEnabled(_EDIT):
            return
        why = "" if simulated else "No scene is simulated: select one, or press Ctrl+M."
        for page in (_EDIT, _EFFECTS):
            self.setTabEnabled(page, simulated)
            self.setTabToolTip(page, why)
