"""What colours the skin and the heatmaps, from the choice to the picture."""

import time
from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtWidgets import QApplication

from kappaskin import Patch, SensorLayout
from kappaskin.estimation import FAULTS
from kappaskin_app.features.heatmaps.heatmap import Heatmap
from kappaskin_app.features.membrane.surface import ElementCells
from kappaskin_app.shell.colouring import HEALTH, HEALTH_COLOURS, SHADES, Ranges
from kappaskin_app.shell.form import SeveralButton
from kappaskin_app.shell.selection import SkinMap
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.settings.shown import COLOURS
from kappaskin_app.shell.window import MainWindow
from kappaskin_app.theme import SATURATED
from kappaskin_app.widgets.tint import Tint

ALL = tuple(name for name, _ in COLOURS)


def test_every_colour_has_a_shade_that_explains_itself_and_a_range() -> None:
    assert tuple(SHADES) == ALL
    for shade in SHADES.values():
        assert shade.tip.endswith(".")
        assert shade.name == "health" or hasattr(Settings(), f"range_{shade.name}")


def test_colours_go_both_ways_from_a_skin_at_rest() -> None:
    tint = SHADES["first"].tint(10.0, at_rest=77.5)
    assert tint.limits == (67.5, 87.5)
    white = tint.rgb(np.array([77.5]), "#000000")[0]
    assert white.min() > 240
    assert SHADES["error_bar"].tint(0.1).limits == (0.0, 0.1)
    assert SHADES["displacement"].tint(2.0, pulled=True).limits == (-2.0, 0.0)


def test_each_kind_of_fault_has_one_colour_of_its_own() -> None:
    kinds = np.arange(len(FAULTS), dtype=float)
    assert HEALTH.rgb(kinds, "#000000").tolist() == HEALTH_COLOURS.tolist()
    assert len(np.unique(HEALTH_COLOURS, axis=0)) == len(FAULTS)
    assert len(HEALTH.kinds) == len(FAULTS)


def test_a_reading_on_a_rail_has_its_own_colour_and_an_entry_in_the_legend() -> None:
    values, railed = np.array([1.0, np.nan, np.nan]), np.array([False, True, False])
    tint = SHADES["xx"].tint(1.0)
    rgb = tint.rgb(values, "#59626d", railed)
    assert [f"#{r:02x}{g:02x}{b:02x}" for r, g, b in rgb[1:].tolist()] == [SATURATED, "#59626d"]
    told = tint.legend(values, "#59626d", railed)
    assert told == ((SATURATED, "saturated"), ("#59626d", "none"))
    assert tint.legend(values[:1], "#59626d", railed[:1]) == ()


def test_one_range_for_all_is_that_of_the_largest_shown() -> None:
    ranges, alone = Ranges(), Settings(maps=("xx", "yy"), colour_by="displacement")
    together = Settings(maps=("xx", "yy"), colour_by="displacement", one_range=True)
    ranges.limit("xy", np.array([90.0]), alone, 0.0)  # not shown
    ranges.limit("xx", np.array([2.0]), alone, 0.0)
    ranges.limit("yy", np.array([6.0]), alone, 0.0)
    assert ranges.limit("xx", np.array([2.0]), alone, 0.0) == 2.0
    assert ranges.limit("xx", np.array([2.0]), together, 0.0) == 7.0
    assert ranges.limit("gaussian", np.array([2.0]), together, 0.0) == 2.0


def test_a_regular_grid_has_a_pixel_for_each_element_and_others_their_nearest() -> None:
    cells = ElementCells()
    cells.set_layout(SensorLayout.regular(Patch(0.1, 0.06), 4, 3))
    assert cells.texture.dimensions == (4, 3)
    layout = SensorLayout.scattered(Patch(0.1, 0.1), [[0.02, 0.05], [0.09, 0.05]])
    cells.set_layout(layout)
    cells.show(np.array([[255, 0, 0], [0, 0, 255]], np.uint8))
    picture = cells.pixels.reshape(*cells.texture.dimensions[::-1], 3)
    red = (picture[:, :, 0] == 255).mean(axis=0)
    edge = np.flatnonzero(np.diff(red))
    assert set(red) == {0.0, 1.0}
    assert edge / len(red) == pytest.approx([0.55], abs=0.01)  # half way between both


def test_a_menu_of_several_stays_open_and_tells_all_that_are_ticked(
    qapp: QApplication, qtbot
) -> None:
    button, told = SeveralButton((("a", "First"), ("b", "Second"), ("c", "Third"))), []
    button.chosen.connect(told.append)
    button.show_chosen(("b",))
    assert (button.text(), told) == ("Second", [])
    menu = button.menu()
    menu.popup(QPoint(0, 0))
    menu.setActiveAction(button.ticks["c"])
    qtbot.keyClick(menu, Qt.Key.Key_Space)
    menu.setActiveAction(button.ticks["a"])
    qtbot.keyClick(menu, Qt.Key.Key_Space)
    assert menu.isVisible()
    menu.close()
    assert told == [("b", "c"), ("a", "b", "c")]
    assert button.text() == "First and 2 more"
    button.deleteLater()


