"""Charts: what the mouse does, what is written, and what is saved of them."""

import csv
import gc
import io
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from PySide6.QtCore import QEvent, QPoint, QPointF, Qt
from PySide6.QtGui import (
    QContextMenuEvent,
    QGuiApplication,
    QHelpEvent,
    QImage,
    QWheelEvent,
)
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QFileDialog, QMenu, QMessageBox, QToolTip, QWidget

from kappaskin_app.theme import DARK, SERIES, apply_look, letters
from kappaskin_app.widgets.chart import Chart, ChartAxis, ChartLine, Series
from kappaskin_app.widgets.layout import scrolled
from kappaskin_app.widgets.text import duration

X = np.linspace(0.0, 10.0, 11)
LEFT = Qt.MouseButton.LeftButton


@pytest.fixture
def chart(qtbot, until) -> Chart:
    """A line from 0 to 2 N, and one of 1 N with a band."""
    chart = Chart(ChartAxis("Force", "N"), ChartAxis("Time", "s"), "The force over time.")
    qtbot.addWidget(chart)
    chart.resize(420, 260)
    band = np.full(11, 0.1)
    chart.show_series(
        [Series("first", X, X / 5), Series("second", X, np.ones(11), 1, band=band, key=7)], "None"
    )
    chart.show()
    until(lambda: chart.place_of(10.0, 0.0).x() > 300)
    return chart


def ends(chart: Chart) -> tuple[float, float, float, float]:
    """The values at left, right, bottom and top."""
    zero, one = chart.place_of(0.0, 0.0), chart.place_of(1.0, 1.0)
    wide, high = one.x() - zero.x(), zero.y() - one.y()
    canvas = chart.canvas.rect()
    return (
        -zero.x() / wide,
        (canvas.width() - zero.x()) / wide,
        (zero.y() - canvas.height()) / high,
        zero.y() / high,
    )


def roll(chart: Chart, at: QPointF, steps: int) -> None:
    over = QPointF(chart.canvas.mapToGlobal(at.toPoint()))
    none = Qt.MouseButton.NoButton, Qt.KeyboardModifier.NoModifier, Qt.ScrollPhase.NoScrollPhase
    turned = QPoint(0, 120 * steps)
    QApplication.sendEvent(chart.canvas, QWheelEvent(at, over, QPoint(), turned, *none, False))


def turn(chart: Chart, at: QPointF, steps: int, keys=Qt.KeyboardModifier.NoModifier) -> None:
    """Turn the wheel of the window, which passes it to the parents of what does not take it."""
    window = chart.window()
    place = QPointF(window.mapFromGlobal(chart.canvas.mapToGlobal(at.toPoint())))
    QTest.wheelEvent(window.windowHandle(), place, QPoint(0, 120 * steps), QPoint(), keys)


def drag(qtbot, chart: Chart, start: QPoint, by: QPoint) -> None:
    qtbot.mouseMove(chart.canvas, start)
    qtbot.mousePress(chart.canvas, LEFT, pos=start)
    for share in (0.3, 0.6, 1.0):
        qtbot.wait(15)
        qtbot.mouseMove(chart.canvas, start + by * share)
    qtbot.mouseRelease(chart.canvas, LEFT, pos=start + by)


def double_click(qtbot, chart: Chart, at: QPoint) -> None:
    qtbot.mouseDClick(chart.canvas, LEFT, pos=at)
    qtbot.mouseRelease(chart.canvas, LEFT, pos=at)  # Qt's own ends with the second press


def test_the_wheel_zooms_about_the_mouse_and_a_double_click_shows_all(chart, qtbot) -> None:
    was, at = ends(chart), chart.place_of(4.0, 1.2)

    roll(chart, at, 3)

    now = ends(chart)
    assert now[1] - now[0] < 0.8 * (was[1] - was[0])
    assert now[3] - now[2] < 0.8 * (was[3] - was[2])
    still = chart.place_of(4.0, 1.2)
    assert (still - at).manhattanLength() < 1.0
    double_click(qtbot, chart, at.toPoint())
    assert ends(chart) == pytest.approx(was)


