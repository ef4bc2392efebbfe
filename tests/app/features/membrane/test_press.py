"""The mouse and keys on the skin move and press a simulated load, or else turn the camera."""

import math
from collections.abc import Iterator

import numpy as np
import pytest
from PySide6.QtCore import QEvent, QPoint, QPointF, Qt
from PySide6.QtGui import QMouseEvent, QWheelEvent
from PySide6.QtWidgets import QApplication

from kappaskin.scenes import scene_file
from kappaskin_app.shell.simulation import patch_of, written
from kappaskin_app.shell.window import MainWindow

LEFT, RIGHT = Qt.MouseButton.LeftButton, Qt.MouseButton.RightButton
NONE, SHIFT = Qt.KeyboardModifier.NoModifier, Qt.KeyboardModifier.ShiftModifier


def move(window: MainWindow, at: QPoint, held=LEFT, keys=NONE) -> None:
    plotter = window.membrane.plotter
    there = QPointF(at), QPointF(plotter.mapToGlobal(at))
    none = Qt.MouseButton.NoButton
    QApplication.sendEvent(plotter, QMouseEvent(QEvent.Type.MouseMove, *there, none, held, keys))


def notch(window: MainWindow, at: QPoint, times: int, held=LEFT) -> None:
    plotter = window.membrane.plotter
    there = QPointF(at), QPointF(plotter.mapToGlobal(at))
    turned, phase = QPoint(0, 120 * times), Qt.ScrollPhase.NoScrollPhase
    event = QWheelEvent(*there, QPoint(), turned, held, NONE, phase, False)
    QApplication.sendEvent(plotter, event)


@pytest.fixture
def window(shared_window: MainWindow) -> MainWindow:
    return shared_window


@pytest.fixture(params=["window", "presenter"])
def pressed(request: pytest.FixtureRequest, window: MainWindow, until) -> Iterator[MainWindow]:
    """The window with a point load at rest, or the same in the presenter."""
    window.history.change("Point", -1, load_case="point", x=0.05, y=0.05, force=0.1)
    if request.param == "presenter":
        window.presenter.enter()
        until(lambda: window.membrane.plotter.height() > 300)
        QApplication.processEvents()
    until(lambda: window.membrane.drag.handles.tolist() == [[0.05, 0.05]])
    until(lambda: abs(window.session.estimate.true_contact[0] - 0.05) < 1e-6)
    yield window
    if window.presenter.on:
        window.presenter.leave()


def test_the_left_button_on_the_skin_presses_there_and_drags(
    pressed, qtbot, until, pixel_of
) -> None:
    plotter, settings = pressed.membrane.plotter, pressed.history.settings
    count, start = pressed.history.stack.count(), pixel_of(pressed, (0.03, 0.065))
    move(pressed, start, held=Qt.MouseButton.NoButton)
    until(lambda: pressed.selection.element >= 0)
    qtbot.mousePress(plotter, LEFT, pos=start)
    now = pressed.history.settings
    assert (now.x, now.y) == pytest.approx((0.03, 0.065), abs=1e-3)
    until(lambda: abs(pressed.session.estimate.true_contact[0] - now.x) < 1e-3)
    assert pressed.selection.element == -1  # no element is marked under the held load
    for step in range(1, 7):
        move(pressed, start + QPoint(5 * step, 0))
    dragged = pressed.history.settings
    assert dragged.x > 0.033
    notch(pressed, start + QPoint(30, 0), 3)
    assert pressed.history.settings.force == pytest.approx(0.1 * 1.08**3)
    move(pressed, start + QPoint(30, -40), keys=SHIFT)
    pressing = pressed.history.settings
    assert pressing.force == pytest.approx(0.1 * 1.08**3 * 1.01**40)
    assert (pressing.x, pressing.y) == (dragged.x, dragged.y)
    move(pressed, start + QPoint(31, -40))
    after = pressed.history.settings
    assert math.dist((after.x, after.y), (dragged.x, dragged.y)) < 0.002
    qtbot.mouseRelease(plotter, LEFT, pos=start + QPoint(31, -40))
    move(pressed, start, held=Qt.MouseButton.NoButton)
    assert pressed.history.settings == after  # it stays where it was released
    assert after.camera == settings.camera
    assert pressed.history.stack.count() == count + 1
    pressed.history.stack.undo()
    assert pressed.history.settings == settings


