"""Recordings as a person makes, annotates, ends and repairs them."""

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
from kappaskin.recording import RecordingStatus, Repaired, RepairTask
from kappaskin_app.guard import guarded
from kappaskin_app.shell.actions import Actions
from kappaskin_app.shell.background import Tasks
from kappaskin_app.shell.folders import proposed, recordings_folder, repaired, repairing, unfinished
from kappaskin_app.shell.recovery import words
from kappaskin_app.shell.work_dialog import WorkDialog, beside, choosing, ended, named, path_in
from kappaskin_app.theme import current

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
    """Shows how a recording does, and that it ended by itself until `clicked`."""

    clicked = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Preferred)
        self.head, self.below, self._bad = "", "", False

    def sizeHint(self) -> QSize:
        return QSize(_WIDTH, 2 * self.fontMetrics().height())

    minimumSizeHint = sizeHint

    def show_written(self, written: RecordingStatus, trouble: str) -> None:
        """Show what is being written, or why it ended by itself."""
        if written.active:
            head, size = duration_of(written.seconds), size_of(written.size)
            head = head if written.seconds >= _HOUR else f"REC {head}"
            self._show(head, f"{written.lost} lost" if written.lost else size, written.lost > 0)
            self.setToolTip(
                f"Recording to {written.path}: {size}, {written.lost} messages lost.\n"
                "Lost is what found too much waiting for the disk."
            )
        else:
            self._show("REC ended", "by itself", True)
            self.setToolTip(f"{trouble}\n\nClick to take this mark away.")
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
        left = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
        bold = painter.font()
        bold.setWeight(QFont.Weight.DemiBold)
        painter.setFont(bold)
        painter.setPen(QColor(theme.alert))
        painter.drawText(QRectF(_TEXT, top, self.width() - _TEXT, line), left, self.head)
        painter.setFont(self.font())
        painter.setPen(QColor(theme.alert if self._bad else theme.text))
        painter.drawText(QRectF(_TEXT, top + line, self.width() - _TEXT, line), left, self.below)


class RepairDialog(WorkDialog):
    """Asks where what is whole of a recording is to be saved; `saved` brings the new one."""

    saved = Signal(Path)

    def __init__(self, tasks: Tasks, parent: QWidget | None = None) -> None:
        how = "&Repair", "Repairing the recording", self._begun, self._told
        super().__init__(tasks, "Repair a recording", *how, parent)
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

    def __init__(self, engine: Engine, tasks: Tasks, window: QWidget) -> None:
        super().__init__(window)
        self._engine, self._window = engine, window
        self._replays = False
        self.written, self.ended = RecordingStatus(), ""
        """How it does, and why it ended by itself."""
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

    # Requests of the user.

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
