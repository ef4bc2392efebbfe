"""Connection panel: listed ports, selection and messages."""

import threading
import time
from dataclasses import replace

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QLineEdit, QStyleOptionViewItem

from kappaskin import Event, Status, load_scene
from kappaskin.sources import Port
from kappaskin_app.features.connection import panel as connection_panel
from kappaskin_app.features.connection.panel import ConnectionPanel, PortSearch
from kappaskin_app.features.log.events import EventLog
from kappaskin_app.shell.background import Tasks

SKIN = Port("/dev/ttyACM0", "Fingertip of ten by ten elements", "Kappa Ltd", "SN-4711", (1, 2))
BOARD = Port("/dev/ttyUSB0", "CP2102N", "Silicon Labs", "beef", (3, 4), opened=False)
PERMISSION = (
    "/dev/ttyUSB0: no permission to open it. Join the port's group with "
    "`sudo usermod -aG dialout $USER`, then log in again; retrying"
)


@pytest.fixture
def panel(shown):
    return shown(ConnectionPanel(), [SKIN, BOARD])


def listed(panel):
    return [panel.sources.itemText(place) for place in range(panel.sources.count())]


def details(panel, row):
    """The lines that the list shows of a source."""
    index = panel.sources.model().index(row, 0)
    option = QStyleOptionViewItem()
    panel.sources.itemDelegate().initStyleOption(option, index)
    return [line.strip() for line in option.text.splitlines()]


def test_ports_are_listed_with_maker_and_number_and_whether_they_may_be_opened(panel):
    assert listed(panel) == ["Simulate a device", SKIN.port, BOARD.port, "Identify devices"]
    assert details(panel, 0) == ["Simulate a device"]
    whole = [
        "/dev/ttyACM0, serial number SN-4711",
        "Fingertip of ten by ten elements, Kappa Ltd",
        "not identified",
    ]
    assert details(panel, 1) == whole
    assert details(panel, 2) == [
        "/dev/ttyUSB0, serial number beef",
        "CP2102N, Silicon Labs",
        "no permission: add yourself to the group dialout",
    ]
    assert panel.sources.itemData(1, Qt.ItemDataRole.ToolTipRole) == "\n".join(whole)
    panel.sources.setCurrentIndex(1)
    assert panel.source() == "/dev/ttyACM0"
    assert whole[0] in panel.sources.toolTip()
    panel.show_ports([replace(SKIN, description=40 * "long ")])
    line = details(panel, 1)[1]
    assert "\N{HORIZONTAL ELLIPSIS}" in line
    assert len(line) == 64


def test_the_list_shows_what_speaks_at_a_port_even_under_another_name(panel):
    sensor = replace(load_scene("centre").sensor(), name="Thumb", serial_number="T-1")
    panel.show_status(Status(state="streaming", source=SKIN.port, sensor=sensor), False)
    assert details(panel, 1)[2] == "Thumb (T-1), 10 x 10 elements"
    assert "permission" in details(panel, 2)[2]
    panel.show_ports([BOARD, replace(SKIN, port="/dev/ttyACM1")])
    assert details(panel, 2)[2] == "Thumb (T-1), 10 x 10 elements"
    other = replace(sensor, name="Palm")
    panel.show_status(Status(state="streaming", source="/dev/ttyACM1", sensor=other), False)
    assert details(panel, 2)[2] == "Palm (T-1), 10 x 10 elements"
    panel.show_ports([BOARD])
    panel.show_ports([SKIN])
    assert details(panel, 1)[2] == "not identified"


def test_the_choice_stays_when_other_ports_come_and_go(panel):
    panel.sources.setCurrentIndex(1)
    panel.show_ports([SKIN])
    panel.show_ports([Port("/dev/ttyACM7"), SKIN, BOARD])
    assert (panel.source(), panel.sources.count()) == (SKIN.port, 5)
    panel.show_ports([])
    assert panel.source() == SKIN.port  # it may come back


def test_a_plug_is_known_again_under_another_name(panel):
    panel.sources.setCurrentIndex(1)
    panel.show_ports([BOARD])
    panel.show_ports([BOARD, replace(SKIN, port="/dev/ttyACM1")])
    assert panel.source() == "/dev/ttyACM1"
    panel.show_ports([replace(SKIN, port="/dev/ttyACM2", serial_number="SN-9")])
    assert panel.source() == "/dev/ttyACM1"  # another of its kind is not it


