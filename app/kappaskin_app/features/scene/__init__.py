"""Simulated scenes: gallery, editor, effect plan, timeline and loads."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

from kappaskin.scenes import scene_file
from kappaskin_app.features.scene.control import SceneControl
from kappaskin_app.features.scene.editing import SceneEditing
from kappaskin_app.features.scene.gallery import MEASURED
from kappaskin_app.features.scene.load_panel import AddedNoisePanel, LoadPanel, NoisePanel
from kappaskin_app.features.scene.panel import ScenePanel
from kappaskin_app.features.scene.plan import EffectPlanner
from kappaskin_app.features.scene.skin_dialog import MESHES, SkinDialog
from kappaskin_app.features.scene.timeline import Timeline
from kappaskin_app.guard import guarded
from kappaskin_app.shell.actions import plain
from kappaskin_app.shell.finder import FinderEntry, enter
from kappaskin_app.shell.loads import loads_at, object_replaceable
from kappaskin_app.shell.opening import Kind
from kappaskin_app.shell.pages import LIVE
from kappaskin_app.shell.parts import FILE
from kappaskin_app.shell.settings.scene import Written
from kappaskin_app.shell.window import MainWindow
from kappaskin_app.widgets.parts import ELLIPSIS

_MILLIMETRE = 1e-3  # m, the unit of mesh files
_OPEN = "Simulate a scene file (.toml); it can also be dropped on the window"
_OPEN_SKIN = "Simulate a skin of any shape, from a mesh file (STL, OBJ, PLY)"
_SAVE = "Write the present scene to a text file, which can be edited and opened again"

_ABOUT = "Gallery of scenes, editor of the present scene, and plan of its effects"


class SceneFeature:
    name = "scene"

    def install(self, shell: MainWindow) -> None:
        self._shell, session = shell, shell.session
        self.load = shell.panels.add(LIVE, LoadPanel())
        self.noise = shell.panels.add(LIVE, NoisePanel())
        self.added_noise = shell.panels.add(LIVE, AddedNoisePanel())
        self.scene, self.timeline = ScenePanel(), Timeline()
        self.planner = EffectPlanner(session, shell.tasks, shell)
        self.skin = SkinDialog(shell.tasks, shell)
        self.editing = SceneEditing(shell.history, session, shell.selection.load)
        self.scene_control = SceneControl(
            *(shell.history, session, self.editing, self.planner),
            *(self.scene, self.timeline, shell.opening, shell),
        )
        shell.docks.put_below("scene", "Scene", self.scene, "F2", _ABOUT, height=0.38)
        shell.display.centre.add_below(self.timeline)
        self._wire(shell)
        self._add_actions(shell)

    def _wire(self, shell: MainWindow) -> None:
        session = shell.session
        session.refused.connect(guarded(self.load.show_refusal))
        session.pause_requested.connect(guarded(self._pause))
        self.scene_control.message.connect(guarded(shell.notify))
        shell.settings_shown.connect(guarded(self.scene_control.show_settings))
        shell.display.unit_changed.connect(guarded(self.timeline.clock.show_unit))
        shell.opening.add(Kind("scene", (".toml",), self.scene_control.play))
        for kind in (
            Kind("mesh of an object", MESHES, self._replace_object, self._replaces_object),
            Kind("mesh of a skin", MESHES, self.skin.begin),
        ):
            shell.opening.add(kind)
        self.skin.made.connect(guarded(self._simulate))
        shell.closing.connect(guarded(self.skin.reject))
        shell.menus.entry_sources.append(self._things)

    def _add_actions(self, shell: MainWindow) -> None:
        add, control = shell.actions_by_name.add, self.scene_control
        add("open-scene", FILE, f"&Open scene{ELLIPSIS}", control.open, "Ctrl+O", _OPEN)
        add("open-skin", FILE, f"Open s&kin{ELLIPSIS}", self.skin.choose, "", _OPEN_SKIN)
        add("save-scene", FILE, f"Save scene &as{ELLIPSIS}", control.save, "Ctrl+Shift+S", _SAVE)
        shell.menus.welcome.add(
            1,
            f"&Open a scene{ELLIPSIS}",
            "Simulate a scene file (Ctrl+O); for the gallery see Scene (F2).",
            control.open,
        )

    def _pause(self) -> None:
        if not self._shell.session.replaying:
            self.scene_control.pause()

    def _simulate(self, scene: Written) -> None:
        self.editing.play(scene)
        self._shell.opening.note(self.skin.file)

    def _replaces_object(self, _: Path) -> bool:
        """Whether a mesh can be the object that presses: one is at rest on the simulated skin."""
        session = self._shell.session
        touches = loads_at(session.scene, session.time) if session.inside else ()
        return bool(touches) and object_replaceable(session.scene)

    def _replace_object(self, file: Path) -> None:
        """Replace the load by the object of a mesh file, whose unit is the millimetre."""
        session = self._shell.session
        load = loads_at(session.scene, session.time)[0].load
        x, y = (float(value) for value in load.centre())
        found = file.resolve()
        mesh = {"what": "mesh", "file": str(found), "unit": _MILLIMETRE}
        self.editing.replace_object(mesh, x, y, load.force, found)
        self._shell.opening.note(file)
        self._shell.notify(f"{file.name} is the object; its lengths are taken as millimetres")

    def _things(self) -> Iterator[FinderEntry]:
        """Finder entries of the panel's pages and of the gallery's scenes."""
        pages = self.scene
        for page in (pages.gallery, pages.editor, pages.effects):
            index = pages.indexOf(page)
            title = plain(pages.tabText(index))
            why_not = "" if pages.isTabEnabled(index) else "no scene is simulated"
            yield FinderEntry(
                f"page:{title}", f"Scene: {title}", "Scene", partial(enter, page), "", why_not
            )
        for name, card in pages.gallery.items.items():
            play = partial(self.scene_control.play, scene_file(name))
            yield FinderEntry(
                f"scene:{name}", f"Play the scene {card.text()}", "Scene, Gallery", play
            )
        for title, file in MEASURED.items():
            replay = partial(self._shell.opening.open, file)
            yield FinderEntry(
                f"measured:{file.stem}",
                f"Replay what was measured: {plain(title)}",
                "Scene, Gallery",
                replay,
            )
