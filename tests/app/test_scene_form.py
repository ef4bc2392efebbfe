import math
import tomllib
from collections.abc import Callable, Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QAction, QWheelEvent
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

from kappaskin import EFFECTS, SCENES
from kappaskin.scene import read_scene
from kappaskin_app.panels.scene_form import SceneForm
from kappaskin_app.panels.scene_form.section import Offer, Section
from kappaskin_app.panels.scene_form.sections import sections_of
from kappaskin_app.panels.scene_form.words import How
from kappaskin_app.scene_text import changes, parts

_FOLDER = files("kappaskin_resources") / "scenes"
_TEXTS = {name: (_FOLDER / f"{name}.toml").read_text(encoding="utf-8") for name in SCENES}

_PLAIN = """format = 1

[skin]
size = [0.1, 0.1]
"""
_TOUCHED = """format = 1
# Of a cork.
[[touch]]
what = "sphere"  # a ball
radius = 0.02  # m
x = 0.03
y = 0.04
force = 0.2
path = [
    { step = "press", seconds = 1.0, to = 0.5 },  # slowly
    { step = "release", seconds = 1.0 },
]
[skin]
size = [0.1, 0.1]
"""


@pytest.fixture
def shown(qapp: QApplication, qtbot: Any) -> Iterator[Callable[[str], SceneForm]]:
    """Shows a text in forms on the screen."""
    made: list[SceneForm] = []

    def shown(text: str) -> SceneForm:
        form = SceneForm()
        made.append(form)
        form.resize(420, 600)
        form.show_text(text)
        form.show()
        form.activateWindow()
        qtbot.waitUntil(form.isActiveWindow)
        return form

    yield shown
    for form in made:
        form.close()
        form.deleteLater()
    qapp.processEvents()


def _said(form: SceneForm) -> list[str]:
    """What it will say from now on."""
    said: list[str] = []
    form.edited.connect(said.append)
    return said


def _box(form: SceneForm, *place: str | int) -> QDoubleSpinBox:
    box = form.editor(*place)
    assert isinstance(box, QDoubleSpinBox)
    return box


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
    widget.setText("7" if isinstance(value, list) else "another")
    widget.editingFinished.emit()
    return [7] if isinstance(value, list) else "another"


def _rows(text: str) -> list[Any]:
    return [row for section in sections_of(tomllib.loads(text)) for row in section.all_rows()]


def _new_rows() -> dict[str, list[Any]]:
    """The rows of each scene that no scene before it has alike."""
    seen: set[tuple[Any, ...]] = set()
    new: dict[str, list[Any]] = {}
    for name, text in _TEXTS.items():
        for row in _rows(text):
            alike = (*row.place, row.kind, row.how.label)
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
    said = _said(form)
    form.show_text(_TEXTS[name])
    assert not said
    elsewhere = {("format",), ("text",), ("effects", "choose")}
    places = set(_flat(tomllib.loads(_TEXTS[name]))) - elsewhere
    assert {row.place for row in _rows(_TEXTS[name])} == places
    assert {place for box in form.boxes for place in box.editors} == places
    form.deleteLater()


@pytest.mark.parametrize("name", _NEW_ROWS)
def test_an_edit_of_any_row_changes_that_value_in_the_text_and_no_more(
    shown: Callable[[str], SceneForm], name: str
) -> None:
    text = _TEXTS[name]
    form = shown(text)
    for row in _NEW_ROWS[name]:
        form.show_text(text)
        said = _said(form)
        expected = _edit(form.editor(*row.place), row.value)
        form.edited.disconnect(said.append)
        assert len(said) == 1, row.place
        before, after = _flat(tomllib.loads(text)), _flat(tomllib.loads(said[0]))
        got = after[row.place]
        if row.part:  # of another kind, it may need other values
            assert got == expected
            continue
        assert {p for p in before | after if before.get(p) != after.get(p)} == {row.place}
        if isinstance(got, list) and not row.how.listed:
            assert got[1:] == row.value[1:]
            expected, got = expected[0], got[0]
        if isinstance(got, float):
            assert got == pytest.approx(expected * row.how.scale, rel=1e-9)
            assert len(repr(got)) < 14
        else:
            assert got == expected
        assert len([line for line in said[0].splitlines() if line not in text.splitlines()]) == 1
        assert said[0].count("#") == text.count("#")


