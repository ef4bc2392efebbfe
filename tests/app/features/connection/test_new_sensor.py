"""A board that nobody described, from its lines to a live skin, by mouse and keys."""

import json
import os
import threading
import time
import tomllib
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QFileDialog, QLabel

from kappaskin.sources import Recogniser, load_description
from kappaskin_app.features.connection.wizard import NewSensorDialog
from kappaskin_app.shell.background import Tasks

tty = pytest.importorskip("tty", reason="no pseudo-terminals on this system")
pytestmark = pytest.mark.slow
M, N, RATE = 4, 3, 100.0


class Board:
    """Prints milliseconds and the heights of 4 x 3 elements in um; `pressed` is one of them."""

    def __init__(self) -> None:
        self.pressed: int | None = None
        self.over = threading.Event()
        self._begun = time.monotonic()
        self.plug()

    def plug(self) -> None:
        self._ours, theirs = os.openpty()
        tty.setraw(theirs)
        os.set_blocking(self._ours, False)
        self.port = os.ttyname(theirs)
        self._theirs = theirs
        self.over.clear()
        self._thread = threading.Thread(target=self._print)
        self._thread.start()

    def _print(self) -> None:
        rng = np.random.default_rng(0)
        while not self.over.wait(1 / RATE):
            heights = rng.normal(0, 1.0, M * N)
            if self.pressed is not None:
                heights[self.pressed] += 200.0
            numbers = [1e3 * (time.monotonic() - self._begun), *heights]
            line = ",".join(f"{number:.2f}" for number in numbers) + "\n"
            with suppress(BlockingIOError):  # nobody reads
                os.write(self._ours, line.encode())

    def unplug(self) -> None:
        self.over.set()
        self._thread.join()
        os.close(self._ours)
        os.close(self._theirs)


@pytest.fixture
def board():
    made = Board()
    yield made
    if not made.over.is_set():
        made.unplug()


@pytest.fixture
def dialog(qtbot) -> NewSensorDialog:
    """The dialog alone."""
    made = NewSensorDialog(Tasks())
    qtbot.addWidget(made)
    return made


def click(widget) -> None:
    QTest.mouseClick(widget, Qt.MouseButton.LeftButton)


def typed(widget, text: str) -> None:
    widget.setFocus()
    QTest.keyClick(widget, Qt.Key.Key_A, Qt.KeyboardModifier.ControlModifier)
    QTest.keyClicks(widget, text)


def test_a_board_becomes_a_live_skin(window, until, board, tmp_path, monkeypatch) -> None:
    file = tmp_path / "glove.toml"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(file), ""))
    click(window.connection.new_button)
    dialog = window.new_sensor
    until(dialog.isVisible)
    typed(dialog.ports.lineEdit(), board.port)
    QTest.keyClick(dialog.ports.lineEdit(), Qt.Key.Key_Return)
    until(lambda: "13 columns" in dialog.fact.text() and "time in ms" in dialog.fact.text())
    assert "separated by commas" in dialog.fact.text()
    assert "," in dialog.raw.toPlainText()

    click(dialog.next)
    until(lambda: dialog.table.rowCount() == 13 and len(dialog.found.numbers) > 100)
    assert dialog.table.item(0, 4).text() == "time_ms"
    assert dialog.table.item(1, 4).text() == "height:0"
    assert dialog.answering() == []
    board.pressed = 7
    until(lambda: dialog.answering() == [8])
    begun = time.monotonic()
    until(lambda: time.monotonic() - begun > 4.0)  # more than all the lines that are kept
    assert dialog.answering() == [8]
    board.pressed = None
    until(lambda: dialog.answering() == [])

    click(dialog.next)
    typed(dialog.name, "Glove")
    typed(dialog.sides[0].lineEdit(), "20")
    typed(dialog.sides[1].lineEdit(), "15")
    assert [box.value() for box in dialog.grid] == [M, N]
    until(dialog.next.isEnabled)
    click(dialog.next)

    until(lambda: window.session.status.sensor.name == "Glove")
    described = tomllib.loads(file.read_text())
    assert described["skin"]["size"] == [0.02, 0.015]
    assert described["line"]["columns"] == ["time_ms", "height:0..11"]
    assert described["readings"]["scale"] == 1e-6
    assert load_description(file).sensor.name == "Glove"
    until(lambda: window.display.badge.state == "LIVE")
    assert not dialog.isVisible()


