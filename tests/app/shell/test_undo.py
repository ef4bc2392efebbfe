"""What is no setting comes back too: where the camera stands, docks, pages, files."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtWidgets import QApplication, QTabBar

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
    until(lambda: here.membrane.skin.patch.base_curvature > 0)
    assert here.history.settings.camera == camera
    at, focus = _camera(here)[:3], _camera(here)[3:6]
    side = here.membrane.skin.side
    assert [a - f for a, f in zip(at, focus, strict=True)] == pytest.approx([0.0, -side, side])


@pytest.mark.full
def test_a_dock_that_is_closed_and_a_tab_that_is_clicked_come_back(here: MainWindow, qtbot) -> None:
    for name in ("cost", "numbers"):
        here.actions_by_name[f"dock-{name}"].trigger()
        _settle()
    (tabs,) = [b for b in here.findChildren(QTabBar) if b.parent() is here and b.isVisible()]
    tabs.setCurrentIndex(0)
    _settle()
    here.docks["numbers"].close()
    _settle()
    here.panels.setCurrentIndex(2)
    _settle()
    assert _texts(here) == [
        *("show Cost of accuracy", "show Numbers", "show Cost of accuracy"),
        *("hide Numbers", "page Sensor"),
    ]
    undo = here.actions_by_name["undo"]
    assert undo.toolTip() == "Undo: page Sensor"
    for _ in range(3):
        undo.trigger()
        _settle()
    assert here.panels.currentIndex() == 0
    assert here.docks["numbers"].visibleRegion().boundingRect().height() > 0
    assert here.docks["cost"].visibleRegion().isEmpty()


@pytest.mark.full
def test_a_dock_that_is_moved_comes_back(here: MainWindow) -> None:
    curvature, left = here.docks["curvature"], Qt.DockWidgetArea.LeftDockWidgetArea
    was = here.dockWidgetArea(curvature)
    here.addDockWidget(left, curvature)
    _settle()
    assert _texts(here) == ["move By element"]
    here.actions_by_name["undo"].trigger()
    _settle()
    assert here.dockWidgetArea(curvature) == was
    assert here.actions_by_name["redo"].text() == "&Redo: move By element"


@pytest.mark.full
def test_an_edge_that_is_dragged_is_one_step(here: MainWindow, qtbot) -> None:
    dock = here.docks["settings"]
    wide, edge = dock.width(), QPoint(dock.geometry().right() + 3, dock.geometry().center().y())
    qtbot.mousePress(here, LEFT, pos=edge)
    for step in (20, 40, 60):
        qtbot.mouseMove(here, edge + QPoint(step, 0))
        _settle()
    qtbot.mouseRelease(here, LEFT, pos=edge + QPoint(60, 0))
    _settle()
    assert dock.width() > wide + 30
    assert _texts(here) == ["size of the panels"]
    here.actions_by_name["undo"].trigger()
    _settle()
    assert abs(dock.width() - wide) <= 2


@pytest.mark.full
def test_a_window_that_grows_for_a_dock_has_that_as_a_step(here: MainWindow) -> None:
    here.resize(here.minimumSizeHint())
    _settle()
    here.actions_by_name["dock-cost"].trigger()
    _settle()
    assert _texts(here) == ["show Cost of accuracy"]
    here.resize(1280, 800)
    _settle()
    assert _texts(here) == ["show Cost of accuracy"]


@pytest.mark.full
def test_what_is_undone_at_once_is_what_was_done_last(here: MainWindow) -> None:
    here.requests.set("letters", 110.0)
    _settle()
    here.docks["settings"].hide()
    here.actions_by_name["undo"].trigger()
    assert not here.docks["settings"].isHidden()
    assert here.history.settings.letters == 110.0


def test_the_page_of_the_scene_comes_back(here: MainWindow) -> None:
    here.actions_by_name["dock-scene"].trigger()
    here.scene.setCurrentIndex(1)
    _settle()
    here.actions_by_name["undo"].trigger()
    assert here.scene.currentIndex() == 0
    assert here.docks["scene"].isHidden()


def test_a_list_of_files_that_was_cleared_comes_back(here: MainWindow) -> None:
    here.opening.note(Path("/there/a.toml"))
    files = here.opening.recent
    here.opening.clear()
    assert here.opening.recent == []
    here.actions_by_name["undo"].trigger()
    assert here.opening.recent == files


@pytest.mark.full
def test_with_nothing_to_undo_the_action_says_so(here: MainWindow) -> None:
    undo: Callable[[], bool] = here.actions_by_name["undo"].isEnabled
    assert not undo()
    assert here.actions_by_name.why_not("undo") == "there is nothing to undo"
    here.requests.set("letters", 110.0)
    assert undo()
    assert here.actions_by_name["undo"].text() == "&Undo: text size 100 \N{RIGHTWARDS ARROW} 110 %"


def test_measuring_and_each_place_of_it_come_back(here: MainWindow) -> None:
    measuring, undo = here.view.measurement, here.actions_by_name["undo"]
    here.actions_by_name["measure"].trigger()
    for place in ((0.02, 0.03), (0.05, 0.06)):
        here.membrane.pointer.clicked.emit(*place)
    assert _texts(here) == ["measure", "measure from here", "measure to here"]
    undo.trigger()
    assert measuring.places == ((0.02, 0.03),)
    here.actions_by_name["measure"].trigger()
    assert measuring.places is None
    undo.trigger()
    assert here.actions_by_name["measure"].isChecked()
    assert measuring.places == ((0.02, 0.03),)
    undo.trigger()
    undo.trigger()
    assert not measuring.on


def test_places_beside_the_skin_that_there_is_now_do_not_come_back(here: MainWindow) -> None:
    measuring = here.view.measurement
    measuring.set_places(((0.02, 0.03), (0.1, 0.1)))
    assert len(measuring.places) == 2
    measuring.set_places(((0.02, 0.03), (0.11, 0.1)))
    assert measuring.places == ()
    assert "click a place" in measuring.ruler.text.input
    measuring.set_places(None)


@pytest.mark.full
def test_the_element_that_was_picked_before_comes_back_and_then_its_dock_goes(
    here: MainWindow,
) -> None:
    for element in (17, 44):
        here.heatmaps["xx"].chosen.emit(element)
        _settle()
    assert _texts(here) == ["show Element", "select element 17", "select element 44"]
    here.actions_by_name["undo"].trigger()
    assert here.selected_element.element == 17
    here.actions_by_name["undo"].trigger()
    _settle()
    assert here.selected_element.element == -1
    assert "Click an element" in here.selected_element.panel.title.text()
    here.actions_by_name["undo"].trigger()
    _settle()
    assert here.docks["element"].isHidden()


def test_an_element_that_the_skin_has_no_more_is_not_picked_again(here: MainWindow, until) -> None:
    here.heatmaps["xx"].chosen.emit(90)
    here.heatmaps["xx"].chosen.emit(3)
    here.history.apply(replace(here.history.settings, elements_x=4, elements_y=4))
    until(lambda: len(here.session.status.sensor.layout) == 16)
    here.actions_by_name["undo"].trigger()
    assert here.selected_element.element == -1


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