@pytest.mark.cases("dome")
@pytest.mark.parametrize(
    ("shape", "radius"),
    [("dome", 0.15), ("dome", -0.15), ("cap", 0.15)],
    ids=["dome", "saddle", "cap"],
)
def test_the_flank_of_a_curved_skin_is_pressed_and_pointed_at_under_the_mouse(
    window: MainWindow, qtbot, until, pixel_of, shape: str, radius: float
) -> None:
    window.requests.set("shape", shape)
    window.history.change("Press", -1, load_case="point", force=0.02, radius_y=radius)
    patch = patch_of(window.history.settings)
    until(lambda: window.membrane.skin.patch == patch)
    until(lambda: held_at(window, patch.a / 2, patch.b / 2))
    plotter = window.membrane.plotter
    shares = (0.15, 0.85) if shape == "dome" else (0.25, 0.35)
    flank = np.array(shares) * (patch.a, patch.b)  # an element is there
    at = pixel_of(window, flank)
    move(window, at, held=Qt.MouseButton.NoButton)
    positions = window.session.scene.layout.positions
    nearest = int(np.argmin(np.linalg.norm(positions - flank, axis=1)))
    np.testing.assert_allclose(positions[nearest], flank)
    until(lambda: window.selection.element == nearest)
    qtbot.mousePress(plotter, LEFT, pos=at)
    pressed = window.history.settings
    assert (pressed.x, pressed.y) == pytest.approx(flank, abs=3e-4)
    move(window, at + QPoint(60, -10))
    until(lambda: held_at(window, *dragged(window)))
    qtbot.mouseRelease(plotter, LEFT, pos=at + QPoint(60, -10))
    (moved,) = window.membrane.drag.handles
    assert (pixel_of(window, moved) - at - QPoint(60, -10)).manhattanLength() <= 6
    until(lambda: np.allclose(window.session.estimate.true_contact, dragged(window)))


def held_at(window: MainWindow, x: float, y: float) -> bool:
    """Whether the one load is drawn at (x, y) in m."""
    handles = window.membrane.drag.handles
    return handles.shape == (1, 2) and np.allclose(handles, [[x, y]])


def dragged(window: MainWindow) -> tuple[float, float]:
    """Where the settings have the load, in m."""
    return window.history.settings.x, window.history.settings.y


@pytest.fixture
def pinched(window: MainWindow, until) -> MainWindow:
    """The fingertip of the first window, paused while nothing presses."""
    window.session.begin(written(scene_file("fingertip-cap")))
    until(lambda: window.session.scene.name == "fingertip-cap" and not window.session.making)
    window.session.run(False)
    window.session.seek(2.7)
    until(lambda: window.session.status.playing.at == 2.7)
    until(lambda: window.membrane.drag.lifted and not len(window.membrane.drag.handles))
    return window


def test_a_press_on_the_fingertip_puts_a_load_there_that_stays(
    pinched, qtbot, until, pixel_of
) -> None:
    plotter, before = pinched.membrane.plotter, pinched.history.settings
    at, rim = pixel_of(pinched, (0.0118, 0.0098)), pixel_of(pinched, (0.0105, 0.0008))
    move(pinched, at, held=Qt.MouseButton.NoButton)
    until(lambda: plotter.cursor().shape() == Qt.CursorShape.CrossCursor)
    qtbot.mousePress(plotter, LEFT, pos=at)
    until(lambda: np.allclose(pinched.membrane.drag.handles, [(0.0118, 0.0098)], atol=4e-4))
    qtbot.mouseRelease(plotter, LEFT, pos=at)
    until(lambda: pinched.history.settings.written != before.written and not pinched.session.making)
    qtbot.mousePress(plotter, LEFT, pos=rim)
    # The disc of 2.5 mm is as near to the mouse as it fits.
    until(lambda: np.allclose(pinched.membrane.drag.handles, [(0.0105, 0.0026)], atol=4e-4))
    qtbot.mouseRelease(plotter, LEFT, pos=rim)
    (handle,) = pinched.membrane.drag.handles
    until(lambda: not pinched.session.making)
    pinched.session.seek(0.0)  # when the contacts of the timetable begin
    until(lambda: np.allclose(pinched.session.estimate.true_contact, handle, atol=1e-5))
    pinched.history.stack.undo()
    pinched.history.stack.undo()
    assert pinched.history.settings == before


@pytest.mark.full
def test_a_press_on_a_mesh_puts_its_load_under_the_mouse(
    window: MainWindow, qtbot, until, pixel_of
) -> None:
    window.session.begin(written(scene_file("thumb-pad")))
    until(lambda: window.session.scene.name == "thumb-pad" and not window.session.making, 200.0)
    window.session.run(False)
    window.session.seek(1.0)
    until(lambda: held_at(window, 0.009, 0.007))
    plotter, flank = window.membrane.plotter, np.array([0.0065, 0.0036])
    at = pixel_of(window, flank)
    move(window, at, held=Qt.MouseButton.NoButton)
    positions = window.session.scene.layout.positions
    nearest = int(np.argmin(np.linalg.norm(positions - flank, axis=1)))
    until(lambda: window.selection.element == nearest)
    qtbot.mousePress(plotter, LEFT, pos=at)
    until(lambda: np.allclose(window.membrane.drag.handles, [flank], atol=3e-4))
    qtbot.mouseRelease(plotter, LEFT, pos=at)
    (handle,) = window.membrane.drag.handles
    until(lambda: np.allclose(window.session.estimate.true_contact, handle, atol=1e-5))
    assert np.linalg.norm(window.session.estimate.contact.position - handle) < 1e-4


