import os
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QAction, QImage, QWheelEvent
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractSpinBox,
    QApplication,
    QCheckBox,
    QComboBox,
    QDockWidget,
    QLineEdit,
    QMenu,
    QPushButton,
)

from kappaskin import EDGES, SCENES, Disk, Port
from kappaskin_app.actions import plain
from kappaskin_app.panels.form import Form
from kappaskin_app.settings import READY_CASES, Settings
from kappaskin_app.views.line import Line
from kappaskin_app.window import MainWindow


def test_the_simulation_is_shown_as_a_simulation(window: MainWindow, until) -> None:
    until(lambda: window.badge.state == "SIM")
    until(lambda: window.readouts.text("contact").endswith(" mm"))
    assert window.readouts.text("rms").endswith(" mm")
    until(lambda: window.readouts.text("age").endswith(" ms"))
    assert window.readouts.text("force").endswith(" mN")


def test_no_view_is_blank(window: MainWindow, until, colours_in) -> None:
    until(lambda: len(window.membrane.ages) > 10)
    assert colours_in(window, window.membrane) > 500
    for heatmap in window.heatmaps.values():
        assert colours_in(window, heatmap.cells) > 20


def test_nothing_is_cut_off_at_1280_by_800(window: MainWindow) -> None:
    assert window.minimumSizeHint().width() <= 1280
    assert window.minimumSizeHint().height() <= 800
    for button in window.findChildren(QPushButton):
        if button.isVisible():
            assert button.width() >= button.sizeHint().width()


