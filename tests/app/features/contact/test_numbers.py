import csv

import numpy as np
import pytest
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QApplication

from kappaskin_app.features.contact.numbers import ELEMENTS, FACTS
from kappaskin_app.shell.window import MainWindow


def test_the_table_has_what_the_picture_shows_and_can_be_copied(window: MainWindow, until) -> None:
    window.actions_by_name["dock-numbers"].trigger()
    numbers = window.numbers

    def there() -> bool:
        counts = numbers.elements.rowCount(), numbers.facts.rowCount()
        return counts == (100, 10) and bool(numbers.facts.item(3, 1).text())

    until(there)
    numbers.copy.click()
    rows = list(csv.reader(QGuiApplication.clipboard().text().splitlines()))
    assert rows[0] == list(FACTS)
    assert "Load radius" in [row[0] for row in rows if row]
    assert rows[len(rows) - 101] == list(ELEMENTS)
    read = np.array([row[3:6] for row in rows[-100:]], float)
    assert np.abs(read).max() > 1.0
    assert [row[1:3] for row in rows[-100:-98]] == [["5.0", "5.0"], ["15.0", "5.0"]]
    window.actions_by_name["disconnect"].trigger()
    until(lambda: numbers.elements.rowCount() == 0)  # what is old is no reading


@pytest.mark.full
def test_larger_letters_enlarge_the_window_and_usual_ones_shrink_it_again(
    window: MainWindow, qapp: QApplication, until
) -> None:
    plain, badge = qapp.font().pointSizeF(), window.display.badge.width()
    window.requests.set("letters", 200.0)
    assert qapp.font().pointSizeF() == pytest.approx(2 * plain)
    until(lambda: window.basis.message.fontInfo().pixelSize() > 20)
    until(lambda: window.display.badge.width() > 1.8 * badge)
    window.requests.set("letters", 100.0)
    assert qapp.font().pointSizeF() == plain
    until(lambda: window.display.badge.width() == badge)
