"""Settings in the window: typed, stepped, refused where they are, undone and redone."""

from dataclasses import fields

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractSpinBox,
    QApplication,
    QCheckBox,
    QComboBox,
    QLineEdit,
)

from kappaskin_app.shell.form import Form
from kappaskin_app.shell.settings import LastingSettings, Settings
from kappaskin_app.shell.settings.scene import SHAPES
from kappaskin_app.shell.window import MainWindow


@pytest.mark.full
def test_ctrl_z_takes_back_a_change_of_settings(window: MainWindow, until, qtbot) -> None:
    window.history.change("Basis functions in x", -1, functions_x=5)
    until(lambda: window.session.estimate.coefficients.shape == (5, 8))
    qtbot.keyClick(window, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    until(lambda: window.history.settings.functions_x == 8)
    until(lambda: window.session.estimate.coefficients.shape == (8, 8))


@pytest.mark.full
def test_ctrl_z_works_while_an_editor_has_the_focus(window: MainWindow, qtbot) -> None:
    box = window.basis.editor("functions_x")
    box.setFocus()
    qtbot.keyClick(box, Qt.Key.Key_Down)
    assert window.history.settings.functions_x == 7
    qtbot.keyClick(box, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert window.history.settings.functions_x == 8


@pytest.mark.full
def test_the_wheel_changes_no_editor_without_the_focus(window: MainWindow, qtbot) -> None:
    box = window.noise.editor("noise_seed")
    window.basis.editor("functions_x").setFocus()
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


@pytest.mark.full
def test_a_basis_the_readings_do_not_decide_is_refused_in_its_panel(
    window: MainWindow, until
) -> None:
    window.history.change("Functions", -1, functions_x=12, functions_y=12)
    message = window.basis.message
    until(lambda: "determine 140 of the 144" in message.text())
    assert window.session.estimate.coefficients.shape == (8, 8)
    window.history.stack.undo()
    until(lambda: not message.text())


@pytest.mark.full
def test_noise_turned_off_leaves_only_what_the_basis_cannot_follow(
    window: MainWindow, until
) -> None:
    window.history.change("Still", -1, load_case="line", noise_kind="none")
    until(lambda: window.session.estimate.error_rms < 1.0e-6)
    window.history.change("Noise", -1, noise_kind="gaussian", noise_rms=2.0)
    until(lambda: window.session.estimate.error_rms > 5e-5)


def test_too_large_a_number_typed_becomes_the_largest_not_another(
    shared_window: MainWindow, qtbot
) -> None:
    box = shared_window.basis.editor("functions_x")
    box.selectAll()
    qtbot.keyClicks(box, "99")
    qtbot.keyClick(box, Qt.Key.Key_Return)
    assert shared_window.history.settings.functions_x == 64


def test_steps_of_one_setting_in_a_row_are_one_to_undo(shared_window: MainWindow, qtbot) -> None:
    box = shared_window.basis.editor("functions_x")
    for _ in range(3):
        qtbot.keyClick(box, Qt.Key.Key_Down)
    assert shared_window.history.settings.functions_x == 5
    shared_window.history.stack.undo()
    assert shared_window.history.settings.functions_x == 8


@pytest.mark.full
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


@pytest.mark.full
def test_a_wrong_belief_about_the_edge_costs(window: MainWindow, until) -> None:
    window.history.change("Still", -1, load_case="centre", noise_kind="none")
    until(lambda: window.session.estimate.error_rms < 3e-5)
    window.history.change("Belief", -1, fit_edge="clamped")
    until(lambda: window.session.estimate.error_rms > 1e-3)
    window.history.change("Truth", -1, edge="clamped")
    until(lambda: window.session.status.sensor.edge == "clamped")
    until(lambda: window.session.estimate and window.session.estimate.error_rms < 3e-5)


@pytest.mark.full
def test_the_colours_of_the_skin_can_be_locked_and_undone(window: MainWindow, until) -> None:
    scale = window.scale
    until(lambda: scale.bar.limits == (0.0, 5.0))
    scale.lock.click()
    assert window.history.settings.range_displacement == pytest.approx(5e-3)
    window.history.change("More", -1, load_case="point", force=0.9)
    until(lambda: window.session.estimate.surface.max() > 0.02)
    until(lambda: window.display.ranges.deepest() > 5)
    assert scale.bar.limits == (0.0, 5.0)
    window.history.stack.undo()
    window.history.stack.undo()
    assert not scale.lock.isChecked()
    window.history.change("Colour", -1, colour_by="xy")
    until(lambda: scale.bar.limits[0] < 0)
    scale.lock.click()
    assert window.heatmaps["xy"].lock.isChecked()


@pytest.mark.full
def test_every_button_and_editor_explains_itself(window: MainWindow) -> None:
    kinds = (QAbstractSpinBox, QComboBox, QAbstractButton)
    for panel in window.panels.all():
        for kind in kinds:
            for widget in panel.findChildren(kind):
                assert widget.toolTip(), (panel.title(), widget.objectName())


@pytest.mark.cases("flat")
@pytest.mark.parametrize("shape", ["flat", "cylinder", "dome", "cap"])
def test_every_control_obeys_the_keyboard_and_can_be_undone_and_redone(
    window: MainWindow, qtbot, shape: str
) -> None:
    window.session.timer.stop()
    window.session.engine.disconnect()  # it would build a pipeline for each
    window.requests.set("shape", shape)
    window.history.change("All", -1, load_case="two-points", side_x=0.03, x=0.02, region="skin")
    obeyed = set()
    window.actions_by_name["dock-compare"].trigger()
    for page in [*range(window.panels.count()), "dock-design", "dock-operator"]:
        if isinstance(page, int):
            window.panels.setCurrentIndex(page)
        else:
            window.actions_by_name[page].trigger()
        for form in window.findChildren(Form):
            redone = False
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
                obeyed.add(editor.objectName())
                if hasattr(LastingSettings, editor.objectName()):  # which undo leaves
                    assert window.history.stack.index() == index
                    window.requests.set(editor.objectName(), getattr(was, editor.objectName()))
                    continue
                assert window.history.stack.index() == index + 1
                window.history.stack.undo()
                assert window.history.settings == was
                if not redone:  # a step is redone as others are: once in each form
                    window.history.stack.redo()
                    assert window.history.settings == now
                    window.history.stack.undo()
                    redone = True
    asked = {f.name for f in fields(Settings) if "form" in f.metadata}
    lengths = {length for shape in SHAPES.values() for length in shape.lengths}
    hidden = {*lengths, *(f"design_{length}" for length in lengths), "size", "size_y"}
    hidden -= {"design_side_x", "design_side_y"}
    hidden |= {"design_pattern", "design_count", "design_rings"}  # of round skins
    hidden |= {"operator_listens", "operator_rumble", "robot_at"}  # of what is switched off
    hidden |= {"design_height_noise", "design_slope_noise"} | {"added_noise"}  # of a device
    hidden -= set(SHAPES[shape].lengths)
    assert asked - obeyed == hidden
