"""The window as a whole: what it shows, in which room, under which keys."""

from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QAction, QImage
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QDockWidget, QMenu, QPushButton, QScrollArea, QScrollBar

from kappaskin.errors import Refusal
from kappaskin_app.shell.actions import plain
from kappaskin_app.shell.window import MainWindow
from kappaskin_app.theme import THEMES, bar_palette
from kappaskin_app.widgets.line import Line


def test_no_view_is_blank(window: MainWindow, until, colours_in) -> None:
    until(lambda: len(window.membrane.ages) > 10)
    # Grey for a moment, where nothing new came on a busy machine.
    until(lambda: colours_in(window, window.membrane) > 500)
    for heatmap in window.heatmaps.values():
        until(lambda cells=heatmap.cells: colours_in(window, cells) > 20)


@pytest.mark.full
def test_nothing_is_cut_off_at_1280_by_800(window: MainWindow) -> None:
    assert window.minimumSizeHint().width() <= 1280
    assert window.minimumSizeHint().height() <= 800
    for button in window.findChildren(QPushButton):
        if button.isVisible():
            assert button.width() >= button.sizeHint().width()


@pytest.mark.full
def test_every_dock_below_has_room_for_all_that_is_in_it(window: MainWindow, until, qtbot) -> None:
    window.docks.reveal("cost")
    until(lambda: window.cost.effects.rowCount() > 0)
    scrolled = {}
    for name in ("cost", "stability", "scene", "health", "numbers", "log", "compare", "design"):
        window.docks.reveal(name)
        qtbot.wait(150)
        area = window.docks[name].findChild(QScrollArea)
        if area.verticalScrollBar().maximum() or area.horizontalScrollBar().maximum():
            scrolled[name] = area.viewport().size().toTuple()
        window.docks[name].hide()
    assert (window.width(), window.height()) == (1280, 800)
    assert scrolled == {}


def test_a_line_too_long_for_its_place_begins_its_tooltip(qapp) -> None:
    line = Line("as short as can be")
    line.setToolTip("What it is.")
    line.resize(400, 20)
    assert line.tip() == "What it is."
    line.resize(20, 20)
    assert line.tip() == "as short as can be\n\nWhat it is."


@pytest.mark.cases("dark")
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_both_themes_draw(window: MainWindow, until, colours_in, theme: str) -> None:
    window.history.change("Theme", -1, theme=theme, colour_by="xy")
    drawn = len(window.membrane.ages)
    until(lambda: len(window.membrane.ages) > drawn + 3)
    # On a busy machine the skin may be grey for a moment, as nothing new came.
    until(lambda: colours_in(window, window.membrane) > 500)
    bar = window.panels.findChild(QScrollBar).palette().button()
    assert bar.color() == bar_palette(THEMES[theme]).button().color()


@pytest.mark.full
def test_a_picture_is_saved(window: MainWindow, tmp_path: Path) -> None:
    window.picture(tmp_path / "a.png")
    with pytest.raises(Refusal, match=r"nowhere/a\.png: cannot be written \(No such file"):
        window.picture(tmp_path / "nowhere" / "a.png")
    assert QImage(str(tmp_path / "a.png")).size() == window.size()


@pytest.mark.full
def test_every_number_is_whole_while_a_recording_is_made(
    window: MainWindow, tmp_path: Path, until
) -> None:
    window.recorder.begin(tmp_path / "a.mcap")
    until(lambda: window.recorder.recording)
    until(lambda: window.readouts.text("error").endswith(" mm"))
    for line in window.readouts.findChildren(Line):  # each has its place once it has its text
        advance = line.fontMetrics().horizontalAdvance
        until(lambda line=line, advance=advance: advance(line.text()) < line.width() - 5)
    assert window.width() == 1280
    window.recorder.toggle()
    until(lambda: not window.recorder.recording)


