"""The numbers of a scale of colours: true to what they stand at, and read whole."""

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor

from kappaskin_app.shell.colouring import HEALTH
from kappaskin_app.widgets.colour_bar import ColourBar, LockButton
from kappaskin_app.widgets.tint import Tint


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

    bar.show_tint(Tint("diverging", limits, "1/m"))

    assert words(bar) == told


def test_a_long_number_is_whole(qtbot) -> None:
    bar = ColourBar()
    qtbot.addWidget(bar)

    bar.show_tint(Tint("diverging", (-150_000.0, 150_000.0), "1/m\u00b2"))

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


def test_the_noise_floor_is_marked_beside_the_scale_and_named_in_the_tooltip(qtbot) -> None:
    bar = ColourBar()
    qtbot.addWidget(bar)
    bar.resize(60, 240)
    ink = bar.palette().windowText().color()

    def marked() -> int:
        image = bar.grab().toImage()
        return sum(image.pixelColor(1, y) == ink for y in range(16, 240))

    bar.show_tint(Tint("diverging", (-5.0, 5.0), "1/m"))
    assert (marked(), bar.toolTip()) == (0, "")

    bar.show_tint(Tint("diverging", (-5.0, 5.0), "1/m", noise=1.0))
    assert marked() == pytest.approx(0.2 * 200, abs=5)
    assert "one standard deviation, 1 1/m" in bar.toolTip()
    bar.show_tint(Tint("sequential", (0.0, 5.0), "mm", noise=1.0))
    assert marked() == pytest.approx(0.2 * 200, abs=5)
    bar.show_tint(Tint("pulled", (-5000.0, 0.0), "mm", noise=0.01))
    assert 2 <= marked() <= 4


def test_the_pin_fixes_a_range_by_mouse_and_by_key_and_looks_so(qtbot) -> None:
    pin = LockButton()
    qtbot.addWidget(pin)
    pin.wanted.connect(pin.show_locked)
    pin.show()
    qtbot.waitExposed(pin)
    free, tip = pin.grab().toImage(), pin.toolTip()
    wished: list[bool] = []
    pin.wanted.connect(wished.append)

    qtbot.mouseClick(pin, Qt.MouseButton.LeftButton)

    assert wished == [True]
    assert pin.isChecked()
    assert not pin.text()
    assert pin.toolTip() != tip
    assert pin.grab().toImage() != free
    assert pin.focusPolicy() & Qt.FocusPolicy.TabFocus
    qtbot.keyClick(pin, Qt.Key.Key_Space)
    assert wished == [True, False]
    assert not pin.isChecked()
    assert pin.toolTip() == tip
    assert pin.accessibleName()
