"""Hand-outs: what is printed of a lesson, and what is not."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QImage
from PySide6.QtWidgets import QApplication, QFileDialog

from kappaskin import Refusal
from kappaskin_app.features.lessons.lesson import (
    ChoiceAnswer,
    LessonTask,
    NumberAnswer,
    whole,
)
from kappaskin_app.features.lessons.lesson_file import READY, lesson_called, lesson_of, read_lesson
from kappaskin_app.features.lessons.sheets import skin_picture, step_page, write_hand_out
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.window import MainWindow

HEAD = '+++\nformat = 1\ntitle = "A"\nminutes = 5\nlearn = "B"\n+++\n'


def pages_of(pdf: Path) -> int:
    content = pdf.read_bytes()
    assert content.startswith(b"%PDF-")
    return content.count(b"/Type /Page\n")


@pytest.mark.parametrize("file", READY, ids=lambda file: file.stem)
def test_a_page_has_text_and_question_and_no_solution(qapp: QApplication, file: Path) -> None:
    for number, step in enumerate(read_lesson(file).steps):
        text = step_page(number, step, None).toPlainText().replace("\N{NO-BREAK SPACE}", " ")
        question = step.question
        assert step.title in text
        assert question.text in text
        assert question.explain not in text
        assert question.hint not in text
        match question.how:
            case ChoiceAnswer(options=options):
                assert all(f"\N{BALLOT BOX}  {option}\n" in f"{text}\n" for option in options)
            case NumberAnswer(unit=unit):
                assert text.rstrip().endswith(f"___ {unit}".rstrip())
            case LessonTask():
                assert text.count("\N{BALLOT BOX}") == 1


def test_text_of_a_lesson_is_printed_as_it_is(qapp: QApplication) -> None:
    step = lesson_of(f"{HEAD}## If 1 < 2 & <b>x\nOne.\n\n> E = mc²\n", "x").steps[0]
    text = step_page(0, step, None).toPlainText().replace("\N{NO-BREAK SPACE}", " ")
    assert text == "1  If 1 < 2 & <b>x\nOne.\nE = mc²"


def test_pages_are_written_and_no_step_is_divided(qapp: QApplication, tmp_path: Path) -> None:
    step = "## One\n" + 32 * "- a\n"
    file, shares = tmp_path / "long.pdf", []
    for share in write_hand_out(lesson_of(HEAD + 5 * step, "x"), file):
        shares.append(share)
    assert pages_of(file) == 5, "one on each, where the lines would fit on four"
    assert shares == sorted(shares)
    assert shares[-1] == 1
    huge = "## One\n" + "- a\n" * 400
    list(write_hand_out(lesson_of(HEAD + huge, "x"), file))
    assert pages_of(file) == 2, "the title, and a step that is made smaller to fit a page"


def test_another_ending_than_that_of_a_pdf_is_refused(qapp: QApplication, tmp_path: Path) -> None:
    with pytest.raises(Refusal, match=r"page\.html: expected a file name that ends in \.pdf"):
        next(write_hand_out(read_lesson(READY[0]), tmp_path / "page.html"))
    assert not list(tmp_path.iterdir())


def _rgb(image: QImage) -> np.ndarray:
    image = image.convertToFormat(QImage.Format.Format_RGB888)
    rows = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), -1)
    return rows[:, : 3 * image.width()].reshape(image.height(), -1, 3).astype(int)


def test_a_picture_has_the_skin_its_load_and_dead_elements(qapp: QApplication, colours_of) -> None:
    sets = {"load_case": "centre", "dead_elements": (0, 1, 2), "noise_kind": "none"}
    whole_skin, dead = (
        _rgb(skin_picture(Settings(**whole(sets | more)))) for more in ({"dead_elements": ()}, {})
    )
    assert colours_of(whole_skin.astype(np.uint8).reshape(-1, 3)) > 200
    red = (whole_skin[..., 0] > 180) & (whole_skin[..., 1] < 80) & (whole_skin[..., 2] < 60)
    assert red.sum() > 100, "the arrow"
    grey = [np.all(picture == (185, 191, 198), axis=-1).sum() for picture in (whole_skin, dead)]
    assert grey[1] > grey[0] + 3 * 2 * 900
    with pytest.raises(Refusal):
        skin_picture(Settings(**whole({"functions_x": 12, "functions_y": 12})))


def test_a_lesson_is_called_by_its_number_or_file() -> None:
    assert lesson_called("3").title == lesson_called(str(READY[2])).title == "Why sines"
    for wrong in ("0", "15"):
        with pytest.raises(Refusal, match=f"from 1 to 14, or a lesson file, got {wrong}"):
            lesson_called(wrong)


def test_the_selected_lesson_is_saved_while_the_window_goes_on(
    window: MainWindow, qtbot, until, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window.actions_by_name["dock-lesson"].trigger()
    page = window.lesson.list
    page.list.setCurrentRow(6)
    asked: list[str] = []
    monkeypatch.setattr(
        QFileDialog,
        "getSaveFileName",
        lambda *about: (asked.append(about[2]), (str(tmp_path / "silent"), ""))[1],
    )
    said: list[str] = []
    window.teaching.notified.connect(said.append)
    qtbot.mouseClick(page.hand_out, Qt.MouseButton.LeftButton)
    until(lambda: bool(said))
    assert said == [f"Saved {tmp_path / 'silent.pdf'}"]
    assert Path(asked[0]).name == "07-silent-mode.pdf"
    assert pages_of(tmp_path / "silent.pdf") == 3
    assert window.teaching.progress is None


def test_the_teachers_page_opens_from_the_lessons_and_from_help(window: MainWindow, qtbot) -> None:
    window.actions_by_name["dock-lesson"].trigger()
    qtbot.mouseClick(window.lesson.list.teacher, Qt.MouseButton.LeftButton)
    assert window.guide.contents.currentText() == "Teach with the lessons"
    (menu,) = [a.menu() for a in window.menuBar().actions() if a.text() == "&Help"]
    assert window.actions_by_name["teacher"] in menu.actions()


@pytest.mark.full
def test_the_command_needs_no_display(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "kappaskin", "handout", "1", "--out", "gage.pdf"]
    env = {name: value for name, value in os.environ.items() if "DISPLAY" not in name}
    done = subprocess.run(
        command, cwd=tmp_path, env=env, capture_output=True, text=True, timeout=90, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert pages_of(tmp_path / "gage.pdf") == 3
