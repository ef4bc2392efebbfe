"""The list of devices, with the mouse and the keys: choose, type, and what a failure leaves."""

import os
import threading
import time
from contextlib import closing

import pytest

pytest.importorskip("pty", reason="no pseudo-terminals on this system")
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtWidgets import QApplication, QLabel

from kappaskin import load_scene
from kappaskin.recording import Recorder
from kappaskin.sources import Port, PseudoDevice, SimulatedSource, VirtualClock
from kappaskin.sources.ports import open_port
from kappaskin_app.features.connection.panel import ConnectionPanel

PORTS = [Port("/dev/ttyACM0", "Fingertip", "Kappa Ltd", "SN-4711"), Port("/dev/ttyACM10")]
DETAILS = Qt.ItemDataRole.UserRole + 1
LEFT = Qt.MouseButton.LeftButton


class RecordedPanel(ConnectionPanel):
    """A panel that lists what it requests."""

    def __init__(self):
        super().__init__()
        self.requests = []
        self.connect_requested.connect(self.requests.append)


@pytest.fixture
def panel(qtbot, shown):
    made = shown(RecordedPanel(), PORTS)
    qtbot.waitExposed(made)
    made.activateWindow()
    return made


def opened_by_click(panel, qtbot):
    """The list, opened with the mouse."""
    qtbot.mouseClick(panel.sources.line, LEFT, pos=QPoint(30, 8))
    view = panel.sources.view()
    qtbot.waitUntil(view.isVisible)
    return view


def typed(qtbot, text):
    """Type a text into whatever has the keyboard."""
    for letter in text:
        popup = QApplication.activePopupWidget()
        qtbot.keyClicks((popup and popup.focusWidget()) or QApplication.focusWidget(), letter)


def test_a_click_opens_the_list_and_a_click_there_connects(panel, qtbot):
    view = opened_by_click(panel, qtbot)
    assert panel.requests == []
    where = view.visualRect(view.model().index(1, 0)).center()
    qtbot.mouseMove(view.viewport(), where)
    qtbot.wait(300)  # after which a release is no longer that of the click which opened it
    qtbot.mouseClick(view.viewport(), LEFT, pos=where)
    assert panel.requests == [PORTS[0].port]
    assert panel.sources.currentText() == PORTS[0].port
    assert not view.isVisible()


def test_arrows_choose_from_the_list_and_connect_with_return_alone(panel, qtbot):
    panel.sources.setFocus()
    qtbot.keyClick(panel.sources, Qt.Key.Key_Down)
    view = panel.sources.view()
    qtbot.waitUntil(view.isVisible)
    for _ in range(2):
        qtbot.keyClick(view, Qt.Key.Key_Down)
    assert panel.requests == []
    qtbot.keyClick(view, Qt.Key.Key_Return)
    assert panel.requests == [PORTS[1].port]


def test_escape_closes_the_list_and_changes_nothing(panel, qtbot):
    view = opened_by_click(panel, qtbot)
    qtbot.keyClick(view, Qt.Key.Key_Down)
    qtbot.keyClick(view, Qt.Key.Key_Escape)
    qtbot.waitUntil(lambda: not view.isVisible())
    assert (panel.requests, panel.source()) == ([], "sim:")


def test_what_is_typed_replaces_the_text_and_return_connects_it_once(panel, qtbot):
    for text in ("/dev/ttyACM1", "COM3", "/dev/ttyACM0"):
        qtbot.keyClick(opened_by_click(panel, qtbot), Qt.Key.Key_Escape)  # and once more
        opened_by_click(panel, qtbot)
        typed(qtbot, text)
        assert panel.sources.currentText() == text
        assert not panel.sources.view().isVisible()
        qtbot.keyClick(panel.sources, Qt.Key.Key_Return)
        assert panel.requests.pop() == text  # not the longer name that is listed
        assert panel.requests == []


def test_a_typed_name_that_is_listed_connects_with_return_alone(panel, qtbot):
    opened_by_click(panel, qtbot)
    typed(qtbot, PORTS[0].port)
    panel.connect_button.setFocus()
    assert panel.requests == []
    qtbot.keyClick(panel.sources, Qt.Key.Key_Return)
    assert panel.requests == [PORTS[0].port]


def test_a_click_into_text_that_is_being_typed_places_the_cursor(panel, qtbot):
    opened_by_click(panel, qtbot)
    typed(qtbot, "/dev/ttyX")
    qtbot.mouseClick(panel.sources.line, LEFT, pos=QPoint(4, 8))
    assert not panel.sources.view().isVisible()
    typed(qtbot, "Y")
    assert panel.sources.currentText() == "Y/dev/ttyX"