def test_columns_are_set_by_selection_and_what_cannot_be_is_said(dialog, until, board) -> None:
    dialog.begin()
    typed(dialog.ports.lineEdit(), board.port)
    click(dialog.read)
    until(lambda: dialog.next.isEnabled() and dialog.found.roles[:1] == ("time_ms",))
    click(dialog.next)
    dialog.table.selectRow(1)
    dialog.meaning.setCurrentText("Ignored")
    click(dialog.assign)
    assert dialog.table.item(1, 4).text() == "ignored"
    dialog.table.selectRow(2)
    QTest.keyClick(dialog.table, Qt.Key.Key_Down, Qt.KeyboardModifier.ShiftModifier)
    dialog.meaning.setCurrentText("Slope along y")
    dialog.element.setValue(5)
    click(dialog.assign)
    assert dialog.columns[2:5] == ("slope@90:5", "slope@90:6", "height:3")
    click(dialog.next)
    until(lambda: "noise" in dialog.fact.text() or "unit" in dialog.fact.text())
    assert not dialog.next.isEnabled()
    click(dialog.back)
    dialog.reads.setCurrentText("Slopes along x")
    dialog.reads.activated.emit(0)
    click(dialog.next)
    dialog.grid[0].setValue(1)
    until(lambda: "but Elements is 1 x" in dialog.fact.text())
    QTest.keyClick(dialog, Qt.Key.Key_Escape)
    assert not dialog.isVisible()


def test_unplugged_in_the_middle_it_says_so_and_goes_on(dialog, until, tmp_path) -> None:
    board = Board()
    link = tmp_path / "ttyBoard"
    link.symlink_to(board.port)
    dialog.begin()
    typed(dialog.ports.lineEdit(), str(link))
    click(dialog.read)
    until(lambda: "time in ms" in dialog.fact.text())
    click(dialog.next)
    dialog.table.selectRow(1)
    dialog.meaning.setCurrentText("Ignored")
    click(dialog.assign)
    board.unplug()
    until(lambda: "plug the board in again" in dialog.fact.text())
    link.unlink()
    until(lambda: "retrying" in dialog.fact.text())
    board.plug()
    link.symlink_to(board.port)
    until(lambda: "13 columns" in dialog.fact.text() and dialog.lines.trouble == "")
    assert dialog.columns[:3] == ("time_ms", "", "height:1")
    click(dialog.next)
    for box, value in zip(dialog.grid, (2, 6), strict=True):
        box.setValue(value)
    board.unplug()
    link.unlink()
    until(lambda: "retrying" in dialog.fact.text())
    board.plug()
    link.symlink_to(board.port)
    begun = time.monotonic()
    until(lambda: dialog.lines.trouble == "" and time.monotonic() - begun > 3.0)
    assert [box.value() for box in dialog.grid] == [2, 6]
    assert dialog.columns[:3] == ("time_ms", "", "height:1")
    board.unplug()
    dialog.reject()


def test_a_port_that_is_plugged_in_is_read_by_itself(dialog, until, board) -> None:
    from kappaskin.sources import Port

    dialog.begin()
    dialog.show_ports([Port("/dev/ttyS0")])
    assert dialog.lines is None
    dialog.show_ports([Port("/dev/ttyS0"), Port(board.port)])
    until(lambda: "13 columns" in dialog.fact.text())
    assert dialog.ports.currentText() == board.port
    dialog.close()
    assert dialog.lines is None


def test_a_table_that_is_dropped_is_described_and_imported(
    window, until, tmp_path, monkeypatch
) -> None:
    table, file = tmp_path / "week.csv", tmp_path / "week.toml"
    rows = (f"{n / 100},{','.join(f'{n * k % 7}' for k in range(1, 13))}" for n in range(300))
    table.write_text("time," + ",".join(f"h{k}" for k in range(12)) + "\n" + "\n".join(rows) + "\n")
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(file), ""))
    monkeypatch.setenv("XDG_DOCUMENTS_DIR", str(tmp_path))
    window.opening.open(table)
    dialog = window.new_sensor
    until(lambda: "13 columns" in dialog.fact.text())
    assert dialog.columns[:2] == ("time", "height:0")
    click(dialog.next)
    assert dialog.table.item(1, 1).text() == "h0"
    click(dialog.next)
    until(dialog.next.isEnabled)
    assert "import" in dialog.next.text()
    click(dialog.next)

    until(lambda: window.display.badge.state == "REPLAY")
    until(lambda: window.session.status.replay.length == pytest.approx(2.99))
    assert (tmp_path / "Kappaskin" / "week.mcap").exists()


