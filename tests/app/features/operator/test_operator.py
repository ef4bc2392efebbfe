"""The operator in the window: what moves the hand, what stops it, and what is said of it."""

import os
import signal
import socket
import time
from contextlib import closing

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest

from kappaskin.hand import HandTarget, TargetMessage
from kappaskin.hand.operation import decoded
from kappaskin_app.shell.settings.operation import OperationSettings


def free_address() -> str:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made:
        made.bind(("127.0.0.1", 0))
        return f"127.0.0.1:{made.getsockname()[1]}"


@pytest.fixture
def operator(shared_window, until):
    window = shared_window
    window.docks.reveal("operator")
    until(lambda: window.control.status.target.time)
    yield window
    window.history.change("", **vars(OperationSettings()))
    window.operator.pad.release()
    window.control.switch(False)
    window.docks["operator"].hide()
    until(lambda: window.control.link is None)


def place(window) -> tuple[float, float, float]:
    return window.control.status.target.position


def test_nothing_moves_before_it_is_enabled(operator, until) -> None:
    pad, before = operator.operator.pad, place(operator)
    pad.setFocus()
    QTest.keyPress(pad, Qt.Key.Key_Right)
    end = time.monotonic() + 0.3
    until(lambda: time.monotonic() > end)
    assert place(operator) == before
    assert operator.operator.state.text() == "OFF"


def test_a_held_key_moves_the_hand_until_it_is_released(operator, until) -> None:
    panel = operator.operator
    before = place(operator)[0]
    panel.enable.click()
    panel.pad.setFocus()
    QTest.keyPress(panel.pad, Qt.Key.Key_Right)
    until(lambda: place(operator)[0] > before + 1e-3)
    until(lambda: panel.state.text() == "MOVES")
    QTest.keyRelease(panel.pad, Qt.Key.Key_Right)
    until(lambda: panel.state.text() == "HOLDS STILL")
    at = place(operator)
    end = time.monotonic() + 0.2
    until(lambda: time.monotonic() > end)
    assert place(operator) == at
    assert panel.hint.text() == "Hold a key or drag in the pad."


def test_another_focus_stops_the_hand(operator, until) -> None:
    panel = operator.operator
    panel.enable.click()
    panel.pad.setFocus()
    QTest.keyPress(panel.pad, Qt.Key.Key_Down)
    until(lambda: operator.control.status.state == "following")
    panel.form.editor("operator_speed").setFocus()
    until(lambda: operator.control.status.state == "released")


def test_escape_and_another_input_switch_it_off(operator, until) -> None:
    panel = operator.operator
    panel.enable.click()
    QTest.keyPress(panel.pad, Qt.Key.Key_Escape)
    assert not panel.enable.isChecked()
    panel.enable.click()
    operator.requests.set("operator_input", "udp")
    until(lambda: not panel.enable.isChecked())
    assert not panel.grip.isEnabled()


def test_the_slider_sets_the_grip(operator, until) -> None:
    panel = operator.operator
    panel.enable.click()
    panel.grip.setValue(50)
    until(lambda: operator.control.status.target.grip == pytest.approx(0.75))
    until(lambda: operator.control.status.state == "released")
    operator.requests.set("operator_grip", 0.5)
    until(lambda: operator.control.status.target.grip == 0.5)


def test_a_glove_moves_it_by_udp_to_the_robot(operator, until) -> None:
    panel, listen = operator.operator, free_address()
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as robot,
        closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as glove,
    ):
        robot.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{robot.getsockname()[1]}"
        changes = {"operator_listens": listen, "send_to_robot": True, "robot_at": address}
        operator.history.change("t", -1, operator_input="udp", **changes)
        until(lambda: operator.control.status.sent > 2)
        panel.enable.click()
        host, port = listen.split(":")
        sent = 0

        def send(then) -> bool:
            nonlocal sent
            target = HandTarget((-0.02, 0.0, 0.0), time=time.monotonic())
            glove.sendto(TargetMessage(target, True, 5, sent).encoded(), (host, int(port)))
            sent += 1
            return then()

        until(lambda: send(lambda: panel.state.text() == "MOVES"))
        until(lambda: send(lambda: place(operator)[0] == pytest.approx(-0.02)))
        glove.sendto(b"nonsense", (host, int(port)))
        until(lambda: "expected JSON" in panel.message.text())
        until(lambda: panel.state.text() == "STALE: HOLDS STILL")
        assert decoded(robot.recv(4096)).session
        assert "followed, 0 late, 1 refused" in panel.numbers["UDP"].text()


def test_an_address_that_is_none_is_reported(operator, until) -> None:
    operator.history.change("t", -1, send_to_robot=True, robot_at="nowhere")
    until(lambda: "Expected HOST:PORT" in operator.operator.message.text())


def test_a_process_that_dies_is_reported_and_started_again(operator, until) -> None:
    panel = operator.operator
    panel.enable.click()
    os.kill(operator.control.link.process.pid, signal.SIGKILL)
    until(lambda: not panel.enable.isChecked())
    assert "ended unexpectedly" in operator.statusBar().currentMessage()
    before = operator.control.status.target.time
    panel.enable.click()
    assert panel.enable.isChecked()
    until(lambda: operator.control.status.target.time > before)


def test_a_gamepad_that_is_missing_is_reported(operator, until) -> None:
    operator.requests.set("operator_input", "gamepad")
    text = operator.operator.message.text
    until(lambda: "ip install 'kappaskin[gamepad]'" in text() or "plug one in" in text())


def test_undo_and_another_reset_leave_the_limits(operator) -> None:
    operator.requests.set("functions_x", 5)
    operator.requests.set("operator_speed", 0.01)
    operator.history.stack.undo()
    operator.requests.reset()
    assert operator.history.settings.operator_speed == 0.01


def test_the_gamepad_rumbles_as_the_finger_that_feels_most(operator) -> None:
    shared_window, feature = operator, operator.features["operator"]
    feature.feeling.felt.emit([0.2, 0.7, 0.0])
    assert feature.control.rumble == 0.7
    shared_window.requests.set("operator_rumble", False)
    feature.feeling.felt.emit([0.2, 0.7, 0.0])
    assert feature.control.rumble == 0.0