def test_who_types_or_chooses_is_left_alone(panel, qtbot):
    line: QLineEdit = panel.sources.lineEdit()
    line.setFocus()
    line.selectAll()
    qtbot.keyClicks(line, "/dev/ttyS")
    line.setCursorPosition(4)
    panel.show_ports([SKIN])
    qtbot.keyClicks(line, "x")
    assert line.text() == "/devx/ttyS"
    panel.sources.showPopup()
    panel.show_ports([SKIN, BOARD])
    assert panel.sources.count() == 3
    panel.sources.hidePopup()
    panel.show_ports([SKIN, BOARD])
    assert panel.sources.count() == 4


def test_a_message_is_shown_whole_and_its_command_can_be_copied(panel):
    panel.show_status(Status(state="lost", message=PERMISSION), False)
    assert panel.message.text() == PERMISSION
    how = panel.message.textInteractionFlags()
    assert how & Qt.TextInteractionFlag.TextSelectableByMouse
    assert how & Qt.TextInteractionFlag.TextSelectableByKeyboard
    assert panel.copy_button.isVisible()
    panel.copy_button.click()
    assert QGuiApplication.clipboard().text() == "sudo usermod -aG dialout $USER"
    panel.show_status(Status(state="lost", message="silent"), False)
    assert not panel.copy_button.isVisible()


def test_what_was_lost_on_the_line_is_told_in_words(panel):
    sensor, counts = load_scene("centre").sensor(), Status().accounting
    panel.show_status(Status(state="streaming", sensor=sensor), True)
    assert not panel.losses.isVisible()  # nothing goes over a line
    counts = replace(counts, bytes_in=40000, discarded=(("checksum", 120),), lost=12, span=30210)
    panel.show_status(Status(state="streaming", sensor=sensor, accounting=counts), False)
    assert panel.losses.isVisible()
    told = "12 of 30,210 messages lost; 0.3 % of bytes discarded: checksum 120."
    assert panel.losses.text() == told


@pytest.fixture
def found(monkeypatch):
    """The threads in which the ports were searched."""
    calls = []
    monkeypatch.setattr(
        connection_panel.Port, "found", lambda: calls.append(threading.current_thread()) or [SKIN]
    )
    monkeypatch.setattr(connection_panel, "_PERIOD", 50)
    return calls


def test_ports_are_searched_in_the_background_while_the_list_is_visible(panel, found, until, qtbot):
    panel.activateWindow()
    tasks = Tasks()
    search = PortSearch(panel.sources, tasks, panel)
    taken = []
    search.found.connect(panel.show_ports)
    search.found.connect(taken.append)
    until(lambda: len(found) > 1 and panel.sources.count() == 3)
    assert threading.main_thread() not in found
    panel.hide()
    search.refresh()  # unless a search is running: after it there is none
    before = len(taken)
    until(lambda: len(taken) > before)
    count = len(found)
    qtbot.wait(300)
    assert len(found) == count
    search.refresh()  # requested, it searches
    until(lambda: len(found) == count + 1)
    tasks.close()
    assert not any(thread.is_alive() for thread in found)


def test_the_last_events_are_listed_newest_first_and_each_is_told_once(qtbot):
    window = EventLog()
    qtbot.addWidget(window)
    told = []
    window.notified.connect(told.append)
    began, now, status = time.time(), time.monotonic(), Status()
    window.follow(status)
    assert told == []
    for number in range(70):
        status = status.after([Event(now - 3600 + number, "gap", f"{number} messages lost")])
        window.follow(status)
        window.follow(status)
    assert told == [f"{number} messages lost" for number in range(70)]
    lines = window.list.toPlainText().splitlines()
    assert len(lines) == 64
    hour_ago = [time.localtime(wall - 3600 + 69) for wall in (began, time.time())]
    assert lines[0][:5] in [time.strftime("%H:%M", when) for when in hour_ago]
    assert lines[0].endswith("  gap:  69 messages lost")
    assert lines[-1].endswith("  gap:  6 messages lost")
    window.copy_button.click()
    assert QGuiApplication.clipboard().text().splitlines() == lines


def test_events_that_came_together_are_all_listed(qtbot):
    window = EventLog()
    qtbot.addWidget(window)
    now = time.monotonic()
    window.follow(Status().after([Event(now, "met", "a"), Event(now, "gap", "b")]))
    window.follow(Status().after([Event(now, "gap", str(n)) for n in range(100)]))
    lines = window.list.toPlainText().splitlines()
    assert [line.split()[-1] for line in (lines[0], lines[-1])] == ["99", "36"]


def test_what_happened_twice_at_once_is_listed_twice_and_told_once(qtbot):
    window = EventLog()
    qtbot.addWidget(window)
    told = []
    window.notified.connect(told.append)
    now = time.monotonic()
    window.follow(Status().after([Event(now, "met", "a skin"), Event(now, "met", "a skin")]))
    assert told == ["A skin"]
    assert len(window.list.toPlainText().splitlines()) == 2
