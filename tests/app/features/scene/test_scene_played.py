"""A scene that plays in a window: stopped, sought, dragged, and connected to again."""

import os
import signal

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QImage

from kappaskin.scenes import scene_file
from kappaskin_app.features.scene.gallery import MEASURED
from kappaskin_app.shell.loads import loads_at

from .conftest import EDIT, EFFECTS_PAGE, plays


@pytest.mark.full
def test_the_timeline_stops_seeks_and_goes_on(window, panel, until, qtbot) -> None:
    panel.gallery.chosen.emit("tapping")
    until(lambda: plays(window, "tapping"))
    assert window.timeline.isVisible()
    qtbot.keyClick(window, Qt.Key.Key_P, Qt.KeyboardModifier.ControlModifier)
    until(lambda: window.session.status.playing.speed == 0)
    window.timeline.sought.emit(0.05)
    assert window.session.time == 0.05  # at once, or keys in a row would go from where it was
    until(lambda: window.session.status.playing.at == 0.05)
    first = window.session.estimate.sequence
    until(lambda: window.session.estimate.sequence > first + 50)
    assert window.session.time == pytest.approx(0.05)
    depth = window.session.estimate.surface.copy()
    window.timeline.sought.emit(0.75)
    until(lambda: np.abs(window.session.estimate.surface).max() < 0.2 * np.abs(depth).max())
    window.timeline.play_wanted.emit(True)
    until(lambda: window.session.status.playing.speed == 1)


@pytest.mark.full
def test_the_time_to_go_to_is_told_until_a_slow_engine_is_there(
    window, panel, until, qtbot
) -> None:
    panel.gallery.chosen.emit("tapping")
    until(lambda: plays(window, "tapping"))
    window.session.run(False)
    os.kill(window.session.engine.pid, signal.SIGSTOP)
    window.timeline.sought.emit(0.05)
    qtbot.wait(600)
    assert window.session.time == 0.05
    os.kill(window.session.engine.pid, signal.SIGCONT)
    until(lambda: window.session.status.playing.at == 0.05)


def test_where_nothing_moves_there_is_no_timeline(window, panel, until) -> None:
    panel.gallery.chosen.emit("fingertip")
    until(lambda: plays(window, "fingertip"))
    until(lambda: not window.timeline.isVisible())


@pytest.mark.full
def test_a_touch_of_a_written_scene_is_dragged_in_the_picture_and_in_the_text(
    window, panel, until
) -> None:
    panel.gallery.chosen.emit("sphere")
    until(lambda: plays(window, "sphere"))
    window.session.run(False)
    window.session.seek(1.5)
    scene, drag = window.session.scene, window.membrane.drag
    x, y = loads_at(scene, 1.5)[0].load.centre().tolist()
    until(lambda: drag.handles.tolist() == [[x, y]])
    drag.grabbed.emit(x, y)
    for step in range(1, 11):
        drag.dragged.emit(x + 1e-3 * step, y)
    there = np.array([x + 0.01, y])
    until(lambda: np.abs(window.session.estimate.true_contact - there).max() < 2e-3)
    drag.cancelled.emit()
    until(lambda: window.session.scene.stimuli == scene.stimuli)
    drag.grabbed.emit(x, y)
    drag.dragged.emit(x + 0.01, y)
    drag.released.emit()
    until(lambda: f"x = {x + 0.01:g}" in window.history.settings.written.text)
    until(lambda: np.abs(window.session.estimate.true_contact - there).max() < 2e-3)
    window.history.stack.undo()
    until(lambda: window.session.scene.stimuli[0].what.x == pytest.approx(x))
    drag.grabbed.emit(x, y)
    drag.dragged.emit(x + 0.01, y)
    panel.gallery.chosen.emit("hum")  # or undone, with the mouse held
    until(lambda: plays(window, "hum"))
    written = window.history.settings.written
    drag.dragged.emit(x + 0.02, y)
    drag.released.emit()
    assert window.session.scene.name == "hum"
    assert window.history.settings.written == written


def test_a_drag_begun_while_the_scene_is_computed_moves_the_load_in_it(
    window, panel, until, qtbot, pixel_of
) -> None:
    panel.gallery.chosen.emit("centre")
    until(lambda: plays(window, "centre"))
    load, written = window.session.scene.stimuli[0].what, window.history.settings.written
    x, y = load.x, load.y
    until(lambda: window.membrane.drag.handles.tolist() == [[x, y]])
    text = written.text.replace("4.70e-3", "4.60e-3")
    start, view = pixel_of(window, (x, y)), window.membrane.plotter
    window.editing.write(text)
    assert window.session.making
    qtbot.mousePress(view, Qt.MouseButton.LeftButton, pos=start)
    qtbot.mouseMove(view, start + QPoint(30, 0))
    qtbot.mouseRelease(view, Qt.MouseButton.LeftButton, pos=start + QPoint(30, 0))
    assert window.session.making
    until(lambda: window.session.scene.stimuli[0].what.x > x + 1e-3)
    assert "4.60e-3" in window.history.settings.written.text
    window.history.stack.undo()
    until(lambda: window.session.scene.stimuli[0].what.x == x)
    assert window.history.settings.written.text == text