def test_a_map_of_health_tells_which_element_is_what(qapp: QApplication) -> None:
    heatmap = Heatmap("health")
    heatmap.show_layout(SensorLayout.regular(Patch(0.1, 0.1), 2, 2))
    kinds = np.array([0.0, 6.0, 0.0, 2.0])
    heatmap.show_values(kinds, HEALTH)
    heatmap.show_reading(kinds)
    assert heatmap.value.text() == "2 faulty"
    assert [words for _, words in heatmap.bar.legend] == ["OK", "stuck", "dead"]
    heatmap.show_element(1)
    heatmap.show_reading(kinds)
    assert heatmap.value.text() == "dead at (75, 25) mm"


@pytest.mark.full
def test_only_maps_that_are_shown_are_computed(window: MainWindow, until, monkeypatch) -> None:
    asked, found = set[str](), window.display.colouring.of_elements
    monkeypatch.setattr(
        window.display.colouring,
        "of_elements",
        lambda name, estimate: asked.add(name) or found(name, estimate),
    )
    window.history.change("Maps", -1, maps=("yy", "gaussian"))
    asked.clear()
    until(lambda: len(asked) == 2)
    drawn = len(window.membrane.ages)
    until(lambda: len(window.membrane.ages) > drawn + 5)
    assert asked == {"yy", "gaussian"}
    assert [name for name, map_ in window.heatmaps.items() if map_.isVisible()] == [
        "yy",
        "gaussian",
    ]
    window.history.stack.undo()
    assert window.heatmaps["xy"].isVisible()


@pytest.mark.full
def test_every_colour_is_drawn_smooth_and_per_element(window: MainWindow, until) -> None:
    for name in ALL:
        for how in ("smooth", "elements"):
            window.history.change("Colour", -1, colour_by=name, colour_from=how)
            label, symbol = SHADES[name].label, SHADES[name].symbol
            told = label if label == symbol else f"{label}<br><b>{symbol}</b>"
            until(lambda told=told: window.scale.what.text() == told)
            drawn = len(window.membrane.ages)
            until(lambda drawn=drawn: len(window.membrane.ages) > drawn + 1)
    window.history.change("Colour", -1, colour_by="error_bar", colour_from="smooth")
    until(lambda: window.scale.bar.limits[1] > 0.005)
    assert window.membrane.caption.input == ""


@pytest.mark.full
def test_all_ranges_are_locked_in_one_step_and_freed_in_another(window: MainWindow, until) -> None:
    until(lambda: window.scale.bar.limits == (0.0, 5.0))
    time.sleep(0.1)
    lock = window.actions_by_name["lock-ranges"]
    lock.trigger()
    settings = window.history.settings
    assert settings.range_displacement == pytest.approx(5e-3)
    assert min(settings.range_xx, settings.range_yy, settings.range_xy) > 0
    assert settings.range_mean == 0
    lock.trigger()
    assert window.history.settings.range_xx == 0
    window.history.stack.undo()
    window.history.stack.undo()
    assert window.history.settings.range_displacement == 0


@pytest.mark.full
def test_only_ranges_that_are_seen_are_locked(window: MainWindow, until) -> None:
    window.docks["curvature"].hide()
    values, tint = np.zeros(window.session.estimate.surface.shape), Tint("diverging", (-1, 1), "")
    window.selection.show_map(SkinMap(values, tint, "A shape"))
    until(lambda: window.scale.bar.limits == (-1.0, 1.0))
    lock = window.actions_by_name["lock-ranges"]

    lock.trigger()

    settings = window.history.settings
    assert [settings.range_displacement, settings.range_xx, settings.range_yy] == [0, 0, 0]
    window.selection.show_map(None)
    until(lambda: window.scale.bar.limits != (-1.0, 1.0))
    lock.trigger()
    assert window.history.settings.range_displacement == pytest.approx(5e-3)
    assert window.history.settings.range_xx == 0


@pytest.mark.full
def test_a_difference_that_nobody_knows_is_said_not_drawn(window: MainWindow, until) -> None:
    unknown = np.full(window.session.estimate.surface.shape, np.nan)
    window.history.change("Colour", -1, colour_by="difference", colour_from="smooth")
    captions: list[str] = []

    def show() -> None:
        if not captions:
            window.display.show_estimate(replace(window.session.estimate, true_surface=unknown))
            captions.append(window.membrane.caption.input)

    # Only here it is sure to be ready: the next picture is asked for at once.
    window.membrane.drawn.connect(show)
    until(lambda: bool(captions))
    assert "not known" in captions[0]
    until(lambda: window.membrane.caption.input == "")
