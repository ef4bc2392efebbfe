"""The colour map of a window, its pins and the maps of a strip, by mouse and keys."""

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QWidget

from kappaskin_app.shell.window import MainWindow
from kappaskin_app.theme import COLOUR_MAPS, colour_map
from kappaskin_app.widgets.layout import scroll_to

LEFT = Qt.MouseButton.LeftButton


@pytest.fixture
def window(shared_window: MainWindow) -> MainWindow:
    return shared_window


def away(widget: QWidget, at: QPoint, colours: np.ndarray) -> float:
    """How far a pixel is from the nearest of some colours, in RGB."""
    pixel = QColor(widget.grab().toImage().pixel(at)).getRgb()[:3]
    return float(np.abs(colours.astype(int) - pixel).sum(axis=1).min())


def test_a_map_selected_from_the_list_colours_skin_heatmaps_and_scales(
    window: MainWindow, qtbot, until
) -> None:
    box = window.features["membrane"].panel.editor("colour_map")
    scroll_to(box)
    qtbot.wait(50)
    assert box.count() == len(COLOUR_MAPS) == 5
    xx, scale = window.heatmaps["xx"], window.scale.bar
    until(lambda: xx.isVisible() and scale.limits[1] > 1.0)
    for name, row in (("viridis", 1), ("grey", 4)):
        qtbot.mouseClick(box, LEFT)
        view = box.view()
        until(view.isVisible)
        place = view.visualRect(view.model().index(row, 0)).center()
        qtbot.mouseMove(view.viewport(), place)
        qtbot.mouseClick(view.viewport(), LEFT, pos=place)
        until(lambda name=name: window.history.settings.colour_map == name)
        made = colour_map(name)
        inside = xx.cells.rect().center() + QPoint(7, 7)
        near = QPoint(12, scale.height() // 2)
        until(lambda made=made, near=near: away(scale, near, made.sequential) < 12)
        near = QPoint(12, xx.bar.height() - 20)
        until(lambda made=made, near=near: away(xx.bar, near, made.diverging) < 12)
        until(lambda made=made, inside=inside: away(xx.cells, inside, made.diverging) < 12)
        lookup = window.membrane.surface.actor.mapper.lookup_table
        until(lambda made=made, of=lookup: np.array_equal(of.values[:, :3], made.sequential))
        qtbot.wait(1100)  # changes that follow each other sooner are one step to undo
    window.history.stack.undo()
    assert window.history.settings.colour_map == "viridis"


def test_a_pin_is_reached_by_tab_and_fixes_the_range_with_space(
    window: MainWindow, qtbot, until
) -> None:
    xx = window.heatmaps["xx"]
    until(lambda: xx.isVisible() and xx.bar.limits[1] > 1.0)
    xx.lock.setFocus()
    qtbot.keyClick(xx.lock, Qt.Key.Key_Space)
    until(xx.lock.isChecked)
    assert window.history.settings.range_xx == pytest.approx(xx.limit)
    qtbot.mouseClick(xx.lock, LEFT)
    until(lambda: not xx.lock.isChecked())
    assert window.history.settings.range_xx == 0


def test_noise_is_marked_on_every_scale_with_and_without_a_contact(
    window: MainWindow, until
) -> None:
    scales = [window.scale.bar, window.heatmaps["xx"].bar]
    until(lambda: all("one standard deviation" in bar.toolTip() for bar in scales))
    window.history.change("Light", -1, load_case="point", force=0.0)
    until(lambda: not window.session.estimate.contact.present)
    noise = window.display.colouring.noise
    until(lambda: window.display.ranges.deepest() < 1.0)
    found = noise("displacement", window.session.estimate)
    assert 0 < 5 * found <= window.display.ranges.deepest() * 1.2


def test_a_strip_has_no_map_across_and_a_sheet_has_its_maps_again(
    window: MainWindow, until
) -> None:
    maps = window.heatmaps
    until(lambda: all(maps[name].isVisible() for name in ("xx", "yy", "xy")))
    window.requests.set("shape", "strip")
    until(lambda: window.session.status.sensor.layout.patch.strip)
    until(lambda: maps["xx"].isVisible() and not maps["yy"].isVisible())
    assert not maps["xy"].isVisible()
    panel = window.features["membrane"].panel
    box = panel.editor("colour_by")
    listed = [box.itemData(k) for k in range(box.count())]
    assert "xx" in listed
    assert not {"yy", "xy", "residual_yy", "residual_xy"} & {*listed}
    assert window.actions_by_name.why_not("colour-yy")
    window.requests.set("shape", "flat")
    until(lambda: all(maps[name].isVisible() for name in ("xx", "yy", "xy")))