@pytest.mark.parametrize("high", [900, 200])
def test_on_a_page_that_scrolls_the_wheel_scrolls_it_and_zooms_with_ctrl(
    chart, qtbot, until, high: int
) -> None:
    below = QWidget()
    below.setFixedHeight(high)
    page = scrolled(chart, below)
    qtbot.addWidget(page)
    chart.setFixedHeight(260)
    page.resize(440, 520)
    page.show()
    until(lambda: chart.place_of(10.0, 0.0).x() > 300 and page.isVisible())
    was, at, bar = ends(chart), chart.place_of(4.0, 1.2), page.verticalScrollBar()
    assert (bar.maximum() > 0) == (high == 900)

    turn(chart, at, -1)

    assert (bar.value() > 0, ends(chart) == pytest.approx(was)) == (high == 900, high == 900)
    value, was = bar.value(), ends(chart)
    turn(chart, at, 1, Qt.KeyboardModifier.ControlModifier)
    assert bar.value() == value
    assert ends(chart) != pytest.approx(was)
    chart.setParent(None)  # or it would go with the page


def test_dragging_pans_and_new_values_leave_the_view_until_a_double_click(chart, qtbot) -> None:
    start, was = chart.place_of(5.0, 0.4).toPoint(), chart.place_of(5.0, 0.4)

    drag(qtbot, chart, start, QPoint(60, -30))

    moved = chart.place_of(5.0, 0.4) - was
    assert (moved.x(), moved.y()) == pytest.approx((60, -30), abs=2)
    chart.show_series([Series("", X, 40 * X)])
    assert (chart.place_of(5.0, 0.4) - was - moved).manhattanLength() < 1e-6
    double_click(qtbot, chart, start)
    assert 0 < chart.place_of(10.0, 400.0).y() < 100


def test_new_values_are_shown_whole_while_nothing_was_zoomed(chart) -> None:
    chart.show_series([Series("", X, 300 - 30 * X)])

    assert ends(chart)[3] > 300
    assert ends(chart)[1] > 10


def test_the_cursor_shows_the_point_under_the_mouse_with_units(
    chart, points_at, until, qtbot
) -> None:
    seen = []
    chart.pointed.connect(seen.append)

    points_at(chart.canvas, chart.place_of(3.0, 1.0).toPoint() + QPoint(2, -3))

    until(lambda: QToolTip.isVisible())
    bars = "\N{PLUS-MINUS SIGN} 0.1 N (\N{PLUS-MINUS SIGN}1 \u03c3)"
    assert QToolTip.text() == f"second\nForce: 1 N {bars}\nTime: 3 s"
    assert (seen[-1].series.key, seen[-1].index) == (7, 3)
    # The chart's own tip does not replace it.
    at = chart.place_of(3.0, 1.0).toPoint()
    over = chart.canvas.mapToGlobal(at)
    QApplication.sendEvent(chart.canvas, QHelpEvent(QEvent.Type.ToolTip, at, over))
    assert QToolTip.text().startswith("second")
    QApplication.sendEvent(chart.canvas, QEvent(QEvent.Type.Leave))
    assert seen[-1] is None
    until(lambda: not QToolTip.isVisible())


def test_a_joined_curve_is_met_between_its_points_and_a_gap_is_not(chart, points_at, until) -> None:
    seen = []
    chart.pointed.connect(lambda point: seen.append(point and point.series.name))
    y = np.where((X > 3.5) & (X < 6.5), np.nan, 1.0)
    chart.show_series([Series("gap", X, y), Series("low", X, np.zeros(11))])

    points_at(chart.canvas, chart.place_of(2.4, 1.0).toPoint())
    points_at(chart.canvas, chart.place_of(5.0, 1.0).toPoint())
    points_at(chart.canvas, chart.place_of(5.6, 0.0).toPoint())

    assert seen == ["gap", None, "low"]
    QApplication.sendEvent(chart.canvas, QEvent(QEvent.Type.Leave))
    until(lambda: not QToolTip.isVisible())


def test_the_cursor_follows_values_that_move_under_the_mouse(chart, points_at, until) -> None:
    points_at(chart.canvas, chart.place_of(3.0, 1.0).toPoint())
    until(lambda: "Force: 1 N" in QToolTip.text())

    chart.show_series([Series("third", X, np.full(11, 1.02)), chart.series[0]])

    until(lambda: QToolTip.text() == "third\nForce: 1.02 N\nTime: 3 s")
    chart.show_series([chart.series[1]])
    until(lambda: not QToolTip.isVisible())
    QApplication.sendEvent(chart.canvas, QEvent(QEvent.Type.Leave))


