"""A real line in the whole window: pulled, back, another device, and the engine killed."""

import json
import os
import signal
import threading
from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt

from kappaskin import load_scene

pytest.importorskip("pty", reason="no pseudo-terminals on this system")
from kappaskin.sources import PseudoDevice

SCENE = replace(load_scene("circle"), rate=50.0)


class Plugged(PseudoDevice):
    """A device that says it is a real one, served in a thread until it is pulled."""

    def __init__(self, port, **said):
        super().__init__(SCENE)
        self._information = json.dumps(
            {**json.loads(self._information), "simulated": False, "name": "Fingertip", **said}
        )
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self.serve, args=(self._stop.is_set,))
        self._thread.start()
        self.link = port
        port.unlink(missing_ok=True)
        port.symlink_to(self.port)

    def pull(self):
        self._stop.set()
        self._thread.join()
        self.close()
        self.link.unlink()


@pytest.fixture
def plug(tmp_path):
    """PortSearch a device into the one port that there is."""
    made = []

    def plug(**said):
        made.append(Plugged(tmp_path / "ttyACM0", **said))
        return made[-1]

    yield plug
    if made[-1].link.is_symlink():
        made[-1].pull()


def kinds(window):
    lines = window.event_log.list.toPlainText().splitlines()
    return [line.split()[1].rstrip(":") for line in lines]


def test_a_line_may_fail_at_any_moment(plug, opened, until, qtbot, colours_in) -> None:
    device = plug(serial_number="A-1")
    window = opened(str(device.link))
    until(lambda: window.display.badge.state == "LIVE" and len(window.membrane.ages) > 3)
    until(lambda: "messages lost" in window.connection.losses.text())

    # A region of interest is scanned, and held for as long as the others take to come up.
    inside = tuple(10 * row + column for row in range(3, 7) for column in range(3, 7))
    window.history.change("Region", -1, region="elements", region_elements=inside)
    until(lambda: 0 < window.session.estimate.fresh.sum() < 120)
    until(lambda: window.session.status.setup.hold == pytest.approx(0.6))
    window.history.stack.undo()
    until(lambda: window.session.estimate.fresh.all())
    until(lambda: window.session.status.setup.hold == 0.1)
    until(lambda: np.abs(window.membrane.skin.height).max() > 0)  # a busy machine draws it later

    # Pulled: the last picture stays, with since when across it, and what to do in the panel alone.
    device.pull()
    until(lambda: window.display.badge.state == "LOST")
    alarm, message = window.membrane.alarm, window.connection.message
    assert alarm.text.startswith("LOST ")
    until(lambda: any(why in message.text() for why in ("connection lost", "plug the sensor in")))
    if seen := "connection lost" in message.text():  # else the first try to open it came before
        until(lambda: "gone" in kinds(window))
    assert not (seen and "connection lost" in window.statusBar().currentMessage())
    assert colours_in(window, window.membrane) > 300
    heights = window.membrane.skin.height.copy()
    until(lambda: int(alarm.text.split()[1]) >= 2)
    assert alarm.text == f"LOST {alarm.text.split()[1]} s"
    until(lambda: "plug the sensor in" in message.text())
    window.docks["settings"].hide()  # then it is across the picture
    until(lambda: message.text() in alarm.text)
    window.docks["settings"].show()
    until(lambda: message.text() not in alarm.text)
    assert np.abs(heights).max() > 0
    assert np.array_equal(window.membrane.skin.height, heights)
    generation = window.session.status.generation

    # Back: live again at once, with the same pipeline.
    device = plug(serial_number="A-1")
    until(lambda: window.display.badge.state == "LIVE")
    assert alarm.text == ""
    assert window.session.status.generation == generation
    until(lambda: kinds(window) == ["back", "gone", "met"])  # told after the state
    until(lambda: "restarted once" in window.connection.losses.text())

    # Another device on the port is said, with both names.
    device.pull()
    until(lambda: window.display.badge.state == "LOST")
    plug(serial_number="B-2", name="Thumb")
    until(lambda: window.display.badge.state == "LIVE")
    until(
        lambda: window.display.notice.warning.startswith("Another device: Thumb B-2 instead of A-1")
    )

    # The engine killed: it is started again, and said. LOST may be over before it is drawn.
    os.kill(window.session.engine.pid, signal.SIGKILL)
    until(lambda: kinds(window)[:4] == ["met", "engine", "other", "gone"])
    assert "ended unexpectedly and was started again" in window.event_log.list.toPlainText()
    until(lambda: window.display.badge.state == "LIVE")
    assert not message.isVisible()

    # What happened can be read, by key or by a click on the badge.
    qtbot.keyClick(window, Qt.Key.Key_F4)
    assert window.event_log.isVisible()
    qtbot.keyClick(window.event_log, Qt.Key.Key_Escape)
    assert not window.event_log.isVisible()
    qtbot.mouseClick(window.display.badge, Qt.MouseButton.LeftButton, pos=QPoint(5, 5))
    assert window.event_log.isVisible()
    window.event_log.close()

    # What is read from elsewhere has no other device in its place.
    assert "Another device" in window.display.notice.warning
    window.actions_by_name["simulate"].trigger()
    until(lambda: window.display.badge.state == "SIM")
    until(lambda: "Another device" not in window.display.notice.warning)
