"""Presenter controller: full screen, the simulated hand, and lost connections."""

import math
from dataclasses import replace
from importlib.resources import files
from types import SimpleNamespace

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtWidgets import QDockWidget

from kappaskin.publish import CueStatus, PublishStatus, TargetStatus
from kappaskin_app.features.presenter.feedback import RadiusEstimate
from kappaskin_app.shell.badge import GAP, LATE, LOST, SIM
from kappaskin_app.theme import THEMES, current

LEFT = Qt.MouseButton.LeftButton


@pytest.fixture
def demo(opened, until):
    """The window on the demonstration in full screen, once there is a contact."""
    window = opened("sim:demo")
    until(lambda: window.isActiveWindow() and window.display.badge.state == "SIM")
    window.presenter.enter()
    until(lambda: window.presenter.feedback is not None)
    until(lambda: len(window.membrane.drag.handles) == 1 and hand(window) is not None)
    return window


def hand(window):
    return window.presenter.view.controls.hand_text.hand


def _size(dock):
    # One behind the tab of another has no size that is seen.
    return (0, 0) if dock.visibleRegion().isEmpty() else dock.size().toTuple()


def layout_of(window):
    docks = window.findChildren(QDockWidget)
    return (
        window.geometry(),
        window.windowState(),
        sorted((d.objectName(), not d.visibleRegion().isEmpty(), *_size(d)) for d in docks),
        [
            window.menuBar().isVisible(),
            window.statusBar().isVisible(),
            window.display.badge.isVisible(),
        ],
    )


def settled(window, qtbot):
    """The layout, once the window has had it for a second."""
    was = layout_of(window)
    for _ in range(60):
        qtbot.wait(1000)
        if was == (was := layout_of(window)):
            return was
    raise AssertionError("the layout never stood still for a second")


@pytest.mark.full
def test_leaving_gives_the_window_back_as_it_was(window, until, qtbot) -> None:
    window.actions_by_name["dock-cost"].trigger()
    window.actions_by_name["dock-scene"].trigger()
    window.actions_by_name["dock-curvature"].trigger()
    until(lambda: window.docks["scene"].width() < window.width())  # between the columns
    was = settled(window, qtbot)

    qtbot.keyClick(window, Qt.Key.Key_F11)
    until(lambda: window.presenter.on)
    window.resize(1600, 900)
    qtbot.wait(300)
    assert not any(dock.isVisible() for dock in window.findChildren(QDockWidget))
    assert not window.menuBar().isVisible()
    qtbot.keyClick(window, Qt.Key.Key_Escape)

    assert not window.presenter.on
    until(lambda: layout_of(window) == was)


def test_a_layout_chosen_while_presenting_is_that_of_the_window(window, until, qtbot) -> None:
    window.actions_by_name["layout-study"].trigger()
    wanted = settled(window, qtbot)
    window.actions_by_name["layout-teach"].trigger()
    assert settled(window, qtbot) != wanted
    qtbot.keyClick(window, Qt.Key.Key_F11)
    until(lambda: window.presenter.on)

    qtbot.keyClick(window, Qt.Key.Key_K, Qt.KeyboardModifier.ControlModifier)
    line = window.menus.finder.line
    until(lambda: line.isVisible())
    qtbot.keyClicks(line, "study layout")
    qtbot.keyClick(line, Qt.Key.Key_Return)
    assert not window.presenter.on
    qtbot.wait(300)  # in which a window manager may resize it
    until(lambda: layout_of(window) == wanted)


def test_shortcuts_work_while_presenting(demo, qtbot, until) -> None:
    theme = demo.history.settings.theme
    qtbot.keyClick(demo, Qt.Key.Key_T, Qt.KeyboardModifier.ControlModifier)
    assert demo.history.settings.theme != theme
    assert current() is THEMES[demo.history.settings.theme]
    qtbot.keyClick(demo, Qt.Key.Key_F11)
    until(lambda: not demo.presenter.on)


