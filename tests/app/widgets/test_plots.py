"""Curves of many readings: drawn by what is seen of them, and no reading is lost."""

import numpy as np
import pytest
from PySide6.QtGui import QColor

from kappaskin_app.theme import SERIES
from kappaskin_app.widgets.plots import Curve, CurvePlot, as_seen


def test_one_reading_among_five_thousand_is_seen(qtbot) -> None:
    plot = CurvePlot("Curvature", "1/m", True, "tip")
    qtbot.addWidget(plot)
    plot.resize(350, 180)
    values = np.zeros(5001)
    values[2503] = 4.0

    plot.show_curves(np.linspace(-10, 0, 5001), [Curve("", 0, values)], (-10, 0), "s")

    image, ink = plot.grab().toImage(), np.array(QColor(SERIES[0][0]).getRgb()[:3])
    colours = [np.array(image.pixelColor(x, 50).getRgb()[:3]) for x in range(60, 340)]
    assert min(np.abs(colour - ink).max() for colour in colours) < 100


def test_of_a_dense_curve_lowest_and_highest_of_each_pixel_are_left() -> None:
    rng = np.random.default_rng(0)
    x, y = np.linspace(46.3, 142.0, 5001), rng.normal(0, 1, 5001)

    u, v = as_seen(x, y)

    columns = np.floor(x).astype(int)
    for column in np.unique(columns):
        left = v[np.floor(u) == column]
        assert left.tolist() == [y[columns == column].min(), y[columns == column].max()]


def test_a_curve_of_few_readings_goes_through_each() -> None:
    x = np.linspace(46.3, 142.0, 50)

    assert as_seen(x, np.sin(x))[1].tolist() == np.sin(x).tolist()


@pytest.mark.parametrize("most", [1.5e-3, 1.5e3])
def test_numbers_beside_a_curve_are_whole(most: float, qtbot) -> None:
    plot = CurvePlot("Curvature", "1/m", True, "tip")
    qtbot.addWidget(plot)
    plot.resize(350, 180)

    plot.show_curves(np.array([0.0, 1.0]), [Curve("", 0, np.array([0.0, most]))], (0.0, 1.0), "s")

    image, line = plot.grab().toImage(), plot.fontMetrics().height()
    ground = plot.palette().window().color()
    lowest = [
        image.pixelColor(x, y) == ground for x in (0, 1) for y in range(line + 4, image.height())
    ]
    assert all(lowest)
