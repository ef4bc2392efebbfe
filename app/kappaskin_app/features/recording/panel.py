"""What is recorded, and which recording is played."""

from pathlib import Path

from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QWidget

from kappaskin_app.features.recording.playback import Replaying
from kappaskin_app.features.recording.recorder import Taping, duration_of, size_of
from kappaskin_app.guard import guarded
from kappaskin_app.shell.panel import Panel
from kappaskin_app.widgets.line import Line
from kappaskin_app.widgets.parts import button, in_a_row, sentence
from kappaskin_app.widgets.text import COMMAND

_RECORD = "Write all that comes in to a file, or end that (Ctrl+Shift+R)."
_NOTE = "Write down what happened just now, in the recording too (Ctrl+Shift+N)."
_OPEN = "Play a recording as if it were live (Ctrl+Shift+O); or drop one on the window."
_REPAIR = "Save what is whole of the damaged recording to a new one beside it, and play that."
_DOTS = "\N{HORIZONTAL ELLIPSIS}"


class RecordingPanel(Panel):
    """Says how the recording does, and asks for another one."""

    purpose = (
        "Writes all that comes in, before anything is made of it, to a file that outlives a crash; "
        "plays such a file again, with other settings if you like."
    )
    guide_page = "record"

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Recording", parent)
        self.record = button(f"Record{_DOTS}", "record-button", _RECORD)
        self.note = button(f"Note{_DOTS}", "note-button", _NOTE)
        self.open = button(f"Open{_DOTS}", "open-button", _OPEN)
        self.what = Line()
        self.copy_button = button(
            "Copy the command", "copy-repair", "Copy what the message above says to type."
        )
        self.repair = button(f"Repair{_DOTS}", "repair-button", _REPAIR)
        self.offer = QWidget()
        buttons = in_a_row(self.repair, self.copy_button)
        buttons.setContentsMargins(0, 0, 0, 0)
        self.offer.setLayout(buttons)
        self.offer.hide()
        self.body.addLayout(in_a_row(self.record, self.note, self.open))
        self.body.addWidget(self.what)
        self._around.addWidget(self.offer)
        self._taping: Taping | None = None
        self._replaying: Replaying | None = None
        self._damaged: Path | None = None
        self.copy_button.clicked.connect(guarded(self._copy))
        self.repair.clicked.connect(guarded(self._ask_for_repair))

    def attend(self, taping: Taping, replaying: Replaying) -> None:
        """Show how both go, and pass on what the user requests."""
        self._taping, self._replaying = taping, replaying
        self.record.clicked.connect(guarded(lambda *_: taping.turn()))
        self.note.clicked.connect(guarded(lambda *_: taping.note()))
        self.open.clicked.connect(guarded(lambda *_: replaying.open()))
        taping.changed.connect(guarded(self._tell))
        replaying.changed.connect(guarded(self._tell))
        self._tell()

    def _tell(self) -> None:
        taping, replaying = self._taping, self._replaying
        if taping is None or replaying is None:
            return
        written = taping.written
        self.record.setText("Stop" if taping.recording else f"Record{_DOTS}")
        self.record.setEnabled(not taping.why_not)
        self.record.setToolTip(taping.why_not or _RECORD)
        how = f"{duration_of(written.seconds)}, {size_of(written.size)}"
        self.what.show_text(f"{how}: {Path(written.path).name}" if written.messages else "")
        self.what.setToolTip(written.path)
        self.what.setVisible(bool(written.messages))
        message = replaying.message or taping.message
        alarm = bool(replaying.alarming if replaying.message else taping.alarming)
        self.show_message(sentence(message), hint=not alarm)
        self._damaged = replaying.damaged if replaying.message else taping.damaged
        self.offer.setVisible(self._damaged is not None)
        self.copy_button.setVisible("`kappaskin repair " in message)

    def _ask_for_repair(self) -> None:
        if self._taping is not None and self._damaged is not None:
            self._taping.repairs.ask_of(self._damaged)

    def _copy(self) -> None:
        if command := COMMAND.search(self.message.text()):
            QGuiApplication.clipboard().setText(command[1])