def test_escape_during_a_drag_gives_it_up_and_stays(demo, qtbot, until) -> None:
    plotter = demo.membrane.plotter
    qtbot.mousePress(plotter, LEFT, pos=QPoint(plotter.width() // 2, plotter.height() // 2))
    assert demo.membrane.drag.holding
    qtbot.keyClick(plotter, Qt.Key.Key_Escape)
    assert demo.presenter.on
    qtbot.mouseRelease(plotter, LEFT)
    qtbot.keyClick(plotter, Qt.Key.Key_Escape)
    assert not demo.presenter.on


@pytest.mark.full
def test_a_drag_on_the_skin_moves_the_contact_and_the_cue_follows(
    demo, until, qtbot, pixel_of
) -> None:
    plotter, count = demo.membrane.plotter, demo.history.stack.count()
    until(lambda: abs(demo.presenter.feedback.position[0] - 0.05) < 0.002)
    start = pixel_of(demo, demo.membrane.drag.handles[0]) - QPoint(0, 8)
    qtbot.mousePress(plotter, LEFT, pos=start)
    for step in range(1, 9):
        qtbot.mouseMove(plotter, start + QPoint(5 * step, 0))
        qtbot.wait(20)
    until(lambda: demo.session.scene.stimuli[0].what.x > 0.055)
    ball = demo.session.scene.stimuli[0].what
    # The skin is inclined there: the ball touches it further out than where the hand is.
    until(lambda: demo.presenter.feedback.position[0] > ball.x + 0.001)
    until(lambda: math.dist(demo.presenter.feedback.position, _touched(demo)) < 0.0015)
    qtbot.mouseRelease(plotter, LEFT, pos=start + QPoint(40, 0))
    until(lambda: demo.history.stack.count() == count + 1)
    until(lambda: abs(demo.session.scene.stimuli[0].what.x - ball.x) < 1e-4)
    demo.history.stack.undo()
    until(lambda: abs(demo.presenter.feedback.position[0] - 0.05) < 0.002)


def _touched(demo):
    return demo.session.estimate.true_contact


@pytest.mark.full
def test_pressing_harder_is_felt(demo, until, qtbot) -> None:
    presenter, drag = demo.presenter, demo.membrane.drag
    force = lambda: presenter.feedback.force  # noqa: E731
    until(lambda: abs(force() - 0.5) < 0.02)
    for _ in range(4):
        qtbot.keyClick(demo.focusWidget(), Qt.Key.Key_PageDown)
    lighter = 0.5 / 1.08**4
    until(lambda: abs(force() - lighter) < 0.02)
    until(lambda: f"{lighter:.2f} N" in presenter.view.controls.hand_text.words()[0].text)
    until(lambda: not drag.holding)
    assert f"force = {lighter:.4g}" in demo.history.settings.written.text
    until(lambda: presenter.view.force.value.endswith(" N"))


@pytest.mark.full
def test_no_hand_presses_the_skin_out_of_the_picture(demo, until, qtbot) -> None:
    for _ in range(60):
        qtbot.keyClick(demo.focusWidget(), Qt.Key.Key_PageUp)
    until(lambda: not demo.membrane.drag.holding)
    assert 0.5 < demo.session.scene.stimuli[0].what.force < 0.8
    until(lambda: demo.display.badge.state == "SIM")
    until(lambda: demo.presenter.feedback and 0.5 < demo.presenter.feedback.force < 0.8)


@pytest.mark.full
def test_another_object_is_chosen_and_felt_at_the_same_place(demo, until, qtbot) -> None:
    view = demo.presenter.view
    objects = view.controls.objects
    until(lambda: objects.checkedId() == 0)
    until(lambda: view.radius.name == "Radius of the ball")
    qtbot.mouseClick(objects.button(2), LEFT)
    until(lambda: objects.checkedId() == 2)
    until(lambda: abs((demo.presenter.feedback.radius or NONE).value - 0.08) < 0.006)
    qtbot.mouseClick(objects.button(4), LEFT)
    until(lambda: view.radius.value == "edge")
    for _ in range(2):
        demo.history.stack.undo()
    until(lambda: objects.checkedId() == 0)


NONE = RadiusEstimate("", math.nan, (0.0, math.inf))


def test_the_estimate_drives_the_cue_and_not_the_truth(demo, until) -> None:
    fewer = demo.history.settings.functions_x - 3
    demo.history.change("Fewer", -1, functions_x=fewer, functions_y=fewer)
    until(lambda: demo.session.estimate.coefficients.shape == (fewer, fewer))

    def told() -> bool:
        value, _, unit = demo.presenter.view.displacement.value.partition(" ")
        deepest = demo.session.estimate.surface.max()
        return unit == "mm" and 1e-3 * float(value) == pytest.approx(deepest, rel=0.05)

    until(told)


@pytest.mark.full
def test_a_lost_line_says_what_to_do_and_what_is_felt_comes_back(demo, until) -> None:
    view = demo.presenter.view
    demo.session.disconnect_from()  # or the scene would stay
    until(lambda: demo.session.status.state == "off")
    demo.session.connect_to("/dev/ttyNOWHERE")
    until(lambda: view.strip.state == LOST)
    assert view.pages.currentWidget() is view.banner
    assert "there is no such port" in view.banner.why
    assert "Check the cable" in view.banner.remedy
    assert demo.presenter.feedback is None
    assert not view.controls.isVisible()
    until(lambda: view.banner.since.endswith(" s"))
    demo.session.connect_to("sim:demo")
    until(lambda: view.strip.state == SIM and view.pages.currentWidget() is not view.banner)
    until(lambda: demo.presenter.feedback is not None)


def test_a_faded_cue_of_any_finger_is_told_at_once_and_for_a_second(
    demo, until, monkeypatch
) -> None:
    view, session = demo.presenter.view, demo.session

    def told(cue: CueStatus) -> str:
        """The state that is shown with a cue of the index, in a hand."""
        publishing = PublishStatus((TargetStatus("cue://glove:1", cue=cue),))
        index = replace(session.status, publishing=publishing)
        hand = SimpleNamespace(status=lambda: {"thumb": session.status, "index": index})
        with monkeypatch.context() as patch:
            patch.setattr(session, "fingers", hand)
            demo.presenter.follow(session.status)
        return view.banner.state if view.pages.currentWidget() is view.banner else ""

    until(lambda: told(CueStatus("live", 1.0, 1e-3, 2.4e-3)) == "")
    until(lambda: told(CueStatus("late", 0.3, 1e-3, 2.4e-3)) == LATE)
    assert view.banner.since == "index"
    assert view.strip.latency == "haptic cue 1.0 ms after the data, 99 % within 2.4 ms"
    assert told(CueStatus("live", 0.4)) == LATE  # it returns
    until(lambda: told(CueStatus("live", 1.0)) == "")


@pytest.mark.full
def test_a_recording_that_stands_is_felt_where_it_stands(opened, recording, until) -> None:
    window = opened(f"replay:{recording}")
    until(lambda: window.display.badge.state.startswith("REPLAY"))
    window.playback.go(False)
    window.playback.seek(0.3)
    until(lambda: window.session.status.replay.at == 0.3)
    until(lambda: window.session.estimate and 28 < window.session.estimate.sequence < 33)
    window.presenter.enter()
    view = window.presenter.view
    until(lambda: view.force.value.endswith(" N"))
    window.playback.seek(1.4)
    until(lambda: view.strip.state == GAP)
    until(lambda: (view.force.value, view.force.note) == ("\N{EN DASH}", "no reading"))
    assert (view.strip.age, view.radius.name) == ("", "Radius of the object")


@pytest.mark.full
def test_nothing_that_touches_is_said_to_be_nothing(demo, until) -> None:
    text = demo.history.settings.written.text
    demo.editing.write(text[: text.index("[[touch]]")])
    until(lambda: demo.presenter.view.force.note == "no contact")
    until(lambda: not demo.presenter.view.controls.isVisible())


def test_a_moving_simulation_of_the_panels_is_held_and_pressed_too(window, until, qtbot) -> None:
    window.presenter.enter()
    plotter, drag = window.membrane.plotter, window.membrane.drag
    until(lambda: hand(window) is not None and len(drag.handles) == 1)
    assert not window.presenter.view.controls.objects.button(0).isVisible()
    qtbot.mouseClick(plotter, LEFT, pos=QPoint(plotter.width() // 2, plotter.height() // 2))
    settings = window.history.settings
    assert settings.load_case == "point"
    force = settings.force
    qtbot.keyClick(plotter, Qt.Key.Key_PageUp)
    until(lambda: window.history.settings.force == pytest.approx(1.08 * force))
    until(lambda: not drag.holding)


@pytest.mark.full
def test_the_3d_arrow_is_still_dragged_while_presenting(demo, until, qtbot, pixel_of) -> None:
    until(lambda: len(demo.membrane.drag.handles) == 1)
    view = demo.membrane
    start = pixel_of(demo, view.drag.handles[0]) - QPoint(0, 8)
    qtbot.mousePress(view.plotter, LEFT, pos=start)
    qtbot.mouseMove(view.plotter, start + QPoint(30, 0))
    until(lambda: demo.session.scene.stimuli[0].what.x > 0.052)
    qtbot.keyClick(view.plotter, Qt.Key.Key_Escape)
    assert demo.presenter.on
    until(lambda: demo.session.scene.stimuli[0].what.x == 0.05)
    qtbot.mouseRelease(view.plotter, LEFT, pos=start)


@pytest.mark.full
def test_a_scene_that_is_refused_says_so_below_the_skin_until_it_is_taken_back(
    demo, until, qtbot
) -> None:
    told, objects = demo.presenter.view.controls.hand_text, demo.presenter.view.controls.objects
    until(lambda: objects.button(0).isVisible())
    demo.editing.write(demo.history.settings.written.text.replace("radius", "radios"))
    until(lambda: "expected radius" in told.words()[1].text)
    assert "Ctrl+Z" in told.words()[1].text
    assert told.words()[1].fits
    assert not objects.button(0).isVisible()
    qtbot.keyClick(demo, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    until(lambda: "expected" not in told.words()[1].text)


@pytest.mark.full
def test_two_points_pressed_harder_keep_their_share(window, until, qtbot) -> None:
    window.history.change("Two", -1, load_case="two-points", force=0.1)
    window.presenter.enter()
    until(lambda: hand(window) is not None and hand(window).force == pytest.approx(0.05))
    until(lambda: len(window.membrane.drag.handles) == 2)
    qtbot.keyClick(window.focusWidget(), Qt.Key.Key_PageUp)
    until(lambda: window.history.settings.force == pytest.approx(0.108))
    until(lambda: not window.membrane.drag.holding)


@pytest.mark.full
def test_the_page_on_the_demonstration_names_what_is_there(demo) -> None:
    page = (files("kappaskin_resources") / "demonstration" / "demonstration.md").read_text("utf-8")
    for button in demo.presenter.view.controls.objects.buttons():
        assert button.text() in page
    assert demo.actions_by_name["present"].shortcut().toString() == "F11"
    assert demo.actions_by_name["sound"].shortcut().toString() == "F12"