def test_a_load_of_a_timetable_rests_while_it_is_held_and_goes_on_after_escape(
    pinched, qtbot, until, pixel_of
) -> None:
    plotter, drag, before = pinched.membrane.plotter, pinched.membrane.drag, pinched.session.scene
    pinched.session.seek(4.0)
    until(lambda: len(drag.handles) == 1 and pinched.session.status.playing.at == 4.0)
    (handle,) = drag.handles
    qtbot.mousePress(plotter, LEFT, pos=pixel_of(pinched, handle))
    pinched.session.run(True)
    until(lambda: pinched.session.time > 4.3)
    assert np.allclose(drag.handles, [handle])
    qtbot.keyClick(plotter, Qt.Key.Key_Escape)
    qtbot.mouseRelease(plotter, LEFT)
    assert pinched.session.scene.stimuli == before.stimuli
    until(lambda: not np.allclose(drag.handles, [handle], atol=1e-4))


@pytest.mark.cases("window")
def test_escape_returns_the_load_that_is_held(pressed, qtbot, pixel_of) -> None:
    plotter, settings = pressed.membrane.plotter, pressed.history.settings
    qtbot.mousePress(plotter, LEFT, pos=pixel_of(pressed, (0.03, 0.06)))
    assert pressed.history.settings != settings
    presenting = pressed.presenter.on
    qtbot.keyClick(plotter, Qt.Key.Key_Escape)
    assert pressed.history.settings == settings
    move(pressed, pixel_of(pressed, (0.07, 0.06)))
    qtbot.mouseRelease(plotter, LEFT)
    assert pressed.history.settings == settings
    assert pressed.presenter.on == presenting


@pytest.mark.cases("window")
def test_keys_move_and_press_the_load(pressed, qtbot, until) -> None:
    if not pressed.presenter.on:  # which gives the view the keys itself
        pressed.membrane.setFocus()
    plotter, count = pressed.membrane.plotter, pressed.history.stack.count()
    until(plotter.hasFocus)
    for key in ("Right", "Right", "Down", "PageUp"):
        qtbot.keyClick(plotter, getattr(Qt.Key, f"Key_{key}"))
    settings = pressed.history.settings
    assert (settings.x, settings.y) == pytest.approx((0.052, 0.049))
    assert settings.force == pytest.approx(0.108)
    until(lambda: not pressed.membrane.drag.holding)
    assert pressed.history.stack.count() == count + 1


@pytest.mark.cases("window")
def test_off_the_skin_and_with_the_right_button_the_mouse_turns_the_view(
    pressed, qtbot, pixel_of
) -> None:
    plotter, settings = pressed.membrane.plotter, pressed.history.settings
    for button, start in ((LEFT, QPoint(20, 20)), (RIGHT, pixel_of(pressed, (0.03, 0.06)))):
        was = pressed.history.settings.camera
        qtbot.mousePress(plotter, button, pos=start)
        for step in range(1, 5):
            move(pressed, start + QPoint(15 * step, 4 * step), held=button)
        qtbot.mouseRelease(plotter, button, pos=start + QPoint(60, 16))
        now = pressed.history.settings
        assert now.camera != was
        # It turned: the distance from what it looks at is the same.
        far = [math.dist(camera[:3], camera[3:6]) for camera in (was, now.camera) if camera]
        assert far == pytest.approx([far[0]] * len(far))
        assert (now.x, now.y, now.force) == (settings.x, settings.y, settings.force)


@pytest.mark.cases("window")
def test_the_cursor_shows_what_the_left_button_does(pressed, until, pixel_of) -> None:
    plotter, none = pressed.membrane.plotter, Qt.MouseButton.NoButton
    tip = pixel_of(pressed, (0.05, 0.05))
    for at, shape in (
        (pixel_of(pressed, (0.02, 0.08)), Qt.CursorShape.CrossCursor),
        (tip - QPoint(0, 8), Qt.CursorShape.OpenHandCursor),
        (QPoint(20, 20), Qt.CursorShape.ArrowCursor),
    ):
        move(pressed, at, held=none)
        until(lambda shape=shape: plotter.cursor().shape() == shape)


