"""Progress in a lesson: the present step, and the answers."""

import json
import math
import re
from contextlib import suppress
from dataclasses import astuple, dataclass, field, replace
from pathlib import Path

from kappaskin.errors import Refusal
from kappaskin_app.features.lessons.expression import Figures
from kappaskin_app.features.lessons.lesson import (
    UNITS,
    ChoiceAnswer,
    Lesson,
    LessonTask,
    NumberAnswer,
    Question,
)

DONE = "done"
"""The answer to a task."""


@dataclass(frozen=True)
class Answer:
    """The answer `given` last, the number of `tries`, and whether it was `right`."""

    given: str = ""
    tries: int = 0
    right: bool = False

    @property
    def closed(self) -> bool:
        """Whether it was right, or the explanation was shown."""
        return self.right or self.tries >= 2

    def outcome(self) -> str:
        """The result as text."""
        if not self.tries:
            return "not answered"
        if not self.right:
            return "explained" if self.closed else "not right yet"
        return "right" if self.tries == 1 else f"right at try {self.tries}"


def judged(question: Question, given: str, figures: Figures, before: Answer) -> Answer:
    """The next answer; a `Refusal` where `given` cannot be judged."""
    right = _right(question.how, given, figures)
    words = question.how.options[int(given)] if isinstance(question.how, ChoiceAnswer) else given
    if isinstance(question.how, NumberAnswer):
        words = f"{given.strip()} {question.how.unit}".strip()
    return replace(before, given=words, tries=before.tries + 1, right=right)


def _right(how: ChoiceAnswer | NumberAnswer | LessonTask, given: str, figures: Figures) -> bool:
    match how:
        case ChoiceAnswer(right=right):
            if not given:
                raise Refusal("Choose one of the answers first.")
            return int(given) == right
        case LessonTask(check=check):
            return bool(check(figures))
        case NumberAnswer(expected=expected, tolerance=tolerance, unit=unit):
            there = float(expected(figures))
            if not math.isfinite(there):
                raise Refusal("The window does not show this number yet: wait a moment.")
            return abs(number_in(given) * UNITS[unit] - there) <= tolerance


def number_in(text: str) -> float:
    """The number that a person typed, with a comma or a point."""
    try:
        value = float(text.strip().replace(",", ".").replace("\N{MINUS SIGN}", "-"))
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise Refusal("Type a number without its unit, such as 4.7.")
    return value


@dataclass
class Progress:
    """The present `step` of a `lesson`, and the answers by step."""

    lesson: Lesson
    step: int = 0
    seen: int = 0
    answers: dict[int, Answer] = field(default_factory=dict[int, Answer])

    @property
    def key(self) -> str:
        """What `text` is saved by: another version of the lesson has another."""
        return f"{self.lesson.name} {self.lesson.version:08x}"

    def text(self) -> str:
        """The progress to be saved."""
        answers = [(step, *astuple(answer)) for step, answer in self.answers.items()]
        return json.dumps([self.step, self.seen, answers])

    def resume(self, text: str) -> "Progress":
        """Itself, with the steps and answers of a saved `text` unless that is damaged."""
        with suppress(ValueError, TypeError, OverflowError, RecursionError):
            step, seen, answers = json.loads(text)
            steps = len(self.lesson.steps)
            found = {int(at): Answer(str(said), int(n), bool(ok)) for at, said, n, ok in answers}
            if 0 <= int(step) <= int(seen) <= steps and all(0 <= at < steps for at in found):
                self.step, self.seen, self.answers = int(step), int(seen), found
        return self

    def go(self, step: int) -> None:
        """Go to a step; one past the last is where the figure is handed in."""
        self.step = min(max(step, 0), len(self.lesson.steps))
        self.seen = max(self.seen, self.step)

    @property
    def at_end(self) -> bool:
        return self.step == len(self.lesson.steps)

    @property
    def question(self) -> Question | None:
        return None if self.at_end else self.lesson.steps[self.step].question

    @property
    def answer(self) -> Answer:
        """The answer to this step's question so far."""
        return self.answers.get(self.step, Answer())

    def give(self, given: str, figures: Figures) -> None:
        """Answer this step's question, unless it is closed."""
        if self.question is not None and not self.answer.closed:
            self.answers[self.step] = judged(self.question, given, figures, self.answer)

    @property
    def right(self) -> int:
        """The number of right answers."""
        return sum(answer.right for answer in self.answers.values())

    def describe(self) -> str:
        """The progress as text."""
        if self.seen == len(self.lesson.steps):
            return f"done, {self.right} of {self.lesson.questions} right"
        return f"step {self.seen + 1} of {len(self.lesson.steps)}" if self.seen else ""

    def file_name(self, student: str) -> str:
        """The name of the figure to hand in: a list of such files is a list of the class."""
        who = re.sub(r"[^\w-]+", "-", student.strip()).strip("-")
        return f"{Path(self.lesson.name).stem}_{who}_{self.right}-of-{self.lesson.questions}"

    def rows(self) -> list[tuple[str, str, str, str]]:
        """Of each question: its step's title, its text, the answer, the result."""
        found: list[tuple[str, str, str, str]] = []
        for number, step in enumerate(self.lesson.steps):
            if step.question is not None:
                answer = self.answers.get(number, Answer())
                found.append((step.title, step.question.text, answer.given, answer.outcome()))
        return found
