import faulthandler
import io
import json
import logging
import sys
import threading
import zipfile
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import qWarning
from PySide6.QtWidgets import QApplication

from kappaskin import Refusal
from kappaskin_app import guard
from kappaskin_app.features.log.errors import ReportContents, write_report
from kappaskin_app.shell.log_files import CRASHES, LOG, LogFiles
from kappaskin_app.shell.window import MainWindow


def fail() -> None:
    raise RuntimeError("no such thing")


def test_what_goes_wrong_is_in_the_log_whoever_missed_it(tmp_path: Path, monkeypatch) -> None:
    told: list[str] = []
    monkeypatch.setattr(guard, "_listeners", [told.append])
    hooks = sys.excepthook, threading.excepthook
    was_on = faulthandler.is_enabled()
    log_files = LogFiles(tmp_path / "log")
    guard.guarded(fail)()
    sys.excepthook(ValueError, ValueError("in a slot"), None)
    thread = threading.Thread(target=fail, name="beside")
    thread.start()
    thread.join()
    qWarning("a warning of Qt's")
    log_files.close()
    logged = (tmp_path / "log" / LOG).read_text()
    for words in ("in fail", "no such thing", "in a slot", "in beside", "a warning of Qt's"):
        assert words in logged
    assert told == ["Error in the program: no such thing", "Error in the program: in a slot"]
    assert "started, process" in (tmp_path / "log" / CRASHES).read_text()
    assert (sys.excepthook, threading.excepthook) == hooks
    if was_on:
        faulthandler.enable()


def test_the_log_never_grows_beyond_its_files(tmp_path: Path) -> None:
    log_files = LogFiles(tmp_path)
    for handler in logging.getLogger().handlers[-1:]:
        logging.getLogger().removeHandler(handler)  # not on the screen too
    for _ in range(60):
        logging.getLogger("kappaskin").error("x" * 100_000)
    log_files.close()
    sizes = [file.stat().st_size for file in tmp_path.glob(f"{LOG}*")]
    assert len(sizes) == 4
    assert max(sizes) <= 1_000_000


@pytest.mark.full
@pytest.mark.fails_inside
def test_a_failure_is_counted_and_listed_while_the_session_goes_on(
    window: MainWindow, until
) -> None:
    window.port_search.found.connect(guard.guarded(lambda *_: fail()))
    window.port_search.found.emit([])
    window.port_search.found.emit([])
    assert window.errors.count.text() == "2 errors"
    assert window.errors.count.isVisible()
    window.notify("in passing")
    window.display.status_bar.activity.show_work("Counting: 1 s", True)
    for _ in range(5):
        QApplication.processEvents()
    assert not window.display.notice.isVisible()  # or the two would stand over each other
    assert "failure:  Error in the program: no such thing" in window.event_log.list.toPlainText()
    window.errors.count.click()
    until(lambda: window.log.table.rowCount() >= 4)
    texts = [window.log.table.item(row, 2).text() for row in range(window.log.table.rowCount())]
    assert any("RuntimeError: no such thing" in text for text in texts)
    drawn = len(window.membrane.ages)
    until(lambda: len(window.membrane.ages) > drawn + 2)


@pytest.mark.cases("True")
@pytest.mark.parametrize("ticked", [False, True])
def test_a_report_holds_readings_only_if_that_is_ticked(
    window: MainWindow, tmp_path: Path, until, ticked: bool
) -> None:
    window.actions_by_name["report"].trigger()
    dialog = window.errors.report
    assert not dialog.readings.isChecked()
    dialog.to.setText(str(tmp_path / "report.zip"))
    dialog.readings.setChecked(ticked)
    dialog.begin_button.click()
    until(lambda: not dialog.busy)
    assert dialog.words.text().startswith("Saved")
    with zipfile.ZipFile(tmp_path / "report.zip") as report:
        names = set(report.namelist())
        assert {"settings.json", "happened.txt", "state.txt", "doctor.json"} <= names
        assert ("shown.npz" in names) == ticked
        assert "numpy" in json.loads(report.read("doctor.json"))["packages"]
        if ticked:
            shown = np.load(io.BytesIO(report.read("shown.npz")))
            assert shown["curvature"].shape == (3, 100)
    dialog.close()


def test_a_report_names_no_home_folder_and_takes_the_log_along(tmp_path: Path) -> None:
    logs, path = tmp_path / "logs", tmp_path / "report.zip"
    logs.mkdir()
    (logs / LOG).write_text(f"in {Path.home()}/secret")
    (logs / f"{LOG}.1").write_text("older")
    told = ReportContents({"happened.txt": f"{Path.home()} it was"})
    list(write_report(path, told, logs, dict))
    with zipfile.ZipFile(path) as report:
        assert set(report.namelist()) == {"happened.txt", "doctor.json", LOG, f"{LOG}.1"}
        assert report.read("happened.txt") == b"~ it was"
        assert report.read(LOG) == b"in ~/secret"


def test_a_home_folder_is_not_named_where_a_text_has_to_escape_it(tmp_path, monkeypatch) -> None:
    home = tmp_path / "j\u00fcrgen"
    monkeypatch.setattr(Path, "home", lambda: home)
    path = tmp_path / "report.zip"
    doctor = {"python": str(home / "bin" / "python")}
    list(write_report(path, ReportContents({}), tmp_path, lambda: doctor))
    with zipfile.ZipFile(path) as report:
        assert json.loads(report.read("doctor.json")) == {"python": "~/bin/python"}


def test_a_log_that_cannot_be_read_is_told_in_the_report(tmp_path: Path) -> None:
    (tmp_path / LOG).mkdir()
    list(write_report(tmp_path / "report.zip", ReportContents({}), tmp_path, dict))
    with zipfile.ZipFile(tmp_path / "report.zip") as report:
        assert report.read(LOG) == b"cannot be read (Is a directory)"


def test_a_report_that_is_cancelled_leaves_nothing(tmp_path: Path) -> None:
    writing = write_report(tmp_path / "report.zip", ReportContents({}), tmp_path, dict)
    assert next(writing) == 0.0
    assert list(tmp_path.iterdir()) != []
    writing.close()
    assert list(tmp_path.iterdir()) == []


def test_a_report_is_written_over_nothing(tmp_path: Path) -> None:
    (tmp_path / "report.zip").write_bytes(b"mine")
    with pytest.raises(Refusal, match="exists already"):
        list(write_report(tmp_path / "report.zip", ReportContents({}), tmp_path))
    with pytest.raises(Refusal, match="ends in"):
        list(write_report(tmp_path / "report.txt", ReportContents({}), tmp_path))
