"""The scene between the session that plays it and where it is chosen, edited, planned, scrubbed."""

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QFileDialog, QWidget

from kappaskin.errors import Refusal
from kappaskin.live import Status
from kappaskin.scenes import SCENES, Scene, scene_file
from kappaskin_app.features.scene.panel import ScenePanel
from kappaskin_app.features.scene.planning import Planning
from kappaskin_app.features.scene.timeline import Timeline
from kappaskin_app.guard import guarded
from kappaskin_app.shell.history import History
from kappaskin_app.shell.session import Session
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.simulation import OWN, text_of, written
from kappaskin_app.shell.wishes import Wishes
from kappaskin_app.shell.work_dialog import with_ending

_FILES = "Scene (*.toml)"
_PLANNING = "Each effect is sized and timed\N{HORIZONTAL ELLIPSIS}"


class Staging(QObject):
    """Shows in `panel`, `timeline` and plan what is played; `told` says what came of a wish.

    `played` names the source when a scene in a file is played, `used` the file of a person's own.
    """

    told = Signal(str)
    played = Signal(str)
    used = Signal(object)

    def __init__(
        self,
        history: History,
        session: Session,
        wishes: Wishes,
        planning: Planning,
        panel: ScenePanel,
        timeline: Timeline,
        window: QWidget,
    ) -> None:
        super().__init__(window)
        self._history, self._session, self._wishes = history, session, wishes
        self._planning, self._panel, self._timeline = planning, panel, timeline
        self._window = window
        self._wire()

    def _wire(self) -> None:
        panel, session, planning = self._panel, self._session, self._planning
        panel.gallery.chosen.connect(guarded(lambda name: self.play(scene_file(name))))
        panel.gallery.open_wanted.connect(guarded(self.open))
        panel.editor.edited.connect(guarded(self._wishes.write))
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
        file, _ = QFileDialog.getOpenFileName(self._window, "Open a scene", "", _FILES)
        if file:
            self.play(Path(file))

    def save(self) -> None:
        """Ask for a file, and write the scene as it is there."""
        settings = self._history.settings
        self.save_as(
            settings.written.file.name if settings.written else OWN.name, self._wishes.save
        )

    def save_as(self, name: str, write: Callable[[Path], object]) -> None:
        """Ask for a file, `name` to begin with, and `write` a scene there."""
        file, _ = QFileDialog.getSaveFileName(self._window, "Save the scene", name, _FILES)
        if file:
            try:
                path = with_ending(file, ".toml")
                write(path)
                self.used.emit(path)
                self.told.emit(f"Saved {path}")
            except (OSError, Refusal) as error:
                self.told.emit(f"Could not write {file}: {error}")

    def pause(self) -> None:
        """Let the scene stand still, or go on."""
        self._session.run(not self._session.running)

    def play(self, file: Path) -> None:
        """Play the scene in a file, from its beginning."""
        try:
            self._wishes.play(written(file))
            self.played.emit(self._session.source)
            if not _ready(file):
                self.used.emit(file)
        except Refusal as refusal:
            self.told.emit(str(refusal))

    def _force(self, effect: str, how: str) -> None:
        try:
            self._wishes.force(effect, how)
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
    return file.stem in SCENES and file == scene_file(file.stem)