def test_ctrl_z_takes_back_a_change_of_settings(window: MainWindow, until, qtbot) -> None:
    window.history.change("Functions along x", -1, functions_x=5)
    until(lambda: window.session.estimate.coefficients.shape == (5, 8))
    qtbot.keyClick(window, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    until(lambda: window.history.settings.functions_x == 8)
    until(lambda: window.session.estimate.coefficients.shape == (8, 8))


def test_ctrl_z_works_while_an_editor_has_the_focus(window: MainWindow, qtbot) -> None:
    box = window.panels.basis.editor("functions_x")
    box.setFocus()
    qtbot.keyClick(box, Qt.Key.Key_Down)
    assert window.history.settings.functions_x == 7
    qtbot.keyClick(box, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert window.history.settings.functions_x == 8


def test_the_wheel_changes_no_editor_without_the_focus(window: MainWindow, qtbot) -> None:
    box = window.panels.noise.editor("noise_seed")
    window.panels.basis.editor("functions_x").setFocus()
    here = QPointF(box.rect().center())
    event = QWheelEvent(
        here,
        QPointF(box.mapToGlobal(here.toPoint())),
        QPoint(0, 0),
        QPoint(0, 120),
        Qt.MouseButton.NoButton,
        Qt.KeyboardModifier.NoModifier,
        Qt.ScrollPhase.NoScrollPhase,
        False,
    )
    QApplication.sendEvent(box, event)
    assert window.history.settings.noise_seed == 0


def test_a_basis_the_readings_do_not_decide_is_refused_in_its_panel(
    window: MainWindow, until
) -> None:
    window.history.change("Functions", -1, functions_x=12, functions_y=12)
    message = window.panels.basis.message
    until(lambda: "determine 140 of the 144" in message.text())
    assert window.session.estimate.coefficients.shape == (8, 8)
    window.history.stack.undo()
    until(lambda: not message.text())


def test_noise_turned_off_leaves_only_what_the_basis_cannot_follow(
    window: MainWindow, until
) -> None:
    window.history.change("Still", -1, load_case="line", noise_kind="none")
    until(lambda: window.session.estimate.error_rms < 1.0e-6)
    window.history.change("Noise", -1, noise_kind="gaussian", noise_rms=2.0)
    until(lambda: window.session.estimate.error_rms > 5e-5)


def _shown(window: MainWindow) -> bool:
    """Whether the load is drawn where the settings have it."""
    settings, contact = window.history.settings, window.session.estimate.true_contact
    handles = window.membrane.drag.handles
    drawn = len(handles) > 0 and np.allclose(handles[0], [settings.x, settings.y])
    return drawn and np.allclose(contact, [settings.x, settings.y])


def test_a_load_dragged_on_the_skin_is_where_the_mouse_let_go(
    window: MainWindow, until, qtbot
) -> None:
    window.history.change("Point", -1, load_case="point", x=0.05, y=0.05)
    until(lambda: _shown(window))
    view, count = window.membrane, window.history.stack.count()
    start = view.drag.on_screen().toPoint() - QPoint(0, 8)
    qtbot.mousePress(view.plotter, Qt.MouseButton.LeftButton, pos=start)
    for step in range(1, 9):
        qtbot.mouseMove(view.plotter, start + QPoint(9 * step, 2 * step))
        until(lambda: _shown(window))
    qtbot.mouseRelease(view.plotter, Qt.MouseButton.LeftButton, pos=start + QPoint(72, 16))
    moved = window.history.settings
    assert moved.x > 0.06
    assert window.history.stack.count() == count + 1
    until(lambda: _shown(window))
    end = view.drag.on_screen().toPoint()
    assert (end - start - QPoint(72, 24)).manhattanLength() <= 12
    window.history.stack.undo()
    assert window.history.settings.x == 0.05


def test_letters_typed_over_the_skin_do_not_reach_vtk(window: MainWindow, qtbot) -> None:
    window.membrane.plotter.setFocus()
    for key in "3wspfvr":
        qtbot.keyClick(window.membrane.plotter, key)
    assert not window.membrane.plotter.ren_win.GetStereoRender()


def test_a_load_cannot_be_dragged_when_nothing_comes_in(window: MainWindow, until) -> None:
    assert len(window.membrane.drag.handles) == 1
    window.actions_by_name["disconnect"].trigger()
    until(lambda: not len(window.membrane.drag.handles))
    assert not window.panels.load.editor("load_case").isEnabled()


def test_two_points_are_not_called_one(window: MainWindow, until) -> None:
    window.history.change("Two", -1, load_case="two-points", x=0.03, y=0.03, x_end=0.07, y_end=0.07)
    until(lambda: "spread" in window.readouts.text("contact"))
    window.history.change("One", -1, load_case="centre")
    until(lambda: "\N{PLUS-MINUS SIGN}" in window.readouts.text("contact"))


def test_a_port_typed_is_the_port_meant(window: MainWindow, qtbot) -> None:
    window.panels.connection.show_ports([Port("/dev/ttyACM10", "Board")])
    line = window.panels.connection.sources.lineEdit()
    line.selectAll()
    qtbot.keyClicks(line, "/dev/ttyACM1")
    assert window.panels.connection.source() == "/dev/ttyACM1"


def test_too_large_a_number_typed_becomes_the_largest_not_another(
    window: MainWindow, qtbot
) -> None:
    box = window.panels.basis.editor("functions_x")
    box.selectAll()
    qtbot.keyClicks(box, "99")
    qtbot.keyClick(box, Qt.Key.Key_Return)
    assert window.history.settings.functions_x == 64


def test_steps_of_one_setting_in_a_row_are_one_to_undo(window: MainWindow, qtbot) -> None:
    box = window.panels.basis.editor("functions_x")
    for _ in range(3):
        qtbot.keyClick(box, Qt.Key.Key_Down)
    assert window.history.settings.functions_x == 5
    window.history.stack.undo()
    assert window.history.settings.functions_x == 8


def test_turning_the_camera_does_not_move_the_load(window: MainWindow, qtbot) -> None:
    settings, corner = window.history.settings, QPoint(20, 20)
    qtbot.mousePress(window.membrane.plotter, Qt.MouseButton.LeftButton, pos=corner)
    qtbot.mouseMove(window.membrane.plotter, corner + QPoint(60, 30))
    qtbot.mouseRelease(
        window.membrane.plotter, Qt.MouseButton.LeftButton, pos=corner + QPoint(60, 30)
    )
    assert window.history.settings.camera != settings.camera
    assert replace(window.history.settings, camera=settings.camera) == settings


def test_an_absent_port_says_why_and_the_simulation_comes_back(window: MainWindow, until) -> None:
    window.panels.connection.sources.setCurrentText("/dev/ttyNOWHERE")
    window.panels.connection.connect_button.click()
    until(lambda: window.badge.state == "LOST")
    assert "there is no such port" in window.panels.connection.message.text()
    until(lambda: window.readouts.text("contact") == "\N{EN DASH}")
    window.actions_by_name["simulate"].trigger()
    until(lambda: window.badge.state == "SIM")
    assert not window.panels.connection.message.isVisible()


def test_a_scene_of_its_own_is_shown_as_it_is_and_leaves_the_load_to_itself(opened, until) -> None:
    window = opened("sim:calibration")
    until(lambda: window.session.estimate is not None)
    assert window.session.status.sensor.transduction.amplifier.gain == 35  # no load case has it
    until(lambda: window.badge.state == "SIM")
    assert not window.session.simulating
    assert "Only for the simulated skin" in window.panels.load.message.text()
    until(lambda: "red arrow" not in window.display.notice.text())  # there is none
    window.actions_by_name["simulate"].trigger()
    until(lambda: not window.panels.load.message.text())
    assert window.session.simulating


@pytest.mark.parametrize("name", READY_CASES)
def test_a_ready_scene_becomes_the_load_case(opened, until, name: str) -> None:
    window = opened(f"sim:{name}")
    until(lambda: window.session.estimate is not None)
    assert window.history.settings.load_case == name


@pytest.mark.parametrize("name", ["nonsense", "disc"])
def test_an_unknown_scene_is_refused_with_those_there_are(opened, until, name: str) -> None:
    window = opened(f"sim:{name}")
    until(lambda: window.badge.state == "LOST")
    assert f"got '{name}'" in window.panels.connection.message.text()
    for known in SCENES:
        assert known in window.panels.connection.message.text()
    assert window.history.settings.load_case == "circle"


def test_a_load_too_near_the_rim_is_warned_of_and_no_more_further_inside(
    window: MainWindow, until
) -> None:
    notice = window.display.notice
    window.history.change("Load", -1, load_case="point", x=0.003, y=0.05)
    until(lambda: "too near the rim to trust" in notice.text())
    assert "near rim" in window.readouts.text("contact")
    assert notice.toolTip()
    window.history.change("Load", -1, x=0.05)
    until(lambda: not notice.warning)
    assert "Drag the red arrow" in notice.text()


def test_a_load_over_the_rim_is_explained_where_it_is_placed(window: MainWindow, until) -> None:
    window.history.change("Load", -1, load_case="disc", x=0.001)
    until(lambda: "reaches over the rim" in window.panels.load.message.text())
    window.history.stack.undo()
    until(lambda: not window.panels.load.message.text())


def test_only_edges_that_the_skin_can_have_are_offered(window: MainWindow, until) -> None:
    def offered(panel, name: str) -> list[str]:
        box = panel.editor(name)
        return [box.itemData(i) for i in range(box.count()) if box.model().item(i).isEnabled()]

    shape, basis = window.panels.shape, window.panels.basis
    assert offered(shape, "edge") == list(EDGES)
    window.history.change("Edges", -1, edge="elastic", fit_edge="elastic")
    window.wishes.wish("shape", "cylinder")
    assert (window.history.settings.edge, window.history.settings.fit_edge) == ("hinged", "")
    _met(window, until)
    assert offered(shape, "edge") == ["hinged", "sliding", "clamped"]
    until(lambda: offered(basis, "fit_edge") == ["", "hinged", "sliding", "clamped"])


def test_a_line_too_long_for_its_place_begins_its_tooltip(qapp) -> None:
    line = Line("as short as can be")
    line.setToolTip("What it is.")
    line.resize(400, 20)
    assert line.tip() == "What it is."
    line.resize(20, 20)
    assert line.tip() == "as short as can be\n\nWhat it is."


def test_disconnecting_is_said(window: MainWindow, until) -> None:
    window.actions_by_name["disconnect"].trigger()
    until(lambda: window.badge.state == "OFF")


def test_a_killed_engine_is_started_again_and_what_was_chosen_simulated(
    window: MainWindow, until
) -> None:
    window.history.change("Point", -1, load_case="point", x=0.03, y=0.06)
    os.kill(window.session.engine.pid, 9)
    until(lambda: "was started again" in window.happenings.list.toPlainText())
    until(lambda: window.badge.state == "SIM")
    until(lambda: window.session.estimate.true_contact.tolist() == [0.03, 0.06])
    drawn = len(window.membrane.ages)
    until(lambda: len(window.membrane.ages) > drawn + 5)


def test_a_locked_range_stays_and_an_undone_one_follows_again(window: MainWindow, until) -> None:
    heatmap = window.heatmaps["xx"]
    heatmap.lock.click()
    locked = window.history.settings.range_xx
    assert locked > 0
    window.history.change("More", -1, load_case="point", force=0.9)
    until(lambda: np.nanmax(np.abs(window.session.estimate.curvature[0])) > 1.5 * locked)
    until(lambda: heatmap.bar.limits == (-locked, locked))
    window.history.stack.undo()
    window.history.stack.undo()
    assert not heatmap.lock.isChecked()


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_both_themes_draw(window: MainWindow, until, colours_in, theme: str) -> None:
    window.history.change("Theme", -1, theme=theme, colour_by="xy")
    drawn = len(window.membrane.ages)
    until(lambda: len(window.membrane.ages) > drawn + 3)
    # On a busy machine the skin may be grey for a moment, as nothing new came.
    until(lambda: colours_in(window, window.membrane) > 500)


def test_a_picture_is_saved(window: MainWindow, tmp_path: Path) -> None:
    assert window.picture(tmp_path / "a.png")
    assert not window.picture(tmp_path / "nowhere" / "a.png")
    assert QImage(str(tmp_path / "a.png")).size() == window.size()


def test_every_number_is_whole_beside_the_mark_of_a_recording(
    window: MainWindow, tmp_path: Path, until
) -> None:
    wide = window.readouts.width()
    window.taping.begin(tmp_path / "a.mcap")
    until(lambda: window.readouts.width() < wide - 50)
    until(lambda: window.readouts.text("error").endswith(" mm"))
    for line in window.readouts.findChildren(Line):
        assert line.fontMetrics().horizontalAdvance(line.text()) < line.width() - 5, line.text()
    assert window.width() == 1280
    window.taping.turn()
    until(lambda: not window.taping.recording)


def test_every_action_is_in_a_menu_and_no_shortcut_is_used_twice(window: MainWindow) -> None:
    entries = window.actions_by_name.entries
    shortcuts = [entry.action.shortcut().toString() for entry in entries.values()]
    used = [shortcut for shortcut in shortcuts if shortcut]
    assert len(used) == len(set(used))
    registered = {entry.action for entry in entries.values()}

    def within(menu: QMenu) -> set[QAction]:
        found = set(menu.actions())
        parts = [a for a in found if a.menu() is not None and a not in registered]
        return (found - set(parts)).union(*(within(part.menu()) for part in parts))

    in_menus = set().union(*(within(bar.menu()) for bar in window.menuBar().actions()))
    assert registered == in_menus


def test_every_shortcut_is_read_on_a_small_screen_under_its_menu(window: MainWindow, until) -> None:
    window.actions_by_name["shortcuts"].trigger()
    sheet = window.menus.sheet
    until(lambda: sheet.height() > 100)
    assert sheet.height() < 700
    assert sheet.width() < 1000
    rows = [sheet.list.topLevelItem(row) for row in range(sheet.list.topLevelItemCount())]
    shown = [(row.text(0), row.text(1), row.text(2)) for row in rows]
    assert shown == [
        (plain(entry.action.text()), plain(entry.menu), entry.action.shortcut().toString())
        for entry in window.actions_by_name.entries.values()
    ]
    sheet.close()


def test_every_dock_has_a_name_for_saved_layouts(window: MainWindow) -> None:
    names = [dock.objectName() for dock in window.findChildren(QDockWidget)]
    assert all(names)
    assert window.restoreState(window.saveState())


def _met(window: MainWindow, until) -> None:
    """Wait until the skin of the settings is drawn with an estimate."""
    settings = window.history.settings

    def drawn() -> bool:
        patch, estimate = window.membrane.skin.patch, window.session.estimate
        here = (patch.a, patch.b) == (settings.side_x, settings.side_y)
        count = settings.elements_x * settings.elements_y
        return here and estimate is not None and estimate.curvature.shape == (3, count)

    until(drawn)


def test_another_skin_is_drawn_bent_and_undone_flat_again(
    window: MainWindow, until, qtbot, colours_in
) -> None:
    was = window.history.settings
    box = window.panels.shape.editor("shape")
    window.panels.setCurrentIndex(1)
    qtbot.keyClick(box, "C")
    _met(window, until)
    assert window.membrane.skin.patch.radius == pytest.approx(0.0129)
    assert "radius 12.9 mm" in window.panels.connection.device.text()
    drawn = len(window.membrane.ages)
    until(lambda: len(window.membrane.ages) > drawn + 3)
    assert colours_in(window, window.membrane) > 500
    assert window.session.status.accounting.bytes_discarded == 0
    qtbot.keyClick(box, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert window.history.settings == was
    _met(window, until)
    assert not window.membrane.skin.patch.base_curvature


def test_a_skin_that_cannot_be_is_refused_in_its_panel_and_the_last_one_stays(
    window: MainWindow, until
) -> None:
    message = window.panels.shape.message
    window.wishes.wish("shape", "cylinder")
    _met(window, until)
    window.wishes.wish("base_radius", 0.004)
    until(lambda: "larger base radius" in message.text())
    assert window.session.scene.plate.patch.radius == pytest.approx(0.0129)
    window.history.change("Case", -1, load_case="point")
    assert "larger base radius" in message.text()
    window.history.stack.undo()
    window.history.stack.undo()
    until(lambda: not message.text())


def test_too_few_elements_for_the_basis_are_said_where_they_are_chosen(
    window: MainWindow, until
) -> None:
    window.history.change("Few", -1, elements_x=3, elements_y=4)
    _met(window, until)
    for panel in (window.panels.elements, window.panels.basis):
        until(lambda message=panel.message: "3 x 4 elements" in message.text())
    assert window.session.estimate.coefficients.size < 36
    assert len(window.heatmaps["xx"].cells.grab().toImage().size().toTuple()) == 2


def test_a_wrong_belief_about_the_edge_costs(window: MainWindow, until) -> None:
    window.history.change("Still", -1, load_case="centre", noise_kind="none")
    until(lambda: window.session.estimate.error_rms < 2e-5)
    window.history.change("Belief", -1, fit_edge="clamped")
    until(lambda: window.session.estimate.error_rms > 1e-3)
    window.history.change("Truth", -1, edge="clamped")
    until(lambda: window.session.status.sensor.edge == "clamped")
    until(lambda: window.session.estimate and window.session.estimate.error_rms < 2e-5)


def test_a_round_skin_is_made_beside_the_window_and_drawn_round(
    window: MainWindow, until, colours_in
) -> None:
    window.history.change("Disk", -1, shape="disk", rim_radius=0.043)  # no other test made it
    message = window.panels.shape.message
    until(lambda: "Computing this skin" in message.text())
    until(lambda: isinstance(window.membrane.skin.patch, Disk))
    until(lambda: window.session.estimate is not None and not message.text())
    until(lambda: colours_in(window, window.membrane) > 300)
    assert window.session.estimate.curvature.shape == (3, 80)
    until(lambda: "skin there curves" in window.object.text())
    window.wishes.wish("edge", "elastic")
    until(lambda: "elastic" in message.text())
    assert window.session.scene.edge == "hinged"


def test_a_load_dragged_on_a_bent_skin_is_where_the_mouse_let_go(
    window: MainWindow, until, qtbot
) -> None:
    window.wishes.wish("shape", "cylinder")
    window.history.change("Point", -1, load_case="point", force=0.3)
    _met(window, until)
    until(lambda: _shown(window))
    view = window.membrane
    start = view.drag.on_screen().toPoint()
    qtbot.mousePress(view.plotter, Qt.MouseButton.LeftButton, pos=start)
    for step in range(1, 9):
        qtbot.mouseMove(view.plotter, start + QPoint(-9 * step, 4 * step))
        until(lambda: _shown(window))
    qtbot.mouseRelease(view.plotter, Qt.MouseButton.LeftButton, pos=start + QPoint(-72, 32))
    assert window.history.settings.x < 0.017
    until(lambda: _shown(window))
    end = view.drag.on_screen().toPoint()
    assert (end - start - QPoint(-72, 32)).manhattanLength() <= 12


def test_escape_puts_a_dragged_load_back_and_leaves_nothing_to_redo(
    window: MainWindow, until, qtbot
) -> None:
    window.history.change("Point", -1, load_case="point", x=0.05, y=0.05)
    until(lambda: _shown(window))
    view, was, count = window.membrane, window.history.settings, window.history.stack.count()
    start = view.drag.on_screen().toPoint()
    qtbot.mousePress(view.plotter, Qt.MouseButton.LeftButton, pos=start)
    qtbot.mouseMove(view.plotter, start + QPoint(40, 0))
    assert window.history.settings != was
    qtbot.keyClick(view.plotter, Qt.Key.Key_Escape)
    assert window.history.settings == was
    qtbot.mouseMove(view.plotter, start + QPoint(60, 0))
    qtbot.mouseRelease(view.plotter, Qt.MouseButton.LeftButton, pos=start + QPoint(60, 0))
    assert window.history.settings == was
    assert window.history.stack.count() == count
    assert not window.history.stack.canRedo()


def test_no_height_leaves_the_picture_and_the_true_one_is_written(
    window: MainWindow, until
) -> None:
    window.history.change("High", -1, exaggeration=50, load_case="point", force=0.9)
    until(lambda: window.session.estimate.surface.max() > 0.02)
    view, times = window.membrane, window.display.scale.times
    until(lambda: times.text() != "height\n\N{MULTIPLICATION SIGN} 6")
    until(lambda: -view.skin.height.min() > 20)
    assert -view.skin.height.min() <= view.skin.deepest * (1 + 1e-9)
    written = float(times.text().split()[-1])
    assert written == pytest.approx(view.skin.deepest / window.display.ranges.deepest(), rel=5e-3)


def test_the_colours_of_the_skin_can_be_locked_and_undone(window: MainWindow, until) -> None:
    scale = window.display.scale
    until(lambda: scale.bar.limits == (0.0, 5.0))
    scale.lock.click()
    assert window.history.settings.range_displacement == pytest.approx(5e-3)
    window.history.change("More", -1, load_case="point", force=0.9)
    until(lambda: window.session.estimate.surface.max() > 0.02)
    until(lambda: window.display.ranges.deepest() > 5)
    assert scale.bar.limits == (0.0, 5.0)
    window.history.stack.undo()
    window.history.stack.undo()
    assert scale.lock.text() == "Lock"
    window.history.change("Colour", -1, colour_by="xy")
    until(lambda: scale.bar.limits[0] < 0)
    scale.lock.click()
    assert window.heatmaps["xy"].lock.isChecked()


def test_pages_are_turned_with_the_keyboard_and_every_title_is_whole(
    window: MainWindow, qtbot
) -> None:
    panels, control = window.panels, Qt.KeyboardModifier.ControlModifier
    shown = []
    for key in (Qt.Key.Key_PageDown, Qt.Key.Key_PageUp):
        qtbot.keyClick(window, key, control)
        shown.append(panels.tabText(panels.currentIndex()))
    assert shown == ["S&kin", "&Live"]
    bar = panels.tabBar()
    for index in range(panels.count()):
        text = panels.tabText(index).replace("&", "")
        assert bar.tabRect(index).width() >= bar.fontMetrics().horizontalAdvance(text) + 8
    assert bar.sizeHint().width() <= panels.width()


def test_the_whole_skin_is_seen_from_every_side(window: MainWindow, until) -> None:
    window.wishes.wish("shape", "cylinder")
    _met(window, until)
    renderer, skin = window.membrane.plotter.renderer, window.membrane.skin
    for name in ("look-from-above", "look-along-y", "look-along-x", "camera"):
        window.actions_by_name[name].trigger()
        seen = []
        for point in skin.points():
            renderer.SetWorldPoint(*point, 1.0)
            renderer.WorldToView()
            seen.append(renderer.GetViewPoint()[:2])
        assert np.abs(seen).max() < 1, name
        assert np.ptp(seen, axis=0).max() > 1, name  # and large
        written = [bool(label.GetVisibility()) for label in window.membrane.sides.labels]
        end_on = {"look-along-x": 1, "look-along-y": 2}.get(name)
        assert written == [number != end_on for number in range(3)], name


def test_every_button_and_editor_explains_itself(window: MainWindow) -> None:
    kinds = (QAbstractSpinBox, QComboBox, QAbstractButton)
    for panel in window.panels.all():
        for kind in kinds:
            for widget in panel.findChildren(kind):
                assert widget.toolTip(), (panel.title(), widget.objectName())


@pytest.mark.parametrize("shape", ["flat", "cylinder"])
def test_every_control_obeys_the_keyboard_and_can_be_undone_and_redone(
    window: MainWindow, qtbot, shape: str
) -> None:
    window.wishes.wish("shape", shape)
    window.history.change("All", -1, load_case="two-points", side_x=0.03, x=0.02, region="skin")
    obeyed = set()
    window.actions_by_name["dock-compare"].trigger()
    for page in range(window.panels.count() + 1):
        if page < window.panels.count():
            window.panels.setCurrentIndex(page)
        else:
            window.actions_by_name["dock-design"].trigger()
        for form in window.findChildren(Form):
            for editor in form.editors():
                if not editor.isVisible():
                    continue
                was, index = window.history.settings, window.history.stack.index()
                key = Qt.Key.Key_Space if isinstance(editor, QCheckBox) else Qt.Key.Key_Down
                editor.setFocus()
                if isinstance(editor, QLineEdit):
                    qtbot.keyClicks(editor, "1")
                    key = Qt.Key.Key_Return
                qtbot.keyClick(editor, key)
                if window.history.settings == was:
                    qtbot.keyClick(editor, Qt.Key.Key_Up)
                now = window.history.settings
                assert now != was, editor.objectName()
                assert window.history.stack.index() == index + 1
                window.history.stack.undo()
                assert window.history.settings == was
                window.history.stack.redo()
                assert window.history.settings == now
                window.history.stack.undo()
                obeyed.add(editor.objectName())
    asked = {f.name for f in fields(Settings) if "ask" in f.metadata}
    hidden = {"rim_radius", "size", "size_y", "design_base_radius", "design_rim_radius"}
    hidden |= {"base_radius"} if shape == "flat" else set()
    assert asked - obeyed == hidden


def test_the_heatmaps_keep_their_share_of_a_wider_window(window: MainWindow, qtbot) -> None:
    was = window.heatmaps["xx"].width()
    window.resize(1920, 1100)
    qtbot.waitUntil(lambda: window.heatmaps["xx"].width() > 1.3 * was)


def test_connecting_is_called_waiting(window: MainWindow, until) -> None:
    window.session.status = replace(window.session.status, state="waiting")
    assert window.session.badge() == "WAITING"
