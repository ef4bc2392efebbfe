"""Recording: start, notes, stop, repair."""

from datetime import datetime
from pathlib import Path

from PySide6.QtCore import QObject, QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QFont, QMouseEvent, QPainter, QPaintEvent
from PySide6.QtWidgets import (
    QFileDialog,
    QInputDialog,
    QLineEdit,
    QMessageBox,
    QSizePolicy,
    QWidget,
)

from kappaskin.live import LONGEST_NOTE, Engine, ResumeInfo, Status
from kappaskin.recording import RecordingStatus, Repaired, RepairTask, part_of
from kappaskin_app.guard import guarded
from kappaskin_app.shell.actions import Actions
from kappaskin_app.shell.background import Tasks
from kappaskin_app.shell.folders import (
    RECORDINGS,
    proposed,
    recordings_folder,
    repaired,
    repairing,
    unfinished,
)
from kappaskin_app.shell.recovery import resume_text
from kappaskin_app.shell.work_dialog import (
    WorkDialog,
    path_in,
    with_suffix,
)
from kappaskin_app.theme import current
from kappaskin_app.widgets.lettering import LEFT
from kappaskin_app.widgets.parts import plain_tip

_WIDTH, _TEXT = 92, 22  # px: of all, and to where the words begin
_HOUR = 3600.0  # s, from which there is room for the time alone
_UNITS = ((1e9, "GB"), (1e6, "MB"), (1e3, "kB"))


def size_of(count: int) -> str:
    """A number of bytes in few digits."""
    for one, unit in _UNITS:
        if count >= one:
            return f"{count / one:.1f} {unit}"
    return f"{count} B"


def duration_of(seconds: float) -> str:
    """A time as m:ss, or h:mm:ss from an hour on."""
    whole = int(seconds)
    hours, rest = divmod(whole, 3600)
    below = f"{rest // 60:02d}:{rest % 60:02d}" if hours else f"{rest // 60}:{rest % 60:02d}"
    return f"{hours}:{below}" if hours else below


class RecordingMark(QWidget):
    """The mark of a recording; after one that ended by itself, until `clicked`."""

    clicked = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Preferred)
        self.head, self.below, self._bad = "", "", False

    def sizeHint(self) -> QSize:
        return QSize(_WIDTH, 2 * self.fontMetrics().height())

    minimumSizeHint = sizeHint

    def show_written(self, written: RecordingStatus, trouble: str) -> None:
        """Show the recording, or the error that ended it."""
        if written.active:
            head, size = duration_of(written.seconds), size_of(written.size)
            head = head if written.seconds >= _HOUR else f"REC {head}"
            self._show(head, f"{written.lost} lost" if written.lost else size, written.lost > 0)
            self.setToolTip(
                plain_tip(
                    f"Recording to {written.path}: {size}, {written.lost} messages lost.\n"
                    "Messages are lost when the disk is too slow."
                )
            )
        else:
            self._show("REC ended", "with an error", True)
            self.setToolTip(plain_tip(f"{trouble}\n\nClick to remove this mark."))
        self.setAccessibleName(f"{self.head}, {self.below}")

    def _show(self, head: str, below: str, bad: bool) -> None:
        if (head, below, bad) != (self.head, self.below, self._bad):
            self.head, self.below, self._bad = head, below, bad
            self.update()

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        self.clicked.emit()
        super().mouseReleaseEvent(event)

    def paintEvent(self, event: QPaintEvent) -> None:
        painter, theme = QPainter(self), current()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        line = float(self.fontMetrics().height())
        top = (self.height() - 2 * line) / 2
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(theme.alert))
        painter.drawEllipse(QPointF(12, top + line / 2), 5, 5)
        bold = painter.font()
        bold.setWeight(QFont.Weight.DemiBold)
        painter.setFont(bold)
        painter.setPen(QColor(theme.alert))
        painter.drawText(QRectF(_TEXT, top, self.width() - _TEXT, line), LEFT, self.head)
        painter.setFont(self.font())
        painter.setPen(QColor(theme.alert if self._bad else theme.text))
        painter.drawText(QRectF(_TEXT, top + line, self.width() - _TEXT, line), LEFT, self.below)


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
_RECORD, _STOP = "&Record\N{HORIZONTAL ELLIPSIS}", "&Stop recording"


