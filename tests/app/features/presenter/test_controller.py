"""The operator's view in a real window: in and out, moved by a hand, lost."""

import math
from importlib.resources import files

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtWidgets import QDockWidget

from kappaskin_app.features.presenter.feedback import Roundness
from kappaskin_app.shell.badge import GAP, LOST, SIM
from kappaskin_app.theme import THEMES, current

LEFT = Qt.MouseButton.LeftButton


@pytest.fixture
def demo(opened, until):
    """The window on the demonstration, presenting, once something is felt."""
    window = opened("sim:demo")
    until(lambda: window.isActiveWindow() and window.display.badge.state == "SIM")
    window.presenting.enter()
    until(lambda: window.presenting.cue is not None)
    pad = window.presenting.stage.operator.pad
    until(lambda: pad.height() > 100 and pad.hand is not None)
    return window


def _size(dock):
    return dock.size().toTuple() if dock.isVisible() else (0, 0)


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


def test_leaving_gives_the_window_back_as_it_was(window, until, qtbot) -> None:
    window.actions_by_name["dock-cost"].trigger()
    window.actions_by_name["dock-scene"].trigger()
    window.actions_by_name["dock-curvature"].trigger()
    qtbot.wait(300)
    was = layout_of(window)

    qtbot.keyClick(window, Qt.Key.Key_F11)
    until(lambda: window.presenting.on)
    window.resize(1600, 900)
    qtbot.wait(300)
    assert not any(dock.isVisible() for dock in window.findChildren(QDockWidget))
    assert not window.menuBar().isVisible()
    qtbot.keyClick(window, Qt.Key.Key_Escape)

    assert not window.presenting.on
    until(lambda: layout_of(window) == was)


def test_shortcuts_work_while_presenting(demo, qtbot, until) -> None:
    theme = demo.history.settings.theme
    qtbot.keyClick(demo, Qt.Key.Key_T, Qt.KeyboardModifier.ControlModifier)
    assert demo.history.settings.theme != theme
    assert current() is THEMES[demo.history.settings.theme]
    qtbot.keyClick(demo, Qt.Key.Key_F11)
    until(lambda: not demo.presenting.on)


def test_escape_during_a_drag_gives_it_up_and_stays(demo, qtbot) -> None:
    pad = demo.presenting.stage.operator.pad
    qtbot.mousePress(pad, LEFT, pos=pad.seen_at(0.06, 0.06).toPoint())
    qtbot.keyClick(pad, Qt.Key.Key_Escape)
    assert demo.presenting.on
    qtbot.mouseRelease(pad, LEFT)
    qtbot.keyClick(pad, Qt.Key.Key_Escape)
    assert not demo.presenting.on


def test_a_drag_on_the_pad_moves_the_contact_and_the_cue_follows(demo, until, qtbot) -> None:
    pad, count = demo.presenting.stage.operator.pad, demo.history.stack.count()
    until(lambda: abs(demo.presenting.cue.position[0] - 0.05) < 0.002)
    start, end = pad.seen_at(0.05, 0.05).toPoint(), pad.seen_at(0.065, 0.04).toPoint()
    qtbot.mousePress(pad, LEFT, pos=start)
    for step in range(1, 9):
        qtbot.mouseMove(pad, start + (end - start) * step / 8)
        qtbot.wait(20)
    until(lambda: abs(demo.session.scene.stimuli[0].what.x - 0.065) < 0.001)
    # The skin is inclined there: the ball touches it further out than where the hand is.
    until(lambda: math.dist(demo.presenting.cue.position, (0.0708, 0.0372)) < 0.0015)
    assert math.dist(demo.session.estimate.true_contact, (0.0708, 0.0372)) < 0.001
    qtbot.mouseRelease(pad, LEFT, pos=end)
    until(lambda: demo.history.stack.count() == count + 1)
    until(lambda: abs(demo.session.scene.stimuli[0].what.x - 0.065) < 0.001)
    demo.history.stack.undo()
    until(lambda: abs(demo.presenting.cue.position[0] - 0.05) < 0.002)


