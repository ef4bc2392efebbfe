"""Recordings as a person begins, annotates and ends them; the engine writes them."""

from datetime import datetime
from pathlib import Path

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtWidgets import QFileDialog, QInputDialog, QLineEdit, QMessageBox, QWidget

from kappaskin.live import LONGEST_NOTE, Engine, ResumeInfo, Status
from kappaskin.recording import RecordingStatus
from kappaskin_app.features.recording.recording_mark import duration_of, size_of
from kappaskin_app.features.recording.repairs import RepairDialog
from kappaskin_app.guard import guarded
from kappaskin_app.shell.actions import Actions
from kappaskin_app.shell.folders import proposed, recordings_folder, repairing, unfinished
from kappaskin_app.shell.resume import words
from kappaskin_app.shell.work_dialog import ended

FILES = "Recording (*.mcap)"
_MENU = "&Recording"
_RECORD, _STOP = "&Record\N{HORIZONTAL ELLIPSIS}", "&Stop recording"


class Taping(QObject):
    """Has the engine record, and tells how that does: `told` once, `changed` whenever it is so.

    `message` says what a person should know or do about recordings, and `alarming` whether it is
    bad news; `damaged` is the one that a repair may help then.
    """

    told = Signal(str)
    changed = Signal()

    def __init__(self, engine: Engine, window: QWidget) -> None:
        super().__init__(window)
        self._engine, self._window = engine, window
        self._replays = False
        self.written, self.ended = RecordingStatus(), ""
        """How it does, and why it ended by itself."""
        self.message, self.alarming = "", False
        self.damaged: Path | None = None
        self.repairs = RepairDialog(window)
        self._question: QMessageBox | None = None
        self._actions: Actions | None = None

    @property
    def recording(self) -> bool:
        return self.written.active

    @property
    def why_not(self) -> str:
        """Why nothing can be recorded now, or nothing."""
        if self._replays and not self.recording:
            return "This is a recording: to copy it, copy its file."
        return ""

    def add_actions(self, actions: Actions) -> None:
        """Register what a person can do."""
        self._actions = actions
        tip = "Write all that comes in to a file, or end that; it goes on when the source changes"
        actions.add("record", _MENU, _RECORD, self.turn, "Ctrl+Shift+R", tip)
        tip = "Write down what happened just now, in the recording too"
        actions.add("note", _MENU, "&Note\N{HORIZONTAL ELLIPSIS}", self.note, "Ctrl+Shift+N", tip)

    # What a person wishes.

    def turn(self) -> None:
        """Ask for a file and record to it, or end that."""
        if self.recording:
            self._engine.record(None)
        elif self.why_not:
            self.told.emit(self.why_not)
        elif (path := self._asked()) is not None:
            self.begin(path)

    def _asked(self) -> Path | None:
        """The file to record to, as a person names it."""
        path = proposed(recordings_folder(), datetime.now())
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            self.told.emit(f"{path.parent}: cannot be made ({error.strerror}); choose another")
            path = Path(path.name)
        option = QFileDialog.Option.DontConfirmOverwrite  # never done: the engine refuses
        chosen, _ = QFileDialog.getSaveFileName(
            self._window, "Record to", str(path), FILES, "", option
        )
        return ended(chosen, ".mcap") if chosen else None

    def begin(self, path: Path) -> None:
        """Record to `path`."""
        self.dismiss()
        self._say("")
        self._engine.record(path)

    def note(self) -> None:
        """Ask for a text, and let it be among what happened."""
        dialog = QInputDialog(self._window)
        dialog.setWindowTitle("Note")
        dialog.setLabelText("What happened just now, for the list and for the recording:")
        dialog.setMinimumWidth(420)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.textValueSelected.connect(guarded(self.write_down))
        dialog.open()
        for line in dialog.findChildren(QLineEdit):  # made only now
            line.setMaxLength(LONGEST_NOTE)

    def write_down(self, text: str) -> None:
        """Let `text` be among what happened, unless there is none."""
        if text.strip():
            self._engine.note(text.strip())

    def may_close(self) -> bool:
        """Whether the window may close now; asks, where that would end a recording."""
        if not self.recording:
            return True
        if self._question is None:
            self._question = self._asking()
        self._question.open()
        self._question.activateWindow()
        return False

    def _asking(self) -> QMessageBox:
        box = QMessageBox(self._window)
        box.setIcon(QMessageBox.Icon.Question)
        box.setWindowTitle("Close while recording")
        box.setText(f"{Path(self.written.path).name} is being recorded.")
        box.setInformativeText("Closing the window ends the recording; the file is whole then.")
        roles = QMessageBox.ButtonRole
        end = box.addButton("&End the recording and close", roles.AcceptRole)
        keep = box.addButton("&Keep the window", roles.RejectRole)
        box.setDefaultButton(keep)
        box.setEscapeButton(keep)
        box.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        box.finished.connect(guarded(lambda *_: self._answer(box.clickedButton() is end)))
        return box

    def _answer(self, closes: bool) -> None:
        self._question = None
        if closes:
            self._window.close()

    def dismiss(self) -> None:
        """Show no more that a recording ended by itself."""
        if self.ended:
            self.ended = ""
            self.changed.emit()

    def offer_repair(self) -> None:
        """Say which recordings were never ended, and how to repair them."""
        left = unfinished(recordings_folder())
        if not left:
            return
        file, more = left[0], f" There are {len(left)} in all." if len(left) > 1 else ""
        self._say(
            f"The recording {file.name} was never ended. What is in it can be opened as it is, or "
            f"repaired: `{repairing(file)}`.{more}",
            alarming=False,
            damaged=file,
        )
        self.told.emit(f"The recording {file.name} was never ended: see Recording on the page Live")

    def go_on(self, left: ResumeInfo, wanted: str) -> None:
        """Say what went on without a window, to one who `wanted` this source."""
        self._say(words(left, wanted), alarming=False)

    # News.

    def follow(self, status: Status) -> None:
        """Take note of how the engine is doing."""
        was, self.written = self.written, status.recording
        turned, self._replays = self._replays, status.replay is not None
        self._show_actions()
        if (now := self.written) == was:
            if self._replays != turned:
                self.changed.emit()
            return
        if now.trouble and now.trouble != was.trouble:
            self.ended = now.trouble if was.active else ""
            self._say(now.trouble)
            self.told.emit(now.trouble)
        elif was.active and not now.active:
            self.told.emit(f"Recorded {now.path}: {duration_of(now.seconds)}, {size_of(now.size)}")
        self.changed.emit()

    def _show_actions(self) -> None:
        if self._actions is not None:
            self._actions["record"].setText(_STOP if self.recording else _RECORD)
            self._actions.allow("record", self.why_not)

    def close(self) -> None:
        """End what is being repaired: it is not there then; and ask no more."""
        self.repairs.close()
        if self._question is not None:
            self._question.close()

    def _say(self, message: str, alarming: bool = True, damaged: Path | None = None) -> None:
        self.message, self.alarming, self.damaged = message, alarming, damaged
        self.changed.emit()