class RecordingControl(QObject):
    """Controls the engine's recorder; `notified` brings messages, `changed` reports its state.

    `message` is the present message about recordings, an alarm where it is `alarming`; `damaged`
    is a recording that can be repaired.
    """

    notified = Signal(str)
    changed = Signal()

    def __init__(self, engine: Engine, tasks: Tasks, window: QWidget) -> None:
        super().__init__(window)
        self._engine, self._window = engine, window
        self._replays = False
        self.written, self.ended = RecordingStatus(), ""
        """The state of the recording, and the error that ended it."""
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
        tip = "Start or stop recording to a file; it continues when the source changes"
        actions.add("record", _MENU, _RECORD, self.toggle, "Ctrl+Shift+R", tip)
        tip = "Add a note to the event log and the recording"
        actions.add("note", _MENU, "&Note\N{HORIZONTAL ELLIPSIS}", self.note, "Ctrl+Shift+N", tip)

    # Requests of the user.

    def toggle(self) -> None:
        """Ask for a file and record to it, or stop."""
        if self.recording:
            self._engine.record(None)
        elif self.why_not:
            self.notified.emit(self.why_not)
        elif (path := self._ask_path()) is not None:
            self.begin(path)

    def _ask_path(self) -> Path | None:
        """Ask for the file to record to; None if cancelled."""
        path = proposed(recordings_folder(), datetime.now())
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            self.notified.emit(f"{path.parent}: cannot be made ({error.strerror}); choose another")
            path = Path(path.name)
        option = QFileDialog.Option.DontConfirmOverwrite  # the engine refuses existing files
        chosen, _ = QFileDialog.getSaveFileName(
            self._window, "Record to", str(path), RECORDINGS, "", option
        )
        return with_suffix(chosen, ".mcap") if chosen else None

    def begin(self, path: Path) -> None:
        """Record to `path`."""
        self.dismiss()
        self._set_message("")
        self._engine.record(path)

    def note(self) -> None:
        """Ask for a note, and add it to the events."""
        dialog = QInputDialog(self._window)
        dialog.setWindowTitle("Note")
        dialog.setLabelText("Note for the event log and the recording:")
        dialog.setMinimumWidth(420)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.textValueSelected.connect(guarded(self.write_down))
        dialog.open()
        for line in dialog.findChildren(QLineEdit):  # made only now
            line.setMaxLength(LONGEST_NOTE)

    def write_down(self, text: str) -> None:
        """Add `text` to the events, unless it is empty."""
        if text.strip():
            self._engine.note(text.strip())

    def may_close(self) -> bool:
        """Whether the window may close; asks first while recording."""
        if not self.recording:
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

    def dismiss(self) -> None:
        """Remove the mark of a recording that ended by itself."""
        if self.ended:
            self.ended = ""
            self.changed.emit()

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
        turned, self._replays = self._replays, status.replay is not None
        self._show_actions()
        if (now := self.written) == was:
            if self._replays != turned:
                self.changed.emit()
            return
        if now.trouble and now.trouble != was.trouble:
            self.ended = now.trouble if was.active else ""
            part = part_of(Path(now.path))
            self._set_message(now.trouble, damaged=part if part.exists() else None)
            self.notified.emit(now.trouble)
        elif was.active and not now.active:
            self.notified.emit(
                f"Recorded {now.path}: {duration_of(now.seconds)}, {size_of(now.size)}"
            )
        if now.active:
            self.ended = ""
        self.changed.emit()

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
