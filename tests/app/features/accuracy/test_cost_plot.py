"""The plot of costs by itself: what is written beside it, and what the mouse means."""

import math

import numpy as np
import pytest
from PySide6.QtCore import QEvent, Qt
from PySide6.QtWidgets import QApplication, QToolTip

from kappaskin.studies import Cost, Setting
from kappaskin_app.features.accuracy.cost_plot import CostPlot
from kappaskin_app.features.accuracy.measurement import Frontier


@pytest.fixture
def plot(qtbot) -> CostPlot:
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
    return plot


def test_a_small_error_is_written_whole(plot: CostPlot) -> None:
    image = plot.grab().toImage()

    ground = plot.palette().window().color()
    column = [image.pixelColor(x, y) == ground for x in (0, 1) for y in range(image.height())]
    assert np.all(column)


def test_the_hand_that_means_a_point_is_not_there_after_the_mouse_left(
    plot: CostPlot, points_at, until
) -> None:
    plot.show()
    at = plot.place_of(plot.frontier.costs[0]).toPoint()
    points_at(plot, at)
    until(lambda: plot.cursor().shape() == Qt.CursorShape.PointingHandCursor)

    QApplication.sendEvent(plot, QEvent(QEvent.Type.Leave))

    assert plot.cursor().shape() == Qt.CursorShape.ArrowCursor
    plot.hide()
    until(lambda: not QToolTip.isVisible())