@pytest.mark.parametrize("name", SCENES)
def test_what_is_put_in_and_shown_again_says_the_same(name: str) -> None:
    text = _TEXTS[name]
    for row in _rows(text):
        if not row.part:
            assert changes.put(text, row.place, row.value) == text


def test_lengths_are_shown_in_mm_and_angles_in_degrees_with_the_digits_they_need(
    shown: Callable[[str], SceneForm],
) -> None:
    form = shown(_TEXTS["edge"])
    assert _box(form, "touch", 0, "x").text() == "50 mm"
    assert _box(form, "touch", 0, "angle").text() == "90\N{DEGREE SIGN}"
    assert _box(form, "touch", 0, "path", 1, "by").text() == "90\N{DEGREE SIGN}"
    assert _box(form, "effects", "gaussian-noise", "rms").text() == "0.1 1/m"
    form.show_text(_TEXTS["fingertip"])
    assert _box(form, "touch", 0, "x").text() == "20.2633 mm"


def test_a_typed_length_is_written_without_rounding(
    shown: Callable[[str], SceneForm], qtbot: Any
) -> None:
    form = shown(_TEXTS["pencil"])
    said = _said(form)
    box = _box(form, "touch", 0, "x")
    box.setFocus()
    box.selectAll()
    qtbot.keyClicks(box, "47,3")
    assert not said
    qtbot.keyClick(box, Qt.Key.Key_Return)
    assert said == [_TEXTS["pencil"].replace("x = 0.05", "x = 0.0473")]
    assert box.text() == "47.3 mm"


@pytest.mark.parametrize(
    ("value", "steps", "expected"),
    [(50.0, 1, 51.0), (10.0, -1, 9.9), (10.0, 1, 11.0), (0.0, 1, 1.0), (0.5, -5, 0.0)],
)
def test_a_step_is_a_tenth_of_a_number_and_reaches_zero(
    shown: Callable[[str], SceneForm], value: float, steps: int, expected: float
) -> None:
    form = shown(_TOUCHED.replace("x = 0.03", f"x = {value / 1e3}"))
    box = _box(form, "touch", 0, "x")
    for _ in range(abs(steps)):
        box.stepBy(1 if steps > 0 else -1)
    assert box.value() == pytest.approx(expected, abs=1e-12)


def test_the_range_of_a_parameter_is_that_of_its_effect(shown: Callable[[str], SceneForm]) -> None:
    form = shown(_TEXTS["hot-room"])
    rise = _box(form, "effects", "temperature", "rise")
    assert (rise.minimum(), rise.maximum(), rise.suffix()) == (-200, 200, " K")
    assert "-200 to 200 K" in rise.toolTip()
    assert "As the skin warms" in rise.toolTip() or "as the skin warms" in rise.toolTip()


def test_a_value_out_of_range_is_shown_as_it_is(shown: Callable[[str], SceneForm]) -> None:
    form = shown(_TEXTS["hot-room"].replace("rise = 10.0", "rise = 1000.0"))
    assert _box(form, "effects", "temperature", "rise").value() == 1000.0


def test_the_same_text_again_leaves_focus_and_typing_alone(
    shown: Callable[[str], SceneForm], qtbot: Any
) -> None:
    text = _TEXTS["pencil"]
    form = shown(text)
    box = _box(form, "touch", 0, "x")
    box.setFocus()
    box.selectAll()
    qtbot.keyClicks(box, "4")
    form.show_text(text)
    form.show_text(text.replace("y = 0.035", "y = 0.04"))
    assert _box(form, "touch", 0, "y").text() == "40 mm"
    assert box.hasFocus()
    assert box.lineEdit().text().startswith("4")
    assert _box(form, "touch", 0, "x") is box


def test_a_changed_value_elsewhere_is_shown_in_place_and_says_nothing(
    shown: Callable[[str], SceneForm],
) -> None:
    form = shown(_TEXTS["pencil"])
    said, box = _said(form), _box(form, "touch", 0, "x")
    form.show_text(_TEXTS["pencil"].replace("x = 0.05", "x = 0.02"))
    assert box.text() == "20 mm"
    assert not said


