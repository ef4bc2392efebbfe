"""A scene's text in forms: each value has a row, and an edit of it changes nothing else."""

import tomllib
from collections.abc import Callable
from typing import Any

import pytest
from PySide6.QtCore import QPoint
from PySide6.QtWidgets import (
    QAbstractSpinBox,
    QApplication,
    QCheckBox,
    QComboBox,
    QDoubleSpinBox,
    QLineEdit,
    QSpinBox,
    QToolButton,
    QWidget,
)

from kappaskin._schema import Key, Unit
from kappaskin.scenes import SCENES
from kappaskin_app.features.scene import scene_text
from kappaskin_app.features.scene.scene_form import SceneForm
from kappaskin_app.features.scene.sections import sections_of
from kappaskin_app.theme import DARK, LIGHT, apply_look

from .conftest import TEXTS, box_at, said_by


def _at(said: Any, place: tuple[str | int, ...]) -> Any:
    for name in place:
        said = said[name]
    return said


def _flat(said: Any, place: tuple[str | int, ...] = ()) -> dict[tuple[str | int, ...], Any]:
    """Every value of a table by its place."""
    if isinstance(said, dict):
        each = list(said.items())
    elif isinstance(said, list) and said and isinstance(said[0], dict):
        each = list(enumerate(said))
    else:
        return {place: said}
    return {key: value for name, one in each for key, value in _flat(one, (*place, name)).items()}


def _edit(widget: QWidget, value: Any) -> Any:
    """Change what an editor shows as a person does; the value that its text should get."""
    first = widget.findChildren(QAbstractSpinBox)
    if first:
        return [_edit(first[0], None), *value[1:]]
    if isinstance(widget, QComboBox):
        index = (widget.currentIndex() + 1) % widget.count()
        widget.setCurrentIndex(index)
        widget.activated.emit(index)
        return widget.itemData(index)
    if isinstance(widget, QCheckBox):
        widget.click()
        return widget.isChecked()
    if isinstance(widget, QSpinBox | QDoubleSpinBox):
        widget.stepBy(1 if widget.value() < widget.maximum() else -1)
        return widget.value()
    assert isinstance(widget, QLineEdit)
    if isinstance(value, list) and isinstance(value[0], str):
        text, changed = "xx, another", ["xx", "another"]
    elif isinstance(value, list) and isinstance(value[0], list):
        text, changed = "7", [[7.0]]
    else:
        text, changed = ("7", [7]) if isinstance(value, list) else ("another", "another")
    widget.setText(text)
    widget.editingFinished.emit()
    return changed


def _rows(text: str) -> list[Any]:
    return [row for section in sections_of(tomllib.loads(text)) for row in section.all_rows()]


def _new_rows() -> dict[str, list[Any]]:
    """The rows of each scene that no scene before it has alike."""
    seen: set[tuple[Any, ...]] = set()
    new: dict[str, list[Any]] = {}
    for name, text in TEXTS.items():
        for row in _rows(text):
            alike = (*row.place, row.kind, row.key.label)
            if alike not in seen:
                seen.add(alike)
                new.setdefault(name, []).append(row)
    return new


_NEW_ROWS = _new_rows()


@pytest.mark.parametrize("name", SCENES)
def test_a_ready_scene_is_shown_without_a_word_and_every_value_of_it_has_a_row(
    shown: Callable[[str], SceneForm], name: str
) -> None:
    form = SceneForm()
    said = said_by(form)
    form.show_text(TEXTS[name])
    assert not said
    elsewhere = {("format",), ("text",), ("effects", "choose")}
    places = set(_flat(tomllib.loads(TEXTS[name]))) - elsewhere
    assert {row.place for row in _rows(TEXTS[name])} == places
    assert {place for box in form.boxes for place in box.editors} == places
    form.deleteLater()


@pytest.mark.parametrize("name", _NEW_ROWS)
def test_an_edit_of_any_row_changes_that_value_in_the_text_and_no_more(
    shown: Callable[[str], SceneForm], name: str
) -> None:
    text = TEXTS[name]
    form = shown(text)
    for row in _NEW_ROWS[name]:
        form.show_text(text)
        said = said_by(form)
        expected = _edit(form.editor(*row.place), row.value)
        form.edited.disconnect(said.append)
        assert len(said) == 1, row.place
        before, after = _flat(tomllib.loads(text)), _flat(tomllib.loads(said[0]))
        got = after[row.place]
        if row.part:  # of another kind, it may need other values
            assert got == expected
            continue
        assert {p for p in before | after if before.get(p) != after.get(p)} == {row.place}
        if isinstance(got, list) and not row.key.listed:
            assert got[1:] == row.value[1:]
            expected, got = expected[0], got[0]
        if isinstance(got, float):
            assert got == pytest.approx(expected * row.key.unit.scale, rel=1e-9)
            assert len(repr(got)) < 14
        else:
            assert got == expected
        assert len([line for line in said[0].splitlines() if line not in text.splitlines()]) == 1
        assert said[0].count("#") == text.count("#")


