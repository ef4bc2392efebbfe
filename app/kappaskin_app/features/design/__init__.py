"""Design of a sensor before it is built."""

from kappaskin_app.features.design.designing import Designing
from kappaskin_app.features.design.panel import DesignPanel
from kappaskin_app.guard import guarded
from kappaskin_app.shell.window import MainWindow

_ABOUT = "A sensor before it is built: how sure it would be, where its elements tell most"


class DesignFeature:
    name = "design"

    def install(self, shell: MainWindow) -> None:
        self.design, self.designing = DesignPanel(), Designing(shell.history, shell.tasks, shell)
        shell.docks.put_below("design", "Design", self.design, "Ctrl+Alt+N", _ABOUT, height=0.4)
        shell.docks["design"].visibilityChanged.connect(guarded(self.designing.watch))
        shell.session.reported.connect(guarded(self.designing.follow))
        shell.panels.join(self.design.form)
        self.design.save_wanted.connect(
            guarded(lambda: shell.opening.save_scene("design.scene.toml", self.designing.write))
        )
        self.design.attend(self.designing)
        shell.settings_shown.connect(guarded(self.design.show_settings))
