"""The scene: chosen, edited, planned, played, pressed."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

from kappaskin.errors import Refusal
from kappaskin.scenes import scene_file
from kappaskin_app.features.scene.editing import SceneEditing
from kappaskin_app.features.scene.load_panel import LoadPanel, NoisePanel
from kappaskin_app.features.scene.panel import ScenePanel
from kappaskin_app.features.scene.plan import Planning
from kappaskin_app.features.scene.staging import Staging
from kappaskin_app.features.scene.timeline import Timeline
from kappaskin_app.guard import guarded
from kappaskin_app.shell.actions import plain
from kappaskin_app.shell.finder.things import FinderEntry, enter
from kappaskin_app.shell.loads import loads_at, object_replaceable
from kappaskin_app.shell.menus import DOTS
from kappaskin_app.shell.opening import Kind
from kappaskin_app.shell.pages import LIVE
from kappaskin_app.shell.parts import FILE
from kappaskin_app.shell.window import MainWindow

_MILLIMETRE = 1e-3  # m, the unit of what is drawn for a printer
_OPEN = "Simulate what a scene file (.toml) says; it may also be dropped on the window"
_SAVE = "Write the scene that plays, as text that can be edited and opened again"

_ABOUT = "Ready scenes, the text of the one that plays, and which effects it calls for"


class SceneFeature:
    name = "scene"

    def install(self, shell: MainWindow) -> None:
        self._shell, session = shell, shell.session
        self.load = shell.panels.add(LIVE, LoadPanel())
        self.noise = shell.panels.add(LIVE, NoisePanel())
        self.scene, self.timeline = ScenePanel(shell.tasks), Timeline()
        self.planning = Planning(session, shell.tasks, shell)
        self.editing = SceneEditing(shell.history, session, shell.selection.load)
        self.staging = Staging(
            *(shell.history, session, self.editing, self.planning),
            *(self.scene, self.timeline, shell.opening, shell),
        )
        shell.docks.put_below("scene", "Scene", self.scene, "F2", _ABOUT, height=0.38)
        shell.display.centre.add_below(self.timeline)
        shell.layouts.pages.append(self.scene)
        self._wire(shell)
        self._add_actions(shell)

    def _wire(self, shell: MainWindow) -> None:
        session = shell.session
        session.refused.connect(guarded(self.load.show_refusal))
        session.pausing.connect(guarded(self._pause))
        self.staging.told.connect(guarded(shell.tell))
        shell.settings_shown.connect(guarded(self.staging.show_settings))
        shell.display.unit_changed.connect(guarded(self.timeline.clock.show_unit))
        shell.opening.add(Kind("scene", (".toml",), self.staging.play))
        shell.opening.add(Kind("mesh", (".stl", ".ply", ".obj"), self._touch_with))
        shell.menus.things.append(self._things)

    def _add_actions(self, shell: MainWindow) -> None:
        add, staging = shell.actions_by_name.add, self.staging
        add("open-scene", FILE, f"&Open scene{DOTS}", staging.open, "Ctrl+O", _OPEN)
        add("save-scene", FILE, f"Save scene &as{DOTS}", staging.save, "Ctrl+Shift+S", _SAVE)
        shell.menus.welcome.add(
            1,
            f"&Open a scene{DOTS}",
            "Simulate what a file says (Ctrl+O); ready ones with pictures: Scene (F2).",
            staging.open,
        )

    def _pause(self) -> None:
        if not self._shell.session.replaying:
            self.staging.pause()

    def _touch_with(self, file: Path) -> None:
        """Let the object in a mesh file press where the load is, in millimetres as it is drawn."""
        session = self._shell.session
        touches = loads_at(session.scene, session.time) if session.inside else []
        if not touches or not object_replaceable(session.scene):
            raise Refusal(
                f"{file}: expected a simulated skin that one object at rest touches, to take its "
                "place; choose such a scene (F2), or run `kappaskin demo`"
            )
        load = touches[0].load
        x, y = (float(value) for value in load.centre())
        said = {"what": "mesh", "file": str(file.absolute()), "unit": _MILLIMETRE}
        self.editing.touch_with(said, x, y, load.force)
        self._shell.opening.note(file)
        self._shell.tell(f"{file.name} touches the skin, its numbers taken as millimetres")

    def _things(self) -> Iterator[FinderEntry]:
        """The pages of the panel, and the ready scenes, to be found."""
        pages = self.scene
        for page in (pages.gallery, pages.editor, pages.effects):
            index = pages.indexOf(page)
            title = plain(pages.tabText(index))
            why_not = "" if pages.isTabEnabled(index) else "no scene is played"
            yield FinderEntry(
                f"page:{title}", f"Scene: {title}", "Scene", partial(enter, page), "", why_not
            )
        for name, card in pages.gallery.items.items():
            play = partial(self.staging.play, scene_file(name))
            yield FinderEntry(
                f"scene:{name}", f"Play the scene {card.text()}", "Scene, Gallery", play
            )