@pytest.mark.full
def test_every_action_is_in_a_menu_and_no_shortcut_is_used_twice(window: MainWindow) -> None:
    entries = window.actions_by_name.entries
    shortcuts = [entry.action.shortcut().toString() for entry in entries.values()]
    used = [shortcut for shortcut in shortcuts if shortcut]
    assert len(used) == len(set(used))
    registered = {entry.action for entry in entries.values()}

    def within(menu: QMenu) -> set[QAction]:
        found = set(menu.actions())
        parts = [a for a in found if a.menu() is not None and a not in registered]
        return (found - set(parts)).union(*(within(part.menu()) for part in parts))

    in_menus = set().union(*(within(bar.menu()) for bar in window.menuBar().actions()))
    assert registered == in_menus


@pytest.mark.full
def test_every_shortcut_is_read_on_a_small_screen_under_its_menu(window: MainWindow, until) -> None:
    window.actions_by_name["shortcuts"].trigger()
    sheet = window.menus.shortcuts
    until(lambda: sheet.height() > 100)
    assert sheet.height() < 700
    assert sheet.width() < 1000
    rows = [sheet.list.topLevelItem(row) for row in range(sheet.list.topLevelItemCount())]
    shown = [(row.text(0), row.text(1), row.text(2)) for row in rows]
    assert shown == [
        (plain(entry.action.text()), plain(entry.menu), entry.action.shortcut().toString())
        for entry in window.actions_by_name.entries.values()
    ]
    sheet.close()


def test_every_shortcut_takes_its_action_wherever_the_focus_is(window: MainWindow, until) -> None:
    taken, failed = list[str](), list[tuple[str, str, list[str]]]()
    keys = {name: entry.action for name, entry in window.actions_by_name.entries.items()}
    keys = {name: action for name, action in keys.items() if not action.shortcut().isEmpty()}
    assert len(keys) > 60
    window.session.timer.stop()
    window.session.engine.disconnect()  # keys are taken as well without what comes in
    for name, action in keys.items():
        action.triggered.disconnect()  # not to quit, record or open dialogs
        action.triggered.connect(lambda *_, name=name: taken.append(name))
        if action.isCheckable():  # that of a dock, which its own action would show
            action.setCheckable(False)
    window.docks.reveal("numbers")
    places = (
        window.membrane.plotter,
        window.basis.editor("functions_x"),
        window.numbers.elements,
        window.panels.tabBar(),
    )
    for place in places:
        place.setFocus()
        until(place.hasFocus)
        for name, action in keys.items():
            action.setEnabled(True)  # the engine's status may disable it meanwhile
            taken.clear()
            QTest.keySequence(place, action.shortcut())
            if taken != [name]:
                failed.append((action.shortcut().toString(), type(place).__name__, list(taken)))
    assert failed == []


@pytest.mark.full
def test_every_dock_has_a_name_for_saved_layouts(window: MainWindow) -> None:
    names = [dock.objectName() for dock in window.findChildren(QDockWidget)]
    assert all(names)
    assert window.restoreState(window.saveState())


@pytest.mark.full
def test_pages_are_turned_with_the_keyboard_and_every_title_is_whole(
    window: MainWindow, qtbot
) -> None:
    panels, control = window.panels, Qt.KeyboardModifier.ControlModifier
    shown = []
    for key in (Qt.Key.Key_PageDown, Qt.Key.Key_PageUp):
        qtbot.keyClick(window, key, control)
        shown.append(panels.tabText(panels.currentIndex()))
    assert shown == ["S&kin", "&Live"]
    bar = panels.tabBar()
    for index in range(panels.count()):
        text = panels.tabText(index).replace("&", "")
        assert bar.tabRect(index).width() >= bar.fontMetrics().horizontalAdvance(text) + 8
    assert bar.sizeHint().width() <= panels.width()


@pytest.mark.full
def test_the_heatmaps_keep_their_share_of_a_wider_window(window: MainWindow, until) -> None:
    was = window.heatmaps["xx"].width()
    window.resize(1920, 1100)
    until(lambda: window.heatmaps["xx"].width() > 1.3 * was)
