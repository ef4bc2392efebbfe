from dataclasses import fields, replace

import pytest
from PySide6.QtWidgets import QAbstractSpinBox, QApplication, QComboBox

from kappaskin_app.panels.basis import BasisPanel
from kappaskin_app.panels.form import Panel
from kappaskin_app.panels.load import LoadPanel, NoisePanel
from kappaskin_app.panels.view import ViewPanel
from kappaskin_app.settings import Range, Settings, ask_of

ASKED = [f.name for f in fields(Settings) if "ask" in f.metadata]


@pytest.fixture
def panels(qapp: QApplication) -> list[Panel]:
    return [LoadPanel(), NoisePanel(), BasisPanel(), ViewPanel()]


def test_every_setting_asked_for_stands_in_one_panel(panels: list[Panel]) -> None:
    shown = [name for panel in panels for name in ASKED if panel.findChild(object, name)]
    assert sorted(shown) == sorted(ASKED)


@pytest.mark.parametrize("name", ASKED)
def test_every_setting_explains_itself_and_starts_in_range(name: str) -> None:
    how, default = ask_of(name), getattr(Settings(), name)
    assert how.label
    assert how.tip.endswith(".")
    if isinstance(how, Range):
        assert how.least <= default <= how.most


def test_showing_settings_wishes_nothing(panels: list[Panel]) -> None:
    wishes = []
    for panel in panels:
        panel.wished.connect(lambda *wish: wishes.append(wish))
        panel.show_settings(replace(Settings(), functions_x=3, x=0.01, theme="light"))
    assert wishes == []


def test_an_editor_wishes_in_si_units_and_shows_its_unit(panels: list[Panel]) -> None:
    load, wishes = panels[0], []
    load.wished.connect(lambda *wish: wishes.append(wish))
    box = load.editor("x")
    assert isinstance(box, QAbstractSpinBox)
    box.setProperty("value", 12.5)
    assert wishes == [("x", pytest.approx(0.0125))]
    assert box.text().endswith(" mm")


def test_a_choice_made_with_the_keyboard_is_a_wish(panels: list[Panel], qtbot) -> None:
    noise, wishes = panels[1], []
    noise.show_settings(Settings())
    noise.wished.connect(lambda *wish: wishes.append(wish))
    box = noise.editor("noise_kind")
    assert isinstance(box, QComboBox)
    qtbot.keyClick(box, "G")
    assert wishes == [("noise_kind", "gaussian")]


def test_a_ready_case_asks_for_no_place(panels: list[Panel]) -> None:
    load = panels[0]
    load.show_settings(Settings(load_case="centre"))
    assert load.form.isRowVisible(load.editor("load_case"))
    assert not load.form.isRowVisible(load.editor("x"))
    load.show_settings(Settings(load_case="free-line"))
    assert load.form.isRowVisible(load.editor("y_end"))
