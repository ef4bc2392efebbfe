from collections.abc import Iterator

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QApplication, QLabel, QMainWindow

from kappaskin import Refusal
from kappaskin_app.shell.actions import WITHIN, Actions, with_keys
from kappaskin_app.shell.shortcuts import ShortcutDialog
from kappaskin_app.theme import DARK, LIGHT, palette

CONTROL = Qt.KeyboardModifier.ControlModifier


@pytest.fixture
def actions(qtbot) -> Actions:
    window = QMainWindow()
    qtbot.addWidget(window)
    actions = Actions(window)
    actions.window = window  # type: ignore[attr-defined]
    for name, key in (("picture", "Ctrl+S"), ("theme", "Ctrl+T"), ("reset", "")):
        actions.add(name, "&View", f"&{name.title()}", lambda: None, key)
    return actions


@pytest.fixture
def sheet(actions: Actions) -> Iterator[ShortcutDialog]:
    sheet = ShortcutDialog(actions, actions.window)
    sheet.open_all()
    yield sheet
    sheet.close()


def _shown(sheet: ShortcutDialog) -> list[str]:
    rows = (sheet.list.topLevelItem(row) for row in range(sheet.list.topLevelItemCount()))
    return [row.text(2) for row in rows]


def test_a_clash_is_told_with_what_has_the_key_and_changes_nothing(actions: Actions) -> None:
    with pytest.raises(Refusal, match=r"Ctrl\+S belongs to Picture"):
        actions.change_key("theme", "Ctrl+S")
    assert actions.key("theme") == "Ctrl+T"


@pytest.mark.parametrize("key", ["A", "Shift+A", "Space", "1", "Left", "Ctrl+K, Ctrl+S"])
def test_a_key_that_types_is_no_shortcut(actions: Actions, key: str) -> None:
    with pytest.raises(Refusal, match="for typing"):
        actions.change_key("theme", key)


@pytest.mark.parametrize("key", ["F7", "Shift+F7", "Ctrl+Shift+A", "Alt+Left", "Meta+1", ""])
def test_any_other_key_is_one(actions: Actions, key: str) -> None:
    actions.change_key("theme", key)
    assert actions.changed_keys() == {"theme": key}


def test_keys_kept_may_change_places(actions: Actions) -> None:
    assert actions.take_keys({"picture": "Ctrl+T", "theme": "Ctrl+S"}) == []
    assert (actions.key("picture"), actions.key("theme")) == ("Ctrl+T", "Ctrl+S")


def test_of_two_that_want_one_key_the_second_is_told_and_has_none(actions: Actions) -> None:
    (told,) = actions.take_keys({"reset": "Ctrl+J", "theme": "Ctrl+J", "unknown": "Ctrl+U"})
    assert told == "Ctrl+J belongs to Reset: change that shortcut first"
    assert actions.key("theme") == ""


def test_a_shortcut_is_found_changed_and_reset_with_the_keyboard(
    sheet: ShortcutDialog, actions: Actions, qtbot, until
) -> None:
    qtbot.keyClicks(sheet.line, "them")
    assert _shown(sheet) == ["Ctrl+T"]
    qtbot.keyClick(sheet.line, Qt.Key.Key_Return)
    qtbot.keyClick(sheet.edit, Qt.Key.Key_J, CONTROL)
    until(lambda: _shown(sheet) == ["Ctrl+J *"])
    assert actions.key("theme") == "Ctrl+J"
    assert "Theme has the shortcut Ctrl+J now." in sheet.message.text()
    qtbot.keyClick(sheet.edit, Qt.Key.Key_S, CONTROL)
    until(lambda: "Ctrl+S belongs to Picture" in sheet.message.text())
    assert sheet.edit.keySequence().toString() == "Ctrl+J"
    sheet.reset.click()
    assert actions.key("theme") == "Ctrl+T"
    assert not sheet.reset.isEnabled()


