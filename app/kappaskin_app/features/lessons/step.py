"""One step of a lesson: what there is to read, to try and to answer."""

from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtWidgets import QLayout, QVBoxLayout, QWidget

from kappaskin_app.features.lessons.asking import Asking
from kappaskin_app.features.lessons.progress import Progress
from kappaskin_app.guard import guarded
from kappaskin_app.theme import LIGHT, Theme
from kappaskin_app.widgets.columns import scrolled
from kappaskin_app.widgets.parts import button, text_label


class StepPage(QWidget):
    """Shows a step; `pressed` numbers the button of it that was pressed, from 0."""

    answered = Signal(str)
    show_wanted = Signal()
    pressed = Signal(int)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.title, self.text = text_label(), text_label()
        self.title.setTextFormat(Qt.TextFormat.PlainText)
        self.text.setTextFormat(Qt.TextFormat.MarkdownText)
        self.text.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        bold = self.title.font()
        bold.setBold(True)
        bold.setPointSizeF(1.15 * bold.pointSizeF())
        self.title.setFont(bold)
        self._inner = QWidget()
        self._below = QVBoxLayout(self._inner)
        self._below.setContentsMargins(0, 0, 0, 0)
        self.area = scrolled(self.title, self.text, self._inner)
        whole = QVBoxLayout(self)
        whole.setContentsMargins(0, 0, 0, 0)
        whole.addWidget(self.area)
        self.asking: Asking | None = None
        self._shown: tuple[str, int] | None = None
        self._theme = LIGHT

    def show_progress(self, progress: Progress, message: str) -> None:
        """Show the step that a person is at, and what came of the answer."""
        now = progress.lesson.name, progress.step
        if another := now != self._shown:
            self._shown = now
            self._make(progress)
        if self.asking is not None:
            self.asking.show_answer(progress.answer, message)
            if not another:
                # Once what is said has its place below the question.
                QTimer.singleShot(0, self.asking, guarded(self._see_feedback))

    def _see_feedback(self) -> None:
        if self.asking is not None:
            self.area.ensureWidgetVisible(self.asking.feedback)

    def _make(self, progress: Progress) -> None:
        step = progress.lesson.steps[progress.step]
        self.title.setText(step.title)
        self.text.setText(step.text)
        _empty(self._below)
        self.asking = None
        for number, one in enumerate(step.buttons):
            made = button(one.label, f"lesson-button-{number}", "Ctrl+Z takes it back.")
            made.clicked.connect(guarded(lambda *_, number=number: self.pressed.emit(number)))
            self._below.addWidget(made)
        if step.question is not None:
            self.asking = Asking(step.question)
            self.asking.show_theme(self._theme)
            self.asking.answered.connect(self.answered)
            self.asking.show_wanted.connect(self.show_wanted)
            self._below.addWidget(self.asking)
        self.area.verticalScrollBar().setValue(0)

    def forget(self) -> None:
        """Make the step anew the next time, for a lesson that was read anew."""
        self._shown = None

    def show_theme(self, theme: Theme) -> None:
        self._theme = theme
        if self.asking is not None:
            self.asking.show_theme(theme)


def _empty(layout: QLayout) -> None:
    while (item := layout.takeAt(0)) is not None:
        if (widget := item.widget()) is not None:
            widget.hide()
            widget.deleteLater()
