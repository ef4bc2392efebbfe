"""Noise added to what is shown of a device: seen, marked, and in no file and no message."""

import json
import socket
import subprocess
import sys
import time
from collections.abc import Iterator

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDoubleSpinBox

from kappaskin.recording import Verification

pytest.importorskip("pty", reason="no pseudo-terminals on this system")
QUIET, LOUD = 0.5, 2.0  # 1/m: more than the device's own noise, and that which is added


@pytest.fixture
def port() -> Iterator[str]:
    """The port of a device in a process of its own."""
    arguments = ["-m", "kappaskin", "device", "circle", "--rate", "200"]
    made = subprocess.Popen([sys.executable, *arguments], stdout=subprocess.PIPE, text=True)
    assert made.stdout is not None
    yield json.loads(made.stdout.readline())["port"]
    made.kill()
    made.communicate()


def _noises(receiver: socket.socket, count: int) -> list[float]:
    """The noise of the next published contacts, in 1/m."""
    end, found = time.monotonic() + 30, list[float]()
    while len(found) < count and time.monotonic() < end:
        message = json.loads(receiver.recv(9999))
        found += [message["noise_per_m"]] if message["kind"] == "contact" else []
    return found


def test_added_noise_is_shown_and_marked_but_neither_recorded_nor_published(
    opened, until, qtbot, port: str, tmp_path
) -> None:
    window, path = opened(port), tmp_path / "quiet.mcap"
    until(lambda: window.display.badge.state == "SIM" and window.added_noise.isVisible())
    assert window.load.isHidden()
    assert window.noise.isHidden()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(30)
        window.session.engine.publish([f"udp://127.0.0.1:{receiver.getsockname()[1]}"])
        window.session.engine.record(path)
        assert max(_noises(receiver, 5)) < QUIET

        box = window.added_noise.editor("added_noise")
        assert isinstance(box, QDoubleSpinBox)
        window.panels.reveal(window.added_noise)
        qtbot.mouseClick(box.lineEdit(), Qt.MouseButton.LeftButton)
        box.selectAll()
        qtbot.keyClicks(box, f"{LOUD}")
        qtbot.keyClick(box, Qt.Key.Key_Return)
        until(lambda: window.session.estimate.noise > LOUD / 2)
        until(lambda: "NOISE ADDED" in window.display.badge.text())
        while receiver.recv(9999) and window.session.status.recording.seconds < 2:
            qtbot.wait(20)
        assert max(_noises(receiver, 50)) < QUIET
        assert window.session.estimate.noise > LOUD / 2

    window.session.engine.record(None)
    until(lambda: path.exists())
    *_, verdict = Verification.steps(path)
    assert verdict.same, verdict.words
    window.history.stack.undo()
    until(lambda: window.display.badge.text() == "SIM")
    until(lambda: window.session.estimate.noise < QUIET)


def test_no_noise_is_added_while_a_calibration_captures_readings(
    opened, until, qtbot, port: str
) -> None:
    window = opened(port)
    until(lambda: window.display.badge.state == "SIM")
    window.requests.set("added_noise", LOUD)
    until(lambda: window.session.estimate.noise > LOUD / 2)

    window.panels.reveal(window.calibrate)
    until(lambda: window.calibrate.start.begin.isEnabled())
    qtbot.mouseClick(window.calibrate.start.begin, Qt.MouseButton.LeftButton)
    until(lambda: window.calibration.procedure is not None)
    until(lambda: not window.session.status.added_noise)
    window.calibration.cancel()
    until(lambda: window.session.status.added_noise == LOUD)
