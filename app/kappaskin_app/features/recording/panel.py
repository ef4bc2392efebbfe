"""The recording panel: record, note, open, repair."""

from pathlib import Path

from PySide6.QtWidgets import QWidget

from kappaskin._text import printable
from kappaskin_app.features.recording.playback import PlaybackControl
from kappaskin_app.features.recording.recorder import RecordingControl
from kappaskin_app.guard import guarded
from kappaskin_app.shell.panel import Panel
from kappaskin_app.widgets.line import Line
from kappaskin_app.widgets.parts import ELLIPSIS, button, in_a_row, plain_tip, sentence
from kappaskin_app.widgets.text import elapsed, file_size

_RECORD = "Start or stop recording to a file in the folder Kappaskin (Ctrl+R)."
_NOTE = "Add a note to the event log and the recording (Ctrl+Shift+N)."
_OPEN = "Play a recording (Ctrl+Shift+O); or drop one on the window."
_REPAIR = "Save the readable part of the damaged recording to a new file, and play it."


class RecordingPanel(Panel):
    """Shows the state of recording and playback, and requests changes."""

    purpose = (
        "Records all raw readings to a file that survives a crash; plays such a file, with its "
        "settings or others."
    )
    guide_page = "record"

    def __init__(self) -> None:
        super().__init__("Recording")
        self.record = button("Record", "record-button", _RECORD)
        self.note = button(f"Note{ELLIPSIS}", "note-button", _NOTE)
        self.open = button(f"Open{ELLIPSIS}", "open-button", _OPEN)
        self.what, self.estimates = Line(), Line()
        self.copy_button = button(
            "Copy the command", "copy-repair", "Copy the command in the message above."
        )
        self.repair = button(f"Repair{ELLIPSIS}", "repair-button", _REPAIR)
        self.offer = QWidget()
        buttons = in_a_row(self.repair, self.copy_button)
        buttons.setContentsMargins(0, 0, 0, 0)
        self.offer.setLayout(buttons)
        self.offer.hide()
        self.body.addLayout(in_a_row(self.record, self.note, self.open))
        self.body.addWidget(self.what)
        self.body.addWidget(self.estimates)
        self._around.addWidget(self.offer)
        self._recorder: RecordingControl | None = None
        self._playback: PlaybackControl | None = None
        self._damaged: Path | None = None
        self.copy_button.clicked.connect(guarded(self._copy_command))
        self.repair.clicked.connect(guarded(self._ask_for_repair))

    def bind(self, recorder: RecordingControl, playback: PlaybackControl) -> None:
        """Show the state of both, and pass on requests."""
        self._recorder, self._playback = recorder, playback
        self.record.clicked.connect(guarded(lambda *_: recorder.toggle()))
        self.note.clicked.connect(guarded(lambda *_: recorder.note()))
        self.open.clicked.connect(guarded(lambda *_: playback.open()))
        recorder.changed.connect(guarded(self._update))
        playback.changed.connect(guarded(self._update))
        self._update()

    def _update(self) -> None:
        recorder, playback = self._recorder, self._playback
        if recorder is None or playback is None:
            return
        written = recorder.written
        self.record.setText("Stop" if recorder.recording else "Record")
        self.record.setEnabled(not recorder.why_not)
        self.record.setToolTip(plain_tip(recorder.why_not or _RECORD))
        how = f"{elapsed(written.seconds)}, {file_size(written.size)}"
        self.what.show_text(f"{how}: {Path(written.path).stem}" if written.messages else "")
        self.what.setToolTip(plain_tip(written.path))
        self.what.setVisible(bool(written.messages))
        self.estimates.show_text(printable(playback.made_by))
        self.estimates.setToolTip(plain_tip(playback.made_by))
        self.estimates.setVisible(bool(playback.made_by))
        message = playback.message or recorder.message
        alarm = bool(playback.alarming if playback.message else recorder.alarming)
        self.show_message(sentence(message), hint=not alarm)
        self._damaged = playback.damaged if playback.message else recorder.damaged
        self.offer.setVisible(self._damaged is not None)
        self.copy_button.setVisible("`kappaskin repair " in message)

    def _ask_for_repair(self) -> None:
        if self._recorder is not None and self._damaged is not None:
            self._recorder.repairs.ask_of(self._damaged)