def test_all_are_reset_at_once(sheet: ShortcutDialog, actions: Actions) -> None:
    actions.take_keys({"picture": "Ctrl+T", "theme": "Ctrl+S"})
    sheet.open_all()
    sheet.reset_all.click()
    assert actions.changed_keys() == {}
    assert _shown(sheet) == ["Ctrl+S", "Ctrl+T", ""]


def test_each_change_of_shortcuts_is_reported(
    sheet: ShortcutDialog, actions: Actions, qtbot, until
) -> None:
    told: list[dict[str, str]] = []
    sheet.changed.connect(lambda: told.append(actions.changed_keys()))
    qtbot.keyClicks(sheet.line, "theme")
    sheet.edit.setKeySequence("Ctrl+J")
    until(lambda: actions.key("theme") == "Ctrl+J")
    sheet.reset_all.click()
    assert told == [{"theme": "Ctrl+J"}, {}]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("Save it (Ctrl+S).", "Save it (Ctrl+T)."),
        ("Ctrl+T, or Ctrl+Shift+S", "Ctrl+S, or Ctrl+Shift+S"),
        ("See F1; F11 and Ctrl+F1 are others", "See no shortcut; F11 and Ctrl+F1 are others"),
        ("nothing", "nothing"),
    ],
)
def test_a_text_names_the_keys_of_now(text: str, told: str) -> None:
    assert with_keys(text, {"Ctrl+S": "Ctrl+T", "Ctrl+T": "Ctrl+S", "F1": "", "": "Ctrl+J"}) == told


def test_tooltips_follow_a_changed_shortcut_and_one_that_is_set_meanwhile(actions: Actions) -> None:
    label, other = QLabel(actions.window), QLabel(actions.window)
    label.setToolTip("Theme (Ctrl+T)")
    other.setToolTip("Else")
    actions.change_key("theme", "Ctrl+J")
    assert (label.toolTip(), other.toolTip()) == ("Theme (Ctrl+J)", "Else")
    other.setToolTip("Now Ctrl+T")
    actions.change_key("theme", "Ctrl+L")
    assert (label.toolTip(), other.toolTip()) == ("Theme (Ctrl+L)", "Now Ctrl+L")
    actions.take_keys({})
    assert (label.toolTip(), other.toolTip()) == ("Theme (Ctrl+T)", "Now Ctrl+T")


def test_a_menu_may_stand_within_another(actions: Actions) -> None:
    for name in ("map", "dock"):
        actions.add(name, f"E&xport{WITHIN}&Picture", name, lambda: None)
    (export,) = [a for a in actions.window.menuBar().actions() if a.text() == "E&xport"]
    (picture,) = export.menu().actions()
    assert [action.text() for action in picture.menu().actions()] == ["map", "dock"]


def test_a_tip_that_is_set_after_a_change_names_the_key_of_now(actions: Actions) -> None:
    label = QLabel("x", actions.window)
    label.setToolTip("Theme")
    actions.change_key("theme", "Ctrl+J")
    label.setToolTip("Not now; later with Ctrl+T")
    assert label.toolTip() == "Not now; later with Ctrl+J"
    late = QLabel("y", actions.window)
    late.setToolTip("Ctrl+T")
    actions.update_tips()
    assert late.toolTip() == "Ctrl+J"
    actions.take_keys({})
    assert (label.toolTip(), late.toolTip()) == ("Not now; later with Ctrl+T", "Ctrl+T")


def test_menus_beside_shortcuts_have_the_ink_of_the_theme_of_now(
    sheet: ShortcutDialog, qapp: QApplication
) -> None:
    before = qapp.palette()
    for theme in (DARK, LIGHT):
        qapp.setPalette(palette(theme))
        qapp.processEvents()
        assert sheet.list.topLevelItem(0).foreground(1).color() == QColor(theme.faint)
    qapp.setPalette(before)