def test_a_right_click_selects_the_element_and_moves_nothing(
    window, qtbot, until, pixel_of
) -> None:
    window.history.change("Point", -1, load_case="point", x=0.05, y=0.05)
    until(lambda: window.membrane.drag.handles.tolist() == [[0.05, 0.05]])
    settings = window.history.settings
    qtbot.mouseClick(window.membrane.plotter, RIGHT, pos=pixel_of(window, (0.03, 0.07)))
    positions = window.session.status.sensor.layout.positions
    found = positions[window.selected_element.element]
    assert found == pytest.approx((0.03, 0.07), abs=0.006)
    assert window.history.settings == settings


def test_while_measuring_a_click_measures_and_presses_nothing(
    window, qtbot, until, pixel_of
) -> None:
    until(lambda: len(window.membrane.drag.handles) == 1)
    settings = window.history.settings
    window.actions_by_name["measure"].trigger()
    qtbot.mouseClick(window.membrane.plotter, LEFT, pos=pixel_of(window, (0.02, 0.02)))
    ((x, y),) = window.view.measurement.places
    assert (x, y) == pytest.approx((0.02, 0.02), abs=2e-3)
    assert window.history.settings == settings
    window.actions_by_name["measure"].trigger()
    qtbot.mousePress(window.membrane.plotter, LEFT, pos=pixel_of(window, (0.03, 0.03)))
    assert window.history.settings.x == pytest.approx(0.03, abs=2e-3)
    qtbot.mouseRelease(window.membrane.plotter, LEFT)


def test_on_a_recording_the_left_button_turns_the_view(
    window, recording, until, qtbot, pixel_of
) -> None:
    window.session.connect_to(f"replay:{recording}")
    until(lambda: window.display.badge.state.startswith("REPLAY") and window.session.estimate)
    drawn = len(window.membrane.ages)
    until(lambda: len(window.membrane.ages) > drawn + 2)
    plotter, start = window.membrane.plotter, pixel_of(window, (0.03, 0.06))
    move(window, start, held=Qt.MouseButton.NoButton)
    qtbot.mousePress(plotter, LEFT, pos=start)
    for step in range(1, 5):
        move(window, start + QPoint(15 * step, 4 * step))
    qtbot.mouseRelease(plotter, LEFT, pos=start + QPoint(60, 16))
    assert window.history.settings.camera
    assert plotter.cursor().shape() == Qt.CursorShape.ArrowCursor


def shown(window: MainWindow) -> set[str]:
    return {name for name, button in window.legend.buttons.items() if button.isVisible()}


def test_the_legend_hides_what_is_clicked_and_shows_it_again(window, until, qtbot) -> None:
    membrane, legend = window.membrane, window.legend.buttons
    actors = {
        "show_fit": membrane.surface.actor,
        "show_truth": membrane._truth.actor,  # noqa: SLF001
        "show_contact": membrane._contacts[0],  # noqa: SLF001
        "show_elements": membrane._elements_actor,  # noqa: SLF001
        "show_load": membrane._loads._arrows[0],  # noqa: SLF001
    }
    until(lambda: all(actor.visibility for actor in actors.values()))
    until(lambda: actors.keys() < shown(window))
    for name, actor in actors.items():
        qtbot.mouseClick(legend[name], LEFT)
        until(lambda actor=actor: not actor.visibility)
        assert legend[name].font().strikeOut()
        legend[name].setFocus(Qt.FocusReason.TabFocusReason)
        qtbot.keyClick(legend[name], Qt.Key.Key_Space)
        until(lambda actor=actor: actor.visibility)
        assert not legend[name].font().strikeOut()
    assert legend["show_fit"].focusPolicy() & Qt.FocusPolicy.TabFocus


def test_the_legend_names_what_the_source_has(window, recording, until) -> None:
    window.session.connect_to("sim:demo")
    always = {"show_fit", "show_elements", "show_contact", "show_frame", "show_object"}
    until(lambda: shown(window) == always | {"show_truth", "show_pressed", "show_load"})
    window.session.connect_to(f"replay:{recording}")
    until(lambda: shown(window) == always | {"show_truth"})


def test_what_is_hidden_while_a_recording_is_paused_is_hidden_at_once(
    window, recording, until, qtbot
) -> None:
    window.session.connect_to(f"replay:{recording}")
    until(lambda: window.display.badge.state.startswith("REPLAY") and window.session.estimate)
    window.playback.go(False)
    window.playback.seek(0.3)
    until(lambda: window.session.status.replay.at == 0.3)
    truth = window.membrane._truth.actor  # noqa: SLF001
    until(lambda: truth.visibility)
    qtbot.wait(300)
    drawn = len(window.membrane.ages)
    for shown in (False, True):
        qtbot.mouseClick(window.legend.buttons["show_truth"], LEFT)
        until(lambda shown=shown: bool(truth.visibility) == shown, 5.0)
    qtbot.wait(300)
    assert len(window.membrane.ages) == drawn  # the frame counts once, and its age stays unknown
