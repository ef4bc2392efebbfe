"""Health panel: list of faulty channels, marks of their elements, and the press test."""

import numpy as np
import pytest
from PySide6.QtCore import Qt

from kappaskin import Patch, SensorLayout, Status, load_scene
from kappaskin.calibration import PressPhase
from kappaskin.estimation import FAULTS
from kappaskin.health import Health
from kappaskin.health.findings import Finding
from kappaskin_app.features.health.panel import HealthPanel
from kappaskin_app.features.health.press import ChannelMapTest
from kappaskin_app.features.heatmaps.heatmap import Heatmap
from kappaskin_app.shell.colouring import SHADES
from kappaskin_app.shell.window import MainWindow
from kappaskin_app.theme import DARK, apply_look

STUCK = Finding(157, 57, "yy", "stuck", 100.0, "reads -1.70 1/m")
KEPT = Finding(12, 12, "xx", "dead", 20.0, "reported by the device", retained=True)


def told(panel: HealthPanel) -> list[list[str]]:
    table = panel.table
    columns = range(table.columnCount())
    return [[table.item(row, c).text() for c in columns] for row in range(table.rowCount())]


def test_findings_are_listed_with_their_age_and_figure(qapp) -> None:
    panel = HealthPanel()

    panel._show(Health((KEPT, STUCK), 2, 1, 1.08, 1.3), 130.0)  # noqa: SLF001

    assert told(panel) == [
        ["12", "xx", "dead, not excluded", "2 min", "reported by the device"],
        ["57", "yy", "stuck", "30 s", "reads \N{MINUS SIGN}1.70 1/m"],
    ]
    assert panel.words.text() == (
        "1 channel excluded, error bars +8 %, at the contact +30 %, 1 faulty but not "
        "excluded: the shape is undetermined without them."
    )
    panel._show(Health(), 130.0)  # noqa: SLF001
    assert told(panel) == []
    assert panel.words.text() == "All channels OK."


def test_without_readings_no_channel_is_said_to_be_well(qapp) -> None:
    panel = HealthPanel()
    assert panel.words.text() == "No readings arrive, so nothing is checked."
    panel._show(Health((KEPT, STUCK), 2), 130.0, streaming=False)  # noqa: SLF001
    assert panel.words.text().endswith("so nothing is checked. The faults found last are listed.")
    assert len(told(panel)) == 2


def test_a_finding_that_is_chosen_is_pointed_at(qapp, qtbot) -> None:
    panel = HealthPanel()
    panel._show(Health((KEPT, STUCK), 2), 130.0)  # noqa: SLF001
    pointed = list[int]()
    panel.pointed.connect(pointed.append)

    panel.table.selectRow(0)
    qtbot.keyClick(panel.table, Qt.Key.Key_Down)

    assert pointed == [12, 57]


def test_a_letter_and_the_value_name_the_fault_of_an_excluded_element(qapp) -> None:
    heatmap = Heatmap("xx")
    heatmap.resize(300, 260)
    apply_look(DARK)
    heatmap.show_layout(SensorLayout.regular(Patch(0.1, 0.1), 4, 4))
    heatmap.show_values(np.zeros(16), SHADES["xx"].tint(1.0))
    none, kinds = np.zeros(16, bool), np.zeros(16, np.uint8)
    heatmap.show_marks(none, none, kinds)
    bare = heatmap.cells.grab().toImage()
    pictures = []
    for kind in FAULTS[1:]:
        kinds[5] = FAULTS.index(kind)
        heatmap.show_marks(none, none, kinds)
        pictures.append(heatmap.cells.grab().toImage())
        heatmap.show_element(5)
        heatmap.show_reading(np.zeros(16))
        assert heatmap.value.text().endswith(f", {kind}")
        heatmap.show_element(-1)

    assert all(picture != bare for picture in pictures)
    assert all(a != b for a in pictures for b in pictures if a is not b)


