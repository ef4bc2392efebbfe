"""Every lesson played through on the window, and what the panel says meanwhile."""

import math

from kappaskin_app.lessons.lesson import UNITS, Choice, Number, Question, Task
from kappaskin_app.lessons.progress import DONE
from kappaskin_app.window import MainWindow


def take(window: MainWindow, name: str) -> None:
    if not window.lesson.isVisible():
        window.actions_by_name["dock-lesson"].trigger()
    window.teaching.take(name)


def number_seen(window: MainWindow, how: Number) -> float:
    return float(how.expected(window.teaching.figures()))


def given(window: MainWindow, how: Choice | Number | Task, right: bool) -> str:
    """What a person gives as a right answer, or as a wrong one."""
    if isinstance(how, Choice):
        return str(how.right if right else (how.right + 1) % len(how.options))
    if isinstance(how, Number):
        off = 0.0 if right else 20 * how.tolerance
        return repr((number_seen(window, how) + off) / UNITS[how.unit])
    return DONE


def answer_wrongly_then_rightly(window: MainWindow, question: Question, until) -> None:
    teaching, how = window.teaching, question.how
    feedback = window.lesson.step.asking.feedback
    if isinstance(how, Number):
        until(lambda: math.isfinite(number_seen(window, how)))
    if isinstance(how, Task):
        until(lambda: not how.check(teaching.figures()))
    teaching.answer(given(window, how, right=False))
    assert not teaching.progress.answer.right
    assert question.hint in feedback.text()
    if isinstance(how, Task):
        teaching.show_how()
        until(lambda: how.check(teaching.figures()))
    teaching.answer(given(window, how, right=True))
    assert teaching.progress.answer.right
    assert question.explain in feedback.text()


def play(window: MainWindow, name: str, until) -> None:
    take(window, name)
    progress = window.teaching.progress
    for number, step in enumerate(progress.lesson.steps):
        window.teaching.go(number)
        assert window.lesson.step.title.text() == step.title
        for target in [window.pointing.targets(place)[0] for place in step.point]:
            assert target.isVisible(), (name, step.title)
        assert [ring.isVisible() for ring in window.pointing.rings] == [True] * len(step.point)
        for button in range(len(step.buttons)):
            window.teaching.press(button)
        if step.question is not None:
            answer_wrongly_then_rightly(window, step.question, until)
        assert not window.session.refusal, (name, step.title)
    window.teaching.go(len(progress.lesson.steps))
    assert progress.describe().startswith("done")
    assert {row[3] for row in progress.rows()} == {"right at try 2"}


def test_every_lesson_can_be_played_through(window: MainWindow, until) -> None:
    before = window.history.settings
    window.teaching.look()
    assert len(window.teaching.taken) >= 11
    for name in list(window.teaching.taken):
        play(window, name, until)
        window.teaching.leave()
        assert window.history.settings == before, name
    while window.history.stack.canUndo():
        window.history.stack.undo()
    assert window.history.settings == before
