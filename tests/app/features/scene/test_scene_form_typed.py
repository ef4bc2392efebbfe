"""Forms that are typed into, while their text may change elsewhere."""

from collections.abc import Callable
from typing import Any

import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtWidgets import QAbstractSpinBox, QApplication, QLineEdit

from kappaskin_app.features.scene.scene_form import SceneForm

from .conftest import TEXTS, TOUCHED, box_at, said_by


def test_a_typed_length_is_written_without_rounding(
    shown: Callable[[str], SceneForm], qtbot: Any
) -> None:
    form = shown(TEXTS["pencil"])
    said = said_by(form)
    box = box_at(form, "touch", 0, "x")
    box.setFocus()
    box.selectAll()
    qtbot.keyClicks(box, "47,3")
    assert not said
    qtbot.keyClick(box, Qt.Key.Key_Return)
    assert said == [TEXTS["pencil"].replace("x = 0.05", "x = 0.0473")]
    assert box.text() == "47.3 mm"


@pytest.mark.parametrize(
    ("value", "steps", "expected"),
    [(50.0, 1, 51.0), (10.0, -1, 9.9), (10.0, 1, 11.0), (0.0, 1, 1.0), (0.5, -5, 0.0)],
)
def test_a_step_is_a_tenth_of_a_number_and_reaches_zero(
    shown: Callable[[str], SceneForm], value: float, steps: int, expected: float
) -> None:
    form = shown(TOUCHED.replace("x = 0.03", f"x = {value / 1e3}"))
    box = box_at(form, "touch", 0, "x")
    for _ in range(abs(steps)):
        box.stepBy(1 if steps > 0 else -1)
    assert box.value() == pytest.approx(expected, abs=1e-12)


def test_the_same_text_again_leaves_focus_and_typing_alone(
    shown: Callable[[str], SceneForm], qtbot: Any
) -> None:
    text = TEXTS["pencil"]
    form = shown(text)
    box = box_at(form, "touch", 0, "x")
    box.setFocus()
    box.selectAll()
    qtbot.keyClicks(box, "4")
    form.show_text(text)
    form.show_text(text.replace("y = 0.035", "y = 0.04"))
    assert box_at(form, "touch", 0, "y").text() == "40 mm"
    assert box.hasFocus()
    assert box.lineEdit().text().startswith("4")
    assert box_at(form, "touch", 0, "x") is box


def test_a_changed_value_elsewhere_is_shown_in_place_and_says_nothing(
    shown: Callable[[str], SceneForm],
) -> None:
    form = shown(TEXTS["pencil"])
    said, box = said_by(form), box_at(form, "touch", 0, "x")
    form.show_text(TEXTS["pencil"].replace("x = 0.05", "x = 0.02"))
    assert box.text() == "20 mm"
    assert not said


def test_a_text_that_is_no_toml_greys_the_forms_until_it_is_again(
    shown: Callable[[str], SceneForm],
) -> None:
    text = TEXTS["pencil"]
    form = shown(text)
    said, box = said_by(form), box_at(form, "touch", 0, "x")
    box.setFocus()
    form.show_text(text + "[oh")
    assert not box.isEnabled()
    assert box.text() == "50 mm"
    form.show_text(text)
    assert box.isEnabled()
    assert not said


def test_what_cannot_be_read_is_what_it_was(shown: Callable[[str], SceneForm], qtbot: Any) -> None:
    form = shown(TEXTS["failing-elements"])
    said, line = said_by(form), form.editor("elements", "dead")
    assert isinstance(line, QLineEdit)
    line.setText("44, 4-5")
    line.editingFinished.emit()
    assert line.text() == "44, 45"
    assert not said
    line.clear()
    qtbot.keyClicks(line, "44,x 46,")
    qtbot.keyClick(line, Qt.Key.Key_Return)
    assert said == [TEXTS["failing-elements"].replace("[44, 45]", "[44, 46]")]


