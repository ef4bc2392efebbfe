"""The scene between the session that plays it and where it is chosen, edited, planned, scrubbed."""

from contextlib import suppress
from pathlib import Path

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QFileDialog, QWidget

from kappaskin.errors import Refusal
from kappaskin.live import Status
from kappaskin.scenes import SCENES as READY
from kappaskin.scenes import Scene, scene_file
from kappaskin_app.features.scene.editing import SceneEditing
from kappaskin_app.features.scene.panel import ScenePanel
from kappaskin_app.features.scene.plan import Planning
from kappaskin_app.features.scene.timeline import Timeline
from kappaskin_app.guard import guarded
from kappaskin_app.shell.history import History
from kappaskin_app.shell.opening import SCENES, Opening
from kappaskin_app.shell.session import Session
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.simulation import OWN, text_of, written

_PLANNING = "Each effect is sized and timed\N{HORIZONTAL ELLIPSIS}"


class Staging(QObject):
    """Shows in `panel`, `timeline` and plan what is played; `told` reports what a request did."""

    told = Signal(str)

    def __init__(
        self,
        history: History,
        session: Session,
        editing: SceneEditing,
        planning: Planning,
        panel: ScenePanel,
        timeline: Timeline,
        opening: Opening,
        window: QWidget,
    ) -> None:
        super().__init__(window)
        self._history, self._session, self._editing = history, session, editing
        self._planning, self._panel, self._timeline = planning, panel, timeline
        self._opening, self._window = opening, window
        self._wire()

    def _wire(self) -> None:
        panel, session, planning = self._panel, self._session, self._planning
        panel.gallery.chosen.connect(guarded(lambda name: self.play(scene_file(name))))
        panel.gallery.open_wanted.connect(guarded(self.open))
        panel.editor.edited.connect(guarded(self._editing.write))
        panel.editor.save_wanted.connect(guarded(self.save))
        panel.effects.forced.connect(guarded(self._force))
        panel.seen.connect(guarded(planning.watch))
        session.playing.connect(guarded(self._show_scene))
        session.refused.connect(guarded(panel.show_refusal))
        session.reported.connect(guarded(planning.follow))
        session.reported.connect(guarded(self._show_status))
        planning.changed.connect(guarded(self._show_plan))
        self._timeline.play_wanted.connect(guarded(session.run))
        self._timeline.sought.connect(guarded(self._seek))
        self._timeline.track.sliderReleased.connect(guarded(lambda: session.run(session.running)))

    # What a person asks.

    def open(self) -> None:
        """Ask for a file, and play the scene in it."""
        file, _ = QFileDialog.getOpenFileName(self._window, "Open a scene", "", SCENES)
        if file:
            self.play(Path(file))

    def save(self) -> None:
        """Ask for a file, and write the scene as it is there."""
        settings = self._history.settings
        name = settings.written.file.name if settings.written else OWN.name
        self._opening.save_scene(name, self._editing.save)

    def pause(self) -> None:
        """Let the scene stand still, or go on."""
        self._session.run(not self._session.running)

    def play(self, file: Path) -> None:
        """Play the scene in a file, from its beginning."""
        try:
            self._editing.play(written(file))
            if not _ready(file):
                self._opening.note(file)
        except Refusal as refusal:
            self.told.emit(str(refusal))

    def _force(self, effect: str, how: str) -> None:
        try:
            self._editing.force(effect, how)
        except Refusal as refusal:
            self.told.emit(str(refusal))
            self._show_plan()  # or what was asked would look as if it were so

    def _seek(self, at: float) -> None:
        self._session.seek(at, self._timeline.track.isSliderDown())

    # What is so.

    def show_settings(self, settings: Settings) -> None:
        """Show the text of the scene that is written, whether it can be played or not."""
        if settings.written is not None:
            self._show_text(settings)

    def _show_scene(self, scene: Scene) -> None:
        self._timeline.show_scene(scene)
        self._show_card()
        self._show_text(self._history.settings)

    def _show_card(self) -> None:
        """Mark the ready scene that is played: none for a file of one's own of its name."""
        written = self._history.settings.written
        file = written.file if written else OWN
        shown = file.stem if _ready(file) and self._session.inside else ""
        self._panel.gallery.show_playing(shown)

    def _show_text(self, settings: Settings) -> None:
        editor, written = self._panel.editor, settings.written
        if written is not None:
            editor.show_scene(written.text, written.file.name)
        elif self._session.inside:
            with suppress(Refusal):  # no such skin: what is shown is the last one's
                editor.show_scene(text_of(settings), "The panels' skin")

    def _show_plan(self) -> None:
        planning, effects = self._planning, self._panel.effects
        if planning.rows and planning.scene is not None:
            effects.show_plan(planning.rows, planning.scene.choice)
        if planning.refusal or planning.waiting:
            effects.show_waiting(planning.refusal or _PLANNING)

    def _show_status(self, _: Status) -> None:
        self._panel.show_simulated(self._session.inside)
        self._show_card()
        if not self._session.inside:
            self._timeline.show_scene(None)
            return
        self._timeline.show_time(self._session.time, self._session.running)


def _ready(file: Path) -> bool:
    """Whether a file is that of a ready scene."""
    return file.stem in READY and file == scene_file(file.stem)
