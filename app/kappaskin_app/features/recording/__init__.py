"""Recording, playback and repair."""

from functools import partial
from pathlib import Path

from kappaskin.live import ResumeInfo
from kappaskin_app.features.recording.panel import RecordingPanel
from kappaskin_app.features.recording.playback import PlaybackControl
from kappaskin_app.features.recording.recorder import RecordingControl
from kappaskin_app.features.recording.transport import Transport
from kappaskin_app.guard import guarded
from kappaskin_app.shell.folders import newest, recordings_folder
from kappaskin_app.shell.opening import Kind
from kappaskin_app.shell.pages import LIVE
from kappaskin_app.shell.recovery import SettingsHandover
from kappaskin_app.shell.session import RECORDED
from kappaskin_app.shell.window import MainWindow
from kappaskin_app.widgets.parts import ELLIPSIS, sentence


class RecordingFeature:
    name = "recording"

    def install(self, shell: MainWindow) -> None:
        self._shell, session = shell, shell.session
        self.recording = shell.panels.add(LIVE, RecordingPanel())
        self.transport, banner = Transport(), shell.display.banner
        self.recorder = RecordingControl(session, shell.tasks, banner, shell)
        self.playback = PlaybackControl(shell.history, session, self.transport, shell.tasks, shell)
        shell.display.centre.add_below(self.transport)
        self.recorder.add_actions(shell.actions_by_name)
        self.playback.add_actions(shell.actions_by_name)
        self._wire_recorder(shell)
        self._wire_playback(shell)
        self.recording.bind(self.recorder, self.playback)
        shell.begun.connect(guarded(self._begin))
        shell.closing.connect(guarded(self.playback.close))
        shell.closing.connect(guarded(self.recorder.close))

    def _wire_recorder(self, shell: MainWindow) -> None:
        session, recorder = shell.session, self.recorder
        session.reported.connect(guarded(recorder.follow))
        self._handover = SettingsHandover(shell.history, session)
        session.reported.connect(guarded(self._handover.follow))
        recorder.notified.connect(guarded(shell.notify))
        recorder.play_wanted.connect(guarded(self.playback.open_file))
        recorder.repairs.saved.connect(guarded(self.playback.open_file))
        session.may_close.append(recorder.may_close)

    def _wire_playback(self, shell: MainWindow) -> None:
        session, opening, playback = shell.session, shell.opening, self.playback
        session.source_handlers.append(playback.takes)
        session.reasons.append(self.recording.message)
        session.pause_requested.connect(guarded(self._pause))
        playback.notified.connect(guarded(self._notify))
        playback.opened.connect(session.source_changed)
        playback.opened.connect(guarded(self._add_recent))
        playback.offered.connect(guarded(partial(shell.panels.reveal, self.recording)))
        opening.add(Kind("recording", (".mcap", ".part"), playback.open_file))
        opening.others = lambda: newest(recordings_folder())
        opening.drops.take_key = self.transport.take_key
        shell.menus.welcome.add(
            4,
            f"&Play a recording{ELLIPSIS}",
            "Play a recording; a file can also be dropped on the window.",
            playback.open,
        )

    def _notify(self, text: str) -> None:
        """Show a message of the playback in the panel alone, if that is visible, or below."""
        if self.recording.isVisible() and sentence(text) == self.recording.message.text():
            self._shell.panels.reveal(self.recording)
        else:
            self._shell.notify(text)

    def _add_recent(self, source: str) -> None:
        self._shell.opening.note(Path(source.removeprefix(RECORDED)))

    def _pause(self) -> None:
        if self._shell.session.replaying:
            self.playback.toggle()

    def _begin(self, left: ResumeInfo | None, source: str) -> None:
        """Resume a recording, or report unfinished ones."""
        if left is not None:
            self.recorder.go_on(left, source)
        else:
            self.recorder.offer_repair()
        self.playback.resume(self._shell.session.source)
