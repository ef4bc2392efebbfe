from dataclasses import fields, replace

import pytest
from PySide6.QtWidgets import QAbstractSpinBox, QComboBox, QLabel

from kappaskin import Status
from kappaskin.bases import EDGES
from kappaskin_app.features.compare.panel import OtherForm
from kappaskin_app.features.design.panel import DesignForm
from kappaskin_app.features.operator.panel import OperatorForm
from kappaskin_app.shell.settings import SceneSettings, Settings, form_field, part
from kappaskin_app.shell.settings.form_fields import Choice, Range
from kappaskin_app.shell.settings.scene import SHAPES

ASKED = [f.name for f in fields(Settings) if "form" in f.metadata]


def test_every_setting_asked_for_stands_in_one_panel(panels) -> None:
    # Those of what is compared with, of what is designed and of the operator stand elsewhere.
    forms = [*panels.all(), OtherForm(), DesignForm(), OperatorForm()]
    shown = [name for form in forms for name in ASKED if form.findChild(object, name)]
    assert sorted(shown) == sorted(ASKED)


@pytest.mark.parametrize("name", ASKED)
def test_every_setting_explains_itself_and_starts_in_range(name: str) -> None:
    how, default = form_field(name), getattr(Settings(), name)
    assert how.label
    assert how.tip.endswith(".")
    if isinstance(how, Range):
        assert how.least <= default <= how.most
    if isinstance(how, Choice):
        assert default in dict(how.options)


def test_every_edge_there_is_can_be_chosen_and_assumed() -> None:
    for name, before in (("edge", []), ("fit_edge", [""])):
        how = form_field(name)
        assert isinstance(how, Choice)
        assert [value for value, _ in how.options] == [*before, *EDGES]


def test_only_what_makes_the_scene_belongs_to_it() -> None:
    was = part(Settings(), SceneSettings)
    for change in ({"theme": "light"}, {"functions_x": 3}, {"range_xx": 2.0}, {"fit_edge": "x"}):
        assert part(replace(Settings(), **change), SceneSettings) == was
    for change in ({"force": 0.2}, {"noise_seed": 3}, {"tension": 2.0}, {"elements_x": 3}):
        assert part(replace(Settings(), **change), SceneSettings) != was


def test_showing_settings_wishes_nothing(panels) -> None:
    wishes = []
    panels.requested.connect(lambda *wish: wishes.append(wish))
    changed = {"functions_x": 3, "x": 0.01, "theme": "light", "shape": "cylinder", "fluid": True}
    panels.show_settings(replace(Settings(), **changed))
    panels.show_settings(replace(Settings(), side_x=0.02, x=0.01))
    assert wishes == []


def test_an_editor_wishes_in_si_units_and_shows_its_unit(panels) -> None:
    wishes = []
    panels.requested.connect(lambda *wish: wishes.append(wish))
    for panel, name, typed, wished, unit in (
        (panels.load, "x", 12.5, 0.0125, " mm"),
        (panels.support, "foam", 20.0, 2e4, " kN/m\u00b3"),
        (panels.shape, "side_x", 80.0, 0.08, " mm"),
    ):
        box = panel.editor(name)
        assert isinstance(box, QAbstractSpinBox)
        box.setProperty("value", typed)
        assert wishes.pop() == (name, pytest.approx(wished))
        assert box.text().endswith(unit)


def test_a_choice_made_with_the_keyboard_is_a_wish(panels, qtbot) -> None:
    wishes = []
    panels.show_settings(Settings())
    panels.requested.connect(lambda *wish: wishes.append(wish))
    box = panels.noise.editor("noise_kind")
    assert isinstance(box, QComboBox)
    qtbot.keyClick(box, "G")
    assert wishes == [("noise_kind", "gaussian")]


def test_a_ready_case_asks_for_no_place(panels) -> None:
    load = panels.load
    load.show_settings(Settings(load_case="centre"))
    assert load.form.isRowVisible(load.editor("load_case"))
    assert not load.form.isRowVisible(load.editor("x"))
    load.show_settings(Settings(load_case="free-line"))
    assert load.form.isRowVisible(load.editor("y_end"))


@pytest.mark.parametrize(
    ("case", "rows", "called"),
    [
        ("disc", ["size"], "Radius"),
        ("rectangle", ["size", "size_y"], "Width along x"),
        ("gaussian", ["size"], "Std. deviation"),
        ("point", [], ""),
    ],
)
def test_a_spread_load_asks_for_its_size_by_its_name(
    panels, case: str, rows: list[str], called: str
) -> None:
    load = panels.load
    load.show_settings(Settings(load_case=case))
    shown = [name for name in ("size", "size_y") if load.form.isRowVisible(load.editor(name))]
    assert shown == rows
    label = load.form.labelForField(load.editor("size"))
    assert isinstance(label, QLabel)
    assert not called or label.text() == called
    assert load.editor("size").text().endswith(" mm")
    assert not load.form.isRowVisible(load.editor("x_end"))