def test_pressing_harder_is_felt(demo, until, qtbot) -> None:
    presenting = demo.presenting
    pad, force = presenting.stage.operator.pad, lambda: presenting.cue.force
    until(lambda: abs(force() - 0.5) < 0.02)
    for _ in range(4):
        qtbot.keyClick(pad, Qt.Key.Key_PageDown)
    lighter = 0.5 / 1.08**4
    until(lambda: abs(force() - lighter) < 0.02)
    until(lambda: f"{lighter:.2f} N" in presenting.stage.operator.told.words()[0].text)
    until(lambda: not pad.holding)
    assert f"force = {lighter:.4g}" in demo.history.settings.written.text
    until(lambda: presenting.stage.force.value.endswith(" N"))


def test_no_hand_presses_the_skin_out_of_the_picture(demo, until, qtbot) -> None:
    pad = demo.presenting.stage.operator.pad
    for _ in range(60):
        qtbot.keyClick(pad, Qt.Key.Key_PageUp)
    until(lambda: not pad.holding)
    assert 0.5 < demo.session.scene.stimuli[0].what.force < 0.8
    until(lambda: demo.display.badge.state == "SIM")
    until(lambda: demo.presenting.cue and 0.5 < demo.presenting.cue.force < 0.8)


def test_another_object_is_chosen_and_felt_at_the_same_place(demo, until, qtbot) -> None:
    stage = demo.presenting.stage
    things = stage.operator.things
    until(lambda: things.checkedId() == 0)
    until(lambda: stage.radius.name == "Radius of the ball")
    qtbot.mouseClick(things.button(2), LEFT)
    until(lambda: things.checkedId() == 2)
    until(lambda: abs((demo.presenting.cue.roundness or NONE).radius - 0.08) < 0.006)
    qtbot.mouseClick(things.button(4), LEFT)
    until(lambda: stage.radius.value == "edge")
    for _ in range(2):
        demo.history.stack.undo()
    until(lambda: things.checkedId() == 0)


NONE = Roundness("", math.nan, (0.0, math.inf))


def test_the_estimate_drives_the_cue_and_not_the_truth(demo, until) -> None:
    fewer = demo.history.settings.functions_x - 3
    demo.history.change("Fewer", -1, functions_x=fewer, functions_y=fewer)
    until(lambda: demo.session.estimate.coefficients.shape == (fewer, fewer))

    def told() -> bool:
        value, _, unit = demo.presenting.stage.displacement.value.partition(" ")
        deepest = demo.session.estimate.surface.max()
        return unit == "mm" and 1e-3 * float(value) == pytest.approx(deepest, rel=0.05)

    until(told)


def test_a_lost_line_says_what_to_do_and_what_is_felt_comes_back(demo, until) -> None:
    stage = demo.presenting.stage
    demo.session.connect_to("/dev/ttyNOWHERE")
    until(lambda: stage.strip.state == LOST)
    assert stage.pages.currentWidget() is stage.banner
    assert "there is no such port" in stage.banner.why
    assert "Check the cable" in stage.banner.remedy
    assert demo.presenting.cue is None
    assert not stage.operator.isVisible()
    until(lambda: stage.banner.since.endswith(" s"))
    demo.session.connect_to("sim:demo")
    until(lambda: stage.strip.state == SIM and stage.pages.currentWidget() is not stage.banner)
    until(lambda: demo.presenting.cue is not None)


