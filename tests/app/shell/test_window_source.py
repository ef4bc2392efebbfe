"""The window on one source after the other: simulated, absent, refused, gone."""

import os
from dataclasses import replace

import pytest

from kappaskin.scenes import SCENES
from kappaskin.sources import Port
from kappaskin_app.shell.settings.scene import READY_CASES
from kappaskin_app.shell.window import MainWindow


@pytest.mark.full
def test_the_simulation_is_shown_as_a_simulation(window: MainWindow, until) -> None:
    until(lambda: window.display.badge.state == "SIM")
    units = {"contact": " mm", "rms": " mm", "age": " ms", "force": " N"}
    until(lambda: all(window.readouts.text(name).endswith(unit) for name, unit in units.items()))


def test_a_port_typed_is_the_port_meant(window: MainWindow, qtbot) -> None:
    window.connection.show_ports([Port("/dev/ttyACM10", "Board")])
    line = window.connection.sources.lineEdit()
    line.selectAll()
    qtbot.keyClicks(line, "/dev/ttyACM1")
    assert window.connection.source() == "/dev/ttyACM1"


@pytest.mark.full
def test_an_absent_port_says_why_and_the_simulation_comes_back(window: MainWindow, until) -> None:
    window.actions_by_name["disconnect"].trigger()  # or the simulation would stay
    until(lambda: window.session.status.state == "off")
    window.connection.sources.setCurrentText("/dev/ttyNOWHERE")
    window.connection.connect_button.click()
    until(lambda: window.display.badge.state == "LOST")
    assert "there is no such port" in window.connection.message.text()
    until(lambda: window.readouts.text("contact") == "\N{EN DASH}")
    window.actions_by_name["simulate"].trigger()
    until(lambda: window.display.badge.state == "SIM")
    assert not window.connection.message.isVisible()


@pytest.mark.full
def test_a_scene_of_its_own_is_shown_as_it_is_and_leaves_the_load_to_itself(opened, until) -> None:
    window = opened("sim:calibration")
    until(lambda: window.session.estimate is not None)
    assert window.session.status.sensor.transduction.amplifier.gain == 35  # no load case has it
    until(lambda: window.display.badge.state == "SIM")
    assert not window.session.simulating
    assert "only for the simulated skin" in window.load.message.text()
    until(lambda: "red arrow" not in window.display.notice.text())  # there is none
    window.actions_by_name["simulate"].trigger()
    until(lambda: not window.load.message.text())
    assert window.session.simulating


@pytest.mark.cases("circle")
@pytest.mark.parametrize("name", READY_CASES)
def test_a_ready_scene_becomes_the_load_case(opened, until, name: str) -> None:
    window = opened(f"sim:{name}")
    until(lambda: window.session.estimate is not None)
    assert window.history.settings.load_case == name


@pytest.mark.parametrize("name", ["nonsense", "disc"])
def test_an_unknown_scene_is_refused_with_those_there_are(opened, until, name: str) -> None:
    window = opened(f"sim:{name}")
    until(lambda: window.display.badge.state == "LOST")
    assert f"got '{name}'" in window.connection.message.text()
    for known in SCENES:
        assert known in window.connection.message.text()
    assert window.history.settings.load_case == "circle"


@pytest.mark.full
def test_disconnecting_is_said(window: MainWindow, until) -> None:
    window.actions_by_name["disconnect"].trigger()
    until(lambda: window.display.badge.state == "OFF")


@pytest.mark.full
def test_a_killed_engine_is_started_again_and_what_was_chosen_simulated(
    window: MainWindow, until
) -> None:
    window.history.change("Point", -1, load_case="point", x=0.03, y=0.06)
    os.kill(window.session.engine.pid, 9)
    until(lambda: "was started again" in window.event_log.list.toPlainText())
    until(lambda: window.display.badge.state == "SIM")
    until(lambda: window.session.estimate.true_contact.tolist() == [0.03, 0.06])
    drawn = len(window.membrane.ages)
    until(lambda: len(window.membrane.ages) > drawn + 5)


@pytest.mark.full
def test_connecting_is_called_waiting(window: MainWindow, until) -> None:
    window.session.status = replace(window.session.status, state="waiting")
    assert window.session.badge() == "WAITING"
