"""Error bars: one choice of all views, made by its keys, that undo and files leave alone."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QGuiApplication

from kappaskin_app.features.contact.numbers import FACTS
from kappaskin_app.shell.window import MainWindow
from kappaskin_app.shell.window_file import WindowFile
from kappaskin_app.widgets.chart import Chart, ChartAxis, Series
from kappaskin_app.widgets.text import ERROR_BARS, Coverage

CONTROL = Qt.KeyboardModifier.ControlModifier
_BAR = re.compile("\N{PLUS-MINUS SIGN} ([0-9.]+)")


@pytest.fixture(autouse=True)
def one_sigma_again():
    yield
    Coverage.now = ERROR_BARS["sigma"]


def _bar(text: str) -> float:
    found = _BAR.search(text)
    return float(found[1]) if found else math.nan


def test_a_95_percent_interval_is_cores_or_that_of_a_normal_distribution() -> None:
    sigma, wide = ERROR_BARS["sigma"], ERROR_BARS["95"]
    assert (sigma.of(2.0, 4.4), wide.of(2.0, 4.4)) == (2.0, 4.4)
    assert wide.of(2.0) == pytest.approx(3.92)
    assert wide.of(np.array([1.0, 2.0])) == pytest.approx([1.96, 3.92])
    assert (sigma.of_half_width(1.96), wide.of_half_width(1.96)) == pytest.approx((1.0, 1.96))


def test_a_chart_draws_the_error_bars_in_use_and_copies_standard_deviations(qtbot) -> None:
    chart = Chart(ChartAxis("Force", "N"), ChartAxis("Time", "s"), "")
    qtbot.addWidget(chart)
    line = Series("", np.arange(3.0), np.ones(3), band=np.full(3, 0.1))
    seen = {}
    for name, Coverage.now in ERROR_BARS.items():
        chart.show_series([line])
        seen[name] = float(line.off[0])
        assert "standard deviation, N" in chart.table(",")
        assert "0.1\n" in chart.table(",")
    assert seen == pytest.approx({"sigma": 0.1, "95": 0.196})


def test_the_choice_by_keys_reaches_every_view_and_no_step_or_export(
    window: MainWindow, until, qtbot, tmp_path: Path
) -> None:
    window.saver.begin(tmp_path / "window.toml")
    readouts = window.readouts
    numbers = window.numbers
    compare = window.features["compare"].compare
    for name in ("numbers", "compare"):
        window.docks.reveal(name)
    window.requests.set("load_case", "point")
    until(lambda: not math.isnan(_bar(readouts.text("force"))))
    narrow = _bar(readouts.text("force"))
    assert "Force (\N{PLUS-MINUS SIGN}1 \u03c3)" in [
        label.text() for label in readouts.parts["force"][1:]
    ]
    steps = window.history.stack.count()

    qtbot.keyClick(window, Qt.Key.Key_K, CONTROL)
    finder = window.menus.finder
    until(finder.isVisible)
    qtbot.keyClicks(finder.line, "error bars 95")
    qtbot.keyClick(finder.line, Qt.Key.Key_Return)

    assert window.history.settings.error_bars == "95"
    assert window.history.stack.count() == steps
    until(lambda: 1.5 * narrow < _bar(readouts.text("force")) < 2.6 * narrow)
    assert "Force (95 %)" in [label.text() for label in readouts.parts["force"][1:]]
    assert compare.table.horizontalHeaderItem(0).text() == "Error bars: 95 %"
    window.docks.reveal("numbers")
    head = numbers.facts.horizontalHeaderItem
    until(lambda: head(2).text() == "Error bar (95 %)" and numbers.facts.rowCount() > 3)
    numbers.copy.click()
    copied = QGuiApplication.clipboard().text()
    assert copied.startswith(",".join(FACTS))
    assert FACTS[2] == "Standard deviation"
    (row,) = [line for line in copied.splitlines() if line.startswith("Force,")]
    assert float(row.split(",")[2]) < 1.4 * narrow
    window.saver.finish()
    assert WindowFile(tmp_path / "window.toml").read()[0].error_bars == "95"
    window.requests.set("error_bars", "sigma")
    until(lambda: _bar(readouts.text("force")) < 1.4 * narrow)
