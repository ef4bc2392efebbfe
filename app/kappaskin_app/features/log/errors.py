"""Errors of the program, and the report file."""

import io
import json
import zipfile
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PySide6.QtCore import QObject
from PySide6.QtWidgets import QCheckBox, QFileDialog, QToolButton, QWidget

from kappaskin._files import replacing
from kappaskin.cli.system import examine
from kappaskin.errors import Refusal
from kappaskin.frames import Estimate
from kappaskin_app import guard
from kappaskin_app.features.log.events import EventLog
from kappaskin_app.guard import guarded
from kappaskin_app.shell.actions import Actions
from kappaskin_app.shell.background import BackgroundThread, Tasks
from kappaskin_app.shell.folders import proposed
from kappaskin_app.shell.log_files import CRASHES, LOG, log_folder
from kappaskin_app.shell.recovery import settings_text
from kappaskin_app.shell.work_dialog import (
    WorkDialog,
    path_in,
    with_suffix,
)
from kappaskin_app.theme import current, follow_look
from kappaskin_app.widgets.parts import Label

if TYPE_CHECKING:
    from kappaskin_app.shell.window import MainWindow


_CONTENTS = (
    "Contains the log, the event log, the settings, the versions of the installed packages and "
    "the serial ports. Your home folder is written as ~. The file is saved on this computer and "
    "not sent."
)
_SHOWN = ("curvature", "residual", "coefficients", "surface")


@dataclass(frozen=True)
class ReportContents:
    """The contents of a report from the window: texts by name, and an estimate if requested."""

    texts: Mapping[str, str]
    estimate: Estimate | None = None


def write_report(
    path: Path,
    contents: ReportContents,
    logs: Path,
    doctor: Callable[[], Mapping[str, object]] = examine,
) -> Generator[float | str]:
    """Write the `contents`, and the log files in `logs`, to the new file `path`.

    Yields the share done before each part, at last a text. A `Refusal` where `path` is no zip,
    exists already or cannot be written.
    """
    if path.suffix.lower() != ".zip":
        raise Refusal(f"{path.name}: expected a file that ends in .zip")
    if path.exists():
        raise Refusal(f"{path}: exists already; choose another name")
    parts = {name: text.encode() for name, text in contents.texts.items()}
    parts["doctor.json"] = json.dumps(doctor(), indent=1).encode()
    for file in sorted([*logs.glob(f"{LOG}*"), *logs.glob(CRASHES)]):
        parts[file.name] = _read_bytes(file)
    for written in _written_home():
        parts = {name: text.replace(written.encode(), b"~") for name, text in parts.items()}
    if contents.estimate is not None:
        parts["shown.npz"] = _readings(contents.estimate)
    with replacing(path) as part:
        path.parent.mkdir(parents=True, exist_ok=True)
        with zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as packed:
            for number, (name, content) in enumerate(parts.items()):
                yield number / len(parts)
                packed.writestr(name, content)
        yield 1.0
    yield f"{path}: {', '.join(parts)}"


def _written_home() -> tuple[str, ...]:
    """The home folder as texts have it: plain, and as in JSON."""
    try:
        home = str(Path.home())
    except RuntimeError:  # there is none
        return ()
    return home, json.dumps(home)[1:-1]


def _read_bytes(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError as error:
        return f"cannot be read ({error.strerror or error})".encode()


def _readings(estimate: Estimate) -> bytes:
    """The arrays of an estimate as an NPZ file, in SI units."""
    packed = io.BytesIO()
    np.savez_compressed(packed, **{name: getattr(estimate, name) for name in _SHOWN})
    return packed.getvalue()


class ReportDialog(WorkDialog):
    """Asks where a report is to be saved, and whether with readings.

    `contents` returns the contents of now, with the estimate or without; `logs` is the log folder.
    """

    def __init__(
        self, contents: Callable[[bool], ReportContents], logs: Path, tasks: Tasks, parent: QWidget
    ) -> None:
        how = "&Save", "Writing the report", self._start_work, self._result_text
        super().__init__(tasks, "Error report", *how, parent)
        self.setObjectName("report")
        self._contents, self._logs = contents, logs
        self.readings = QCheckBox("&With the present readings")
        self.inputs.append(self.readings)
        explanation = Label(_CONTENTS)
        explanation.setWordWrap(True)
        self.to.setToolTip("The zip file to write; check it before you send it.")
        self.readings.setToolTip("The readings of one frame, as numbers.")
        self.form.addRow(explanation)
        self._add_file("&File", self.to, self.choose_file)
        self.form.addRow(self.readings)
        self._add_buttons()

    def ask(self) -> None:
        if not self.busy:
            now = datetime.now()
            self.to.setText(str(proposed(f"kappaskin-report-{now:%Y%m%d-%H%M%S}.zip")))
        super().ask()

    def _choose_file(self) -> None:
        name, _ = QFileDialog.getSaveFileName(
            self, "Save the report to", self.to.text(), "Report (*.zip)"
        )
        if name:
            self.to.setText(str(with_suffix(name, ".zip")))

    def _start_work(self) -> BackgroundThread:
        contents = self._contents(self.readings.isChecked())
        return BackgroundThread(write_report, path_in(self.to), contents, self._logs)

    def _result_text(self, result: object) -> str:
        return f"Saved {result}"


REPORT_TIP = "Save the log, the settings and the versions in one file"
_TIP = (
    "Errors inside the program, which continues. Click to read them in the Log; Help > Report "
    "saves a file that helps to find the cause."
)


class Errors(QObject):
    """Counts the errors caught in a `window`: `count` shows them, `report` saves a report."""

    def __init__(self, window: "MainWindow", events: EventLog) -> None:
        super().__init__(window)
        self._window, self.events = window, events
        self.failures = 0
        self.count = QToolButton()
        self.count.setToolTip(_TIP)
        self.count.setAccessibleName("No errors")
        self.count.clicked.connect(guarded(lambda *_: window.docks.reveal("log")))
        self.count.hide()
        self.report = ReportDialog(self._contents, log_folder(), window.tasks, window)
        guard.on_failure(self._take)
        follow_look(window, self._dress)

    def add_actions(self, actions: Actions, menu: str) -> None:
        """Register the action."""
        actions.add(
            "report", menu, "&Report\N{HORIZONTAL ELLIPSIS}", self.report.ask, "", REPORT_TIP
        )

    def _take(self, words: str) -> None:
        self.failures += 1
        self.count.setText(f"{self.failures} error{'s' if self.failures > 1 else ''}")
        self.count.setAccessibleName(f"{self.count.text()}: open the Log")
        self.count.show()
        self.events.note("failure", words)
        self._window.notify(words)

    def _dress(self) -> None:
        self.count.setStyleSheet(f"color: {current().alert};")

    def _contents(self, with_readings: bool) -> ReportContents:
        window, session = self._window, self._window.session
        sensor = session.status.sensor
        state = {
            "state": session.badge(),
            "source": session.source,
            "sensor": f"{sensor.name}, firmware {sensor.firmware}" if sensor else "none",
            "frames": f"{session.status.rate:.0f}/s, {session.status.accounting.lost} lost",
            "failures": self.failures,
        }
        texts = {
            "settings.json": settings_text(window.history.settings),
            "happened.txt": self.events.list.toPlainText(),
            "state.txt": "".join(f"{name}: {value}\n" for name, value in state.items()),
        }
        return ReportContents(texts, session.estimate if with_readings else None)

    def close(self) -> None:
        guard.forget(self._take)
        self.report.close()