def test_the_wheel_does_not_change_the_source(panel, qtbot):
    panel.sources.setFocus()
    at = QPointF(30, 8)
    turn = QWheelEvent(
        at,
        panel.sources.mapToGlobal(at),
        QPoint(),
        QPoint(0, -120),
        Qt.MouseButton.NoButton,
        Qt.KeyboardModifier.NoModifier,
        Qt.ScrollPhase.NoScrollPhase,
        False,
    )
    QApplication.sendEvent(panel.sources, turn)
    assert (panel.requests, panel.source()) == ([], "sim:")


def connected(window, qtbot, text):
    """Type a source over what is in the box, and press Return."""
    view = opened_by_click(window.connection, qtbot)
    if text:
        typed(qtbot, text)
    else:
        qtbot.keyClick(view, Qt.Key.Key_Delete)
    qtbot.keyClick(window.connection.sources, Qt.Key.Key_Return)


def places_of(window, text):
    """Where in the window a text is shown."""
    shown = [label for label in window.findChildren(QLabel) if label.isVisible()]
    found = [label for label in shown if text in label.text()]
    return (
        len(found)
        + (text in window.statusBar().currentMessage())
        + (text in window.membrane.alarm.text)
    )


@pytest.mark.cases("replay")
@pytest.mark.parametrize(
    ("source", "reason"),
    [
        ("/dev/ttyABSENT7", "there is no such port"),
        ("sim:nowhere", "expected a scene among"),
        ("feed:nobody", "no program feeds it"),
        ("replay:/nowhere/x.mcap", "cannot be read"),
    ],
)
def test_a_wrong_path_leaves_the_simulation_and_one_reason(window, qtbot, until, source, reason):
    connections = window.session.status.connections
    connected(window, qtbot, source)
    until(lambda: places_of(window, reason) > 0)
    before = window.session.estimate.sequence
    until(lambda: window.session.estimate.sequence > before + 20)

    assert places_of(window, reason) == 1
    assert (window.session.source, window.session.engine.source) == ("sim:", "sim:")
    assert window.session.status.connections == connections
    assert window.display.badge.state == "SIM"
    assert window.connection.sources.currentText() == source  # to be mended

    window.connection.sources.setFocus()
    connected(window, qtbot, "sim:circle")
    until(lambda: window.session.source == "sim:circle")
    until(lambda: places_of(window, reason) == 0)


def test_bad_sources_each_have_one_reason_and_leave_the_simulation(window, qtbot, until, tmp_path):
    text = tmp_path / "notes.txt"
    text.write_text("hello")
    address = "expected host and port, such as socket://host:5000"
    nothing = "expected a source: sim:SCENE, replay:FILE, feed:NAME, a port or a URL; got no name"
    reasons = {
        f"{tmp_path}": f"{tmp_path}: a folder, not a serial port; expected a port such as",
        "": nothing,
        f"{text}": f"{text}: a file, not a serial port; expected a port such as",
        "   ": nothing,
        "/dev/null": "/dev/null: a device, not a serial port; expected a port such as",
        "http://example.org": "http://example.org: cannot be opened",
        "udp://[::1]:5005": "udp://[::1]:5005: expected the format of the datagrams",
        "socket://localhost": f"socket://localhost: {address}",
        "socket://localhost:99999": f"socket://localhost:99999: {address}",
        f"replay:{tmp_path}": "expected a recording",
        "a b  c": "a b  c: there is no such port",
        "<b>bold</b>": "<b>bold</b>: there is no such port",
    }
    panel, connections = window.connection, window.session.status.connections
    for source, reason in reasons.items():
        connected(window, qtbot, source)
        until(lambda reason=reason: places_of(window, reason) == 1)
        assert places_of(window, "Connecting to") == 0
        assert panel.sources.currentText() == source
        assert (window.session.source, window.session.engine.source) == ("sim:", "sim:")
    assert window.session.status.connections == connections
    before = window.session.estimate.sequence
    until(lambda: window.session.estimate.sequence > before + 20)
    assert window.display.badge.state == "SIM"


@pytest.mark.cases("sim:")
@pytest.mark.parametrize("scheme", ["", "sim:", "replay:"])
def test_a_source_of_10000_characters_has_a_short_reason(window, qtbot, until, scheme):
    panel, width = window.connection, window.width()
    QApplication.clipboard().setText(scheme + "x" * 10_000)
    view = opened_by_click(panel, qtbot)
    qtbot.keyClick(view, Qt.Key.Key_V, Qt.KeyboardModifier.ControlModifier)
    assert len(panel.sources.currentText()) == 10_000 + len(scheme)
    qtbot.keyClick(panel.sources, Qt.Key.Key_Return)
    reason = window.recording.message if scheme == "replay:" else panel.message
    until(lambda: "xxx" in reason.text())
    assert len(reason.text()) < 1000
    assert window.width() == width
    assert window.display.badge.state == "SIM"


