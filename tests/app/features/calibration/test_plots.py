"""What a calibration draws, in letters twice as large: nothing of what is written is cut."""

from collections.abc import Iterator

import numpy as np
import pytest
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QApplication, QVBoxLayout, QWidget

from kappaskin import Patch, SensorLayout
from kappaskin.scenes.cylinders import schedule
from kappaskin_app.features.calibration.plots import (
    LOOP_AXES,
    LOOP_TIP,
    CylinderView,
    PassMap,
    loop_series,
)
from kappaskin_app.theme import letters
from kappaskin_app.widgets.chart import Chart
from kappaskin_app.widgets.parts import Heading


@pytest.fixture
def large(qapp: QApplication) -> Iterator[QApplication]:
    before = qapp.font()
    qapp.setFont(letters(200))
    yield qapp
    qapp.setFont(before)


def inked(view: QWidget) -> np.ndarray:
    """Which px (height, width) are not the ground, of a `view` as small as it may be."""
    view.resize(view.minimumSizeHint())
    image = view.grab().toImage()
    ground = QColor(view.palette().window().color()).rgb()
    wide, high = range(image.width()), range(image.height())
    return np.array([[image.pixel(x, y) != ground for x in wide] for y in high])


def test_a_loop_is_filled_falling_and_open_rising_and_broken_between_cycles() -> None:
    applied = np.array([0.0, 50.0, 100.0, 50.0, 0.0, 40.0])
    read, back = applied + np.array([0, 0, 0, 9, 9, 0]), np.array([0, 0, 0, 1, 1, 0], bool)

    falling, rising, line, joined = loop_series(
        applied, read, back, np.array([1, 0, 0, 0, 0, 1], bool), 2.0, 1.0
    )

    assert (falling.x.tolist(), falling.filled) == ([0, 50, 100, 40], True)
    assert (rising.y.tolist(), rising.filled) == ([59, 9], False)
    assert (line.x.tolist(), line.y.tolist()) == ([-100, 100], [-199, 201])
    assert np.isnan(joined.x).tolist() == [False] * 5 + [True, False]


def test_a_channel_without_readings_says_so(qtbot) -> None:
    plot = Chart(*LOOP_AXES, LOOP_TIP)
    qtbot.addWidget(plot)
    none, flags = np.full(3, np.nan), np.array([True, False, False])
    plot.show_series(
        loop_series(np.arange(3.0), none, flags, flags, np.nan, np.nan), "No readings."
    )
    assert plot.is_empty


def test_titles_above_passed_channels_are_whole(large: QApplication, qtbot) -> None:
    passed = PassMap()
    qtbot.addWidget(passed)

    passed.show_channels(SensorLayout.regular(Patch(0.1, 0.1), 10, 10), {3: "dead"}, [""] * 300)

    ink = inked(passed)
    high = passed.fontMetrics().height()
    assert not ink[0].any()
    assert ink[:high].any()
    between = np.flatnonzero(~ink[:high].any(axis=0))
    thirds = np.linspace(0, ink.shape[1], 4)[1:-1]
    assert all(np.abs(between - third).min() < 5 for third in thirds)


def test_what_is_written_beside_a_cylinder_is_whole(large: QApplication, qtbot) -> None:
    view = CylinderView()
    qtbot.addWidget(view)
    bent = next(step for step in schedule((0.02, 0.05, 0.1)) if not step.flat)

    view.show_step(bent, Patch(0.1, 0.1))

    ink = inked(view)
    assert not ink[:, :4].any()
    assert not ink[-2:].any()


def test_a_heading_grows_with_the_other_letters(large: QApplication, qtbot) -> None:
    alone, inside, around = Heading(1.5), Heading(1.5), QWidget()
    QVBoxLayout(around).addWidget(inside)
    for each in (alone, around):
        qtbot.addWidget(each)
        each.show()
    for percent in (100, 200):
        large.setFont(letters(percent))
        large.processEvents()
        for heading in (alone, inside):
            assert heading.font().pointSizeF() == 1.5 * letters(percent).pointSizeF()
