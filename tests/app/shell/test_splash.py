import gc
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtGui import QGuiApplication, QImage
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

from kappaskin_app.launch import _all_stays, _theme_in
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.splash import Splash
from kappaskin_app.shell.window_file import WindowFile, WindowState
from kappaskin_app.theme import DARK, LIGHT, THEMES, Theme, apply_look


class Window(QObject):
    """What a splash asks of a window: whether an estimate is shown, and when it is drawn."""

    drawn = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.display, self.estimate = self, None

    def estimate_shown(self) -> object:
        return self.estimate


@pytest.fixture
def splash(qapp: QApplication) -> Iterator[Splash]:
    made = Splash()
    made.show()
    yield made
    made.close()


def test_it_says_at_once_what_is_loaded_and_all_of_it(splash: Splash) -> None:
    splash.say("Loading 3-D graphics (VTK)")
    assert splash.words.text().startswith("Loading 3-D graphics (VTK)")
    assert splash.words.width() >= splash.words.sizeHint().width()
    screen = QGuiApplication.primaryScreen().geometry()
    assert (splash.geometry().center() - screen.center()).manhattanLength() <= 2


def test_it_goes_when_the_first_estimate_is_drawn_and_no_sooner(splash: Splash) -> None:
    window = Window()
    splash.finish(window)
    window.display.drawn.emit()
    assert splash.isVisible()
    window.estimate = "an estimate"
    window.display.drawn.emit()
    assert not splash.isVisible()


def test_it_goes_where_no_estimate_comes(
    splash: Splash, until: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("kappaskin_app.shell.splash._MOST", 20)
    splash.finish(window := Window())
    until(lambda: not splash.isVisible())
    assert window.estimate is None


def test_a_click_puts_it_away_and_does_not_end_the_program(splash: Splash) -> None:
    assert not splash.testAttribute(Qt.WidgetAttribute.WA_QuitOnClose)
    QTest.mouseClick(splash, Qt.MouseButton.LeftButton)
    assert not splash.isVisible()


@pytest.mark.parametrize("theme", [LIGHT, DARK], ids=["light", "dark"])
def test_it_is_in_the_colours_of_its_theme(qapp: QApplication, theme: Theme) -> None:
    apply_look(theme)
    splash = Splash()
    picture = splash.grab().toImage().convertToFormat(QImage.Format.Format_RGB32)
    assert f"#{picture.pixel(5, 5) & 0xFFFFFF:06x}" == theme.window
    splash.close()


def test_the_theme_that_is_kept_is_told_and_the_file_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "window.toml"
    first = THEMES[Settings().theme]
    assert _theme_in(path) is first
    WindowFile(path).write(WindowState(theme="light"))
    assert _theme_in(path) is LIGHT
    path.write_text("no TOML")
    assert _theme_in(path) is first
    assert [file.name for file in tmp_path.iterdir()] == ["window.toml"]


def test_garbage_is_not_looked_for_while_all_is_loaded_and_is_again_even_where_that_fails() -> None:
    looked_for: list[bool] = []

    def load() -> None:
        looked_for.append(gc.isenabled())
        raise ImportError

    with pytest.raises(ImportError), _all_stays():
        load()

    assert [*looked_for, gc.isenabled()] == [False, True]
