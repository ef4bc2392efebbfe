"""Recording: start, notes, stop, rename, repair."""

from datetime import datetime
from functools import partial
from pathlib import Path

from PySide6.QtCore import QObject, Qt, QUrl, Signal
from PySide6.QtGui import QDesktopServices
from PySide6.QtWidgets import QFileDialog, QInputDialog, QLineEdit, QMessageBox, QWidget

from kappaskin.errors import Refusal
from kappaskin.live import LONGEST_NOTE, ResumeInfo, Status
from kappaskin.recording import RecordingStatus, Repaired, RepairTask, part_of, renamed
from kappaskin_app.guard import guarded
from kappaskin_app.shell.actions import Actions
from kappaskin_app.shell.background import Tasks
from kappaskin_app.shell.centre import ActionBanner, BannerAction
from kappaskin_app.shell.folders import (
    RECORDINGS,
    dated,
    recordings_folder,
    repaired,
    repairing,
    unfinished,
)
from kappaskin_app.shell.recovery import resume_text
from kappaskin_app.shell.session import Session
from kappaskin_app.shell.work_dialog import (
    WorkDialog,
    path_in,
    with_suffix,
)
from kappaskin_app.widgets.parts import ELLIPSIS, sentence
from kappaskin_app.widgets.text import elapsed, file_size


class RepairDialog(WorkDialog):
    """Asks where a repaired recording is to be saved; `saved` brings its path."""

    saved = Signal(Path)

    def __init__(self, tasks: Tasks, parent: QWidget | None = None) -> None:
        how = "Re&pair", "Repairing the recording", self._start_work, self._result_text
        super().__init__(tasks, "Repair a recording", *how, parent)
        self.setObjectName("repair")
        self.recording = QLineEdit()
        self.recording.setReadOnly(True)
        self.recording.setToolTip("The damaged recording; it is not changed.")
        self.to.setToolTip("The file to write, with all that can be read of the damaged one.")
        self.form.addRow("&Damaged", self.recording)
        self._add_file("&Repaired", self.to, self.choose_file)
        self._add_buttons()

    def ask_of(self, recording: Path) -> None:
        """Ask for the path of the repaired `recording`, by default in the same folder."""
        if not self.busy:
            self.recording.setText(str(recording))
            self.to.setText(str(repaired(recording)))
        self.ask()
        self._allow()

    def _choose_file(self) -> None:
        option = QFileDialog.Option.DontConfirmOverwrite  # existing files are refused
        name, _ = QFileDialog.getSaveFileName(
            self, "Save the repaired recording to", self.to.text(), RECORDINGS, "", option
        )
        if name:
            self.to.setText(str(with_suffix(name, ".mcap")))

    def _start_work(self) -> RepairTask:
        return RepairTask(path_in(self.recording), path_in(self.to))

    def _result_text(self, result: object) -> str:
        if not isinstance(result, Repaired):
            return ""
        if not (result.total or result.attachments):
            return f"Nothing was written: {result.words}."
        self.saved.emit(path_in(self.to))
        return f"Saved {result.words}. The damaged recording is unchanged; this one is played."


_MENU = "&Recording"
_RECORD, _STOP = "&Record", "&Stop recording"
_ELSEWHERE = "Record to a file of another name or in another folder."


def _question(window: QWidget, title: str, words: str) -> QInputDialog:
    """A dialog for a line of text."""
    dialog = QInputDialog(window)
    dialog.setWindowTitle(title)
    dialog.setLabelText(words)
    dialog.setMinimumWidth(420)
    dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    return dialog


