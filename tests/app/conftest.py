"""A real window on a real (virtual) display, and nothing left behind it."""

import math
import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PySide6.QtCore import QEvent, QPoint, QPointF, Qt
from PySide6.QtGui import QImage, QMouseEvent, QSurface
from PySide6.QtWidgets import QApplication, QWidget
from pyvistaqt import QtInteractor
from shiboken6 import getAllValidWrappers

from kappaskin import Engine
from kappaskin_app import features, guard
from kappaskin_app.features.membrane.camera import Projection
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.window import Feature, MainWindow
from kappaskin_app.theme import LIGHT, apply_look, current

if sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
    pytest.exit("the app's tests need a display: run `python3 packaging/start.py test`", 2)


def pytest_configure(config: pytest.Config) -> None:
    """Take the line of a feature out, where `--without` names one."""
    left_out = config.getoption("--without")
    rest = tuple(made for made in features.FEATURES if made.name != left_out)
    if left_out and rest == features.FEATURES:
        names = ", ".join(made.name for made in rest)
        raise pytest.UsageError(f"--without: expected one of {names}, got {left_out}")
    features.FEATURES, TestedWindow.left_out = rest, left_out


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Pass by what is of a feature that is left out."""
    left_out = config.getoption("--without")
    folder = Path(__file__).with_name("features") / left_out
    return True if left_out and collection_path.is_relative_to(folder) else None


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """End each file with its shared window: it draws and computes as long as it is there."""
    files = {item.path: number for number, item in enumerate(items)}
    items.sort(key=lambda item: (files[item.path], "shared_window" in _fixtures(item)))


def _fixtures(item: pytest.Item) -> Sequence[str]:
    return item.fixturenames if isinstance(item, pytest.Function) else ()


@pytest.fixture(autouse=True)
def no_window_and_no_failure_left(
    qapp: QApplication, request: pytest.FixtureRequest
) -> Iterator[None]:
    if current() is not LIGHT:
        apply_look(LIGHT)
    failures: list[str] = []
    guard.on_failure(failures.append)
    yield
    guard.forget(failures.append)
    qapp.processEvents()
    shown = [widget for widget in qapp.topLevelWidgets() if widget.isVisible()]
    left = [widget for widget in shown if not getattr(widget, "shared", False)]
    for widget in left:
        widget.close()
    # Outside of an event loop nothing else does, and each palette would be told to all there were.
    qapp.sendPostedEvents(None, QEvent.Type.DeferredDelete)
    assert not left
    # No QObject, it would outlive what Qt has deleted, and be taken for what comes to lie there.
    kinds = [type(each) for each in getAllValidWrappers()]
    assert kinds.count(QSurface) <= kinds.count(QtInteractor)
    assert not failures or request.node.get_closest_marker("fails_inside")
    assert not qapp.mouseButtons().value, "a mouse button is still held"


class TestedWindow(MainWindow):
    """A window with all features, or those given, whose parts are found by their names alone."""

    __test__ = False
    left_out, shared = "", False

    def __init__(
        self,
        source: str = "sim:",
        engine: Engine | None = None,
        installed: Sequence[Callable[[], Feature]] = (),
    ) -> None:
        super().__init__([made() for made in installed or features.FEATURES], source, engine)

    def __getattr__(self, name: str) -> Any:
        installed = self.__dict__.get("features", {}).values()
        found = [vars(feature)[name] for feature in installed if name in vars(feature)]
        if not found:
            if installed and self.left_out:
                pytest.skip(f"{name} is of {self.left_out}, which is left out")
            raise AttributeError(f"no part of the shell and no feature's is called {name!r}")
        return found[0]


class LonePanels:
    """The panels of a window, whose requests nobody follows; each by its name alone."""

    def __init__(self, window: TestedWindow) -> None:
        self.window, self.pages = window, window.panels

    def __getattr__(self, name: str) -> Any:
        return getattr(self.pages, name, None) or getattr(self.window, name)


@pytest.fixture(scope="module")
def _lone_panels(qapp: QApplication) -> Iterator[LonePanels]:
    window = TestedWindow("sim:")
    window.session.engine.disconnect()
    window.session.timer.stop()
    panels = window.panels
    for signal in (panels.requested, panels.reset_requested, panels.guide_requested):
        signal.disconnect()
    yield LonePanels(window)
    window.close()
    window.deleteLater()


@pytest.fixture
def panels(_lone_panels: LonePanels) -> LonePanels:
    """All panels of settings, as they are at first."""
    _lone_panels.pages.show_settings(Settings())
    _lone_panels.pages.setCurrentIndex(0)
    return _lone_panels


@pytest.fixture(scope="session")
def window_class() -> type[TestedWindow]:
    """What opens a window."""
    return TestedWindow


Wait = Callable[[Callable[[], bool]], None]


@pytest.fixture(scope="session")
def until(qapp: QApplication) -> Wait:
    """Let the window live until something holds; fail after a while.

    It does not hold while it asks of what is not there yet, such as the estimate.
    """

    def wait(holds: Callable[[], bool], patience: float = 60.0) -> None:
        def holds_now() -> bool:
            try:
                return holds()
            except AttributeError as error:
                if error.obj is not None:
                    raise
                return False

        end = time.monotonic() + patience
        while not holds_now():
            assert time.monotonic() < end, "it never came to hold"
            qapp.processEvents()
            time.sleep(0.002)

    return wait


@pytest.fixture
def opened(qapp: QApplication) -> Iterator[Callable[..., MainWindow]]:
    """Opens the window on a source, and closes it whatever happens."""
    qapp.setStyle("Fusion")
    made: list[MainWindow] = []

    def opened(source: str, engine: Engine | None = None) -> MainWindow:
        made.append(TestedWindow(source, engine))
        made[-1].show()
        made[-1].activateWindow()
        return made[-1]

    yield opened
    for window in made:
        window.close()
        window.deleteLater()
    qapp.processEvents()


@pytest.fixture
def window(opened: Callable[..., MainWindow], until: Wait) -> MainWindow:
    """The window on the default simulation, once it has the keyboard and draws what comes in."""
    window = opened("sim:")
    ages = window.membrane.ages
    until(lambda: window.isActiveWindow() and any(math.isfinite(age) for _, age in ages))
    drawn = len(ages)
    until(lambda: window.display.badge.state == "SIM" and len(ages) > drawn + 1)
    return window


@pytest.fixture(scope="module")
def _one_window(qapp: QApplication, until: Wait) -> Iterator[TestedWindow]:
    qapp.setStyle("Fusion")
    window = TestedWindow("sim:")
    window.shared = True  # it stays: hidden and shown again, it does not get the keyboard back
    window.show()
    until(lambda: window.display.badge.state == "SIM" and len(window.membrane.ages) > 1)
    yield window
    window.close()
    window.deleteLater()


@pytest.fixture
def shared_window(
    _one_window: TestedWindow, qapp: QApplication, until: Wait
) -> Iterator[TestedWindow]:
    """One window for the tests of a file that leave it as it was but for settings and source."""
    session = _one_window.session
    _one_window.show()

    def ready() -> bool:
        _one_window.activateWindow()  # which is lost on a window that is not on the screen yet
        asked = session.engine.requested.changed.get("source", 0)
        simulates = session.status.requested >= asked and session.estimate is not None
        active = _one_window.isActiveWindow()
        return active and simulates and _one_window.display.badge.state == "SIM"

    until(ready)
    _one_window.history.stack.clear()
    yield _one_window
    if session.connecting or session.source != "sim:":
        session.connect_to("sim:")
    if not session.running:
        session.run(True)
    _one_window.history.stack.setIndex(0)
    qapp.processEvents()


@pytest.fixture(scope="session")
def points_at() -> Callable[[QWidget, QPoint], None]:
    """Moves the mouse, no button down, to a place of a widget.

    Not by way of the display: nobody is told of a move to where the mouse was last seen, nor, on
    a busy machine, of one that another follows.
    """

    def move(widget: QWidget, place: QPoint) -> None:
        assert widget.hasMouseTracking(), "it would not be told"
        none = Qt.MouseButton.NoButton, Qt.MouseButton.NoButton, Qt.KeyboardModifier.NoModifier
        there = QPointF(place), QPointF(widget.mapToGlobal(place))
        QApplication.sendEvent(widget, QMouseEvent(QEvent.Type.MouseMove, *there, *none))

    return move


@pytest.fixture(scope="session")
def pixel_of() -> Callable[[MainWindow, Sequence[float]], QPoint]:
    """Where a window shows the place (x, y) in m of the drawn skin, in its 3-D view."""

    def find(window: MainWindow, place: Sequence[float]) -> QPoint:
        (point,), _ = window.membrane.skin.place(np.array([place]))
        return QPointF(*Projection(window.membrane.plotter).to_screen(point)).toPoint()

    return find


@pytest.fixture(scope="session")
def colours_of() -> Callable[[np.ndarray], int]:
    """How many different colours bytes (..., 3) are."""
    return lambda rgb: len(np.unique(rgb @ np.array([2**16, 2**8, 1])))


@pytest.fixture
def colours_in(colours_of: Callable[[np.ndarray], int]) -> Callable[[MainWindow, QWidget], int]:
    """How many different colours the window's picture has where a widget is."""

    def count(window: MainWindow, widget: QWidget) -> int:
        picture = window.grab().toImage().convertToFormat(QImage.Format.Format_RGB888)
        at = widget.mapTo(window, QPoint(0, 0))
        part = picture.copy(at.x(), at.y(), widget.width(), widget.height())
        rows = np.frombuffer(part.constBits(), np.uint8).reshape(part.height(), -1)
        return colours_of(rows[:, : 3 * part.width()].reshape(-1, 3))

    return count
