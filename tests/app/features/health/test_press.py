"""Press test page: keys, and tests of a scene that changes."""

from collections import Counter

import pytest
from PySide6.QtGui import QKeySequence
from PySide6.QtWidgets import QPushButton, QTabBar

from kappaskin.scenes import scene_file
from kappaskin_app.shell.settings.scene import Written


@pytest.mark.full
def test_no_key_of_the_page_is_that_of_a_menu_or_of_a_page_of_settings(window) -> None:
    window.actions_by_name["dock-health"].trigger()
    page = window.health.press
    texts = [button.text() for button in page.findChildren(QPushButton)]
    texts += [action.text() for action in window.menuBar().actions()]
    tabs = window.panels.findChildren(QTabBar)
    texts += [tab.tabText(place) for tab in tabs for place in range(tab.count())]

    keys = Counter(QKeySequence.mnemonic(text).toString() for text in texts if "&" in text)

    assert len(keys) > 12
    assert [key for key, count in keys.items() if count > 1] == []


@pytest.mark.full
def test_a_scene_that_is_chosen_meanwhile_does_not_press_by_itself(window, until) -> None:
    window.press_test.begin(quick=True)
    until(lambda: window.session.status.playing.speed == 0)
    file, played = scene_file("tapping"), []
    window.session.playing.connect(played.append)

    window.editing.play(Written(file.read_text(encoding="utf-8"), file))

    until(lambda: played)
    assert not window.session.running
    until(lambda: window.session.status.playing.speed == 0)

    window.press_test.stop()
    until(lambda: window.session.status.playing.speed == 1)  # it goes on


def test_the_element_asked_for_is_marked_on_the_skin_until_the_test_ends(window, until) -> None:
    window.press_test.begin(quick=True)
    until(lambda: window.membrane.target.actor.visibility)
    window.actions_by_name["disconnect"].trigger()
    until(lambda: window.display.badge.state == "OFF")
    assert not window.press_test.running
    assert not window.membrane.target.actor.visibility