@pytest.mark.parametrize("how", ["dock closed", "window switched"])
def test_no_tip_of_a_point_comes_again_with_new_values(
    chart, points_at, until, qtbot, how: str
) -> None:
    other = QWidget()
    qtbot.addWidget(other)
    other.setGeometry(900, 600, 100, 100)
    chart.activateWindow()
    until(chart.isActiveWindow)
    points_at(chart.canvas, chart.place_of(3.0, 1.0).toPoint())
    until(lambda: QToolTip.isVisible())

    if how == "dock closed":
        chart.hide()
        QToolTip.hideText()
        chart.show()
    else:
        other.show()
        other.activateWindow()
        until(other.isActiveWindow)
    until(lambda: not QToolTip.isVisible())
    chart.show_series([*chart.series])

    assert not QToolTip.isVisible()


def test_charts_are_loaded_beside_the_window_and_no_object_of_qt_is_made_there() -> None:
    program = """
import gc, sys, threading
from PySide6.QtCore import QObject
from PySide6.QtWidgets import QApplication
from kappaskin_app.widgets.chart import Chart, ChartAxis, Series, load_charts
application = QApplication([])
before = {id(each) for each in gc.get_objects() if isinstance(each, QObject)}
assert "pyqtgraph" not in sys.modules
loading = threading.Thread(target=load_charts)
loading.start()
loading.join()
made = [each for each in gc.get_objects() if isinstance(each, QObject) and id(each) not in before]
parts = [part for name, module in sys.modules.items() if name.startswith("pyqtgraph")
         for part in vars(module).values() if isinstance(part, QObject)]
assert "pyqtgraph" in sys.modules
assert not made and all(part is application for part in parts), (made, parts)
chart = Chart(ChartAxis("Force", "N"), ChartAxis("Time", "s"), "")
chart.show_series([Series("one", *2 * [__import__("numpy").arange(3.0)])])
chart.show()
application.processEvents()
assert chart.place_of(2.0, 2.0).x() > 0
"""
    subprocess.run([sys.executable, "-c", program], check=True)


def test_a_click_chooses_a_point_and_a_drag_none(chart, qtbot) -> None:
    clicked = []
    chart.clicked.connect(clicked.append)
    at = chart.place_of(8.0, 1.0).toPoint()

    drag(qtbot, chart, at, QPoint(40, 0))
    assert clicked == []
    qtbot.mouseClick(chart.canvas, LEFT, pos=at + QPoint(40, 0))

    double_click(qtbot, chart, chart.place_of(2.0, 0.4).toPoint())
    assert [(point.series.name, point.index) for point in clicked] == [("second", 8)]


def test_logarithmic_axes_have_round_ticks_with_units_at_any_zoom() -> None:
    axis = ChartAxis("Time", log=True, text=duration)

    def written(low: float, high: float, size: float) -> list[str]:
        def linear(low: float, high: float, _: float) -> list:
            return [(0.5e-3, [v * 0.5e-3 for v in range(1, 20) if low < v * 0.5e-3 < high])]

        levels = axis.ticks(low, high, size, 40.0, linear)
        return [text for step, ticks in levels for text in axis.tick_texts(ticks, step)]

    micro = "\N{MICRO SIGN}s"
    assert written(-5.0, -3.0, 400) == [
        *(f"10 {micro}", f"100 {micro}", "1 ms"),
        *(f"20 {micro}", f"50 {micro}", f"200 {micro}", f"500 {micro}"),
    ]
    assert written(-6.0, 0.0, 130)[:3] == [f"1 {micro}", "100 \N{MICRO SIGN}s", "10 ms"]
    assert written(-3.05, -2.6, 400) == ["1 ms", "1.5 ms", "2 ms", "2.5 ms"]


def test_ticks_of_a_linear_axis_keep_their_distance() -> None:
    def linear(*_: float) -> list:
        return [(2.0, [-4.0, -2.0, 0.0, 2.0, 4.0]), (1.0, [-3.0])]

    axis = ChartAxis("")
    assert axis.ticks(-5.0, 5.0, 100.0, 20.0, linear) == linear()
    thinned = [(4.0, [-4.0, 0.0, 4.0]), (2.0, [-2.0, 2.0]), (1.0, [-3.0])]
    assert axis.ticks(-5.0, 5.0, 100.0, 21.0, linear) == thinned


@pytest.mark.parametrize(
    ("values", "log", "shown"),
    [
        ([2.5, 4.0], False, (0.0, 5.0)),
        ([-0.3, 4.0], False, (-0.5, 5.0)),
        ([0.0, 0.0], False, (-1.0, 1.0)),
        ([np.nan, np.inf], False, (0.0, 1.5)),
        ([1e-3, 0.0, np.nan, 1e-1], True, (-3.12, -0.88)),
        ([1e-3], True, (-3.3, -2.7)),
        ([], True, (-0.06, 1.06)),
    ],
)
def test_an_upright_axis_has_all_values_with_zero_or_all_positive_ones(values, log, shown) -> None:
    axis = ChartAxis("", log=log)
    assert axis.ends(np.array(values), False, True) == pytest.approx(shown)


