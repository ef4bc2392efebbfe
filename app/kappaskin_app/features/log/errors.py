"""Errors inside the program: counted, listed, and reported in one file."""

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
from PySide6.QtWidgets import QCheckBox, QFileDialog, QLabel, QLineEdit, QToolButton, QWidget

from kappaskin.cli.system import examine
from kappaskin.errors import Refusal
from kappaskin.frames import Estimate
from kappaskin_app import guard
from kappaskin_app.features.log.events import EventLog
from kappaskin_app.guard import guarded
from kappaskin_app.shell.actions import Actions
from kappaskin_app.shell.background import BackgroundThread, Tasks
from kappaskin_app.shell.folders import recordings_folder
from kappaskin_app.shell.log_files import CRASHES, LOG, log_folder
from kappaskin_app.shell.recovery import settings_text
from kappaskin_app.shell.work_dialog import WorkDialog, beside, choosing, ended, named, path_in
from kappaskin_app.theme import current, follow_look

if TYPE_CHECKING:
    from kappaskin_app.shell.window import MainWindow


_CONTENTS = (
    "Holds what went wrong (the log), what happened on the line, the settings, the versions of "
    "what is installed and this machine's ports. Your home folder is written as ~. It is saved "
    "here and sent to nobody."
)
_SHOWN = ("curvature", "residual", "coefficients", "surface")


@dataclass(frozen=True)
class Told:
    """What a window tells for a report: texts by their names, and what it shows, if wanted."""

    texts: Mapping[str, str]
    estimate: Estimate | None = None


def write_report(
    path: Path,
    told: Told,
    logs: Path,
    doctor: Callable[[], Mapping[str, object]] = examine,
) -> Generator[float | str]:
    """Write what is `told`, and the log files in `logs`, to the new file `path`.

    The share that is done before each part, and at the end in words what was written. A `Refusal`
    where `path` is no zip, is there already or cannot be written.
    """
    if path.suffix.lower() != ".zip":
        raise Refusal(f"{path.name}: expected a file that ends in .zip")
    if path.exists():
        raise Refusal(f"{path}: is there already; choose another name")
    part = path.with_name(f".{path.name}.part")
    parts = {name: text.encode() for name, text in told.texts.items()}
    parts["doctor.json"] = json.dumps(doctor(), indent=1).encode()
    for file in sorted([*logs.glob(f"{LOG}*"), *logs.glob(CRASHES)]):
        parts[file.name] = _content(file)
    home = str(Path.home())
    for written in (home, json.dumps(home)[1:-1]):  # as it is, and as JSON has it
        parts = {name: text.replace(written.encode(), b"~") for name, text in parts.items()}
    if told.estimate is not None:
        parts["shown.npz"] = _readings(told.estimate)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as packed:
            for number, (name, content) in enumerate(parts.items()):
                yield number / len(parts)
                packed.writestr(name, content)
        yield 1.0
        part.replace(path)
    except OSError as error:
        why = error.strerror or error
        raise Refusal(f"{path}: cannot be written ({why}); choose another place") from error
    finally:  # it was cancelled, maybe
        part.unlink(missing_ok=True)
    yield f"{path}: {', '.join(parts)}"


def _content(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError as error:
        return f"cannot be read ({error.strerror or error})".encode()


def _readings(estimate: Estimate) -> bytes:
    """The arrays of an estimate as a file for NumPy, in SI units."""
    packed = io.BytesIO()
    np.savez_compressed(packed, **{name: getattr(estimate, name) for name in _SHOWN})
    return packed.getvalue()


class ReportDialog(WorkDialog):
    """Asks where a report is to be saved, and whether with readings.

    `tell` tells what is so when it is written, with what is shown or without; `logs` holds the log.
    """

    def __init__(
        self, tell: Callable[[bool], Told], logs: Path, tasks: Tasks, parent: QWidget
    ) -> None:
        how = "&Save", "Writing the report", self._begun, self._told
        super().__init__(tasks, "Report what went wrong", *how, parent)
        self.setObjectName("report")
        self._tell, self._logs = tell, logs
        self.to, self.readings = QLineEdit(), QCheckBox("&With the readings that are shown")
        self.choose_file = choosing(self._choose)
        contents = QLabel(_CONTENTS)
        contents.setWordWrap(True)
        self.to.setToolTip("The zip to write; look into it before you send it.")
        self.readings.setToolTip("What the elements read just now, as numbers: one frame.")
        self.form.addRow(contents)
        self.form.addRow(named("&File", self.to), beside(self.to, self.choose_file))
        self.form.addRow(self.readings)
        self._add_buttons()
        self.begin_button.setDefault(True)
        self.to.textChanged.connect(guarded(lambda *_: self._allow()))
        self._allow()

    def ask(self) -> None:
        if not self.busy:
            now = datetime.now()
            self.to.setText(str(recordings_folder() / f"kappaskin-report-{now:%Y%m%d-%H%M%S}.zip"))
        super().ask()

    def _choose(self) -> None:
        name, _ = QFileDialog.getSaveFileName(
            self, "Save the report to", self.to.text(), "Report (*.zip)"
        )
        if name:
            self.to.setText(str(ended(name, ".zip")))

    def _allow(self) -> None:
        super()._allow()
        for widget in (self.to, self.choose_file, self.readings):
            widget.setEnabled(not self.busy)
        self.begin_button.setEnabled(bool(self.to.text().strip()) and not self.busy)

    def _begun(self) -> BackgroundThread:
        told = self._tell(self.readings.isChecked())
        return BackgroundThread(write_report, path_in(self.to), told, self._logs)

    def _told(self, result: object) -> str:
        return f"Saved {result}"


REPORT_TIP = "Save what helps to find out what went wrong, in one file"
_TIP = (
    "Things that went wrong inside, while the rest goes on. Click to read them in the Log; "
    "Help > Report saves what helps to find out why."
)


class Errors(QObject):
    """Counts what a `window` caught: `count` shows it, `report` saves what helps to mend it."""

    def __init__(self, window: "MainWindow", events: EventLog) -> None:
        super().__init__(window)
        self._window, self.events = window, events
        self.failures = 0
        self.count = QToolButton()
        self.count.setToolTip(_TIP)
        self.count.setAccessibleName("No failures")
        self.count.clicked.connect(guarded(lambda *_: window.docks.reveal("log")))
        self.count.hide()
        self.report = ReportDialog(self._tell, log_folder(), window.tasks, window)
        guard.on_failure(self._take)
        follow_look(window, self._dress)

    def add_actions(self, actions: Actions, menu: str) -> None:
        """Register what a person can do."""
        actions.add(
            "report", menu, "&Report\N{HORIZONTAL ELLIPSIS}", self.report.ask, "", REPORT_TIP
        )

    def _take(self, words: str) -> None:
        self.failures += 1
        self.count.setText(f"{self.failures} failure{'s' if self.failures > 1 else ''}")
        self.count.setAccessibleName(f"{self.count.text()}: read them")
        self.count.show()
        self.events.note("failure", words)
        self._window.tell(words)

    def _dress(self) -> None:
        self.count.setStyleSheet(f"color: {current().alert};")

    def _tell(self, with_readings: bool) -> Told:
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
        return Told(texts, session.estimate if with_readings else None)

    def close(self) -> None:
        guard.forget(self._take)
        self.report.close()
