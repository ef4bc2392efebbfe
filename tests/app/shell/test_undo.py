"""Undo covers settings and the camera, and leaves tabs, docks and the look of the window."""

from collections.abc import Callable, Iterator

import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtWidgets import QApplication

from kappaskin_app.shell.window import MainWindow

LEFT = Qt.MouseButton.LeftButton


@pytest.fixture(scope="module")
def shared(qapp: QApplication, until, window_class) -> Iterator[MainWindow]:
    qapp.setStyle("Fusion")
    window = window_class("sim:")
    window.show()
    until(lambda: bool(window.display.status_bar.object.text()))
    window.heatmaps["xx"].chosen.emit(0)
    window.history.stack.undo()
    window.docks["element"].hide()
    yield window
    window.close()
    window.deleteLater()


@pytest.fixture
def here(shared: MainWindow, until) -> Iterator[MainWindow]:
    """The one window of these tests, as it was at first."""
    until(lambda: shared.display.badge.state == "SIM" and shared.membrane.surface.actor is not None)
    shared.show()
    _settle()
    shared.history.stack.clear()
    _settle()
    yield shared
    shared.history.stack.setIndex(0)
    _settle()
    shared.hide()


def _settle() -> None:
    for _ in range(3):
        QApplication.processEvents()


def _camera(window: MainWindow) -> tuple[float, ...]:
    camera = window.membrane.plotter.renderer.GetActiveCamera()
    return (*camera.GetPosition(), *camera.GetFocalPoint(), *camera.GetViewUp())


def _drag(window: MainWindow, qtbot, *points: QPoint) -> None:
    plotter = window.membrane.plotter
    qtbot.mousePress(plotter, LEFT, pos=points[0])
    for point in points[1:]:
        qtbot.mouseMove(plotter, point)
    qtbot.mouseRelease(plotter, LEFT, pos=points[-1])


def _wheel(window: MainWindow) -> None:
    at, none = QPointF(50, 50), QPoint(0, 0)
    event = QWheelEvent(
        *(at, at, none, QPoint(0, 120), Qt.MouseButton.NoButton),
        *(Qt.KeyboardModifier.NoModifier, Qt.ScrollPhase.NoScrollPhase, False),
    )
    QApplication.sendEvent(window.membrane.plotter, event)


def _texts(window: MainWindow) -> list[str]:
    stack = window.history.stack
    return [stack.text(index) for index in range(stack.count())]


@pytest.mark.full
def test_each_turn_of_the_view_is_one_step_and_turns_of_the_wheel_are_one(
    here: MainWindow, qtbot
) -> None:
    stood = [_camera(here)]
    for end in (QPoint(60, 50), QPoint(40, 70)):
        _drag(here, qtbot, QPoint(30, 30), QPoint(40, 35), end)
        stood.append(_camera(here))
    _wheel(here)
    _wheel(here)
    stood.append(_camera(here))
    assert _texts(here) == ["move the camera", "move the camera", "the view"]
    assert len(set(stood)) == 4
    for was in reversed(stood[:-1]):
        here.actions_by_name["undo"].trigger()
        assert _camera(here) == pytest.approx(was, abs=1e-9)
    for now in stood[1:]:
        here.actions_by_name["redo"].trigger()
        assert _camera(here) == pytest.approx(now, abs=1e-9)


def test_a_click_that_turns_nothing_is_no_step(here: MainWindow, qtbot) -> None:
    qtbot.mouseClick(here.membrane.plotter, Qt.MouseButton.RightButton, pos=QPoint(30, 30))
    assert _texts(here) == []


def test_a_direction_after_a_turn_is_a_step_that_goes_back_to_the_turn(
    here: MainWindow, qtbot
) -> None:
    _drag(here, qtbot, QPoint(30, 30), QPoint(60, 50))
    turned = _camera(here)
    here.actions_by_name["look-from-above"].trigger()
    assert _camera(here) != pytest.approx(turned)
    here.actions_by_name["undo"].trigger()
    assert _camera(here) == pytest.approx(turned, abs=1e-9)


