"""Clicks on the skin: what is measured, and what is cut away."""

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt

from kappaskin.skin import Distances
from kappaskin_app.features.membrane.annotations import distances_text
from kappaskin_app.features.membrane.camera import Projection
from kappaskin_app.shell.window import MainWindow


def pixel_of(window: MainWindow, x: float, y: float) -> QPoint:
    """Where (x, y) in m of the skin is seen."""
    view = window.membrane
    points, _ = view.skin.place(np.array([[x, y]]))
    return QPoint(*(round(v) for v in Projection(view.plotter).to_screen(points[0]).tolist()))


def test_distances_are_told_with_their_units() -> None:
    text = distances_text(Distances(0.0421, 0.0433, -0.00212))
    assert text == "straight 42.10 mm, along the skin 43.30 mm, height \N{MINUS SIGN}2.12 mm"
    assert distances_text(Distances(0.0421, 0.0421, -1e-6)).endswith("height +0.00 mm")


@pytest.mark.full
def test_two_clicks_measure_a_third_begins_anew_and_escape_ends(
    window: MainWindow, until, qtbot
) -> None:
    left, plotter = Qt.MouseButton.LeftButton, window.membrane.plotter
    window.history.change("Rest", -1, load_case="point", force=0.0, noise_kind="none")
    until(lambda: np.abs(window.session.estimate.surface).max() < 1e-6)
    ruler, action = window.view.measurement.ruler, window.actions_by_name["measure"]
    action.trigger()
    assert action.isChecked()
    assert "click a place" in ruler.text.input
    qtbot.mouseClick(plotter, left, pos=pixel_of(window, 0.02, 0.03))
    assert "another" in ruler.text.input
    qtbot.mouseClick(plotter, left, pos=pixel_of(window, 0.06, 0.06))
    until(lambda: ruler.text.input.startswith("straight"))
    until(lambda: float(ruler.text.input.split()[1]) == pytest.approx(50.0, abs=0.8))
    assert ruler.actor.visibility
    qtbot.mouseClick(plotter, left, pos=pixel_of(window, 0.05, 0.05))
    assert "another" in ruler.text.input
    qtbot.keyClick(window, Qt.Key.Key_Escape)
    assert not action.isChecked()
    assert ruler.text.input == ""


@pytest.mark.full
def test_what_is_beyond_the_box_is_cut_away_and_comes_back(
    window: MainWindow, until, colours_in
) -> None:
    whole = colours_in(window, window.membrane)
    window.history.change("Cut", -1, from_x=0.5, to_x=0.5)
    drawn = len(window.membrane.ages)
    until(lambda: len(window.membrane.ages) > drawn + 2)
    assert colours_in(window, window.membrane) < 0.7 * whole
    window.history.stack.undo()
    until(lambda: colours_in(window, window.membrane) > 0.7 * whole)


@pytest.mark.full
def test_what_is_above_a_level_is_cut_away(window: MainWindow, until, colours_in) -> None:
    whole = colours_in(window, window.membrane)

    for cut, seen in (({"to_z": 0.02}, False), ({"to_z": 1.0}, True)):
        window.history.change("Cut", -1, **cut)
        drawn = len(window.membrane.ages)
        until(lambda drawn=drawn: len(window.membrane.ages) > drawn + 2)
        until(lambda seen=seen: (colours_in(window, window.membrane) > 0.7 * whole) == seen)