def test_a_recording_without_settings_is_played_with_the_present_ones(
    window, qtbot, until, tmp_path
):
    file, clock = tmp_path / "bare.mcap", VirtualClock(1000.0)
    source = SimulatedSource(load_scene("circle"), clock, clock.sleep)
    with closing(Recorder(file, clock())) as recorder:
        source.record(recorder)
        while clock.now < 1001.0:
            source.read(0.1)
    settings = window.history.settings
    connected(window, qtbot, f"replay:{file}")
    until(lambda: streams_from(window, f"replay:{file}"))
    played = "Playing bare.mcap, with the present settings, as it has none"
    until(lambda: places_of(window, played) == 1)
    assert window.history.settings == settings

    connected(window, qtbot, str(file))  # refused, and played on
    until(lambda: places_of(window, "a file, not a serial port") == 1)
    assert window.playback.summary is not None
    assert window.transport.isVisible()
    assert places_of(window, "bare.mcap is not played") == 0


def test_a_port_that_vanishes_while_it_is_connected_leaves_the_simulation(window, qtbot, until):
    master, slave = os.openpty()
    port, panel = os.ttyname(slave), window.connection
    connected(window, qtbot, port)
    until(lambda: "The simulation runs until it answers." in panel.message.text())
    os.close(slave)
    os.close(master)
    until(lambda: "connection lost" in panel.message.text() or "no such" in panel.message.text())
    assert panel.message.text().count(port) <= 2  # what is connected, and why it is not
    assert (window.session.source, window.display.badge.state) == ("sim:", "SIM")
    qtbot.mouseClick(panel.disconnect_button, LEFT)  # Cancel
    until(lambda: panel.disconnect_button.text() == "Disconnect")
    assert not panel.message.isVisible()
    assert panel.source() == "sim:"


def test_a_silent_port_waits_beside_the_simulation_until_it_is_cancelled(window, qtbot, until):
    master, slave = os.openpty()
    port, panel = os.ttyname(slave), window.connection
    connected(window, qtbot, port)
    until(lambda: "The simulation runs until it answers." in panel.message.text())
    until(lambda: "silent" in panel.message.text())
    assert places_of(window, "silent") == 1
    assert (window.session.source, window.display.badge.state) == ("sim:", "SIM")

    assert panel.disconnect_button.text() == "Cancel"
    qtbot.mouseClick(panel.disconnect_button, LEFT)
    until(lambda: panel.disconnect_button.text() == "Disconnect")
    assert not panel.message.isVisible()
    assert (panel.source(), window.session.engine.source) == ("sim:", "sim:")
    for end in (master, slave):
        os.close(end)


def test_a_busy_port_is_named_with_who_has_it(window, qtbot, until):
    master, slave = os.openpty()
    held = open_port(os.ttyname(slave))
    connected(window, qtbot, os.ttyname(slave))
    until(lambda: "busy, opened by" in window.connection.message.text())
    assert window.display.badge.state == "SIM"
    held.close()
    for end in (master, slave):
        os.close(end)


@pytest.fixture
def device():
    """A simulated device that serves."""
    made, stop = PseudoDevice(load_scene("centre")), threading.Event()
    thread = threading.Thread(target=made.serve, args=(stop.is_set,))
    thread.start()
    yield made
    stop.set()
    thread.join()
    made.close()


@pytest.fixture
def silent():
    """The name of a port at which nothing sends."""
    master, slave = os.openpty()
    yield os.ttyname(slave)
    os.close(master)
    os.close(slave)


@pytest.fixture
def window(opened, until):
    """One for each test: what is listed and identified in one must not show in the next."""
    made = opened("sim:")
    until(lambda: made.isActiveWindow() and made.display.badge.state == "SIM")
    return made


@pytest.fixture
def ports(monkeypatch, device, silent):
    """What is plugged in: a device, a silent port, and one that may not be opened."""
    found = [Port(device.port), Port(silent), Port("/dev/ttyUSB9", opened=False)]
    monkeypatch.setattr(Port, "found", staticmethod(lambda: list(found)))
    return found


@pytest.fixture
def listing(ports, window, until):
    """The window that lists these ports."""
    listed = window.connection.sources.itemData
    until(lambda: [listed(row) for row in (1, 2, 3)] == [port.port for port in ports])
    return window