def test_only_a_bent_skin_asks_for_a_radius_and_says_how_far_it_opens(panels) -> None:
    shape, facts = panels.shape, panels.shape.facts
    panels.show_settings(Settings())
    assert not shape.form.isRowVisible(shape.editor("base_radius"))
    assert not any(shape.form.isRowVisible(fact) for fact in facts.values())
    panels.show_settings(Settings(shape="cylinder", side_x=0.03, base_radius=0.02))
    assert shape.form.isRowVisible(shape.editor("base_radius"))
    assert facts["Opening angle"].text() == "85.9\N{DEGREE SIGN}"
    assert facts["Rise"].text() == "5.37 mm, 18 % of the side"
    assert not shape.form.isRowVisible(facts["Model error"])


def test_a_dome_asks_for_two_radii_and_says_how_shallow_it_is(panels) -> None:
    shape, facts = panels.shape, panels.shape.facts
    dome = Settings(shape="dome", side_x=0.06, side_y=0.04, radius_x=0.2, radius_y=-0.15)
    panels.show_settings(dome)
    shown = {name for name in shape.names if shape.has_row(name)}
    assert shown == {"shape", "side_x", "side_y", "radius_x", "radius_y", "edge"}
    texts = [facts[name].text() for name in ("Opening angle", "Rise", "Model error")]
    assert texts == [
        "17.2\N{DEGREE SIGN} \N{MULTIPLICATION SIGN} 15.3\N{DEGREE SIGN}",
        "3.58 mm, 9 % of the side",
        "0.50 %, at most 1 %",
    ]
    panels.show_settings(replace(dome, radius_x=0.05))  # refused, as the scene reports
    assert not any(shape.form.isRowVisible(fact) for fact in facts.values())


def test_a_load_can_be_placed_on_the_skin_only(panels) -> None:
    panels.show_settings(Settings(side_x=0.04, x=0.03, load_case="point"))
    box = panels.load.editor("x")
    box.setProperty("value", 70.0)
    assert box.property("value") == 40.0
    assert "From 0 to 40 mm" in box.toolTip()


def test_cases_are_called_table_1s_where_they_are(panels) -> None:
    box = panels.load.editor("load_case")
    assert isinstance(box, QComboBox)

    def words() -> list[str]:
        return [box.itemText(index) for index in range(box.count())]

    panels.show_settings(Settings(elements_x=7))
    assert [text.endswith("(Table 1)") for text in words()] == [False, *[True] * 3, *[False] * 6]
    for changed in ({"side_x": 0.09}, {"edge": "sliding"}, {"fluid": True}):
        panels.show_settings(replace(Settings(), **changed))
        assert not any("Table 1" in text for text in words())


def test_every_page_has_its_own_letter(panels) -> None:
    titles = [panels.tabText(index) for index in range(panels.count())]
    letters = [title[title.index("&") + 1].lower() for title in titles]
    assert len(set(letters)) == len(letters)
    assert not set(letters) & set("fesvh")  # the menus'


def test_pages_turn_round_and_round(panels) -> None:
    pages = []
    for step in (1, 1, -1):
        panels.turn(step)
        pages.append(panels.currentIndex())
    assert pages == [1 % panels.count(), 2 % panels.count(), 1]


def test_a_skin_that_cannot_be_is_explained_until_it_can(panels) -> None:
    shape, status = panels.shape, Status()
    shape.show_refusal("too small a radius")
    shape.show_status(status, simulating=True)
    assert shape.message.text() == "The previous skin is still simulated: too small a radius."
    shape.show_status(status, simulating=False)
    assert "only for the simulated skin" in shape.message.text()
    shape.show_refusal("")
    shape.show_status(status, simulating=True)
    assert shape.message.text() == ""


@pytest.mark.parametrize(("name", "value"), [("radius_x", 0.05), ("side_y", 0.25)])
def test_the_refusal_of_a_shape_stands_below_the_field_that_was_changed(
    panels, name, value
) -> None:
    shape = panels.shape
    form, dome = shape.form, {**SHAPES["dome"].lengths, "shape": "dome"}
    shape.show_settings(replace(Settings(), **dome))
    for theme in ("dark", "light"):  # another setting leaves it there
        shape.show_settings(replace(Settings(), **dome | {name: value}, theme=theme))
        row, _ = form.getWidgetPosition(shape.editor(name))
        assert form.getWidgetPosition(shape.message)[0] == row + 1
    shape.show_settings(replace(Settings(), **dome))
    assert form.indexOf(shape.message) < 0
    assert shape.layout().indexOf(shape.message) >= 0


def test_a_choice_without_room_for_all_its_words_says_so(panels) -> None:
    box = panels.basis.editor("method")
    box.setCurrentText("Robust, excludes faulty elements")
    box.resize(110, box.height())
    assert box.words_shown().endswith("\N{HORIZONTAL ELLIPSIS}")
    box.resize(400, box.height())
    assert box.words_shown() == box.currentText()
    for name in ("noise_kind", "load_case", "electronics"):
        box = panels.findChild(QComboBox, name)
        box.resize(box.sizeHint())
        assert box.words_shown() == box.currentText()