def test_a_text_that_is_no_toml_greys_the_forms_until_it_is_again(
    shown: Callable[[str], SceneForm],
) -> None:
    text = _TEXTS["pencil"]
    form = shown(text)
    said, box = _said(form), _box(form, "touch", 0, "x")
    box.setFocus()
    form.show_text(text + "[oh")
    assert not box.isEnabled()
    assert box.text() == "50 mm"
    form.show_text(text)
    assert box.isEnabled()
    assert not said


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
    said = _said(form)
    form.show_text(text)
    for box in form.boxes:
        for place, editor in box.editors.items():
            assert editor.value == _at(tomllib.loads(text), place) or editor.value != editor.value
    assert not said
    form.deleteLater()


def test_what_cannot_be_read_is_what_it_was(shown: Callable[[str], SceneForm], qtbot: Any) -> None:
    form = shown(_TEXTS["failing-elements"])
    said, line = _said(form), form.editor("elements", "dead")
    assert isinstance(line, QLineEdit)
    line.setText("44, 4-5")
    line.editingFinished.emit()
    assert line.text() == "44, 45"
    assert not said
    line.clear()
    qtbot.keyClicks(line, "44,x 46,")
    qtbot.keyClick(line, Qt.Key.Key_Return)
    assert said == [_TEXTS["failing-elements"].replace("[44, 45]", "[44, 46]")]


@pytest.mark.parametrize("typed", ["", "-", ".", "1 m"])
def test_a_number_half_typed_is_none(
    shown: Callable[[str], SceneForm], qtbot: Any, typed: str
) -> None:
    form = shown(_TEXTS["pencil"])
    said, box = _said(form), _box(form, "touch", 0, "force")
    box.setFocus()
    box.selectAll()
    qtbot.keyClick(box, Qt.Key.Key_Delete)
    qtbot.keyClicks(box, typed)
    qtbot.keyClick(box, Qt.Key.Key_Return)
    expected = [_TEXTS["pencil"].replace("force = 0.25", "force = 1.0")] if "1" in typed else []
    assert said == expected


@pytest.mark.parametrize("pasted", ["nan", "inf", "-inf"])
@pytest.mark.parametrize("place", [("elements", "grid"), ("skin", "size")])
def test_what_is_no_number_is_what_it_was(
    shown: Callable[[str], SceneForm], qtbot: Any, place: tuple[str, str], pasted: str
) -> None:
    form = shown(_TEXTS["pencil"])
    said = _said(form)
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
    form = shown(_TEXTS["pencil"])
    said, box = _said(form), _box(form, "touch", 0, "x")
    box.setFocus()
    box.selectAll()
    qtbot.keyClicks(box, "4")
    form.show_text(_TEXTS["calibration"])
    form.show_text(_TEXTS["pencil"])
    _box(form, "touch", 0, "x").setFocus()
    _box(form, "touch", 0, "x").selectAll()
    qtbot.keyClicks(_box(form, "touch", 0, "x"), "4")
    form.show_text("[")
    assert not said


def test_the_wheel_changes_nothing_without_the_focus(
    shown: Callable[[str], SceneForm], qapp: QApplication
) -> None:
    form = shown(_TEXTS["pencil"])
    said, box = _said(form), _box(form, "touch", 0, "x")
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
    shown: Callable[[str], SceneForm], qtbot: Any
) -> None:
    form = shown(_TEXTS["tapping"])
    form.show_text(_TEXTS["pencil"])
    form.show_text(_TEXTS["two-contacts"])
    stops = [stop for box in form.boxes for stop in box.stops]
    qtbot.waitUntil(lambda: all(stop.isVisible() for stop in stops))
    stops[0].setFocus()
    for stop in stops[1:]:
        qtbot.keyClick(QApplication.focusWidget(), Qt.Key.Key_Tab)
        assert QApplication.focusWidget() is stop


# Adding and removing.


