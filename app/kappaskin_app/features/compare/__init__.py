"""Comparison of two setups on the same readings."""

from kappaskin_app.features.compare.comparison import SetupComparison
from kappaskin_app.features.compare.panel import ComparePanel
from kappaskin_app.guard import guarded
from kappaskin_app.shell.window import MainWindow

_ABOUT = "Two setups on the same readings: both surfaces, and their difference"


class CompareFeature:
    name = "compare"

    def install(self, shell: MainWindow) -> None:
        session, display = shell.session, shell.display
        self.comparison = SetupComparison(shell.history, session, shell.tasks, shell)
        self.compare = ComparePanel(display.colouring)
        shell.docks.put_below(
            "compare", "Compare A and B", self.compare, "Ctrl+B", _ABOUT, height=0.36
        )
        shell.docks["compare"].visibilityChanged.connect(guarded(self.comparison.set_active))
        session.reported.connect(guarded(self.comparison.follow))
        display.status_shown.connect(
            guarded(lambda status: self.compare.show_status(status, display.old))
        )
        shell.panels.join(self.compare.form)
        self.compare.connect_to(self.comparison)
        shell.settings_shown.connect(guarded(self.compare.show_settings))