class RecordingControl(QObject):
    """Controls the engine's recorder; `notified` brings messages, `changed` reports its state.

    The `banner` shows what may be done with a recording that ended; `play_wanted` brings the path
    of one to play. `message` is the present message about recordings, an alarm where it is
    `alarming`; `damaged` is a recording that can be repaired.
    """

    notified = Signal(str)
    changed = Signal()
    play_wanted = Signal(Path)

    def __init__(
        self, session: Session, tasks: Tasks, banner: ActionBanner, window: QWidget
    ) -> None:
        super().__init__(window)
        self._session, self._banner, self._window = session, banner, window
        self._replays, self._elsewhere = False, ""  # the place of an engine in another room
        self.written = RecordingStatus()
        self.message, self.alarming = "", False
        self.damaged: Path | None = None
        self.repairs = RepairDialog(tasks, window)
        self._question: QMessageBox | None = None
        self._actions: Actions | None = None

    @property
    def recording(self) -> bool:
        return self.written.active

    @property
    def why_not(self) -> str:
        """Why nothing can be recorded now; empty where it can."""
        if self._replays and not self.recording:
            return "This is a recording: to copy it, copy its file."
        return ""

    def add_actions(self, actions: Actions) -> None:
        """Register the actions."""
        self._actions = actions
        tip = f"Start or stop recording to a file in {recordings_folder()}"
        actions.add("record", _MENU, _RECORD, self.toggle, "Ctrl+R", tip)
        tip = "Add a note to the event log and the recording"
        actions.add("note", _MENU, "&Note\N{HORIZONTAL ELLIPSIS}", self.note, "Ctrl+Shift+N", tip)

    # Requests of the user.

    def toggle(self) -> None:
        """Record to a file named by the time, or stop."""
        if self.recording:
            self._session.record(None)
        elif self.why_not:
            self.notified.emit(self.why_not)
        else:
            self.begin(dated(datetime.now(), ".mcap"))

    def _record_elsewhere(self) -> None:
        """Ask for a file, and record to it."""
        option = QFileDialog.Option.DontConfirmOverwrite  # the engine refuses existing files
        proposal = str(dated(datetime.now(), ".mcap"))
        chosen, _ = QFileDialog.getSaveFileName(
            self._window, "Record to", proposal, RECORDINGS, "", option
        )
        if chosen:
            self.begin(with_suffix(chosen, ".mcap"))

    def begin(self, path: Path) -> None:
        """Record to `path`."""
        self._banner.hide()
        self._set_message("")
        self._session.record(path)

    def note(self) -> None:
        """Ask for a note, and add it to the events."""
        dialog = _question(self._window, "Note", "Note for the event log and the recording:")
        dialog.textValueSelected.connect(guarded(self.write_down))
        dialog.open()
        for line in dialog.findChildren(QLineEdit):  # made only now
            line.setMaxLength(LONGEST_NOTE)

    def write_down(self, text: str) -> None:
        """Add `text` to the events, unless it is empty."""
        if text.strip():
            self._session.engine.note(text.strip())

    def may_close(self) -> bool:
        """Whether the window may close; asks first while recording here."""
        if not self.recording or self._elsewhere:
            return True
        if self._question is None:
            self._question = self._close_question()
        self._question.open()
        self._question.activateWindow()
        return False

    def _close_question(self) -> QMessageBox:
        box = QMessageBox(self._window)
        box.setIcon(QMessageBox.Icon.Question)
        box.setWindowTitle("Close while recording")
        box.setTextFormat(Qt.TextFormat.PlainText)
        box.setText(f"{Path(self.written.path).name} is being recorded.")
        box.setInformativeText("Closing the window ends the recording; the file is complete.")
        roles = QMessageBox.ButtonRole
        end = box.addButton("&End the recording and close", roles.AcceptRole)
        keep = box.addButton("&Continue recording", roles.RejectRole)
        box.setDefaultButton(keep)
        box.setEscapeButton(keep)
        box.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        box.finished.connect(guarded(lambda *_: self._answer(box.clickedButton() is end)))
        return box

    def _answer(self, closes: bool) -> None:
        self._question = None
        if closes:
            self._window.close()

    # What may be done with a recording that has ended.

    def _offer(self, path: Path, words: str) -> None:
        """Offer to play, rename or find the complete recording at `path`."""
        offered = (
            ("&Play", f"Play {path.name}.", partial(self.play_wanted.emit, path)),
            (f"Rena&me{ELLIPSIS}", f"Rename {path.name}.", partial(self._ask_name, path, words)),
            ("Sho&w in folder", f"Open {path.parent}.", partial(self._show_folder, path)),
        )
        self._banner.show_actions(words, str(path), [BannerAction(*each) for each in offered])

    def _ask_name(self, path: Path, words: str) -> None:
        def renames(accepted: int) -> None:
            name = dialog.textValue().strip()
            self._offer(path, words) if not accepted else self._rename(path, name, words)

        dialog = _question(self._window, "Rename", f"New name of {path.name}:")
        dialog.setTextValue(path.stem)
        dialog.finished.connect(guarded(renames))
        dialog.open()

    def _rename(self, path: Path, name: str, words: str) -> None:
        if name in (path.name, path.stem):
            self._offer(path, words)
            return
        try:
            path = renamed(path, name)
            self._offer(path, f"Renamed to {path.name}:")
        except Refusal as refusal:
            self._offer(path, sentence(str(refusal)))

    def _show_folder(self, path: Path) -> None:
        if not QDesktopServices.openUrl(QUrl.fromLocalFile(str(path.parent))):
            self.notified.emit(f"No program opens folders; the recording is {path}")

    def offer_repair(self) -> None:
        """Report unfinished recordings, and how to repair them."""
        left = unfinished(recordings_folder())
        if not left:
            return
        file, more = left[0], f" There are {len(left)} in all." if len(left) > 1 else ""
        self._set_message(
            f"The recording {file.name} is unfinished. It can be opened as it is, or "
            f"repaired: `{repairing(file)}`.{more}",
            alarming=False,
            damaged=file,
        )
        self.notified.emit(
            f"The recording {file.name} is unfinished: see Recording on the page Live"
        )

    def go_on(self, left: ResumeInfo, wanted: str) -> None:
        """Report a resumed recording to a user who requested the source `wanted`."""
        self._set_message(resume_text(left, wanted), alarming=False)

    # Status.

    def follow(self, status: Status) -> None:
        """Take the state of the recording from the status."""
        was, self.written = self.written, status.recording
        self._elsewhere = status.link.place if status.link else ""
        turned, self._replays = self._replays, status.replay is not None
        self._show_actions()
        if (now := self.written) == was:
            if self._replays != turned:
                self.changed.emit()
            return
        if now.trouble and now.trouble != was.trouble:
            part = part_of(Path(now.path))
            self._set_message(now.trouble, damaged=part if part.exists() else None)
            self.notified.emit(now.trouble)
            self._offer_way_out(now, part)
        elif was.active and not now.active:
            words = f"Recorded {elapsed(now.seconds)}, {file_size(now.size)}"
            if self._elsewhere:
                self._set_message(f"{words}: {now.path} at {self._elsewhere}.", alarming=False)
            else:
                self._offer(Path(now.path), f"{words}:")
        self.changed.emit()

    def _offer_way_out(self, now: RecordingStatus, part: Path) -> None:
        """Show an error in the banner, with what can be done about it."""
        if Path(now.path).exists() and now.messages:  # complete up to a full disk
            self._offer(Path(now.path), sentence(now.trouble))
            return
        repair = BannerAction(
            f"Re&pair{ELLIPSIS}", f"Complete {part.name}.", partial(self.repairs.ask_of, part)
        )
        elsewhere = BannerAction(f"Record else&where{ELLIPSIS}", _ELSEWHERE, self._record_elsewhere)
        offered = [repair] if part.exists() and now.messages else [elsewhere]
        self._banner.show_actions(sentence(now.trouble), now.path, offered)

    def _show_actions(self) -> None:
        if self._actions is not None:
            self._actions["record"].setText(_STOP if self.recording else _RECORD)
            self._actions.allow("record", self.why_not)

    def close(self) -> None:
        """Cancel a repair, and close the question."""
        self.repairs.close()
        if self._question is not None:
            self._question.close()

    def _set_message(
        self, message: str, alarming: bool = True, damaged: Path | None = None
    ) -> None:
        self.message, self.alarming, self.damaged = message, alarming, damaged
        self.changed.emit()