@pytest.mark.full
def test_every_touch_is_drawn_however_many_there_are(window, panel, until) -> None:
    head = scene_file("tapping").read_text().split("[[touch]]")[0]
    places = [(0.02 + 0.02 * (n % 4), 0.02 + 0.02 * (n // 4)) for n in range(12)]
    touch = '[[touch]]\nwhat = "disc"\nx = {}\ny = {}\nradius = 0.005\nforce = 0.02\n'
    panel.editor.edited.emit(head + "".join(touch.format(*place) for place in places))
    until(lambda: len(window.membrane.drag.handles) == len(places))
    red = [actor for actor in window.membrane.plotter.renderer.GetActors() if _is_red(actor)]
    arrows = [actor for actor in red if actor.visibility and any(actor.position)]
    assert len(arrows) == len(places)
    others = [actor for actor in red if actor not in arrows and actor.visibility]
    # One circle each; the true surface is red too.
    assert [actor.mapper.dataset.n_lines for actor in others].count(len(places)) == 1


def _is_red(actor) -> bool:
    return getattr(actor, "prop", None) is not None and actor.prop.color == "#e8543f"


@pytest.mark.full
def test_what_is_played_is_neither_dragged_nor_forced_while_the_text_is_no_scene(
    window, panel, until
) -> None:
    panel.gallery.chosen.emit("sphere")
    until(lambda: plays(window, "sphere"))
    panel.setCurrentIndex(EFFECTS_PAGE)
    window.session.run(False)
    window.session.seek(1.5)
    scene, good = window.session.scene, window.history.settings.written.text
    x, y = loads_at(scene, 1.5)[0].load.centre().tolist()
    until(lambda: window.membrane.drag.handles.tolist() == [[x, y]])
    bad = good.replace("[skin]", "[skin")
    panel.editor.edited.emit(bad)
    until(lambda: panel.tabText(EDIT) == "&Edit (refused)")
    assert not panel.effects.table.isEnabled()
    drag = window.membrane.drag
    drag.grabbed.emit(x, y)
    drag.dragged.emit(x + 0.01, y)
    drag.released.emit()
    assert window.history.settings.written.text == bad
    assert window.session.scene is scene
    panel.editor.edited.emit(good)
    until(lambda: panel.tabText(EDIT) == "&Edit")
    assert panel.effects.table.isEnabled()


@pytest.mark.full
def test_connecting_again_goes_on_with_the_scene_that_was_played(window, panel, until) -> None:
    panel.gallery.chosen.emit("tapping")
    until(lambda: plays(window, "tapping"))
    killed = window.session.engine.pid
    os.kill(killed, signal.SIGTERM)
    until(lambda: window.session.engine.pid not in (killed, None))  # LOST may not have been drawn
    window.actions_by_name["connect"].trigger()
    until(lambda: window.display.badge.text() == "SIM" and plays(window, "tapping"))
    assert window.history.settings.written.file == scene_file("tapping")
    window.actions_by_name["disconnect"].trigger()
    until(lambda: window.display.badge.text() == "OFF")
    panel.gallery.chosen.emit("hum")  # which is to play it
    until(lambda: window.display.badge.text() == "SIM" and plays(window, "hum"))


@pytest.mark.cases("0")
@pytest.mark.parametrize("number", [0, 1, 2])
def test_what_others_measured_is_replayed(window, panel, until, number) -> None:
    file = list(MEASURED.values())[number]
    panel.gallery.measured[number].click()
    until(lambda: window.playback.summary is not None)
    assert window.playback.summary.path == file
    sensor = "measured-ball", "measured-plate-slopes", "measured-fibre"
    until(lambda: window.session.status.sensor.serial_number == sensor[number])
    until(lambda: np.isnan(window.session.estimate.contact.force))
    until(lambda: window.session.estimate.contact.present)
    assert window.session.estimate.surface.max() > 0.9e-3
    until(lambda: _green(window) > 30)  # of the contact's mark, in a dent that hides its place


def _green(window) -> int:
    """How many pixels of the window are green, which no colour of the skin is."""
    picture = window.grab().toImage().convertToFormat(QImage.Format.Format_RGB888)
    rows = np.frombuffer(picture.constBits(), np.uint8).reshape(picture.height(), -1)
    r, g, b = rows[:, : 3 * picture.width()].reshape(-1, 3).T.astype(float)
    return int(np.sum((g > 2.5 * r) & (g > 1.2 * b) & (g > 80)))
