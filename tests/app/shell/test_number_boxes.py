"""Numbers as they are typed or pasted into a box."""

import pytest
from PySide6.QtCore import QLocale, Qt

from kappaskin_app.shell.form import RealBox, WholeBox


def entered(qtbot, box: WholeBox | RealBox, text: str, typed: bool = False) -> float:
    """What a box of 1 to 2000, at 42, comes to when a text is typed or pasted over that."""
    qtbot.addWidget(box)
    box.setLocale(QLocale.c())
    box.setRange(1, 2000)
    box.setValue(42)
    box.selectAll()
    if typed:
        qtbot.keyClicks(box, text)
    else:
        box.lineEdit().insert(text)
    qtbot.keyClick(box, Qt.Key.Key_Return)
    return box.value()


@pytest.mark.parametrize(
    ("text", "value"),
    [("7", 7), ("7.5", 8), ("1e3", 1000), ("1_0", 10), ("9999", 2000), ("-3", 1), ("nan", 42)],
)
def test_a_whole_number_is_the_nearest_to_what_is_entered(qtbot, text: str, value: int) -> None:
    assert entered(qtbot, WholeBox(), text) == value


@pytest.mark.parametrize(
    ("text", "value"), [("7.5", 7.5), ("7,5", 7.5), ("1e3", 1000), ("1_0", 10), ("1e9", 2000)]
)
def test_a_number_is_what_is_entered(qtbot, text: str, value: float) -> None:
    assert entered(qtbot, RealBox(), text) == value


@pytest.mark.parametrize("box", [WholeBox, RealBox])
@pytest.mark.parametrize(
    ("text", "value"), [("1e3", 1000), ("1e+2", 100), (".2e2", 20), ("12e", 12), ("1x3", 13)]
)
def test_a_number_is_what_is_typed_key_by_key(qtbot, box, text: str, value: float) -> None:
    assert entered(qtbot, box(), text, typed=True) == value
