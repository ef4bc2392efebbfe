"""With letters twice as large, in a window of the usual size, nothing is cut."""

import time
from collections.abc import Iterator

import numpy as np
import pytest
from PySide6.QtWidgets import (
    QAbstractButton,
    QApplication,
    QComboBox,
    QLabel,
    QScrollArea,
    QTableWidget,
    QWidget,
)

from kappaskin.skin import Distances
from kappaskin_app.shell.docks import Title
from kappaskin_app.shell.window import MainWindow
from kappaskin_app.theme import grown
from kappaskin_app.widgets.line import Line

_PATIENCE = 30.0  # s until what was said a moment ago has the room it asks for


@pytest.fixture(scope="module")
def shared(qapp: QApplication, until, window_class) -> Iterator[MainWindow]:
    qapp.setStyle("Fusion")
    window = window_class("sim:")
    window.show()
    until(lambda: bool(window.display.status_bar.object.text()))
    window.requests.set("letters", 200.0)
    yield window
    window.requests.set("letters", 100.0)
    window.close()
    window.deleteLater()


@pytest.fixture
def large(shared: MainWindow) -> Iterator[MainWindow]:
    """The one window of these tests."""
    shared.show()
    _settle()
    yield shared
    shared.hide()


def _settle() -> None:
    for _ in range(4):
        QApplication.processEvents()


def cut(inside: QWidget) -> list[str]:
    """What is seen of `inside` and goes on to have less room than it needs."""
    end = time.monotonic() + _PATIENCE
    while (found := _cut_now(inside)) and time.monotonic() < end:
        _settle()
    return found


def _cut_now(inside: QWidget) -> list[str]:
    kinds = (QAbstractButton, QLabel, QComboBox)
    seen = [one for kind in kinds for one in inside.findChildren(kind) if one.isVisible()]
    texts = [one for one in seen if not (isinstance(one, QLabel) and one.wordWrap())]
    return [
        f"{type(one).__name__} {one.objectName()} {getattr(one, 'text', str)()}"
        for one in texts
        if isinstance(one, QComboBox) or one.text()
        if one.width() < one.minimumSizeHint().width() - 1
        or one.height() < one.fontMetrics().height() - 1
    ]


@pytest.mark.full
def test_the_header_is_read_whole(large: MainWindow) -> None:
    large.readouts.show_health(501.0, 42.0, 0.0123, 0.0004, lost=1234, skipped=5678)
    lines = [line for line in large.readouts.findChildren(Line) if not line.whole]
    assert [line.text() for line in lines] == []


def test_titles_of_docks_have_those_letters(large: MainWindow) -> None:
    size = QApplication.font().pointSizeF()
    titles = [dock.findChild(Title).words for dock in large.docks.by_name().values()]
    assert {title.font().pointSizeF() for title in titles} == {size}
    seen = [title.height() for title in titles if title.isVisible()]
    assert seen
    assert min(seen) >= large.fontMetrics().height()


@pytest.mark.cases("cost")
@pytest.mark.parametrize(
    "name", ["cost", "stability", "scene", "health", "numbers", "log", "compare", "design"]
)
def test_a_dock_below_shows_all_or_scrolls_it(large: MainWindow, name: str) -> None:
    large.docks.reveal(name)
    _settle()
    wrong = cut(large.docks[name])
    rows = [
        (table.objectName(), table.rowHeight(0))
        for table in large.docks[name].findChildren(QTableWidget)
        if table.isVisible() and table.rowCount()
        if table.rowHeight(0) < table.fontMetrics().height()
    ]
    size = large.width(), large.height()
    large.docks[name].hide()
    _settle()
    assert (wrong, rows) == ([], [])
    assert size == (1280, 800)


def test_ways_to_begin_stand_whole_above_a_dock(large: MainWindow) -> None:
    large.docks.reveal("design")
    large.menus.welcome.offer()
    _settle()
    wrong, size = cut(large.display.banner), (large.width(), large.height())
    low = max(button.geometry().bottom() for button in large.display.banner.buttons)
    inside = low < large.display.banner.height()
    large.display.banner.hide()
    large.docks["design"].hide()
    assert (wrong, inside, size) == ([], True, (1280, 800))


def test_the_pages_beside_the_skin_show_all_or_scroll_it(large: MainWindow) -> None:
    wrong = []
    for page in range(large.panels.count()):
        large.panels.setCurrentIndex(page)
        _settle()
        wrong += cut(large.panels.widget(page))
    large.panels.setCurrentIndex(0)
    assert wrong == []


def test_how_long_the_sides_of_the_skin_are_is_read_whole(large: MainWindow) -> None:
    plotter, sides = large.membrane.plotter, large.membrane.sides
    wide = plotter.render_window.GetSize()[0]
    for label in sides.labels:
        across = [0, 0, 0, 0]
        label.GetBoundingBox(plotter.renderer, across)
        at = label.GetPositionCoordinate().GetComputedViewportValue(plotter.renderer)[0]
        assert across[1] > across[0]
        assert at + across[0] >= 0, label.input
        assert at + across[1] <= wide, label.input


def test_a_step_of_a_calibration_is_not_wider_than_its_page(large: MainWindow) -> None:
    large.panels.reveal(large.calibrate)
    panel = large.calibrate
    page = panel.parentWidget()
    while not isinstance(page, QScrollArea):
        page = page.parentWidget()
    for phase in (panel.steps, panel.result_page, panel.start):
        for each in (panel.start, panel.steps, panel.result_page):
            each.setVisible(each is phase)
        _settle()
        assert page.minimumWidth() >= page.widget().minimumSizeHint().width()
    large.panels.setCurrentIndex(0)


def test_what_is_written_in_the_picture_is_read_whole(large: MainWindow) -> None:
    membrane, ruler = large.membrane, large.view.measurement.ruler
    wide, high = membrane.plotter.render_window.GetSize()
    found = Distances(0.0849, 0.0851, -0.00212)
    ruler.show(membrane.skin, np.array([(0.02, 0.02), (0.08, 0.08)]), 0.0, found)
    membrane.show_caption("Colours: mode 64 of 64, no measurement")
    membrane.alarm.show("LOST 12 s\n" + 6 * "no message came from the device; " + "end")
    for text in (ruler.text, membrane.caption, membrane.alarm.actor):
        across = [0, 0, 0, 0]
        text.GetBoundingBox(membrane.plotter.renderer, across)
        assert across[1] - across[0] < wide, text.input
        assert across[3] - across[2] < high, text.input
    assert membrane.alarm.actor.input.endswith("end")
    assert membrane.alarm.actor.prop.font_size == grown(15)
    assert "\N{MINUS SIGN}2.12 mm" in ruler.text.input
    ruler.hide()
    membrane.show_caption("")
    membrane.alarm.show("")
