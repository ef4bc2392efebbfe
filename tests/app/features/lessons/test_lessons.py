"""Every lesson played through on the window, and what the panel says meanwhile."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import QEvent, QProcess, Qt
from PySide6.QtGui import QImage, QKeyEvent
from PySide6.QtWidgets import QApplication, QDockWidget, QFileDialog, QRadioButton

from kappaskin.hand import named_hand
from kappaskin.live import Fingers
from kappaskin_app.features.lessons.lesson import (
    UNITS,
    ChoiceAnswer,
    LessonTask,
    NumberAnswer,
    Question,
)
from kappaskin_app.features.lessons.lesson_file import DOCKS, READOUTS, READY, SETTABLE
from kappaskin_app.features.lessons.progress import DONE, Answer
from kappaskin_app.shell.window import MainWindow


def take(window: MainWindow, name: str) -> None:
    if not window.lesson.isVisible():
        window.actions_by_name["dock-lesson"].trigger()
    window.teaching.take(next(file for file in window.teaching.taken if name in file))


def number_seen(window: MainWindow, how: NumberAnswer) -> float:
    return float(how.expected(window.teaching.figures()))


def given(window: MainWindow, how: ChoiceAnswer | NumberAnswer | LessonTask, right: bool) -> str:
    """What a person gives as a right answer, or as a wrong one."""
    if isinstance(how, ChoiceAnswer):
        return str(how.right if right else (how.right + 1) % len(how.options))
    if isinstance(how, NumberAnswer):
        off = 0.0 if right else 20 * how.tolerance
        return repr((number_seen(window, how) + off) / UNITS[how.unit])
    return DONE


def answer_wrongly_then_rightly(window: MainWindow, question: Question, until) -> None:
    teaching, how = window.teaching, question.how
    feedback = window.lesson.step.question_view.feedback
    if isinstance(how, NumberAnswer):
        until(lambda: math.isfinite(number_seen(window, how)))
    if isinstance(how, LessonTask):
        until(lambda: not how.check(teaching.figures()))
    wrong = given(window, how, right=False)
    until(lambda: teaching.answer(wrong) or teaching.progress.answer.tries)  # once it is judged
    assert not teaching.progress.answer.right
    assert question.hint in feedback.text()
    if isinstance(how, LessonTask):
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
            until(target.isVisible)  # a panel comes back once the scene before is left
        assert [ring.isVisible() for ring in window.pointing.rings] == [True] * len(step.point)
        for button in range(len(step.buttons)):
            window.teaching.press(button)
        if step.question is not None:
            answer_wrongly_then_rightly(window, step.question, until)
        assert not window.session.refusal, (name, step.title)
    window.teaching.go(len(progress.lesson.steps))
    assert progress.describe().startswith("done")
    assert {row[3] for row in progress.rows()} == {"right at try 2"}


@pytest.mark.full
def test_every_lesson_can_be_played_through(window: MainWindow, until) -> None:
    before = window.history.settings
    window.teaching.look()
    assert len(window.teaching.taken) >= 14
    for name in [name for name, each in window.teaching.taken.items() if not each.lesson.hand]:
        play(window, name, until)
        window.teaching.leave()
        assert window.history.settings == before, name
    below = [window.findChild(QDockWidget, name) for name in DOCKS[1:-1]]
    assert all(dock.isHidden() for dock in below)


def test_a_lesson_on_a_hand_opens_in_a_window_of_it(
    window: MainWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    started = list[list[str]]()
    monkeypatch.setattr(QProcess, "startDetached", lambda _, given: started.append(given))
    window.teaching.look()
    take(window, "13-two-fingers")
    assert window.teaching.progress is None
    ((*_, file, option, source),) = started
    assert (Path(file).name, option, source) == ("13-two-fingers.md", "--source", "hand:hold")


@pytest.mark.full
@pytest.mark.parametrize(
    ("name", "ready"),
    [("13-two-fingers", "hold"), ("14-roll-slide-grasp", "roll-between-fingers")],
)
def test_a_lesson_on_a_hand_is_played_on_it(opened, until, name: str, ready: str) -> None:
    hand = named_hand(f"hand:{ready}")
    sources = {finger.name: finger.source for finger in hand.fingers}
    fingers = Fingers(sources)
    fingers.connect(sources)
    window = opened(sources["thumb"], fingers)
    window.session.begin_fingers(sources, hand)
    before, radius = window.history.settings, {"hold": 41.2, "roll-between-fingers": 12}[ready]
    held = window.features["hand"].panel
    until(lambda: held.held is not None and held.held.kind)
    assert 1e3 * held.held.fits[held.held.kind].radius == pytest.approx(radius, abs=0.4)
    window.opening.open(next(file for file in READY if name in file.name))
    play(window, name, until)
    window.teaching.leave()
    assert window.history.settings == before
    assert window.session.source == sources["thumb"]


@pytest.mark.full
def test_steps_are_undone_one_by_one_and_back_gives_them_again(window: MainWindow) -> None:
    history, teaching = window.history, window.teaching
    before = history.settings
    take(window, "03-why-sines")
    first = history.settings
    for number in range(1, 6):
        teaching.go(number)
    assert history.settings.functions_x == 8
    teaching.go(4)
    assert history.settings.functions_x == 2
    teaching.go(0)
    assert history.settings == first
    while history.stack.canUndo():
        history.stack.undo()
    assert history.settings == before


def test_settings_and_source_from_before_come_back_and_a_theme_stays(window: MainWindow) -> None:
    window.session.source = "/dev/none"  # as while a device is connected
    window.history.change("Mine", -1, functions_x=5, noise_seed=7)
    mine = window.history.settings
    take(window, "07-silent-mode")
    assert window.history.settings.functions_x == 8
    assert window.session.source == "sim:"
    window.requests.switch_theme()
    window.lesson.leave.click()
    assert window.history.settings == replace(mine, theme="light")
    assert window.session.connecting == "/dev/none"
    assert window.lesson.list.isVisible()
    assert not window.pointing.rings


@pytest.mark.full
def test_closing_the_lessons_leaves_the_lesson_and_covering_them_does_not(
    window: MainWindow,
) -> None:
    before = window.history.settings
    take(window, "noise")
    window.teaching.go(1)
    assert window.history.settings != before
    window.docks["lesson"].hide()
    assert window.teaching.progress is not None
    window.docks.reveal("lesson")
    window.docks["lesson"].close()
    assert window.teaching.progress is None
    assert window.history.settings == before


def press(qtbot, *keys: Qt.Key | str) -> None:
    """Press keys, or type a text, wherever the keyboard is."""
    for key in keys:
        QApplication.processEvents()  # a new step is laid out
        field = QApplication.focusWidget()
        assert field is not None, "nothing has the keyboard"
        qtbot.keyClicks(field, key) if isinstance(key, str) else qtbot.keyClick(field, key)


def test_a_lesson_is_taken_and_answered_by_enter_alone(window: MainWindow, qtbot) -> None:
    enter, lesson = Qt.Key.Key_Return, window.lesson
    window.actions_by_name["dock-lesson"].trigger()
    lesson.list.list.setFocus()
    press(qtbot, enter)
    first = lesson.step.question_view
    assert first.options.buttons()[0].hasFocus()
    press(qtbot, enter)
    assert first.feedback.text().startswith("Choose one")
    press(qtbot, Qt.Key.Key_Down, enter)
    assert first.options.checkedId() == 1
    assert first.feedback.text().startswith("Right.")
    assert lesson.next.hasFocus()
    press(qtbot, enter)
    second = lesson.step.question_view
    assert (lesson.step.title.text(), second.number.hasFocus()) == ("A number for bending", True)
    for typed, said in (("much", "Type a number"), ("2", "Not right."), ("20", "Right.")):
        press(qtbot, typed, Qt.Key.Key_Enter)
        assert second.number.text() == typed
        assert second.feedback.text().startswith(said)
    assert not second.check.isEnabled()
    assert window.teaching.progress.answer.outcome() == "right at try 2"
    press(qtbot, enter)
    assert window.teaching.progress.step == 2


@pytest.mark.full
def test_enter_that_is_held_checks_once(window: MainWindow, qtbot) -> None:
    take(window, "01-curvature-gage")
    window.teaching.go(1)
    press(qtbot, "20", Qt.Key.Key_Return)
    assert window.lesson.next.hasFocus()
    held = QKeyEvent(QEvent.Type.KeyPress, Qt.Key.Key_Return, Qt.KeyboardModifier(0), "\r", True)
    QApplication.sendEvent(QApplication.focusWidget(), held)
    assert window.teaching.progress.step == 1


def test_escape_leaves_the_field_and_showing_the_lessons_returns_to_it(
    window: MainWindow, qtbot
) -> None:
    take(window, "01-curvature-gage")
    window.lesson.next.click()
    number = window.lesson.step.question_view.number
    press(qtbot, "2", Qt.Key.Key_Escape)
    assert QApplication.focusWidget() is not number
    assert number.text() == "2"
    assert window.teaching.progress.step == 1
    window.docks["lesson"].hide()
    window.actions_by_name["dock-lesson"].trigger()
    assert number.hasFocus()
    assert number.selectedText() == "2"


@pytest.mark.full
def test_enter_goes_through_tasks_and_to_the_name_at_the_end(
    window: MainWindow, qtbot, until
) -> None:
    enter, lesson = Qt.Key.Key_Return, window.lesson
    take(window, "01-curvature-gage")
    window.teaching.go(5)
    view = lesson.step.question_view
    assert view.check.hasFocus()
    until(lambda: -9 < window.teaching.figures()["peak_xx"] < 0)
    press(qtbot, enter, enter)
    assert view.feedback.text().startswith("Not right.")
    assert view.show_how.hasFocus()
    press(qtbot, enter)
    assert window.history.settings.force == 0.25
    window.teaching.go(7)
    press(qtbot, Qt.Key.Key_Space, enter, enter)
    assert window.teaching.progress.at_end
    assert lesson.end.name.hasFocus()
    lesson.leave.click()
    assert lesson.list.list.hasFocus()


@pytest.mark.full
def test_an_answer_is_scrolled_to_when_it_is_typed(window: MainWindow, qtbot, until) -> None:
    window.resize(1024, 700)
    window.requests.set("letters", 200.0)
    take(window, "01-curvature-gage")
    window.teaching.go(2)
    number = window.lesson.step.question_view.number
    until(lambda: window.lesson.step.area.verticalScrollBar().maximum() > 0)
    assert number.visibleRegion().boundingRect().height() < number.height()
    press(qtbot, "1")
    until(lambda: number.visibleRegion().boundingRect().height() == number.height())


@pytest.mark.full
def test_enter_on_an_option_checks_where_a_desktop_lets_it_press_buttons(
    window: MainWindow, qtbot
) -> None:
    take(window, "01-curvature-gage")
    option = window.lesson.step.question_view.options.buttons()[0]
    assert isinstance(option, QRadioButton)
    event = QKeyEvent(QEvent.Type.KeyPress, Qt.Key.Key_Return, Qt.KeyboardModifier(0))
    option.keyPressEvent(event)
    assert not event.isAccepted()


@pytest.mark.full
def test_twice_wrong_is_explained_and_shown_and_progress_is_kept(window: MainWindow, until) -> None:
    take(window, "04-how-many-functions")
    until(lambda: window.teaching.figures()["error_rms"] > 1e-5)
    asking = window.lesson.step.question_view
    for _ in range(2):
        asking.check.click()
    assert "each way make the dent sharper" in asking.feedback.text()
    assert asking.show_how.isVisible()
    asking.show_how.click()
    assert window.history.settings.functions_x == 6
    window.teaching.go(3)
    window.teaching.leave()
    window.lesson.list.list.setCurrentRow(3)
    assert "step 4 of 7" in window.lesson.list.about.text()
    window.lesson.list.begin.click()
    assert window.teaching.progress.step == 3
    window.teaching.go(0)
    assert "each way make the dent sharper" in window.lesson.step.question_view.feedback.text()


def test_progress_outlives_the_window_and_is_forgotten_where_one_starts_again(
    opened, tmp_path: Path
) -> None:
    file, first = tmp_path / "window.toml", opened("sim:")
    first.saver.begin(file)
    take(first, "01-curvature-gage")
    first.teaching.answer("0")
    first.teaching.answer("1")
    first.teaching.go(3)
    first.close()
    second = opened("sim:")
    second.saver.begin(file)
    second.docks.reveal("lesson")
    listed = second.lesson.list
    assert "step 4 of 8" in listed.about.text()
    listed.begin.click()
    assert second.teaching.progress.step == 3
    assert second.teaching.progress.answers[0] == Answer("Under the arrow", 2, True)
    second.teaching.leave()
    listed.anew.click()
    assert (second.teaching.progress.step, second.teaching.progress.answers) == (0, {})
    second.saver.finish()
    assert "Under the arrow" not in file.read_text("utf-8")


def test_a_task_is_not_judged_before_the_window_shows_the_settings(
    window: MainWindow, until
) -> None:
    take(window, "01-curvature-gage")
    window.teaching.go(5)
    window.history.change("Press", -1, force=0.25)
    window.lesson.step.question_view.check.click()
    assert "wait a moment" in window.lesson.step.question_view.feedback.text()
    assert window.teaching.progress.answer.tries == 0
    until(lambda: window.teaching.figures()["peak_xx"] < -10)
    window.lesson.step.question_view.check.click()
    assert window.teaching.progress.answer.outcome() == "right"


def test_the_layout_to_teach_gives_a_lesson_most_of_the_height(window: MainWindow) -> None:
    window.resize(1280, 720)
    window.requests.set("letters", 150.0)
    window.layouts.choose("Teach")
    QApplication.processEvents()
    assert window.docks["lesson"].height() > 1.4 * window.docks["settings"].height()


@pytest.mark.full
def test_what_is_said_to_an_answer_is_scrolled_to(window: MainWindow, until) -> None:
    take(window, "07-silent-mode")
    window.teaching.go(4)
    until(lambda: window.teaching.figures()["silent"] == 0)
    asking = window.lesson.step.question_view
    assert asking.feedback.visibleRegion().isEmpty()
    window.teaching.answer("5")
    until(lambda: not asking.feedback.visibleRegion().isEmpty())


def test_a_longer_answer_is_scrolled_to_whole(window: MainWindow, until) -> None:
    window.resize(1280, 600)
    window.requests.set("letters", 150.0)
    take(window, "01-curvature-gage")
    window.teaching.go(3)
    view = window.lesson.step.question_view
    feedback = view.feedback
    for given in (0, 2):
        view.options.button(given).click()
        QApplication.processEvents()
        view.check.click()
        for _ in range(20):
            QApplication.processEvents()
    assert feedback.visibleRegion().boundingRect().height() == feedback.height()


@pytest.mark.full
def test_the_figure_holds_the_name_and_the_window(
    window: MainWindow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    take(window, "01-curvature-gage")
    window.teaching.answer("1")
    window.teaching.go(99)
    window.lesson.end.name.setText("Ada <Lovelace>")
    files = {end: tmp_path / f"figure.{end}" for end in ("png", "svg")}
    for file in files.values():
        asked = list[str]()
        monkeypatch.setattr(
            QFileDialog,
            "getSaveFileName",
            lambda _, __, path, *___, file=file, asked=asked: asked.append(path) or (str(file), ""),
        )
        window.lesson.end.save.click()
        assert Path(asked[0]).name.startswith("01-curvature-gage_Ada-Lovelace_1-of-8")
    picture = QImage(str(files["png"]))
    assert picture.text("Title") == "What a curvature gage measures"
    assert picture.text("Description").startswith("Ada <Lovelace>: kappaskin ")
    assert picture.width() == 1000
    assert picture.height() > 600
    drawing = files["svg"].read_text("utf-8")
    assert "Ada &lt;Lovelace&gt;" in drawing
    assert "Under the arrow" in drawing


def test_whatever_a_lesson_may_point_at_is_in_the_window_and_own_ones_are_taken(
    window: MainWindow, tmp_path: Path
) -> None:
    for place in (*DOCKS[:-1], *READOUTS, *SETTABLE):
        assert window.pointing.targets(place)
    file = tmp_path / "own.md"
    head = '+++\nformat = 1\ntitle = "Mine"\nminutes = 3\nlearn = "It."\n+++\n'
    file.write_text(head + "## One\nText.\n```toml\nset = { functions_x = 99 }\n```\n")
    window.teaching.open_file(file)
    window.actions_by_name["dock-lesson"].trigger()
    assert window.lesson.list.message.isVisible()
    assert window.lesson.list.message.text().startswith("own.md, line 10: ")
    assert "functions_x from 1 to 64" in window.lesson.list.message.text()
    file.write_text(head + "## One\nText.\n```toml\nset = { functions_x = 9 }\n```\n")
    window.teaching.open_file(file)
    assert window.history.settings.functions_x == 9
