"""Design of a sensor before it is built."""

from kappaskin_app.features.design.panel import DesignPanel, skin_map
from kappaskin_app.features.design.prediction import DesignPrediction
from kappaskin_app.guard import guarded
from kappaskin_app.shell.window import MainWindow

_ABOUT = "A sensor before it is built: its standard deviation, the best positions of its elements"


class DesignFeature:
    name = "design"

    def install(self, shell: MainWindow) -> None:
        self.design = DesignPanel()
        self.prediction = DesignPrediction(shell.history, shell.tasks, shell)
        shell.docks.put_below("design", "Design", self.design, "Ctrl+Alt+N", _ABOUT, height=0.4)
        shell.docks["design"].visibilityChanged.connect(guarded(self.prediction.set_active))
        shell.session.reported.connect(guarded(self.prediction.follow))
        shell.panels.join(self.design.form)
        self.design.save_wanted.connect(
            guarded(lambda: shell.opening.save_scene("design.scene.toml", self.prediction.write))
        )
        self.design.connect_to(self.prediction)
        shell.settings_shown.connect(guarded(self.design.show_settings))
        self._shell, self._on_skin = shell, False
        self.prediction.changed.connect(guarded(self._show_map))
        self.design.on_skin.toggled.connect(guarded(self._show_map))
        shell.display.restarted.connect(guarded(self._show_map))

    def _show_map(self, *_: object) -> None:
        """Colour the skin by the map of the open scene, while the panel is visible."""
        session, selection, found = (
            self._shell.session,
            self._shell.selection,
            self.prediction.open_map,
        )
        if session.closed:
            return  # the last panel hides while the window closes
        status = session.status
        same = found and status.sensor and found[0].scene.plate.patch == status.sensor.layout.patch
        if found and same and session.inside and self.design.on_skin.isChecked():
            selection.show_map(skin_map(*found, status.setup.nx, status.setup.ny))
            self._on_skin = True
        elif self._on_skin:
            selection.show_map(None)
            self._on_skin = False