@pytest.mark.parametrize("typed", ["", "-", ".", "1 m"])
def test_a_number_half_typed_is_none(
    shown: Callable[[str], SceneForm], qtbot: Any, typed: str
) -> None:
    form = shown(TEXTS["pencil"])
    said, box = said_by(form), box_at(form, "touch", 0, "force")
    box.setFocus()
    box.selectAll()
    qtbot.keyClick(box, Qt.Key.Key_Delete)
    qtbot.keyClicks(box, typed)
    qtbot.keyClick(box, Qt.Key.Key_Return)
    expected = [TEXTS["pencil"].replace("force = 0.25", "force = 1.0")] if "1" in typed else []
    assert said == expected


@pytest.mark.parametrize("pasted", ["nan", "inf", "-inf"])
@pytest.mark.parametrize("place", [("elements", "grid"), ("skin", "size")])
def test_what_is_no_number_is_what_it_was(
    shown: Callable[[str], SceneForm], qtbot: Any, place: tuple[str, str], pasted: str
) -> None:
    form = shown(TEXTS["pencil"])
    said = said_by(form)
    box = form.editor(*place).findChildren(QAbstractSpinBox)[0]
    before = box.text()
    box.setFocus()
    box.selectAll()
    box.lineEdit().insert(pasted)
    qtbot.keyClick(box, Qt.Key.Key_Return)
    assert box.text() == before
    assert not said


def test_what_was_typed_is_no_edit_of_a_text_that_changed_meanwhile(
    shown: Callable[[str], SceneForm], qtbot: Any
) -> None:
    form = shown(TEXTS["pencil"])
    said, box = said_by(form), box_at(form, "touch", 0, "x")
    box.setFocus()
    box.selectAll()
    qtbot.keyClicks(box, "4")
    form.show_text(TEXTS["calibration"])
    form.show_text(TEXTS["pencil"])
    box_at(form, "touch", 0, "x").setFocus()
    box_at(form, "touch", 0, "x").selectAll()
    qtbot.keyClicks(box_at(form, "touch", 0, "x"), "4")
    form.show_text("[")
    assert not said


def test_the_wheel_changes_nothing_without_the_focus(
    shown: Callable[[str], SceneForm], qapp: QApplication
) -> None:
    form = shown(TEXTS["pencil"])
    said, box = said_by(form), box_at(form, "touch", 0, "x")
    assert not box.hasFocus()
    middle = QPointF(box.rect().center())
    wheel = QWheelEvent(
        *(middle, box.mapToGlobal(middle), QPoint(), QPoint(0, 120)),
        *(Qt.MouseButton.NoButton, Qt.KeyboardModifier.NoModifier),
        *(Qt.ScrollPhase.NoScrollPhase, False),
    )
    qapp.sendEvent(box, wheel)
    assert not said


def test_tab_goes_through_all_editors_in_their_order(
    shown: Callable[[str], SceneForm], qtbot: Any, until: Any
) -> None:
    form = shown(TEXTS["tapping"])
    form.show_text(TEXTS["pencil"])
    form.show_text(TEXTS["two-contacts"])
    stops = [stop for box in form.boxes for stop in box.stops]
    until(lambda: all(stop.isVisible() for stop in stops))
    stops[0].setFocus()
    for stop in stops[1:]:
        qtbot.keyClick(QApplication.focusWidget(), Qt.Key.Key_Tab)
        assert QApplication.focusWidget() is stop


@pytest.mark.parametrize("value", ["9" * 5000, "[" * 3000 + "]" * 3000], ids=["long", "deep"])
def test_forms_wait_over_what_cannot_be_read(qapp: QApplication, qtbot: Any, value: str) -> None:
    form = SceneForm()
    qtbot.addWidget(form)
    form.show_text(TEXTS["pencil"])
    form.show_text(f"{TEXTS['pencil']}\nseed = {value}\n")
    assert not form.boxes[0].isEnabled()
    form.show_text(TEXTS["pencil"])
    assert form.boxes[0].isEnabled()
