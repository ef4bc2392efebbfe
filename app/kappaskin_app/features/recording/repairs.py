"""A damaged recording to a whole one beside it, asked for in a dialog."""

from pathlib import Path

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QFileDialog, QLineEdit, QWidget

from kappaskin.recording import Repaired, RepairTask
from kappaskin_app.guard import guarded
from kappaskin_app.shell.folders import repaired
from kappaskin_app.shell.work_dialog import WorkDialog, beside, choosing, ended, named, path_in


class RepairDialog(WorkDialog):
    """Asks where what is whole of a recording is to be saved; `saved` brings the new one."""

    saved = Signal(Path)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Repair a recording", "&Repair", self._begun, self._told, parent)
        self.setObjectName("repair")
        self.recording, self.to = QLineEdit(), QLineEdit()
        self.recording.setReadOnly(True)
        self.recording.setToolTip("The file that its writer did not finish; it is left as it is.")
        self.to.setToolTip("The file to write: all that can be read of the damaged one.")
        self.form.addRow(named("&Damaged", self.recording), self.recording)
        self.choose_file = choosing(self._choose)
        self.form.addRow(named("&Whole one", self.to), beside(self.to, self.choose_file))
        self._add_buttons()
        self.begin_button.setDefault(True)
        self.to.textChanged.connect(guarded(lambda *_: self._allow()))
        self._allow()

    def ask_of(self, recording: Path) -> None:
        """Ask where the repaired `recording` is to be: beside it, if no other place is chosen."""
        if not self.busy:
            self.recording.setText(str(recording))
            self.to.setText(str(repaired(recording)))
        self.ask()
        self._allow()

    def _choose(self) -> None:
        option = QFileDialog.Option.DontConfirmOverwrite  # never done: it is refused
        name, _ = QFileDialog.getSaveFileName(
            self, "Save what is whole to", self.to.text(), "Recording (*.mcap)", "", option
        )
        if name:
            self.to.setText(str(ended(name, ".mcap")))

    def _allow(self) -> None:
        super()._allow()
        for widget in (self.to, self.choose_file):
            widget.setEnabled(not self.busy)
        self.begin_button.setEnabled(bool(self.to.text().strip()) and not self.busy)

    def _begun(self) -> RepairTask:
        return RepairTask(path_in(self.recording), path_in(self.to))

    def _told(self, result: object) -> str:
        if not isinstance(result, Repaired):
            return ""
        if not (result.total or result.attachments):
            return f"Nothing was written: {result.words}."
        self.saved.emit(path_in(self.to))
        return f"Saved {result.words}. The damaged recording is as it was; this one is played."
