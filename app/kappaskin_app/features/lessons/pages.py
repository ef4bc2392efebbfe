"""Pages of lessons: the list, a step with its question, the end."""

from collections.abc import Mapping
from html import escape

from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtGui import QKeyEvent, QMouseEvent
from PySide6.QtWidgets import (
    QButtonGroup,
    QHBoxLayout,
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
from kappaskin_app.shell.form import pass_window_keys
from kappaskin_app.theme import ALERT, current, follow_look, series
from kappaskin_app.widgets.layout import scrolled
from kappaskin_app.widgets.parts import ELLIPSIS, Heading, Label, button, in_a_row, text_label

_ENTER = (Qt.Key.Key_Return, Qt.Key.Key_Enter)
_PER_METRE = "\N{NO-BREAK SPACE}1/\N{WORD JOINER}m"  # with its number, and in one piece
_LARGER = 1.15  # times the letters: the title of a step
_RIGHT, _DARKER = 3, 110  # of the series: green, told apart from the colour of alarms; by so much %


class _Words(Label):
    """The text of an option, which a click selects; a radio button's own does not wrap."""

    def __init__(self, text: str, radio: QRadioButton) -> None:
        super().__init__(text, wordWrap=True)  # pyright: ignore[reportCallIssue]
        self._radio = radio

    def mousePressEvent(self, event: QMouseEvent) -> None:
        self._radio.click()


class _Option(QRadioButton):
    """An option that the arrow keys select; it leaves Enter, which some desktops use, alone."""

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in _ENTER:
            event.ignore()
            return
        super().keyPressEvent(event)
        reached = self.window().focusWidget()  # Qt selects it only if another was selected
        if isinstance(reached, _Option) and reached is not self:
            reached.setChecked(True)


class QuestionView(QWidget):
    """A question; `answered` brings the answer, `show_wanted` requests the solution.

    Enter checks the answer. `edited` reports that the user changes it.
    """

    answered = Signal(str)
    show_wanted = Signal()
    edited = Signal()

    def __init__(self, question: Question) -> None:
        super().__init__()
        self._question = question
        self._answer, self._message = Answer(), ""
        self.text, self.feedback = text_label(question.text), text_label()
        bold = self.text.font()
        bold.setBold(True)
        self.text.setFont(bold)
        self.options = QButtonGroup(self)
        self.number = QLineEdit()
        self.check = button("&Check", "check-answer", "Check the answer (Enter).")
        self.show_how = button("S&how me", "show-how", "Apply the solution; Ctrl+Z undoes it.")
        self._stack = QVBoxLayout(self)
        self._stack.setContentsMargins(0, 6, 0, 0)
        self._stack.addWidget(self.text)
        match question.how:
            case ChoiceAnswer(options=options):
                self._add_options(options)
            case NumberAnswer(unit=unit):
                self._add_number(unit)
            case LessonTask():
                self.check.setToolTip("Check what the window shows (Enter).")
        row = in_a_row(self.check, self.show_how)
        row.addStretch(1)
        self._stack.addLayout(row)
        self._stack.addWidget(self.feedback)
        self.check.clicked.connect(guarded(self._give))
        self.show_how.clicked.connect(guarded(lambda *_: self.show_wanted.emit()))
        self.show_answer(self._answer, "")
        follow_look(self, self._dress)

    def _add_options(self, options: tuple[str, ...]) -> None:
        for index, words in enumerate(options):
            radio = _Option()
            radio.setAccessibleName(words)
            row = QHBoxLayout()
            row.addWidget(radio, 0, Qt.AlignmentFlag.AlignTop)
            row.addWidget(_Words(words, radio), 1)
            self._stack.addLayout(row)
            self.options.addButton(radio, index)
        self.options.idToggled.connect(self.edited)

    def _add_number(self, unit: str) -> None:
        self.number.setAccessibleName(f"Answer in {unit}" if unit else "Answer")
        self.number.textEdited.connect(self.edited)
        self.number.setMaxLength(20)
        pass_window_keys(self.number)
        row = in_a_row(self.number, Label(unit))
        row.addStretch(1)
        self._stack.addLayout(row)

    @property
    def field(self) -> QWidget | None:
        """Where the answer is given; None once it is closed, unless its solution is offered."""
        if self._answer.closed:
            return self.show_how if self._offers_solution else None
        match self._question.how:
            case ChoiceAnswer():
                return self.options.checkedButton() or self.options.buttons()[0]
            case NumberAnswer():
                return self.number
            case LessonTask():
                return self.check

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() not in _ENTER:
            super().keyPressEvent(event)
        elif not event.isAutoRepeat():
            self.check.click()

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
        """Show the result of the answer; `message` is why it could not be judged."""
        self._answer, self._message = answer, message
        self.check.setEnabled(not answer.closed)
        self.number.setEnabled(not answer.closed)
        self.number.selectAll()  # another number replaces it
        for option in self.options.buttons():
            option.setEnabled(not answer.closed)
        self.show_how.setVisible(self._offers_solution)
        self.feedback.setText(self._feedback_text())
        self.feedback.setVisible(bool(self.feedback.text()))
        self._dress()

    @property
    def _offers_solution(self) -> bool:
        task = isinstance(self._question.how, LessonTask)
        return task and self._answer.closed and not self._answer.right

    def _feedback_text(self) -> str:
        answer, question = self._answer, self._question
        if self._message:
            return self._message
        if not answer.tries:
            return ""
        if answer.right:
            return f"Right. {question.explain}"
        return f"Not right. {question.explain if answer.closed else question.hint}"

    def _dress(self) -> None:
        right = self._answer.right and not self._message
        colour = series(_RIGHT).darker(_DARKER).name() if right else current().alert
        self.feedback.setStyleSheet(f"color: {colour};")
        self.number.setMaximumWidth(12 * self.number.fontMetrics().averageCharWidth())
        for option in self.options.buttons():
            option.setStyleSheet(_radio_style())


def _radio_style() -> str:
    """A ring that is visible on a dark background too."""
    theme = current()
    return (
        f"QRadioButton::indicator {{ width: 11px; height: 11px; border-radius: 6px;"
        f" border: 1px solid {theme.faint}; background: {theme.base}; }}"
        f"QRadioButton::indicator:checked {{ background: {theme.accent}; }}"
        f"QRadioButton::indicator:focus {{ border: 1px solid {theme.text}; }}"
    )


class LessonStepPage(QWidget):
    """A step; `pressed` brings the index of the button that was pressed."""

    answered = Signal(str)
    show_wanted = Signal()
    pressed = Signal(int)

    def __init__(self) -> None:
        super().__init__()
        self.title, self.text = Heading(_LARGER), text_label()
        self.text.setTextFormat(Qt.TextFormat.MarkdownText)
        self.text.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self._inner = QWidget()
        self._below = QVBoxLayout(self._inner)
        self._below.setContentsMargins(0, 0, 0, 0)
        self.area = scrolled(self.title, self.text, self._inner)
        whole = QVBoxLayout(self)
        whole.setContentsMargins(0, 0, 0, 0)
        whole.addWidget(self.area)
        self.question_view: QuestionView | None = None
        self._shown: tuple[str, int] | None = None
        self._judged = False
        self.area.verticalScrollBar().rangeChanged.connect(guarded(self._see_feedback))

    def show_progress(self, progress: Progress, message: str) -> None:
        """Show the present step, and the result of the answer."""
        now = progress.lesson.name, progress.step
        if another := now != self._shown:
            self._shown = now
            self._make(progress)
        if self.question_view is not None:
            self.question_view.show_answer(progress.answer, message)
            self._judged = not another
            if not another:
                # Once the feedback is laid out below the question, and when it got longer.
                QTimer.singleShot(0, self.question_view, guarded(self._see_feedback))

    def _see_feedback(self, *_: object) -> None:
        if self.question_view is not None and self._judged:
            self.area.ensureWidgetVisible(self.question_view.feedback)

    def _see_answer(self, *_: object) -> None:
        """Scroll to what the user types or selects."""
        if (field := self.field) is not None:
            self.area.ensureWidgetVisible(field)

    @property
    def field(self) -> QWidget | None:
        """Where the answer to this step is given, if one can be."""
        return None if self.question_view is None else self.question_view.field

    def _make(self, progress: Progress) -> None:
        step = progress.lesson.steps[progress.step]
        self.title.setText(step.title)
        self.text.setText(step.text.replace(" 1/m", _PER_METRE))
        _empty(self._below)
        self.question_view = None
        for number, one in enumerate(step.buttons):
            made = button(one.label, f"lesson-button-{number}", "Ctrl+Z undoes it.")
            made.clicked.connect(guarded(lambda *_, number=number: self.pressed.emit(number)))
            self._below.addWidget(made)
        if step.question is not None:
            self.question_view = QuestionView(step.question)
            self.question_view.answered.connect(self.answered)
            self.question_view.edited.connect(guarded(self._see_answer))
            self.question_view.show_wanted.connect(self.show_wanted)
            self._below.addWidget(self.question_view)
        self.area.verticalScrollBar().setValue(0)

    def forget(self) -> None:
        """Build the step again the next time, for a lesson that was read again."""
        self._shown = None


def _empty(layout: QLayout) -> None:
    while (item := layout.takeAt(0)) is not None:
        if (widget := item.widget()) is not None:
            widget.hide()
            widget.deleteLater()


_NAME = Qt.ItemDataRole.UserRole
_DONE = "\N{CHECK MARK}"


class _List(QListWidget):
    """A list in which Enter selects a row, as a double click does."""

    taken = Signal()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in _ENTER:
            self.taken.emit()
        else:
            super().keyPressEvent(event)


class ListPage(QWidget):
    """The list of lessons; `taken` brings the one to start, `open_wanted` requests a file.

    `again` brings the one to start without the answers so far.
    `hand_out_wanted` brings the lesson to print, `teacher_wanted` requests the teacher's page.
    """

    taken = Signal(str)
    again = Signal(str)
    open_wanted = Signal()
    hand_out_wanted = Signal(str)
    teacher_wanted = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.list = _List()
        self.list.setAccessibleName("Lessons")
        self.list.setSpacing(2)
        self.list.setTextElideMode(Qt.TextElideMode.ElideRight)
        self.list.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.about, self.message = text_label(), text_label()
        self.message.setForegroundRole(ALERT)
        self.about.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.about.setMinimumHeight(5 * self.about.fontMetrics().lineSpacing())
        self.begin = button(
            "S&tart lesson",
            "take-lesson",
            "Start or continue the lesson (Enter, or double-click). It changes the settings; Leave "
            "restores them.",
        )
        self.anew = button(
            "Start a&gain",
            "again",
            "Start from the first step, and forget the answers so far.",
        )
        self.open = button(f"&Open file{ELLIPSIS}", "open-lesson", "Open a lesson file.")
        self.hand_out = button(
            f"Save hand-ou&t{ELLIPSIS}",
            "hand-out",
            "The selected lesson as a PDF to print: texts, pictures, tasks with space for answers, "
            "no solutions.",
        )
        self.teacher = button(
            "Te&acher's page",
            "teacher-page",
            "Of each lesson: goal, time, answers, common mistakes, questions to discuss.",
        )
        stack = QVBoxLayout(self)
        stack.setContentsMargins(8, 6, 8, 8)
        stack.addWidget(self.list, 1)
        stack.addWidget(self.about)
        stack.addWidget(self.message)
        stack.addLayout(in_a_row(self.begin, self.anew, self.open))
        stack.addLayout(in_a_row(self.hand_out, self.teacher))
        self._progress: Mapping[str, Progress] = {}
        self.list.currentItemChanged.connect(guarded(self._describe))
        self.list.itemDoubleClicked.connect(guarded(self._take))
        self.list.taken.connect(guarded(self._take))
        self.begin.clicked.connect(guarded(self._take))
        self.anew.clicked.connect(guarded(lambda *_: self.again.emit(self.selected)))
        self.open.clicked.connect(guarded(lambda *_: self.open_wanted.emit()))
        self.hand_out.clicked.connect(guarded(lambda *_: self.hand_out_wanted.emit(self.selected)))
        self.teacher.clicked.connect(guarded(lambda *_: self.teacher_wanted.emit()))

    def show_lessons(self, progress: Mapping[str, Progress], message: str) -> None:
        """Show the lessons by file, their progress, and why a file could not be read."""
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
        self.anew.setEnabled(one is not None and bool(one.seen or one.answers))
        for way in (self.begin, self.hand_out):
            way.setEnabled(one is not None)
        if one is None:
            self.about.setText("")
            return
        far = one.describe()
        self.begin.setText("&Continue" if far else "S&tart lesson")
        said = f"{one.lesson.minutes} min{', ' + far if far else ''}. {one.lesson.learn}"
        self.about.setText(said)

    def _take(self, *_: object) -> None:
        if self.selected:
            self.taken.emit(self.selected)


class EndPage(QWidget):
    """The results of a lesson; `hand_in_wanted` brings the student's name."""

    hand_in_wanted = Signal(str)

    def __init__(self) -> None:
        super().__init__()
        self.text = text_label(rich=True)
        prompt = text_label("Your name, for the figure:")
        self.name = QLineEdit()
        self.name.setObjectName("student")
        self.name.setMaxLength(80)
        self.name.setAccessibleName("Your name")
        self.name.setToolTip(
            "It is written on the figure, also in its file name, and nowhere else."
        )
        prompt.setBuddy(self.name)
        pass_window_keys(self.name)
        self.save = button(
            f"&Save the figure{ELLIPSIS}",
            "hand-in",
            "One picture to hand in: the present window, your answers and the settings.",
        )
        whole = QVBoxLayout(self)
        whole.setContentsMargins(0, 0, 0, 0)
        whole.addWidget(scrolled(self.text), 1)
        for widget in (prompt, self.name, self.save):
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
            f"<p><b>End of the lesson.</b> {escape(progress.lesson.learn)}</p><p>{rows}</p><p>Set "
            "the window to what you want to show, then save the figure to hand in.</p>"
        )
