"""A lesson's question: what can be answered, and what is said to it."""

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QColor, QMouseEvent
from PySide6.QtWidgets import (
    QButtonGroup,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QRadioButton,
    QVBoxLayout,
    QWidget,
)

from kappaskin_app.features.lessons.lesson import ChoiceAnswer, LessonTask, NumberAnswer, Question
from kappaskin_app.features.lessons.progress import DONE, Answer
from kappaskin_app.guard import guarded
from kappaskin_app.shell.form import well_behaved
from kappaskin_app.theme import LIGHT, SERIES, Theme
from kappaskin_app.widgets.parts import button, in_a_row, text_label

_RIGHT = 3  # of the series: green, told apart from the colour of alarms


class _Words(QLabel):
    """The words of an option, which a click chooses; a button's own would not wrap."""

    def __init__(self, text: str, radio: QRadioButton) -> None:
        super().__init__(text, wordWrap=True)  # pyright: ignore[reportCallIssue]
        self.setTextFormat(Qt.TextFormat.PlainText)
        self._radio = radio

    def mousePressEvent(self, event: QMouseEvent) -> None:
        self._radio.click()


class Asking(QWidget):
    """Asks one question; `answered` brings what is given, `show_wanted` asks how it is done."""

    answered = Signal(str)
    show_wanted = Signal()

    def __init__(self, question: Question, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._question, self._theme = question, LIGHT
        self._answer, self._message = Answer(), ""
        self.text, self.feedback = text_label(question.text), text_label()
        bold = self.text.font()
        bold.setBold(True)
        self.text.setFont(bold)
        self.options = QButtonGroup(self)
        self.number = QLineEdit()
        self.check = button("&Check", "check-answer", "Say whether it is right (Enter).")
        self.show_how = button(
            "S&how me", "show-how", "Set it as it is meant to be; Ctrl+Z takes that back."
        )
        for label in (self.text, self.feedback):
            label.setTextFormat(Qt.TextFormat.PlainText)
        self._stack = QVBoxLayout(self)
        self._stack.setContentsMargins(0, 6, 0, 0)
        self._stack.addWidget(self.text)
        match question.how:
            case ChoiceAnswer(options=options):
                self._add_options(options)
            case NumberAnswer(unit=unit):
                self._add_number(unit)
            case LessonTask():
                self.check.setToolTip("Look at what the window shows, and say whether it is so.")
        row = in_a_row(self.check, self.show_how)
        row.addStretch(1)
        self._stack.addLayout(row)
        self._stack.addWidget(self.feedback)
        self.check.clicked.connect(guarded(self._give))
        self.number.returnPressed.connect(guarded(self._give))
        self.show_how.clicked.connect(guarded(lambda *_: self.show_wanted.emit()))
        self.show_answer(self._answer, "")

    def _add_options(self, options: tuple[str, ...]) -> None:
        for index, words in enumerate(options):
            radio = QRadioButton()
            radio.setAccessibleName(words)
            row = QHBoxLayout()
            row.addWidget(radio, 0, Qt.AlignmentFlag.AlignTop)
            row.addWidget(_Words(words, radio), 1)
            self._stack.addLayout(row)
            self.options.addButton(radio, index)

    def _add_number(self, unit: str) -> None:
        self.number.setAccessibleName(f"Answer in {unit}" if unit else "Answer")
        self.number.setMaximumWidth(12 * self.number.fontMetrics().averageCharWidth())
        self.number.setMaxLength(20)
        well_behaved(self.number)
        row = in_a_row(self.number, QLabel(unit))
        row.addStretch(1)
        self._stack.addLayout(row)

    def _give(self, *_: object) -> None:
        match self._question.how:
            case ChoiceAnswer():
                chosen = self.options.checkedId()
                self.answered.emit("" if chosen < 0 else str(chosen))
            case NumberAnswer():
                self.answered.emit(self.number.text())
            case LessonTask():
                self.answered.emit(DONE)

    def show_answer(self, answer: Answer, message: str) -> None:
        """Say what came of the answer so far; `message` is why it could not be judged."""
        self._answer, self._message = answer, message
        self.check.setEnabled(not answer.told)
        self.number.setEnabled(not answer.told)
        for option in self.options.buttons():
            option.setEnabled(not answer.told)
        task = isinstance(self._question.how, LessonTask)
        self.show_how.setVisible(task and answer.told and not answer.right)
        self.feedback.setText(self._said())
        self.feedback.setVisible(bool(self.feedback.text()))
        self._paint()

    def _said(self) -> str:
        answer, question = self._answer, self._question
        if self._message:
            return self._message
        if not answer.tries:
            return ""
        if answer.right:
            return f"Right. {question.explain}"
        return f"Not so. {question.explain if answer.told else question.hint}"

    def show_theme(self, theme: Theme) -> None:
        self._theme = theme
        self._paint()

    def _paint(self) -> None:
        dark = QColor(self._theme.window).lightness() < 128
        right = self._answer.right and not self._message
        colour = SERIES[_RIGHT][dark] if right else self._theme.alert
        self.feedback.setStyleSheet(f"color: {colour};")
        for option in self.options.buttons():
            option.setStyleSheet(_radio_style(self._theme))


def _radio_style(theme: Theme) -> str:
    """A ring that is seen on a dark ground too, where Fusion's is lost."""
    return (
        f"QRadioButton::indicator {{ width: 11px; height: 11px; border-radius: 6px;"
        f" border: 1px solid {theme.faint}; background: {theme.base}; }}"
        f"QRadioButton::indicator:checked {{ background: {theme.accent}; }}"
        f"QRadioButton::indicator:focus {{ border: 1px solid {theme.text}; }}"
    )