def test_a_recording_that_stands_is_felt_where_it_stands(opened, recording, until) -> None:
    window = opened(f"replay:{recording}")
    until(lambda: window.display.badge.state.startswith("REPLAY"))
    window.replaying.go(False)
    window.replaying.seek(0.3)
    until(lambda: window.session.status.replay.at == 0.3)
    until(lambda: window.session.estimate and 28 < window.session.estimate.sequence < 33)
    window.presenting.enter()
    stage = window.presenting.stage
    until(lambda: stage.force.value.endswith(" N"))
    window.replaying.seek(1.4)
    until(lambda: stage.strip.state == GAP)
    until(lambda: (stage.force.value, stage.force.note) == ("\N{EN DASH}", "no reading"))
    assert (stage.strip.age, stage.radius.name) == ("", "Radius of what touches")


def test_nothing_that_touches_is_said_to_be_nothing(demo, until) -> None:
    text = demo.history.settings.written.text
    demo.editing.write(text[: text.index("[[touch]]")])
    until(lambda: demo.presenting.stage.force.note == "nothing felt")
    until(lambda: not demo.presenting.stage.operator.isVisible())


def test_a_moving_simulation_of_the_panels_is_held_and_pressed_too(window, until, qtbot) -> None:
    window.presenting.enter()
    stage = window.presenting.stage
    pad = stage.operator.pad
    until(lambda: pad.hand is not None and pad.height() > 100)
    assert not stage.operator.things.button(0).isVisible()
    qtbot.mousePress(pad, LEFT, pos=pad.seen_at(0.04, 0.06).toPoint())
    qtbot.mouseRelease(pad, LEFT)
    settings = window.history.settings
    assert (settings.load_case, settings.x) == ("point", pytest.approx(0.04, abs=0.001))
    force = settings.force
    qtbot.keyClick(pad, Qt.Key.Key_PageUp)
    until(lambda: window.history.settings.force == pytest.approx(1.08 * force))
    until(lambda: not pad.holding)


def test_the_3d_arrow_is_still_dragged_while_presenting(demo, until, qtbot) -> None:
    until(lambda: len(demo.membrane.drag.handles) == 1)
    view = demo.membrane
    start = view.drag.on_screen().toPoint() - QPoint(0, 8)
    qtbot.mousePress(view.plotter, LEFT, pos=start)
    qtbot.mouseMove(view.plotter, start + QPoint(30, 0))
    until(lambda: demo.session.scene.stimuli[0].what.x > 0.052)
    qtbot.keyClick(view.plotter, Qt.Key.Key_Escape)
    assert demo.presenting.on
    until(lambda: demo.session.scene.stimuli[0].what.x == 0.05)
    qtbot.mouseRelease(view.plotter, LEFT, pos=start)


def test_a_scene_that_is_refused_says_so_beside_the_pad_until_it_is_taken_back(
    demo, until, qtbot
) -> None:
    told, things = demo.presenting.stage.operator.told, demo.presenting.stage.operator.things
    until(lambda: things.button(0).isVisible())
    demo.editing.write(demo.history.settings.written.text.replace("radius", "radios"))
    until(lambda: "expected radius" in told.words()[1].text)
    assert "Ctrl+Z" in told.words()[1].text
    assert told.words()[1].fits
    assert not things.button(0).isVisible()
    qtbot.keyClick(demo, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    until(lambda: "expected" not in told.words()[1].text)


def test_two_points_pressed_harder_keep_their_share(window, until, qtbot) -> None:
    window.history.change("Two", -1, load_case="two-points", force=0.1)
    window.presenting.enter()
    pad = window.presenting.stage.operator.pad
    until(lambda: pad.hand is not None and pad.hand.force == pytest.approx(0.05))
    qtbot.keyClick(pad, Qt.Key.Key_PageUp)
    until(lambda: window.history.settings.force == pytest.approx(0.108))
    until(lambda: not pad.holding)


def test_the_page_on_the_demonstration_names_what_is_there(demo) -> None:
    page = (files("kappaskin_resources") / "demonstration" / "demonstration.md").read_text("utf-8")
    for button in demo.presenting.stage.operator.things.buttons():
        assert button.text() in page
    assert demo.actions_by_name["present"].shortcut().toString() == "F11"
    assert demo.actions_by_name["sound"].shortcut().toString() == "F12"