def test_the_element_to_press_is_framed(qapp) -> None:
    heatmap = Heatmap("xx")
    heatmap.resize(300, 260)
    heatmap.show_layout(SensorLayout.regular(Patch(0.1, 0.1), 4, 4))
    heatmap.show_values(np.zeros(16), SHADES["xx"].tint(1.0))
    bare = heatmap.cells.grab().toImage()

    heatmap.show_target(5)
    assert heatmap.cells.grab().toImage() != bare

    heatmap.show_target(-1)
    assert heatmap.cells.grab().toImage() == bare


@pytest.fixture
def failing(opened, until) -> MainWindow:
    window = opened("sim:failing-elements")
    until(lambda: len(window.membrane.ages) > 2 and window.session.status.health.count >= 6)
    until(window.isActiveWindow)
    return window


@pytest.mark.full
def test_what_is_found_is_shown_in_the_list_on_the_heatmap_and_on_the_skin(
    failing: MainWindow, until, qtbot
) -> None:
    assert not failing.health.isVisible()
    qtbot.keyClick(failing, Qt.Key.Key_F3)
    assert failing.health.isVisible()
    until(lambda: {"44", "45"} <= {row[0] for row in told(failing.health)})
    assert "channels excluded, error bars +" in failing.health.words.text()
    until(lambda: failing.membrane.excluded.actor.visibility)
    failing.selection.point(44)
    until(lambda: failing.heatmaps["xx"].value.text().endswith(", dead"))
    assert failing.minimumSizeHint().height() <= 800


@pytest.mark.full
def test_marks_of_excluded_elements_go_with_their_skin(failing: MainWindow, until) -> None:
    until(lambda: failing.membrane.excluded.actor.visibility)
    failing.session.request_source("sim:circle")
    until(lambda: not failing.membrane.excluded.actor.visibility)


@pytest.mark.full
def test_a_simulated_skin_is_pressed_by_dragging_its_load(window: MainWindow, until) -> None:
    window.actions_by_name["dock-health"].trigger()
    page = window.health.press
    page.quick.click()
    assert window.press_test.running
    assert not window.session.running  # the load rests, until it is dragged
    until(lambda: window.membrane.target.actor.visibility)
    until(lambda: window.press_test.test.phase is PressPhase.PRESS)
    assert "Press it now" in page.words.text()
    asked = window.press_test.test.target
    x, y = window.session.scene.layout.positions[asked]
    wishes, at = window.editing, window.session.estimate.contact.position

    wishes.grab(*at)
    wishes.drag(float(x), float(y))
    until(lambda: window.press_test.test.done)
    wishes.release()

    assert str(window.press_test.test.done[0]) == f"element {asked} responds"
    assert page.last.text() == f"Element {asked} responds."
    page.back.click()
    assert window.press_test.test.target == asked
    page.skip.click()
    page.nothing.click()
    assert [p.verdict for p in window.press_test.test.done] == ["skipped", "nothing"]
    page.stop.click()
    assert not window.press_test.running
    assert not window.membrane.target.actor.visibility or window.selection.target == -1


@pytest.mark.full
def test_a_test_that_is_over_has_a_verdict_and_ends_with_its_device(
    window: MainWindow, until
) -> None:
    press_test, page = window.press_test, window.health.press
    window.actions_by_name["dock-health"].trigger()
    page.quick.click()
    while press_test.running:
        press_test.skip()
    assert page.verdict.text().startswith("The presses do not determine the map; element 0")
    page.quick.click()
    window.session.disconnect_from()
    until(lambda: not press_test.running)
    assert "Start again" in page.words.text()


def test_without_a_sensor_there_is_nothing_to_press(qapp) -> None:
    press_test = ChannelMapTest()

    press_test.begin(quick=True)

    assert not press_test.running
    assert press_test.message.startswith("no sensor is connected")


def test_going_back_after_a_verdict_requests_nothing_of_another_sensor(qapp) -> None:
    press_test, targets = ChannelMapTest(), []
    sensor, other = (load_scene(name).sensor() for name in ("centre", "fingertip"))
    press_test.follow(Status(state="streaming", sensor=sensor, connections=1))
    press_test.begin(False)
    while press_test.running:
        press_test.skip()
    press_test.target_changed.connect(targets.append)

    press_test.follow(Status(state="streaming", sensor=other, connections=2))
    press_test.back()

    assert set(targets) == {-1}
    assert press_test.message