def test_one_reading_among_five_thousand_is_seen(chart) -> None:
    values = np.zeros(5001)
    values[2503] = 4.0

    chart.show_series([Series("", np.linspace(-10, 0, 5001), values)])

    image, ink = (
        chart.grab().toImage(),
        np.array([int(SERIES[0][0][k : k + 2], 16) for k in (1, 3, 5)]),
    )
    row = chart.canvas.mapTo(chart, chart.place_of(0.0, 2.0).toPoint()).y()
    colours = [np.array(image.pixelColor(x, row).getRgb()[:3]) for x in range(60, 400)]
    assert min(np.abs(colour - ink).max() for colour in colours) < 110


def test_bands_lines_and_marks_are_drawn_and_go_again(chart) -> None:
    def colours() -> set[str]:
        image = chart.canvas.grab().toImage()
        wide, high = range(0, image.width(), 2), range(image.height())
        return {image.pixelColor(x, y).name() for x in wide for y in high}

    drawn = []
    for shown, lines in (
        ([Series("", X, X)], ()),
        ([Series("", X, X, band=np.full(11, 2.0))], ()),
        ([Series("", X, X)], (ChartLine(5.0, "alert"), ChartLine(5.0, "alert", upright=True))),
        ([Series("", X, X, "good", "", "s", 20.0)], ()),
        ([Series("", X, X)], ()),
    ):
        chart.show_series(shown, lines=lines)
        drawn.append(colours())
    plain, band, lined, marked, again = drawn
    assert again == plain
    assert any(colour not in plain for colour in band)
    assert any(colour not in plain for colour in lined)
    assert "#1b7f4b" in marked - plain


def test_an_empty_chart_says_what_to_do_and_a_full_one_has_a_legend(chart) -> None:
    assert "\u2014</span>\N{NO-BREAK SPACE}first" in chart.heading.text()
    assert chart.heading.text().startswith("Force, N")
    full = chart.grab().toImage()

    chart.show_series([], "Press the skin.")

    assert not chart.canvas.isVisible()
    assert "first" not in chart.heading.text()
    assert (chart.message.isVisible(), chart.message.text()) == (True, "Press the skin.")
    empty = chart.grab().toImage()
    chart.show_series([Series("<b>", X, X / 5)])
    assert chart.canvas.isVisible()
    assert not chart.message.isVisible()
    assert "&lt;b&gt;" in chart.heading.text()
    assert full != empty


def test_theme_and_letters_are_followed(chart, qapp) -> None:
    before, light = qapp.font(), chart.canvas.grab().toImage().pixelColor(200, 100).name()
    narrow = chart.place_of(0.0, 0.0).x()
    try:
        apply_look(DARK)
        qapp.processEvents()
        assert chart.canvas.grab().toImage().pixelColor(1, 1).name() == DARK.base
        assert SERIES[0][1] in chart.heading.text()
        qapp.setFont(letters(200))
        qapp.processEvents()
        chart.grab()
        qapp.processEvents()
        assert chart.place_of(0.0, 0.0).x() > 1.3 * narrow
    finally:
        qapp.setFont(before)
    assert light != DARK.base


def test_at_its_least_size_nothing_that_is_written_is_cut(chart, qapp) -> None:
    chart.resize(chart.minimumSizeHint())
    for _ in range(3):
        qapp.processEvents()
        image = chart.grab().toImage()
    ground = image.pixelColor(1, image.height() - 1)
    edge = [(x, y) for y in range(image.height()) for x in (0, 1, image.width() - 2)]
    edge += [(x, image.height() - 1) for x in range(image.width())]
    assert all(image.pixelColor(*at) == ground for at in edge)
    assert chart.canvas.height() > 4 * chart.fontMetrics().height()


@pytest.fixture
def chosen(monkeypatch, tmp_path) -> Callable[[str], Path]:
    """Answers the question for a file with a name in `tmp_path`."""

    def choose(name: str) -> Path:
        path = tmp_path / name
        answer = (str(path), "")
        monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: answer)
        return path

    return choose