def clicked(panel, qtbot, row):
    """Click a row of the open list."""
    view = panel.sources.view()
    where = view.visualRect(view.model().index(row, 0)).center()
    qtbot.mouseMove(view.viewport(), where)
    qtbot.wait(300)
    qtbot.mouseClick(view.viewport(), LEFT, pos=where)


def streams_from(window, source):
    """Whether frames of a source are shown."""
    status = window.session.status
    return (window.session.source, status.source, status.state) == (source, source, "streaming")


def speakers(panel):
    """The last line of each listed port."""
    rows = range(1, panel.sources.count() - 1)
    return [panel.sources.itemData(row, DETAILS).splitlines()[-1].strip() for row in rows]


def test_a_click_identifies_the_devices_in_the_open_list(listing, qtbot, until):
    panel, connections = listing.connection, listing.session.status.connections
    opened_by_click(panel, qtbot)
    assert speakers(panel)[:2] == ["not identified", "not identified"]
    clicked(panel, qtbot, 4)
    until(lambda: any("listening" in text for text in speakers(panel)))
    found = "Kappaskin device: Simulated skin (SIM-0001), 300 channels"
    refused = "no permission: add yourself to the group dialout"
    until(lambda: speakers(panel) == [found, "silent", refused])
    assert panel.sources.view().isVisible()

    qtbot.keyClick(panel.sources.view(), Qt.Key.Key_Escape)
    assert (panel.source(), listing.display.badge.state) == ("sim:", "SIM")
    assert listing.session.status.connections == connections
    opened_by_click(panel, qtbot)
    assert speakers(panel) == [found, "silent", refused]


@pytest.mark.full
def test_return_identifies_the_devices_in_the_open_list(listing, qtbot, until):
    panel = listing.connection
    panel.sources.setFocus()
    qtbot.keyClick(panel.sources, Qt.Key.Key_Down)
    for _ in range(4):
        qtbot.keyClick(panel.sources.view(), Qt.Key.Key_Down)
    qtbot.keyClick(panel.sources.view(), Qt.Key.Key_Return)
    until(lambda: speakers(panel)[0].startswith("Kappaskin device"))
    assert panel.sources.view().isVisible()
    assert panel.source() == "sim:"


def test_a_device_is_connected_at_once_while_devices_are_identified(listing, device, qtbot, until):
    panel = listing.connection
    opened_by_click(panel, qtbot)
    clicked(panel, qtbot, 4)
    until(lambda: speakers(panel)[1].startswith("listening"))
    clicked(panel, qtbot, 1)
    until(lambda: streams_from(listing, device.port))
    assert not panel.message.isVisible()
    assert speakers(panel)[1] == "not identified"


def test_a_port_that_is_identified_is_closed_before_it_is_connected(listing, silent, qtbot, until):
    panel, reasons = listing.connection, []
    listing.session.source_refused.connect(reasons.append)
    opened_by_click(panel, qtbot)
    clicked(panel, qtbot, 4)
    until(lambda: speakers(panel)[1].startswith("listening"))
    clicked(panel, qtbot, 2)
    until(lambda: panel.message.text().startswith(f"Connecting to {silent}"))
    until(lambda: "silent" in panel.message.text())
    assert reasons == []  # not busy


def test_the_device_in_use_is_not_opened_to_identify_it(listing, device, qtbot, until):
    panel = listing.connection
    opened_by_click(panel, qtbot)
    clicked(panel, qtbot, 1)
    until(lambda: streams_from(listing, device.port))
    known = "Simulated skin (SIM-0001), 10 x 10 elements"
    until(lambda: speakers(panel)[0] == known)
    opened_by_click(panel, qtbot)
    clicked(panel, qtbot, 4)
    until(lambda: speakers(panel)[1] == "silent")
    assert speakers(panel)[0] == known
    assert listing.session.status.accounting.lost == 0
    assert streams_from(listing, device.port)


def test_closing_the_window_ends_the_identification(ports, opened, silent, qtbot, until):
    window = opened("sim:")
    panel = window.connection
    until(lambda: panel.sources.count() == 5 and panel.isVisible())
    opened_by_click(panel, qtbot)
    clicked(panel, qtbot, 4)
    until(lambda: speakers(panel)[1].startswith("listening"))
    qtbot.keyClick(panel.sources.view(), Qt.Key.Key_Escape)
    began = time.monotonic()
    window.close()
    assert time.monotonic() - began < 2.5  # the silent port is listened to for longer
    assert "identified_ports" not in [thread.name for thread in threading.enumerate()]
    open_port(silent).close()
