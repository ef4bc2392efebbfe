"""The lesson panel: the list, a step, the end."""

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QKeyEvent, QShowEvent
from PySide6.QtWidgets import (
    QHBoxLayout,
    QProgressBar,
    QStackedWidget,
    QVBoxLayout,
    QWidget,
)

from kappaskin_app.features.lessons.pages import EndPage, LessonStepPage, ListPage
from kappaskin_app.features.lessons.teaching import Teaching
from kappaskin_app.guard import guarded
from kappaskin_app.theme import FAINT, current, follow_look
from kappaskin_app.widgets.parts import Label, button

_NEXT = "The step after this one (Enter after a right answer)."


class LessonPanel(QWidget):
    """Shows the lessons of `Teaching` and passes on requests; `seen` when it is shown.

    A step that is shown has the keyboard where it is answered; Escape gives the keyboard up.
    """

    seen = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.list, self.step, self.end = ListPage(), LessonStepPage(), EndPage()
        self.pages = QStackedWidget()
        for page in (self.step, self.end):
            self.pages.addWidget(page)
        self.where, self.bar = Label(), QProgressBar()
        self.where.setForegroundRole(FAINT)
        self.bar.setTextVisible(False)
        self.bar.setFixedHeight(4)
        self.back = button("\N{LEFTWARDS ARROW} &Back", "lesson-back", "The step before.")
        self.next = button("&Next \N{RIGHTWARDS ARROW}", "lesson-next", _NEXT)
        self.leave = button(
            "&Leave", "leave-lesson", "Back to the list, with the settings from before the lesson."
        )
        self._taking = QWidget()
        self._lay_out()
        self._teaching: Teaching | None = None

    def _lay_out(self) -> None:
        inside = QVBoxLayout(self._taking)
        inside.setContentsMargins(8, 4, 8, 8)
        row = QHBoxLayout()
        for widget in (self.back, self.next):
            row.addWidget(widget, 1)
        row.addWidget(self.leave)
        for widget in (self.where, self.bar):
            inside.addWidget(widget)
        inside.addWidget(self.pages, 1)
        inside.addLayout(row)
        whole = QVBoxLayout(self)
        whole.setContentsMargins(0, 0, 0, 0)
        for widget in (self.list, self._taking):
            whole.addWidget(widget)
        self._taking.hide()
        follow_look(self, self._dress)

    def bind(self, teaching: Teaching) -> None:
        """Show the state of `teaching`, and pass on requests."""
        self._teaching = teaching
        teaching.changed.connect(guarded(self._show))
        self.seen.connect(guarded(teaching.look))
        self.list.taken.connect(guarded(teaching.take))
        self.list.again.connect(guarded(teaching.restart))
        self.list.open_wanted.connect(guarded(teaching.open))
        self.list.hand_out_wanted.connect(guarded(teaching.hand_out))
        self.step.answered.connect(guarded(teaching.answer))
        self.step.show_wanted.connect(guarded(teaching.show_how))
        self.step.pressed.connect(guarded(teaching.press))
        self.end.hand_in_wanted.connect(guarded(teaching.hand_in))
        self.leave.clicked.connect(guarded(lambda *_: teaching.leave()))
        for where, by in ((self.back, -1), (self.next, 1)):
            where.clicked.connect(guarded(lambda *_, by=by: self._go(by)))

    def _go(self, by: int) -> None:
        teaching = self._teaching
        if teaching is not None and teaching.progress is not None:
            teaching.go(teaching.progress.step + by)

    def _show(self) -> None:
        teaching = self._teaching
        if teaching is None:
            return
        progress, left = teaching.progress, self.list.isHidden()
        self.list.setVisible(progress is None)
        self._taking.setVisible(progress is not None)
        if progress is None:
            self.list.show_lessons(teaching.taken, teaching.message)
            self.step.forget()
            if left:
                self.list.list.setFocus()
            return
        steps = len(progress.lesson.steps)
        at = "the end" if progress.at_end else f"step {progress.step + 1} of {steps}"
        self.where.setText(f"{progress.lesson.title}: {at}")
        self.bar.setRange(0, steps)
        self.bar.setValue(progress.step)
        self.back.setEnabled(progress.step > 0)
        self.next.setEnabled(not progress.at_end)
        self.pages.setCurrentWidget(self.end if progress.at_end else self.step)
        if progress.at_end:
            self.end.show_progress(progress)
        else:
            self.step.show_progress(progress, teaching.message)
        self._focus()

    def _focus(self) -> None:
        """Move the keyboard to what is to be done now."""
        field = self.end.name if self.pages.currentWidget() is self.end else self.step.field
        (field or self.next).setFocus(Qt.FocusReason.TabFocusReason)

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        self.seen.emit()
        if self.list.isHidden():
            self._focus()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        field = self.focusWidget()
        if event.key() == Qt.Key.Key_Escape and field is not None and field.hasFocus():
            field.clearFocus()
        else:
            super().keyPressEvent(event)

    def _dress(self) -> None:
        theme = current()
        self.bar.setStyleSheet(
            f"QProgressBar {{ background: {theme.line}; border: none; border-radius: 2px; }}"
            f"QProgressBar::chunk {{ background: {theme.accent}; border-radius: 2px; }}"
        )
