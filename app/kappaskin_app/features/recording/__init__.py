"""Recordings: made, played, repaired."""

from functools import partial
from pathlib import Path

from kappaskin.live import ResumeInfo
from kappaskin_app.features.recording.panel import RecordingPanel
from kappaskin_app.features.recording.playback import Replaying
from kappaskin_app.features.recording.recorder import RecordingMark, Taping
from kappaskin_app.features.recording.transport import Transport
from kappaskin_app.guard import guarded
from kappaskin_app.shell.folders import newest, recordings_folder
from kappaskin_app.shell.menus import DOTS
from kappaskin_app.shell.opening import Kind
from kappaskin_app.shell.pages import LIVE
from kappaskin_app.shell.recovery import WindowStateStore
from kappaskin_app.shell.session import RECORDED
from kappaskin_app.shell.window import MainWindow


class RecordingFeature:
    name = "recording"

    def install(self, shell: MainWindow) -> None:
        self._shell, session = shell, shell.session
        self.recording = shell.panels.add(LIVE, RecordingPanel())
        self.transport, self.mark = Transport(), RecordingMark()
        self.taping = Taping(session.engine, shell.tasks, shell)
        self.replaying = Replaying(shell.history, session, self.transport, shell.tasks, shell)
        self._shown = shell.display.header.add_mark(self.mark)
        self._shown.setVisible(False)
        shell.display.centre.add_below(self.transport)
        self.taping.add_actions(shell.actions_by_name)
        self.replaying.add_actions(shell.actions_by_name)
        self._wire_taping(shell)
        self._wire_replaying(shell)
        self.recording.attend(self.taping, self.replaying)
        shell.begun.connect(guarded(self._begin))
        shell.closing.connect(guarded(self.replaying.close))
        shell.closing.connect(guarded(self.taping.close))

    def _wire_taping(self, shell: MainWindow) -> None:
        session, taping = shell.session, self.taping
        session.reported.connect(guarded(taping.follow))
        self._window_state = WindowStateStore(shell.history, session.engine)
        session.reported.connect(guarded(self._window_state.follow))
        taping.changed.connect(guarded(self._show_mark))
        taping.told.connect(guarded(shell.tell))
        self.mark.clicked.connect(guarded(taping.dismiss))
        taping.repairs.saved.connect(guarded(self.replaying.open_file))
        session.may_close.append(taping.may_close)

    def _wire_replaying(self, shell: MainWindow) -> None:
        session, opening, replaying = shell.session, shell.opening, self.replaying
        session.takers.append(replaying.takes)
        session.pausing.connect(guarded(self._pause))
        replaying.told.connect(guarded(shell.tell))
        replaying.opened.connect(session.source_changed)
        replaying.opened.connect(guarded(self._note))
        replaying.offered.connect(guarded(partial(shell.panels.reveal, self.recording)))
        opening.add(Kind("recording", (".mcap", ".part"), replaying.open_file))
        opening.others = lambda: newest(recordings_folder())
        opening.drops.take_key = self.transport.take_key
        shell.menus.welcome.add(
            4,
            f"&Play a recording{DOTS}",
            "Show what was recorded; a file dropped on the window does too.",
            replaying.open,
        )

    def _show_mark(self) -> None:
        """Show that something is recorded, or that it ended by itself."""
        written, ended = self.taping.written, self.taping.ended
        self._shown.setVisible(written.active or bool(ended))
        self.mark.show_written(written, ended)

    def _note(self, source: str) -> None:
        self._shell.opening.note(Path(source.removeprefix(RECORDED)))

    def _pause(self) -> None:
        if self._shell.session.replaying:
            self.replaying.toggle()

    def _begin(self, left: ResumeInfo | None, source: str) -> None:
        """Go on with what was left, or say what could be repaired."""
        if left is not None:
            self.taping.go_on(left, source)
        else:
            self.taping.offer_repair()
        self.replaying.adopt(self._shell.session.source)
