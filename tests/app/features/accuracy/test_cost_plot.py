"""The plot of costs by itself: its points, steps and legend, and what the mouse means."""

import math
from dataclasses import replace

import pytest
from PySide6.QtCore import QEvent, QPoint, Qt
from PySide6.QtWidgets import QApplication, QToolTip

from kappaskin.studies import Cost, Setting
from kappaskin_app.features.accuracy.cost_plot import CostPlot, cost_text
from kappaskin_app.features.accuracy.measurement import Frontier


@pytest.fixture
def plot(qtbot, until) -> CostPlot:
    """A plot of two settings that are off by 1 and by 100 um."""
    plot = CostPlot()
    qtbot.addWidget(plot)
    plot.resize(700, 300)
    setting = Setting("least-squares", (8, 8))
    costs = tuple(
        Cost(setting, 100, 300, 1e-3, 1e-3, time, 1e-3, 1000, 0.0, rms, 0.0, 0.0, rms, 1e-3)
        for time, rms in ((1e-5, 1e-4), (1e-3, 1e-6))
    )
    plot.show_costs(Frontier(costs, costs), None, (math.nan, math.nan))
    plot.show()
    until(lambda: plot.place_of(1e-3, 1e-6).x() > 400)
    return plot


def test_points_have_tips_and_are_clicked_and_the_legend_says_what_they_are(
    plot: CostPlot, points_at, until, qtbot
) -> None:
    chosen = []
    plot.chosen.connect(chosen.append)
    _, second = plot.frontier.costs
    at = plot.place_of(second.time_per_frame, second.rms).toPoint()

    points_at(plot.canvas, at + QPoint(-6, 1))
    until(QToolTip.isVisible)

    assert QToolTip.text() == cost_text(second)
    assert plot.canvas.cursor().shape() == Qt.CursorShape.PointingHandCursor
    qtbot.mouseClick(plot.canvas, Qt.MouseButton.LeftButton, pos=at + QPoint(-6, 1))
    assert chosen == [second]
    for name in ("Least squares", "filled: own elements", "best for its time"):
        assert name.replace(" ", "\N{NO-BREAK SPACE}") in plot.heading.text()
    QApplication.sendEvent(plot.canvas, QEvent(QEvent.Type.Leave))
    assert plot.canvas.cursor().shape() == Qt.CursorShape.ArrowCursor
    until(lambda: not QToolTip.isVisible())


def test_the_best_settings_are_joined_by_steps(plot: CostPlot) -> None:
    steps = plot.series[-1]
    assert steps.x.tolist() == [1e-5, 1e-5, 1e-3, 1e-3, 1e-3]
    assert steps.y.tolist() == [1e-4, 1e-4, 1e-4, 1e-6, 1e-6]


def test_elements_of_the_setting_in_use_are_filled_and_it_has_a_ring(plot: CostPlot) -> None:
    costs = plot.frontier.costs
    other = replace(costs[1], setting=replace(costs[1].setting, elements=(6, 6)))

    plot.show_costs(Frontier((costs[0], other), costs[:1]), costs[0], (1e-5, 2e-5))

    points = [(each.filled, each.key) for each in plot.series if each.key]
    assert points == [(True, costs[:1]), (False, (other,))]
    named = {each.name: each for each in plot.series}
    assert named["in use, predicted"].x.tolist() == [1e-5]
    assert named["in use, measured"].x.tolist() == [2e-5]


def test_without_costs_there_is_a_text(plot: CostPlot) -> None:
    plot.show_costs(Frontier(), None, (math.nan, math.nan), "Measuring")
    assert plot.is_empty
