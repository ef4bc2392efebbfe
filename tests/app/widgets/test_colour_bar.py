"""The numbers of a scale of colours: true to what they stand at, and read whole."""

import numpy as np
import pytest
from PySide6.QtGui import QColor

from kappaskin_app.shell.colouring import HEALTH
from kappaskin_app.theme import DIVERGING
from kappaskin_app.widgets.colour_bar import ColourBar


def words(bar: ColourBar) -> list[str]:
    return list(bar._numbers.values())  # noqa: SLF001


@pytest.mark.parametrize(
    ("limits", "told"),
    [
        ((-0.5, 0.5), ["\N{MINUS SIGN}0.5", "0", "0.5"]),
        ((0.0, 0.15), ["0", "0.075", "0.15"]),
        ((124.5, 125.5), ["124.5", "125", "125.5"]),
        ((77.4 - 100, 77.4 + 100), ["\N{MINUS SIGN}23", "77", "177"]),
        ((-1500.0, 1500.0), ["\N{MINUS SIGN}1500", "0", "1500"]),
        ((0.0, 0.0), ["0", "0", "0"]),
    ],
)
def test_each_number_is_that_of_its_place(limits, told, qtbot) -> None:
    bar = ColourBar()
    qtbot.addWidget(bar)

    bar.show_scale(DIVERGING, limits, "1/m")

    assert words(bar) == told


def test_a_long_number_is_whole(qtbot) -> None:
    bar = ColourBar()
    qtbot.addWidget(bar)

    bar.show_scale(DIVERGING, (-150_000.0, 150_000.0), "1/m\u00b2")

    bar.resize(bar.width(), 200)
    image, ground = bar.grab().toImage(), bar.palette().window().color().rgb()
    column = [image.pixel(image.width() - 1, y) == ground for y in range(image.height())]
    assert np.all(column)


def test_a_legend_of_kinds_is_whole(qtbot) -> None:
    bar = ColourBar()
    qtbot.addWidget(bar)
    legend = tuple(("#ff0000", words) for words in HEALTH.kinds)

    bar.show_tint(HEALTH, legend)

    bar.resize(bar.minimumSizeHint())
    image = bar.grab().toImage()
    red = [image.pixelColor(8, y) == QColor("#ff0000") for y in range(image.height())]
    assert np.count_nonzero(np.diff(red, prepend=False)) == 2 * len(legend)
