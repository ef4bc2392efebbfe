from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QCursor
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

    def show_actions(self, seconds: float = 0.0) -> None:
        one = BannerAction("&Open a scene", "Simulate it", lambda: self.taken.append("scene"))
        two = BannerAction("Begin a &lesson", "Learn it", lambda: self.taken.append("lesson"))
        three = BannerAction("&Recently opened", "The last ones", self.menu)
        self.offer.show_actions("To begin:", "What moves is simulated", [one, two, three], seconds)


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


def test_it_goes_by_itself_but_not_while_somebody_is_at_it(bench: Bench, until) -> None:
    QCursor.setPos(bench.mapToGlobal(bench.rect().bottomRight()))
    bench.activateWindow()
    until(bench.isActiveWindow)
    bench.show_actions(0.05)
    bench.offer.buttons[0].setFocus()
    assert bench.offer.buttons[0].hasFocus()
    QTest.qWait(120)
    assert bench.offer.isVisible()
    bench.offer.buttons[0].clearFocus()
    until(lambda: not bench.offer.isVisible())


@pytest.mark.full
def test_ways_to_begin_never_cover_the_skin_and_are_not_shown_again_where_unwanted(
    window: MainWindow, tmp_path: Path, until, monkeypatch: pytest.MonkeyPatch
) -> None:
    window.menus.welcome.begin()
    until(lambda: window.display.centre.banner.height() > 20)
    QApplication.processEvents()
    assert len(window.display.centre.banner.buttons) == 6
    above = window.display.centre.banner.mapTo(
        window, QPoint(0, window.display.centre.banner.height())
    ).y()
    assert above <= window.membrane.mapTo(window, QPoint(0, 0)).y()
    QTest.keyClick(window.display.centre.banner.buttons[0], Qt.Key.Key_Escape)
    assert not window.display.centre.banner.isVisible()
    window.saver.begin(tmp_path / "window.toml")
    window.menus.welcome.begin()
    window.display.centre.banner.buttons[-1].click()
    window.saver.finish()
    assert not WindowFile(tmp_path / "window.toml").read()[0].start
    window.menus.welcome.begin()
    assert not window.display.centre.banner.isVisible()
    window.requests.set("show_start", True)
    with monkeypatch.context() as patch:
        patch.setattr(window.session, "source", "/dev/ttyACM0")  # as the command may say
        window.menus.welcome.begin()
    assert not window.display.centre.banner.isVisible()
    window.menus.welcome.begin()
    assert window.display.centre.banner.isVisible()
    window.display.centre.banner.buttons[2].click()
    until(lambda: window.lesson.isVisible())


@pytest.mark.full
def test_ways_to_begin_go_when_something_is_begun_and_give_way_to_what_a_crash_left(
    window: MainWindow, tmp_path: Path
) -> None:
    window.menus.welcome.begin()
    window.requests.set("functions_x", 5)
    assert not window.display.centre.banner.isVisible()
    (tmp_path / "window-1.json").write_text("{}")
    recovering = Recovery(window, tmp_path)
    recovering.offer(LastSession(window.history.settings))
    window.menus.welcome.begin()
    assert window.display.centre.banner.words.text().startswith("The last session")
    window.requests.set("functions_x", 6)
    assert window.display.centre.banner.isVisible()
    recovering.close()


def test_what_is_offered_for_good_stays_though_the_last_offer_was_to_end(
    bench: Bench, qtbot
) -> None:
    QCursor.setPos(bench.mapToGlobal(bench.rect().bottomRight()))
    bench.show_actions(60.0)
    bench.offer.away.click()
    bench.show_actions()
    qtbot.wait(50)
    assert bench.offer.isVisible()