def test_a_bag_that_is_dropped_is_described_and_its_topic_imported(
    window, until, tmp_path, monkeypatch
) -> None:
    bag, file = tmp_path / "bag", tmp_path / "glove.toml"
    bag.mkdir()
    with (bag / "bag_0.mcap").open("wb") as opened:
        writer = Writer(opened)
        writer.start()
        schema = writer.register_schema("k", "", b"")
        for name, count in (("/all", 3), ("/skin", 6)):
            channel = writer.register_channel(name, "json", schema)
            for n in range(200):
                data = json.dumps({"h": [n * k % 7 for k in range(1, count + 1)]}).encode()
                writer.add_message(channel, n * 10**7, data, n * 10**7)
        writer.finish()
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(file), ""))
    monkeypatch.setattr("kappaskin_app.features.connection.recordings_folder", lambda: tmp_path)
    assert window.opening.opens(bag)
    window.opening.open(bag)
    dialog = window.new_sensor
    until(lambda: "3 columns; 100 lines/s" in dialog.fact.text())
    assert dialog.topics.isVisible()
    QTest.keyClick(dialog.topics, Qt.Key.Key_Down)
    until(lambda: "6 columns" in dialog.fact.text())
    click(dialog.next)
    click(dialog.next)
    assert not dialog.form.isRowVisible(dialog.rate)
    until(dialog.next.isEnabled)
    click(dialog.next)

    until(lambda: window.display.badge.state == "REPLAY")
    until(lambda: window.session.status.replay.length == pytest.approx(1.99))
    assert len(window.session.status.sensor.layout.positions) == 6


@pytest.mark.full
def test_a_table_without_times_has_a_rate(window, until, tmp_path, monkeypatch) -> None:
    table, file = tmp_path / "a.csv", tmp_path / "a.toml"
    table.write_text("".join(f"{n * 3 % 7},{n * 5 % 7}\n" for n in range(100)))
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(file), ""))
    monkeypatch.setattr("kappaskin_app.features.connection.recordings_folder", lambda: tmp_path)
    dialog = window.new_sensor
    dialog.begin(table)
    until(lambda: "2 columns" in dialog.fact.text())
    click(dialog.next)
    click(dialog.next)
    assert dialog.form.isRowVisible(dialog.rate)
    dialog.rate.setValue(50.0)
    until(dialog.next.isEnabled)
    click(dialog.next)

    until(lambda: window.display.badge.state == "REPLAY")
    until(lambda: window.session.status.replay.length == pytest.approx(99 / 50))


def test_json_in_lines_is_described_by_its_keys(dialog, until, tmp_path, monkeypatch) -> None:
    lines, file = tmp_path / "glove.jsonl", tmp_path / "glove.toml"
    rows = ({"n": n, "skin": {"h": [n * k % 7 for k in range(1, 7)]}} for n in range(200))
    lines.write_text("".join(json.dumps(row) + "\n" for row in rows))
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(file), ""))
    made = list[tuple[Path, str, str]]()
    dialog.made.connect(lambda *what: made.append(what))
    dialog.begin(lines)
    until(lambda: "A JSON object in each line; 7 columns" in dialog.fact.text())
    click(dialog.next)
    assert dialog.table.item(1, 1).text() == "skin.h[0]"
    click(dialog.next)
    until(dialog.next.isEnabled)
    click(dialog.next)

    assert made == [(file, str(lines), "")]
    fields = tomllib.loads(file.read_text())["line"]["fields"]
    assert fields == {"n": "sequence", "skin.h": "height:0..5"}


def described(dialog, until, lines):
    dialog.begin(lines)
    until(lambda: "13 columns" in dialog.fact.text())
    for _ in range(2):
        until(dialog.next.isEnabled)
        click(dialog.next)
    until(dialog.next.isEnabled)


