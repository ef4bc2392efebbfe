from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QMenu, QVBoxLayout, QWidget

from kappaskin_app.shell.centre import ActionBanner, BannerAction
from kappaskin_app.shell.recovery import LastSession, Recovery
from kappaskin_app.shell.window import MainWindow
from kappaskin_app.shell.window_file import WindowFile


class Bench(QWidget):
    """An offer above something else, and what was taken of it."""

    def __init__(self) -> None:
        super().__init__()
        self.taken: list[str] = []
        self.offer, self.menu = ActionBanner(), QMenu(self)
        self.recent = self.menu.addAction("press.mcap")
        column = QVBoxLayout(self)
        column.addWidget(self.offer)
        column.addWidget(QWidget(), 1)
        self.resize(900, 300)
        self.show()

    def show_actions(self) -> None:
        one = BannerAction("&Open a scene", "Simulate it", lambda: self.taken.append("scene"))
        two = BannerAction("Begin a &lesson", "Learn it", lambda: self.taken.append("lesson"))
        three = BannerAction("&Recently opened", "The last ones", self.menu)
        self.offer.show_actions("To begin:", "What moves is simulated", [one, two, three])


@pytest.fixture
def bench(qapp: QApplication) -> Iterator[Bench]:
    made = Bench()
    yield made
    made.close()
    made.deleteLater()


def test_what_does_not_fit_in_a_line_goes_into_the_next_and_nothing_is_cut(bench: Bench, until):
    bench.show_actions()
    until(lambda: bench.offer.height() > 0)
    low = bench.offer.height()
    bench.resize(260, 300)
    until(lambda: bench.offer.height() > low)
    parts = [bench.offer.words, *bench.offer.buttons, bench.offer.away]
    places = [part.geometry() for part in parts]
    assert all(bench.offer.rect().contains(place) for place in places)
    assert all(p.width() >= w.sizeHint().width() for p, w in zip(places, parts, strict=True))
    overlaps = [a for n, a in enumerate(places) for b in places[:n] if a.intersects(b)]
    assert overlaps == []


def test_tab_goes_from_one_to_the_next_and_to_what_puts_it_away(bench: Bench, until) -> None:
    bench.show_actions()
    bench.activateWindow()
    bench.offer.buttons[0].setFocus()
    until(bench.offer.buttons[0].hasFocus)
    for widget in [*bench.offer.buttons[1:], bench.offer.away]:
        QTest.keyClick(QApplication.focusWidget(), Qt.Key.Key_Tab)
        assert QApplication.focusWidget() is widget


def test_what_is_taken_is_done_and_the_offer_goes(bench: Bench) -> None:
    bench.show_actions()
    QTest.mouseClick(bench.offer.buttons[1], Qt.MouseButton.LeftButton)
    assert bench.taken == ["lesson"]
    assert not bench.offer.isVisible()


def test_what_is_chosen_from_its_menu_puts_it_away(bench: Bench) -> None:
    bench.show_actions()
    bench.recent.trigger()
    assert not bench.offer.isVisible()


@pytest.mark.full
def test_ways_to_begin_never_cover_the_skin_and_are_not_shown_again_where_unwanted(
    window: MainWindow, tmp_path: Path, until, monkeypatch: pytest.MonkeyPatch
) -> None:
    window.menus.welcome.begin()
    until(lambda: window.display.banner.height() > 20)
    QApplication.processEvents()
    assert len(window.display.banner.buttons) == 6
    above = window.display.banner.mapTo(window, QPoint(0, window.display.banner.height())).y()
    assert above <= window.membrane.mapTo(window, QPoint(0, 0)).y()
    QTest.keyClick(window.display.banner.buttons[0], Qt.Key.Key_Escape)
    assert not window.display.banner.isVisible()
    window.saver.begin(tmp_path / "window.toml")
    window.menus.welcome.begin()
    window.display.banner.buttons[-1].click()
    window.saver.finish()
    assert not WindowFile(tmp_path / "window.toml").read()[0].start
    window.menus.welcome.begin()
    assert not window.display.banner.isVisible()
    window.requests.set("show_start", True)
    with monkeypatch.context() as patch:
        patch.setattr(window.session, "source", "/dev/ttyACM0")  # as the command may say
        window.menus.welcome.begin()
    assert not window.display.banner.isVisible()
    window.menus.welcome.begin()
    assert window.display.banner.isVisible()
    window.display.banner.buttons[2].click()
    until(lambda: window.lesson.isVisible())


@pytest.mark.cases("1024")
@pytest.mark.parametrize("width", [1024, 1280])
def test_the_welcome_is_one_row_that_help_and_the_palette_bring_back(
    window: MainWindow, until, width: int
) -> None:
    banner, finder = window.display.banner, window.menus.finder
    window.resize(width, 700)
    QTest.keyClick(window, Qt.Key.Key_K, Qt.KeyboardModifier.ControlModifier)
    QTest.keyClicks(finder.line, "welcome")
    QTest.keyClick(finder.line, Qt.Key.Key_Return)
    until(lambda: banner.height() > 20)
    QApplication.processEvents()
    assert window.width() == width
    assert len({button.y() for button in banner.buttons}) == 1
    assert not [b for b in banner.buttons if b.width() < b.sizeHint().width()]
    assert banner.buttons[-1].geometry().right() < banner.away.x()


@pytest.mark.full
def test_the_welcome_stays_through_other_work_and_the_presenter_until_a_source_opens(
    window: MainWindow, until
) -> None:
    banner = window.display.banner
    window.menus.welcome.begin()
    window.requests.set("functions_x", 5)
    window.actions_by_name["dock-cost"].trigger()
    QTest.keyClick(window, Qt.Key.Key_F11)
    until(lambda: not banner.isVisible())
    QTest.keyClick(window, Qt.Key.Key_Escape)
    until(banner.isVisible)
    window.session.request_source("sim:sphere")
    until(lambda: not banner.isVisible())
    banner.show_actions("Recorded", "", [BannerAction("Play", "", lambda: None)])
    window.session.request_source("sim:")
    until(lambda: window.session.status.source == "sim:")
    assert banner.isVisible()
    window.actions_by_name["begin"].trigger()
    assert banner.words.text() == "Start with:"


@pytest.mark.full
def test_the_welcome_gives_way_to_what_a_crash_left(window: MainWindow, tmp_path: Path) -> None:
    (tmp_path / "window-1.json").write_text("{}")
    recovering = Recovery(window, tmp_path)
    recovering.offer(LastSession(window.history.settings))
    window.menus.welcome.begin()
    assert window.display.banner.words.text().startswith("The last session")
    recovering.close()
