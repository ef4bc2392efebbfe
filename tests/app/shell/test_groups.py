"""Groups of settings: collapsed by a click on their title, and shown where they apply."""

from pathlib import Path

import pytest
from PySide6.QtCore import Qt

from kappaskin_app.shell.finder import entries_in
from kappaskin_app.shell.pages import SENSOR, SKIN

LEFT = Qt.MouseButton.LeftButton


def test_a_click_on_a_title_collapses_a_group_and_the_next_one_expands_it(
    shared_window, until, qtbot
) -> None:
    panel, box = shared_window.noise, shared_window.noise.editor("noise_rms")
    assert box.isVisible()
    high = panel.height()

    qtbot.mouseClick(panel.fold, LEFT)
    assert not box.isVisible()
    until(lambda: panel.height() < high / 2)

    qtbot.mouseClick(panel.fold, LEFT)
    assert box.isVisible()
    until(lambda: panel.height() == high)


def test_the_keyboard_collapses_a_group(shared_window, qtbot) -> None:
    shared_window.noise.fold.setFocus()
    qtbot.keyClick(shared_window.noise.fold, Qt.Key.Key_Space)
    assert not shared_window.noise.editor("noise_rms").isVisible()
    qtbot.keyClick(shared_window.noise.fold, Qt.Key.Key_Space)
    assert shared_window.noise.editor("noise_rms").isVisible()


def test_what_the_finder_goes_to_is_expanded(shared_window, qtbot) -> None:
    qtbot.mouseClick(shared_window.noise.fold, LEFT)
    found = {entry.name: entry for entry in entries_in(shared_window, ())}
    found["setting:noise_rms"].act()
    assert shared_window.noise.editor("noise_rms").isVisible()


def test_collapsed_groups_are_so_in_the_next_window(opened, qtbot, tmp_path: Path) -> None:
    file, window = tmp_path / "window.toml", opened("sim:")
    window.saver.begin(file)
    qtbot.mouseClick(window.noise.fold, LEFT)
    window.saver.finish()
    window.close()

    other = opened("sim:")
    other.saver.begin(file)
    assert other.noise.fold.isChecked()
    assert not other.load.fold.isChecked()


@pytest.mark.full
def test_a_recording_has_no_settings_of_a_simulation(window, until, recording, qtbot) -> None:
    window.session.request_source(f"replay:{recording}")
    until(lambda: window.load.isHidden())
    assert window.noise.isHidden()
    assert window.added_noise.isHidden()
    assert not window.panels.isTabVisible(window.panels.place(SKIN))
    qtbot.keyClick(window, Qt.Key.Key_PageDown, Qt.KeyboardModifier.ControlModifier)
    assert window.panels.currentIndex() == window.panels.place(SENSOR)
    why = {entry.name: entry.why_not for entry in entries_in(window, ())}["setting:force"]
    assert "Ctrl+M" in why
    window.session.simulate()
    until(lambda: not window.load.isHidden())
    assert window.panels.isTabVisible(window.panels.place(SKIN))
