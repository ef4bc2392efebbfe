"""Two setups on the same readings, side by side."""

from kappaskin_app.features.compare.comparing import Comparing
from kappaskin_app.features.compare.panel import ComparePanel
from kappaskin_app.guard import guarded
from kappaskin_app.shell.window import MainWindow

_ABOUT = "Two settings on the same readings: both surfaces, and B less A"


class CompareFeature:
    name = "compare"

    def install(self, shell: MainWindow) -> None:
        session, display = shell.session, shell.display
        self.comparing = Comparing(shell.history, session, shell)
        self.compare = ComparePanel()
        shell.docks.put_below(
            "compare", "Compare A and B", self.compare, "Ctrl+B", _ABOUT, height=0.36
        )
        shell.docks["compare"].visibilityChanged.connect(guarded(self.comparing.watch))
        session.reported.connect(guarded(self.comparing.follow))
        display.status_shown.connect(
            guarded(lambda status: self.compare.show_status(status, display.old))
        )
        shell.panels.join(self.compare.form)
        self.compare.attend(self.comparing)
        shell.settings_shown.connect(guarded(self.compare.show_settings))
