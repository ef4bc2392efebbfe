"""Docks: the guide beside the skin, corners, and a window that comes back from full screen."""

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtWidgets import QMenu

LEFT = Qt.MouseButton.LeftButton


def _click(window, qtbot, menu: str, name: str) -> None:
    """Click an action in a menu of the menu bar."""
    bar, action = window.menuBar(), window.actions_by_name[name]
    title = next(each for each in bar.actions() if each.text() == menu)
    qtbot.mouseClick(bar, LEFT, pos=bar.actionGeometry(title).center())
    opened = title.menu()
    assert isinstance(opened, QMenu)
    assert opened.isVisible()
    qtbot.mouseClick(opened, LEFT, pos=opened.actionGeometry(action).center())


def _places(window) -> dict[str, tuple[int, ...]]:
    docks = window.docks.by_name().items()
    return {n: d.geometry().getRect() for n, d in docks if not d.visibleRegion().isEmpty()}


def test_the_guide_opens_at_the_side_and_gives_the_room_back(window, until, qtbot) -> None:
    window.layouts.reset()
    qtbot.wait(100)
    before = _places(window)
    others = {window.docks[name] for name in before}

    _click(window, qtbot, "&Help", "dock-guide")
    dock = window.docks["guide"]
    until(lambda: not dock.visibleRegion().isEmpty())
    assert dock.x() > window.display.centre.mapTo(window, QPoint()).x()
    until(lambda: dock.width() >= 0.33 * window.width())
    assert not window.guide.text.horizontalScrollBar().isVisible()
    hidden = {dock for dock in others if dock.visibleRegion().isEmpty()}
    assert len(hidden) == 1

    qtbot.mouseClick(dock.titleBarWidget().close_, LEFT)
    until(lambda: _places(window) == before)


def test_columns_own_the_corners_where_what_is_below_fits_between_them(window, until) -> None:
    window.layouts.reset()
    window.resize(1440, 900)
    window.docks.reveal("strip_chart")
    strip, left, right = (window.docks[n] for n in ("strip_chart", "settings", "curvature"))
    until(lambda: strip.x() > left.geometry().right() and strip.width() > 600)
    assert strip.geometry().right() < right.x()
    assert left.geometry().bottom() == strip.geometry().bottom()

    window.resize(1024, 700)
    until(lambda: strip.x() == 0 and strip.width() == 1024)
    assert left.geometry().bottom() < strip.y()
    window.resize(1440, 900)
    until(lambda: strip.x() > left.geometry().right())


@pytest.mark.cases("guide")
@pytest.mark.parametrize("name", ["guide", "cost", "lesson"])
def test_the_presenter_gives_back_docks_sizes_banner_and_scrolled_positions(
    window, until, qtbot, name: str
) -> None:
    window.docks.reveal(name)
    window.docks.reveal("strip_chart")
    window.display.banner.show_actions("A banner", "", [])
    bar = window.panels.currentWidget().verticalScrollBar()
    qtbot.wait(300)
    bar.setValue(bar.maximum() // 2)
    was, at, place = _places(window), bar.value(), window.geometry()
    assert at > 0

    qtbot.keyClick(window, Qt.Key.Key_F11)
    until(lambda: window.presenter.on and not _places(window))
    window.resize(1600, 1000)
    qtbot.wait(100)
    qtbot.keyClick(window, Qt.Key.Key_Escape)

    until(lambda: (window.geometry(), _places(window), bar.value()) == (place, was, at))
    assert window.display.banner.isVisible()