@pytest.fixture
def lines(tmp_path):
    file = tmp_path / "lines.csv"
    rows = (f"{n / 100},{','.join(f'{n * k % 7}' for k in range(1, 13))}" for n in range(300))
    file.write_text("time," + ",".join(f"h{k}" for k in range(12)) + "\n" + "\n".join(rows) + "\n")
    return file


def test_elements_that_are_counted_along_x_are_placed_so(
    dialog, until, lines, tmp_path, monkeypatch
) -> None:
    file = tmp_path / "rows.toml"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(file), ""))
    described(dialog, until, lines)
    dialog.along.setCurrentIndex(1)
    click(dialog.next)

    columns = tomllib.loads(file.read_text())["line"]["columns"]
    # 4 in x and 3 in y: the second column is element 3, right of the first.
    assert columns[:4] == ["time", "height:0", "height:3", "height:6"]


def test_numbers_of_elements_that_differ_from_the_columns_are_said(dialog, until, lines) -> None:
    described(dialog, until, lines)
    dialog.grid[0].setValue(3)
    until(lambda: not dialog.next.isEnabled())
    assert dialog.fact.text() == "12 elements have columns, but Elements is 3 x 3 = 9."
    dialog.grid[0].setValue(5)
    until(dialog.next.isEnabled)
    assert dialog.fact.text() == "Of 5 x 3 = 15 elements 3 have no column."


def test_a_dialog_that_is_opened_again_begins_anew(dialog, until, lines) -> None:
    described(dialog, until, lines)
    QTest.keyClick(dialog, Qt.Key.Key_Escape)
    until(lambda: not dialog.isVisible())
    dialog.begin()

    assert dialog.raw.toPlainText() == ""
    assert not dialog.next.isEnabled()
    assert dialog.ports.currentText() == str(lines)
    QTest.keyClick(dialog.ports.lineEdit(), Qt.Key.Key_Return)
    until(lambda: "13 columns" in dialog.fact.text())


def test_right_after_a_press_it_is_not_taken_for_the_rest(dialog, until, lines) -> None:
    dialog.begin(lines)
    until(lambda: "13 columns" in dialog.fact.text())
    dialog.lines.poll = lambda: None
    dialog.lines.recogniser = Recogniser(arrived=False)
    rng = np.random.default_rng(0)

    def come(count, pressed):
        for _ in range(count):
            heights = rng.normal(0, 1.0, 12)
            heights[4] += 200.0 * pressed
            line = ",".join(f"{number:.2f}" for number in (*heights, 7.0))
            dialog.lines.recogniser.feed(0.0, f"{line}\n".encode())
        dialog.look()

    come(150, pressed=False)
    for _ in range(10):
        come(20, pressed=True)
        assert dialog.answering() == [4]
    for _ in range(20):
        come(10, pressed=False)
        assert dialog.answering() == []


def test_words_after_numbers_are_said(dialog, until, board) -> None:
    dialog.begin()
    QTest.keyClicks(dialog.ports.lineEdit(), board.port)
    QTest.keyClick(dialog.ports.lineEdit(), Qt.Key.Key_Return)
    until(dialog.next.isEnabled)
    dialog.lines.recogniser = Recogniser()
    for n in range(50):
        dialog.lines.recogniser.feed(n / 10, b"sensor fail\n")
    dialog.lines.poll = lambda: None
    until(lambda: "The lines are no numbers" in dialog.fact.text())
    assert not dialog.next.isEnabled()


def test_the_source_whose_port_was_read_is_connected_again(
    window, until, board, tmp_path, monkeypatch
) -> None:
    dialog, file = window.new_sensor, tmp_path / "board.toml"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(file), ""))
    described(dialog, until, Path(board.port))
    click(dialog.next)
    until(lambda: window.display.badge.state == "LIVE")
    dialog.begin(Path(board.port))
    until(lambda: window.display.badge.state == "OFF")
    QTest.keyClick(dialog, Qt.Key.Key_Escape)
    until(lambda: window.display.badge.state == "LIVE")


def test_other_skins_than_rectangles_are_told_where_they_are_made(dialog) -> None:
    said = [label.text() for label in dialog.findChildren(QLabel) if label.objectName() == "hint"]
    assert any("mesh" in words and "Your own sensor" in words for words in said)