def _offers(section: Section) -> list[Offer]:
    each = [*section.offers, *section.more]
    found = [inner for offer in each for inner in (offer.inside or (offer,))]
    return found + [offer for part in section.sections for offer in _offers(part)]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Where the files are that parts name."""
    np.save(tmp_path / "heights.npy", np.add.outer(np.arange(8.0), np.arange(8.0)))
    (tmp_path / "motion.csv").write_text("time,dx,dy,amount\n0,0,0,0\n1,0,0,1\n2,0,0,0\n")
    corners = [(0, 0, 0), (0.15, 0, 0.1), (0, 0.15, 0.1), (0.15, 0.15, 0.2)]
    faces = [(0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)]
    facets = "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join("vertex {} {} {}\n".format(*corners[c]) for c in face)
        + "endloop\nendfacet\n"
        for face in faces
    )
    (tmp_path / "mesh.stl").write_text(f"solid a\n{facets}endsolid a\n")
    return tmp_path / "scene.toml"


_KINDS = [
    *[("touch", kind) for kind in parts.kinds("touch")],
    *[("effects", kind) for kind in parts.kinds("effects")],
    *[("step", kind) for kind in parts.kinds("step")],
    *[("skin", kind) for kind in parts.kinds("skin")],
]


def _with(part: str, kind: str) -> str:
    """A scene with one part of this kind."""
    if part == "touch":
        return changes.add_touch(_PLAIN, kind)
    if part == "effects":
        return changes.add_table(_PLAIN, ("effects", kind), parts.needed("effects", kind))
    if part == "skin":
        named = changes.put_in(_PLAIN, ("skin",), "shape", "rectangle")
        return changes.change_kind(named, ("skin", "shape"), "skin", kind)
    touched = changes.add_touch(_PLAIN, "disc")
    path = changes.put_in(touched, ("touch", 0), "path", parts.optional("touch")["path"])
    return changes.add_step(path, ("touch", 0, "path"), kind)


@pytest.mark.parametrize(("part", "kind"), _KINDS)
def test_every_part_makes_a_valid_scene_and_so_does_whatever_it_may_have(
    part: str, kind: str, folder: Path
) -> None:
    text = _with(part, kind)
    read_scene(text, folder)
    title = {"skin": "Skin", "effects": "Effects"}.get(part, "Touch 1")
    section = next(s for s in sections_of(tomllib.loads(text)) if s.title == title)
    sections = section.sections if part == "effects" else (section,)
    for offer in (offer for one in sections for offer in _offers(one)):
        added = offer.change(text)
        assert tomllib.loads(added) != tomllib.loads(text)
        read_scene(added, folder)


def test_whatever_a_plain_scene_may_have_besides_makes_a_valid_one(folder: Path) -> None:
    offers = [o for s in sections_of(tomllib.loads(_PLAIN)) for o in _offers(s)]
    assert len(offers) > 40
    for offer in offers:
        read_scene(offer.change(_PLAIN), folder)


def test_every_effect_that_has_numbers_of_its_own_can_be_added() -> None:
    follow = {"tension", "foam", "fluid", "dead", "gage-length", "finite-slope"}
    follow |= {"skew", "saturation", "quantisation"}
    assert set(parts.kinds("effects")) == set(EFFECTS) - follow


def test_what_a_menu_adds_is_said_once_and_removed_again_by_its_button(
    shown: Callable[[str], SceneForm], qtbot: Any
) -> None:
    text = _TEXTS["hot-room"]
    form = shown(text)
    said = _said(form)
    _action(form, "Creep").trigger()
    assert len(said) == 1
    assert tomllib.loads(said[0])["effects"]["creep"] == parts.needed("effects", "creep")
    assert "\n\n[effects.creep]\nshare = 0.1\ntime_constant = 8.0\n\n[[touch]]" in said[0]
    box = next(b for b in form.boxes if ("effects", "creep", "share") in b.editors)
    crosses = [b for b in box.findChildren(QToolButton) if b.text() == "\N{MULTIPLICATION SIGN}"]
    qtbot.mouseClick(crosses[-1], Qt.MouseButton.LeftButton)
    assert said[1:] == [text]


def _action(form: SceneForm, words: str) -> QAction:
    return next(a for a in form.findChildren(QAction) if a.text() == words)


def test_a_step_is_added_and_removed_in_its_line(shown: Callable[[str], SceneForm]) -> None:
    form = shown(_TEXTS["pencil"])
    said = _said(form)
    _action(form, "Tap").trigger()
    assert '    { step = "tap", times = 3, seconds = 1.0 },\n]' in said[0]
    assert changes.remove(said[0], ("touch", 0, "path", 4)) == _TEXTS["pencil"]


def test_a_step_that_presses_comes_before_the_release(folder: Path) -> None:
    text = changes.add_step(_TEXTS["pencil"], ("touch", 0, "path"), "hold")
    hold, release = (
        '    { step = "hold", seconds = 1.0 },',
        '    { step = "release", seconds = 0.5 },',
    )
    assert f"\n{hold}\n{release}\n]" in text
    assert text.replace(f"{hold}\n", "") == _TEXTS["pencil"]
    read_scene(text, folder)


def test_what_cannot_press_beside_what_is_there_is_not_offered(
    shown: Callable[[str], SceneForm],
) -> None:
    def offered(name: str) -> set[str]:
        sections = sections_of(tomllib.loads(name))
        return {o.words for s in sections if s.adding == "Add touch" for o in s.more}

    assert {"Ball", "Point load", "Cylinders"} <= offered(_PLAIN)
    assert not offered(_TEXTS["pencil"])
    assert "Point load" in offered(_TEXTS["circle"])
    assert not {"Ball", "Cylinders"} & offered(_TEXTS["circle"])
    assert not offered(_TEXTS["calibration"])


def test_the_last_step_takes_its_path_and_the_last_touch_its_array_along() -> None:
    text = _TOUCHED
    for _ in range(2):
        text = changes.remove(text, ("touch", 0, "path", 0))
    assert "path" not in tomllib.loads(text)["touch"][0]
    assert "touch" not in tomllib.loads(changes.remove(text, ("touch", 0)))


def test_an_effect_that_goes_is_named_no_longer(folder: Path) -> None:
    text = changes.remove(_TEXTS["hum"], ("effects", "mains-hum"))
    assert tomllib.loads(text)["effects"] == {"choose": []}
    read_scene(text, folder)


def test_another_kind_of_touch_keeps_what_it_knows_and_gets_what_it_needs(
    shown: Callable[[str], SceneForm],
) -> None:
    form = shown(_TOUCHED)
    said, box = _said(form), form.editor("touch", 0, "what")
    box.setFocus()
    assert isinstance(box, QComboBox)
    box.setCurrentIndex(box.findData("block"))
    box.activated.emit(box.currentIndex())
    before, after = (tomllib.loads(text)["touch"][0] for text in (_TOUCHED, said[0]))
    kept = {"x", "y", "force", "path"}
    assert after == {k: before[k] for k in kept} | {"what": "block", "length": 0.03, "width": 0.02}
    assert "# Of a cork." in said[0]
    assert "# slowly" in said[0]
    assert "# a ball" in said[0]
    assert form.editor("touch", 0, "what").hasFocus()


def test_a_slide_that_becomes_a_turn_gets_an_angle() -> None:
    place = ("touch", 0, "path", 1, "step")
    text = changes.change_kind(_TEXTS["pencil"], place, "step", "turn")
    assert tomllib.loads(text)["touch"][0]["path"][1] == {
        "step": "turn",
        "seconds": 1.0,
        "by": pytest.approx(math.pi / 2),
    }
    assert [line for line in text.splitlines() if line not in _TEXTS["pencil"]] == [
        '    { step = "turn", seconds = 1.0, by = 1.5707963 },'
    ]


def test_a_displacement_comes_instead_of_a_force_and_a_path_of_an_orbit() -> None:
    text = changes.put_in(_TEXTS["two-contacts"], ("touch", 1), "displacement", 0.002)
    text = changes.put_in(text, ("touch", 1), "path", parts.optional("touch")["path"])
    touch = tomllib.loads(text)["touch"][1]
    assert {"displacement", "path"} <= set(touch)
    assert not {"force", "orbit"} & set(touch)


def test_a_touch_is_put_in_the_middle_of_the_skin_that_is_there(folder: Path) -> None:
    text = changes.add_touch(_TEXTS["on-foam"].replace("[0.1, 0.1]", "[0.2, 0.3]"), "punch")
    touch = tomllib.loads(text)["touch"][-1]
    assert (touch["x"], touch["y"]) == (0.1, 0.15)


def test_headings_keep_an_empty_line_before_them_and_others_their_own() -> None:
    text = changes.put_in(_TOUCHED, ("electronics", "amplifier"), "gain", 50.0)
    assert text == _TOUCHED + "\n[electronics.amplifier]\ngain = 50.0\n"


def test_tips_tell_unit_and_range() -> None:
    assert How("a", "A tip.", "mm", 1e-3).explained == "A tip. In mm."
    assert How("a", "A tip.", "mm", 1e-3, 0.0, 0.5).explained == "A tip. From 0 to 500 mm."
    assert How("a", "A tip.", "N", 1.0, 2.0).explained == "A tip. At least 2 N."
    assert How("a", "A tip.").explained == "A tip."
