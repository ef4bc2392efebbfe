"""Goals and answers of the lessons on the teacher's page, from the lessons' own files.

Run `python tests/guide_lessons.py` when a lesson came, went or changed.
"""

import re
from pathlib import Path

from kappaskin_app.features.lessons.lesson import (
    UNITS,
    ChoiceAnswer,
    Lesson,
    LessonTask,
    NumberAnswer,
    Question,
)
from kappaskin_app.features.lessons.lesson_file import READY, read_lesson
from kappaskin_app.shell.settings import form_field
from kappaskin_app.shell.settings.form_fields import Choice, Range

PAGE = Path(__file__).parents[1] / "resources" / "kappaskin_resources" / "guide" / "teach.md"
_SHOWN = {
    "error_rms": "RMS error above the skin",
    "error_at_load": "Error at load above the skin, with its sign",
    "condition": "condition number under Stability",
    "silent": "number of silent modes under Stability",
    "noise_rms": "RMS in the panel Noise",
    "contact_x": "x of Contact above the skin",
}
"""What a figure that the window shows is called there."""


def told(number: int, lesson: Lesson) -> str:
    """What the page has of a lesson's file: heading, goal, time and answers."""
    rows = ["| step | answer | how it is derived |", "|---|---|---|"]
    for step, one in enumerate(lesson.steps, 1):
        if (question := one.question) is not None:
            number_asked = isinstance(question.how, NumberAnswer)
            why = _plain(
                f"{question.hint} {question.explain}" if number_asked else question.explain
            )
            rows.append(f"| {step} {_plain(one.title)} | {_answer(question)} | {why} |")
    goal = f"**Goal.** {lesson.learn}"
    time = f"**Time.** {lesson.minutes} minutes, {lesson.questions} questions."
    table = "\n".join(rows)
    return f"## {number} {lesson.title}\n\n{goal} {time}\n\n{table}\n"


def _answer(question: Question) -> str:
    match question.how:
        case ChoiceAnswer(options=options, right=right):
            return _plain(options[right])
        case NumberAnswer(expected=expected, tolerance=tolerance, unit=unit):
            within = f"± {tolerance / UNITS[unit]:.3g} {unit}".strip()
            if expected.text in _SHOWN:
                return f"the {_SHOWN[expected.text]}, {within}"
            return f"{float(expected({})) / UNITS[unit]:.4g} {within}"
        case LessonTask(check=check, solution=solution):
            done = "; ".join(_setting(*each) for each in solution.items())
            return f"{done}; or whatever else makes `{check.text}` true"


def _setting(name: str, value: object) -> str:
    how = form_field(name)
    if isinstance(how, Range) and isinstance(value, int | float):
        shown = f"{value * how.scale:.6g} {how.unit}".strip()
    else:
        shown = how.words(value) if isinstance(how, Choice) else str(value)
    return f"{how.label}: {shown}"


def _plain(text: str) -> str:
    return text.replace("|", "\\|")


def lessons() -> list[tuple[int, Lesson]]:
    """The lessons of the program, with their numbers."""
    return [(number, read_lesson(file)) for number, file in enumerate(READY, 1)]


def main() -> None:
    """Write what is generated into the page; the notes below it stay."""
    page = PAGE.read_text("utf-8")
    for number, lesson in lessons():
        part = re.search(
            rf"^## {number}\b.*?(?=\n\*\*Before\.\*\*)", page, re.DOTALL | re.MULTILINE
        )
        assert part is not None, f"expected ## {number}, with notes that begin with **Before.**"
        page = page.replace(part[0], told(number, lesson))
    PAGE.write_text(page, "utf-8")


if __name__ == "__main__":
    main()
