"""Scene control: connects the session with gallery, editor, effect plan and timeline."""

from contextlib import suppress
from pathlib import Path

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QFileDialog, QWidget

from kappaskin.errors import Refusal
from kappaskin.live import Status
from kappaskin.scenes import SCENES as BUILT_IN
from kappaskin.scenes import Scene, scene_file
from kappaskin_app.features.scene.editing import SceneEditing
from kappaskin_app.features.scene.panel import ScenePanel
from kappaskin_app.features.scene.plan import EffectPlanner
from kappaskin_app.features.scene.timeline import Timeline
from kappaskin_app.guard import guarded
from kappaskin_app.shell.folders import recordings_folder
from kappaskin_app.shell.history import History
from kappaskin_app.shell.opening import SCENES, Opening
from kappaskin_app.shell.session import Session
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.simulation import OWN, text_of, written

_PLANNING = "Measuring the effects\N{HORIZONTAL ELLIPSIS}"


class SceneControl(QObject):
    """Shows the simulated scene in `panel` and `timeline`; `message` reports a refused request."""

    message = Signal(str)

    def __init__(
        self,
        history: History,
        session: Session,
        editing: SceneEditing,
        planner: EffectPlanner,
        panel: ScenePanel,
        timeline: Timeline,
        opening: Opening,
        window: QWidget,
    ) -> None:
        super().__init__(window)
        self._history, self._session, self._editing = history, session, editing
        self._planner, self._panel, self._timeline = planner, panel, timeline
        self._opening, self._window = opening, window
        self._wire()

    def _wire(self) -> None:
        panel, session, planner = self._panel, self._session, self._planner
        panel.gallery.chosen.connect(guarded(lambda name: self.play(scene_file(name))))
        panel.gallery.replay_wanted.connect(guarded(self._opening.open))
        panel.gallery.open_wanted.connect(guarded(self.open))
        panel.editor.edited.connect(guarded(self._editing.write))
        panel.editor.save_wanted.connect(guarded(self.save))
        panel.effects.forced.connect(guarded(self._force))
        panel.plan_visible.connect(guarded(planner.set_active))
        session.playing.connect(guarded(self._show_scene))
        session.refused.connect(guarded(panel.show_refusal))
        session.reported.connect(guarded(planner.follow))
        session.reported.connect(guarded(self._show_status))
        planner.changed.connect(guarded(self._show_plan))
        self._timeline.play_wanted.connect(guarded(session.run))
        self._timeline.sought.connect(guarded(self._seek))
        self._timeline.track.sliderReleased.connect(guarded(lambda: session.run(session.running)))

    # Requests

    def open(self) -> None:
        """Open a file dialog, and simulate the selected scene."""
        file, _ = QFileDialog.getOpenFileName(
            self._window, "Open a scene", str(recordings_folder()), SCENES
        )
        if file:
            self.play(Path(file))

    def save(self) -> None:
        """Open a file dialog, and write the scene to the selected file."""
        settings = self._history.settings
        name = settings.written.file.name if settings.written else OWN.name
        self._opening.save_scene(name, self._editing.save)

    def pause(self) -> None:
        """Pause the scene, or continue it."""
        self._session.run(not self._session.running)

    def play(self, file: Path) -> None:
        """Simulate the scene in a file, from its beginning."""
        try:
            self._editing.play(written(file, file.absolute() in self._session.trusted))
            if not _is_built_in(file):
                self._opening.note(file)
        except Refusal as refusal:
            self.message.emit(str(refusal))

    def _force(self, effect: str, how: str) -> None:
        try:
            self._editing.force(effect, how)
        except Refusal as refusal:
            self.message.emit(str(refusal))
            self._show_plan()  # reset the selection

    def _seek(self, at: float) -> None:
        self._session.seek(at, self._timeline.track.isSliderDown())

    # State

    def show_settings(self, settings: Settings) -> None:
        """Show the text of the scene, also of one that is refused."""
        if settings.written is not None:
            self._show_text(settings)

    def _show_scene(self, scene: Scene) -> None:
        self._timeline.show_scene(scene)
        self._show_card()
        self._show_text(self._history.settings)

    def _show_card(self) -> None:
        """Mark the simulated scene in the gallery, unless it is from another file of that name."""
        written = self._history.settings.written
        file = written.file if written else OWN
        shown = file.stem if _is_built_in(file) and self._session.inside else ""
        self._panel.gallery.show_playing(shown)

    def _show_text(self, settings: Settings) -> None:
        editor, written = self._panel.editor, settings.written
        if written is not None:
            editor.show_scene(written.text, written.file.name)
        elif self._session.inside:
            with suppress(Refusal):  # an invalid skin: the previous text stays
                editor.show_scene(text_of(settings), "Scene of the panels")

    def _show_plan(self) -> None:
        planner, effects = self._planner, self._panel.effects
        if planner.rows and planner.scene is not None:
            effects.show_plan(planner.rows, planner.scene.choice)
        if planner.refusal or planner.waiting:
            effects.show_waiting(planner.refusal or _PLANNING)

    def _show_status(self, _: Status) -> None:
        self._panel.show_simulated(self._session.inside)
        self._show_card()
        if not self._session.inside:
            self._timeline.show_scene(None)
            return
        self._timeline.show_time(self._session.time, self._session.running)


def _is_built_in(file: Path) -> bool:
    """Whether a file is that of a built-in scene."""
    return file.stem in BUILT_IN and file == scene_file(file.stem)