@pytest.mark.parametrize("name", SCENES)
def test_what_is_put_in_and_shown_again_says_the_same(name: str) -> None:
    text = TEXTS[name]
    for row in _rows(text):
        if not row.part:
            assert scene_text.put(text, row.place, row.value) == text


def test_lengths_are_shown_in_mm_and_angles_in_degrees_with_the_digits_they_need(
    shown: Callable[[str], SceneForm],
) -> None:
    form = shown(TEXTS["edge"])
    assert box_at(form, "touch", 0, "x").text() == "50 mm"
    assert box_at(form, "touch", 0, "angle").text() == "90\N{DEGREE SIGN}"
    assert box_at(form, "touch", 0, "path", 1, "by").text() == "90\N{DEGREE SIGN}"
    assert box_at(form, "effects", "gaussian-noise", "rms").text() == "0.1 1/m"
    form.show_text(TEXTS["fingertip"])
    assert box_at(form, "touch", 0, "x").text() == "20.2633 mm"


def test_the_range_of_a_parameter_is_that_of_its_effect(shown: Callable[[str], SceneForm]) -> None:
    form = shown(TEXTS["hot-room"])
    rise = box_at(form, "effects", "temperature", "rise")
    assert (rise.minimum(), rise.maximum(), rise.suffix()) == (-200, 200, " K")
    assert "-200 to 200 K" in rise.toolTip()
    assert "As the skin warms" in rise.toolTip() or "as the skin warms" in rise.toolTip()


def test_a_value_out_of_range_is_shown_as_it_is(shown: Callable[[str], SceneForm]) -> None:
    form = shown(TEXTS["hot-room"].replace("rise = 10.0", "rise = 1000.0"))
    assert box_at(form, "effects", "temperature", "rise").value() == 1000.0


@pytest.mark.parametrize(
    "text",
    [
        "",
        "skin = 3\ntouch = 4\neffects = []\nelectronics = 'no'\ncylinders = 1",
        "[touch]\nwhat = 'point'\npath = { step = 'press' }",
        "[[touch]]\nwhat = 'pont'\nx = inf\npath = [1, 2]\norbit = 3",
        "[skin]\nsize = [0.1, 'a']\nshape = 'round'\nfluid = 1979-05-27\noutline = [[]]",
        "rate = 'fast'\nseed = 123456789012345678\naccuracy = -0.0\ntitle = '''a\nb'''",
        "[effects.creep]\nshare = []\n[effects.unheard-of]\nlevel = 1\n[effects.hysteresis]\n"
        "thresholds = [1, 2.5]\nweights = [0.1]",
        "skin.size = [1, 2, 3]\nelements = { dead = [], grid = [1.5, 2] }",
    ],
)
def test_odd_toml_is_shown_and_stays_as_it_is(shown: Callable[[str], SceneForm], text: str) -> None:
    form = SceneForm()
    said = said_by(form)
    form.show_text(text)
    for box in form.boxes:
        for place, editor in box.editors.items():
            assert editor.value == _at(tomllib.loads(text), place) or editor.value != editor.value
    assert not said
    form.deleteLater()


def test_tips_tell_unit_and_range() -> None:
    mm, newton = Unit("m", "mm", 1e-3), Unit("N", "N")
    assert Key("a", "A tip.", mm).explained == "A tip. In mm."
    assert Key("a", "A tip.", mm, 0.0, 0.5).explained == "A tip. From 0 to 500 mm."
    assert Key("a", "A tip.", newton, 2.0).explained == "A tip. At least 2 N."
    assert Key("a", "A tip.").explained == "A tip."


def test_nothing_takes_the_clicks_of_the_button_that_adds_a_touch(
    shown: Callable[[str], SceneForm],
) -> None:
    form = shown(TEXTS["centre"])
    button = next(b for b in form.findChildren(QToolButton) if b.text() == "+ Add touch")
    box = button.parentWidget()
    box.resize(button.geometry().right() + 8, box.height())
    assert box.childAt(button.geometry().center()) is button
    assert box.childAt(button.geometry().topRight() + QPoint(-4, 4)) is button


def test_buttons_have_the_ink_of_the_theme_that_is_switched_to(
    qapp: QApplication, shown: Callable[[str], SceneForm]
) -> None:
    apply_look(DARK)
    form = shown(TEXTS["centre"])
    apply_look(LIGHT)
    qapp.processEvents()
    buttons = form.findChildren(QToolButton)
    assert buttons
    assert {button.palette().buttonText().color().name() for button in buttons} <= {
        LIGHT.text,
        LIGHT.disabled,
    }