def opened_menu(chart: Chart) -> QMenu:
    """The menu that a right click opens."""
    at = chart.place_of(5.0, 0.5).toPoint()
    over = chart.canvas.mapToGlobal(at)
    event = QContextMenuEvent(QContextMenuEvent.Reason.Mouse, at, over)
    QApplication.sendEvent(chart.canvas, event)
    found = QApplication.activePopupWidget()
    assert isinstance(found, QMenu)
    return found


def take(qtbot, chart: Chart, words: str) -> None:
    """Click an entry of the menu."""
    menu = opened_menu(chart)
    action = next(a for a in menu.actions() if a.text().replace("&", "").startswith(words))
    qtbot.mouseClick(menu, LEFT, pos=menu.actionGeometry(action).center())


def rows_of(text: str, separator: str) -> list[list[str]]:
    return list(csv.reader(io.StringIO(text), delimiter=separator))


HEADS = ["Time, s", "first: Force, N", "second: Force, N", "second: standard deviation, N"]


def test_the_menu_copies_the_data(chart, qtbot) -> None:
    take(qtbot, chart, "Copy data")

    rows = rows_of(QGuiApplication.clipboard().text(), "\t")
    assert rows[0] == HEADS
    assert rows[4] == ["3.0", "0.6", "1.0", "0.1"]
    assert len(rows) == 12


def test_the_menu_saves_a_table(chart, qtbot, chosen) -> None:
    path = chosen("forces")

    take(qtbot, chart, "Save data as CSV")

    rows = rows_of(path.with_suffix(".csv").read_text("utf-8"), ",")
    assert rows[0] == HEADS
    assert rows[-1] == ["10.0", "2.0", "1.0", "0.1"]


def test_the_menu_saves_a_picture(chart, qtbot, chosen) -> None:
    path = chosen("forces.png")

    take(qtbot, chart, "Save picture as PNG")

    image = QImage(str(path))
    assert image.size() == chart.size() * chart.devicePixelRatioF()
    seen = {image.pixelColor(x, y).name() for x in range(0, 420, 2) for y in range(0, 260, 2)}
    assert len(seen) > 10


def test_the_menu_saves_a_drawing_of_lines(chart, qtbot, chosen) -> None:
    path = chosen("forces.svg")

    take(qtbot, chart, "Save picture as SVG")

    root = ElementTree.parse(path).getroot()
    tags = [each.tag.rpartition("}")[2] for each in root.iter()]
    assert tags.count("polyline") + tags.count("path") > 5
    assert "Time, s" in "".join(root.itertext())
    assert "image" not in tags


def test_the_menu_shows_all_again(chart, qtbot) -> None:
    was = ends(chart)
    roll(chart, chart.place_of(4.0, 1.0), 4)

    take(qtbot, chart, "Show all")

    assert ends(chart) == pytest.approx(was)


def test_of_an_empty_chart_nothing_is_saved(chart) -> None:
    chart.show_series([], "None")
    menu = chart.menu()
    assert not any(action.isEnabled() for action in menu.actions())
    menu.deleteLater()


def test_a_file_that_cannot_be_written_is_reported(chart, qtbot, chosen, until) -> None:
    chosen("no folder/forces.csv")

    take(qtbot, chart, "Save data as CSV")

    box = chart.findChild(QMessageBox)
    until(box.isVisible)
    assert "forces.csv" in box.text()
    box.close()


def test_nothing_of_a_deleted_chart_is_left(chart, qapp) -> None:
    def views() -> int:
        gc.collect()
        return sum(type(each).__name__ == "_Box" for each in gc.get_objects())

    before = views()
    assert before >= 1
    for _ in range(3):
        other = Chart(chart.y_axis, chart.x_axis, "")
        other.show_series(chart.series, lines=[ChartLine(1.0)])
        other.show()
        qapp.processEvents()
        other.menu()
        other.close()
        other.deleteLater()
        qapp.sendPostedEvents(None, QEvent.Type.DeferredDelete)
    del other
    assert views() == before


def test_pyqtgraph_is_loaded_by_the_first_chart_with_points_alone() -> None:
    code = """
import sys
import numpy as np
from PySide6.QtWidgets import QApplication
from kappaskin_app import features
from kappaskin_app.widgets.chart import Chart, ChartAxis, Series
features.all_features()
app = QApplication([])
chart = Chart(ChartAxis("a"), ChartAxis("b"), "")
chart.show()
app.processEvents()
before = "pyqtgraph" in sys.modules
chart.show_series([Series("", np.arange(3.0), np.arange(3.0))])
print(before, sys.modules["pyqtgraph"].Qt.QT_LIB)
"""
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert (ran.stdout, ran.stderr) == ("False PySide6\n", "")
