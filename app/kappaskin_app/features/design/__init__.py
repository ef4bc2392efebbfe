"""Design of a sensor before it is built."""

from kappaskin_app.features.design.panel import DesignPanel
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