def test_another_skin_is_seen_from_where_the_last_one_was(here: MainWindow, until) -> None:
    camera = (0.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.7, 0.7, 30.0, 0.0, 0.0)
    here.history.change("Turn", -1, camera=camera)
    here.requests.set("shape", "cylinder")
    until(lambda: here.membrane.skin.patch.arc_curvature > 0)
    assert here.history.settings.camera == camera
    at, focus = _camera(here)[:3], _camera(here)[3:6]
    side = here.membrane.skin.side
    assert [a - f for a, f in zip(at, focus, strict=True)] == pytest.approx([0.0, -side, side])


@pytest.mark.full
def test_with_nothing_to_undo_the_action_says_so(here: MainWindow) -> None:
    undo: Callable[[], bool] = here.actions_by_name["undo"].isEnabled
    assert not undo()
    assert here.actions_by_name.why_not("undo") == "there is nothing to undo"
    here.requests.set("functions_x", 6)
    assert undo()
    arrow = "\N{RIGHTWARDS ARROW}"
    assert here.actions_by_name["undo"].text() == f"&Undo: basis functions in x 8 {arrow} 6"


def test_undo_by_its_keys_leaves_tabs_docks_layouts_and_the_theme(here: MainWindow, qtbot) -> None:
    keys, none = Qt.Key, Qt.KeyboardModifier.NoModifier
    control, shift = Qt.KeyboardModifier.ControlModifier, Qt.KeyboardModifier.ShiftModifier
    theme = here.history.settings.theme
    box = here.basis.editor("functions_x")
    here.panels.setCurrentIndex(0)
    here.activateWindow()
    QApplication.processEvents()
    box.setFocus()
    qtbot.keyClick(box, keys.Key_Down)
    assert _texts(here) == ["basis functions in x 8 \N{RIGHTWARDS ARROW} 7"]
    for key, how in (
        (keys.Key_T, control),  # the theme
        (keys.Key_E, control | Qt.KeyboardModifier.AltModifier),  # the dock Element
        (keys.Key_PageDown, control),  # the next page of settings
        (keys.Key_F12, none),  # the sound
    ):
        qtbot.keyClick(here, key, how)
        _settle()
    here.actions_by_name["layout-study"].trigger()
    here.panels.tabBar().setCurrentIndex(2)
    here.heatmaps["xx"].chosen.emit(17)
    _settle()
    assert len(_texts(here)) == 1
    assert here.history.settings.theme != theme
    seen = here.layouts.now

    qtbot.keyClick(here, keys.Key_Z, control)
    _settle()
    assert here.history.settings.functions_x == 8
    qtbot.keyClick(here, keys.Key_Z, control | shift)
    _settle()
    assert here.history.settings.functions_x == 7
    assert here.layouts.now == seen
    assert (here.panels.currentIndex(), here.selected_element.element) == (2, 17)
    assert here.history.settings.theme != theme
    here.requests.set("theme", theme)
    here.layouts.reset()


def test_a_reset_leaves_the_look_of_the_window(here: MainWindow) -> None:
    here.requests.set("letters", 110.0)
    here.requests.set("functions_x", 6)
    here.actions_by_name["reset"].trigger()
    assert (here.history.settings.functions_x, here.history.settings.letters) == (8, 110.0)
    here.requests.set("letters", 100.0)


@pytest.mark.full
def test_the_place_in_a_lesson_comes_back_with_its_settings(here: MainWindow) -> None:
    teaching, undo, before = here.teaching, here.actions_by_name["undo"], here.history.settings
    teaching.look()
    teaching.take(next(iter(teaching.taken)))
    at_first = here.history.settings
    teaching.go(2)
    assert _texts(here)[-1] == "lesson step 3"
    undo.trigger()
    assert (teaching.progress.step, here.history.settings) == (0, at_first)
    teaching.leave()
    assert teaching.progress is None
    undo.trigger()
    assert (teaching.progress.step, here.history.settings) == (0, at_first)
    assert here.lesson.isVisible()
    undo.trigger()
    assert (teaching.progress, here.history.settings) == (None, before)
