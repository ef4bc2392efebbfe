"""Pages of lessons: the list, a step, its question, and the end."""

from collections.abc import Mapping
from html import escape

from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtGui import QKeyEvent, QMouseEvent
from PySide6.QtWidgets import (
    QButtonGroup,
    QHBoxLayout,
    QLabel,
    QLayout,
    QLineEdit,
    QListWidget,
    QListWidgetItem,
    QRadioButton,
    QVBoxLayout,
    QWidget,
)

from kappaskin_app.features.lessons.lesson import ChoiceAnswer, LessonTask, NumberAnswer, Question
from kappaskin_app.features.lessons.progress import DONE, Answer, Progress
from kappaskin_app.guard import guarded
from kappaskin_app.shell.form import well_behaved
from kappaskin_app.theme import ALERT, current, follow_look, series
from kappaskin_app.widgets.layout import scrolled
from kappaskin_app.widgets.parts import ELLIPSIS, button, in_a_row, text_label

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
        self._question = question
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
        follow_look(self, self._dress)

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
        self._dress()

    def _said(self) -> str:
        answer, question = self._answer, self._question
        if self._message:
            return self._message
        if not answer.tries:
            return ""
        if answer.right:
            return f"Right. {question.explain}"
        return f"Not so. {question.explain if answer.told else question.hint}"

    def _dress(self) -> None:
        right = self._answer.right and not self._message
        colour = series(_RIGHT).name() if right else current().alert
        self.feedback.setStyleSheet(f"color: {colour};")
        for option in self.options.buttons():
            option.setStyleSheet(_radio_style())


def _radio_style() -> str:
    """A ring that is seen on a dark ground too, where Fusion's is lost."""
    theme = current()
    return (
        f"QRadioButton::indicator {{ width: 11px; height: 11px; border-radius: 6px;"
        f" border: 1px solid {theme.faint}; background: {theme.base}; }}"
        f"QRadioButton::indicator:checked {{ background: {theme.accent}; }}"
        f"QRadioButton::indicator:focus {{ border: 1px solid {theme.text}; }}"
    )


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
            self.asking.answered.connect(self.answered)
            self.asking.show_wanted.connect(self.show_wanted)
            self._below.addWidget(self.asking)
        self.area.verticalScrollBar().setValue(0)

    def forget(self) -> None:
        """Make the step anew the next time, for a lesson that was read anew."""
        self._shown = None


def _empty(layout: QLayout) -> None:
    while (item := layout.takeAt(0)) is not None:
        if (widget := item.widget()) is not None:
            widget.hide()
            widget.deleteLater()


_NAME = Qt.ItemDataRole.UserRole
_DONE = "\N{CHECK MARK}"


class _List(QListWidget):
    """A list whose row Enter takes, as a double click does."""

    taken = Signal()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            self.taken.emit()
        else:
            super().keyPressEvent(event)


class ListPage(QWidget):
    """Lists the lessons; `taken` names the one to take, `open_wanted` asks for a file."""

    taken = Signal(str)
    open_wanted = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.list = _List()
        self.list.setAccessibleName("Lessons")
        self.list.setSpacing(2)
        self.list.setTextElideMode(Qt.TextElideMode.ElideRight)
        self.list.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.about, self.message = text_label(), text_label()
        self.message.setTextFormat(Qt.TextFormat.PlainText)
        self.message.setForegroundRole(ALERT)
        self.about.setTextFormat(Qt.TextFormat.PlainText)
        self.about.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.about.setMinimumHeight(5 * self.about.fontMetrics().lineSpacing())
        self.begin = button(
            "&Take this lesson",
            "take-lesson",
            "Begin it, or go on where you left it (Enter, or double-click). It changes the "
            "settings; leaving it gives them back.",
        )
        self.open = button(
            f"&Open file{ELLIPSIS}", "open-lesson", "Take a lesson from a file of your own."
        )
        stack = QVBoxLayout(self)
        stack.setContentsMargins(8, 6, 8, 8)
        stack.addWidget(self.list, 1)
        stack.addWidget(self.about)
        stack.addWidget(self.message)
        stack.addLayout(in_a_row(self.begin, self.open))
        self._progress: Mapping[str, Progress] = {}
        self.list.currentItemChanged.connect(guarded(self._describe))
        self.list.itemDoubleClicked.connect(guarded(self._take))
        self.list.taken.connect(guarded(self._take))
        self.begin.clicked.connect(guarded(self._take))
        self.open.clicked.connect(guarded(lambda *_: self.open_wanted.emit()))

    def show_lessons(self, progress: Mapping[str, Progress], message: str) -> None:
        """Show the lessons by file, how far each is, and why a file was no lesson."""
        self._progress = progress
        self.message.setText(message)
        self.message.setVisible(bool(message))
        for row, (name, one) in enumerate(progress.items()):
            if row == self.list.count():
                self.list.addItem(QListWidgetItem())
            item = self.list.item(row)
            item.setData(_NAME, name)
            mark = f"   {_DONE}" if one.describe().startswith("done") else ""
            item.setText(f"{row + 1}  {one.lesson.title}{mark}")
        if self.list.currentRow() < 0 and progress:
            self.list.setCurrentRow(0)
        self._describe()

    @property
    def selected(self) -> str:
        item = self.list.currentItem()
        return "" if item is None else item.data(_NAME)

    def _describe(self, *_: object) -> None:
        one = self._progress.get(self.selected)
        self.begin.setEnabled(one is not None)
        if one is None:
            self.about.setText("")
            return
        far = one.describe()
        self.begin.setText("&Go on" if far.startswith("step") else "&Take this lesson")
        said = f"{one.lesson.minutes} min{', ' + far if far else ''}. {one.lesson.learn}"
        self.about.setText(said)

    def _take(self, *_: object) -> None:
        if self.selected:
            self.taken.emit(self.selected)


class EndPage(QWidget):
    """Tells what came of each question; `hand_in_wanted` brings the name of who hands it in."""

    hand_in_wanted = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.text = text_label()
        self.text.setTextFormat(Qt.TextFormat.RichText)
        asked = text_label("Your name, as it is to stand on the figure:")
        self.name = QLineEdit()
        self.name.setObjectName("student")
        self.name.setMaxLength(80)
        self.name.setAccessibleName("Your name")
        self.name.setToolTip("It stands below the figure, and is kept nowhere else.")
        asked.setBuddy(self.name)
        well_behaved(self.name)
        self.save = button(
            f"&Save the figure{ELLIPSIS}",
            "hand-in",
            "One picture to hand in: the window as it is now, your answers and the settings.",
        )
        whole = QVBoxLayout(self)
        whole.setContentsMargins(0, 0, 0, 0)
        whole.addWidget(scrolled(self.text), 1)
        for widget in (asked, self.name, self.save):
            whole.addWidget(widget)
        self.name.textChanged.connect(guarded(self._allow))
        self.name.returnPressed.connect(guarded(self.save.click))
        self.save.clicked.connect(guarded(lambda *_: self.hand_in_wanted.emit(self.name.text())))
        self._allow()

    def _allow(self, *_: object) -> None:
        self.save.setEnabled(bool(self.name.text().strip()))

    def show_progress(self, progress: Progress) -> None:
        rows = "<br>".join(
            f"{escape(title)}: <b>{escape(outcome)}</b>" for title, _, _, outcome in progress.rows()
        )
        self.text.setText(
            f"<p><b>The end.</b> {escape(progress.lesson.learn)}</p><p>{rows}</p><p>Bring the "
            "window to what you would like to show, then save the figure to hand in.</p>"
        )
