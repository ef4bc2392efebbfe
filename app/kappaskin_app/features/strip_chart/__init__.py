"""Strip chart: force, depth, place and other numbers of the contact over time."""

from kappaskin_app.features.strip_chart.strips import Strips
from kappaskin_app.guard import guarded
from kappaskin_app.shell.window import MainWindow

_ABOUT = "Force, depth, place and other numbers of the contact over the last minute or hour"


class StripChartFeature:
    name = "strip_chart"

    def install(self, shell: MainWindow) -> None:
        self.strips = Strips(
            shell.history, shell.session, shell.display, shell.tasks, shell.selection
        )
        shell.docks.put_below(
            "strip_chart", "Strip chart", self.strips.panel, "Ctrl+Alt+C", _ABOUT, height=0.38
        )
        shell.display.object_found.connect(guarded(self.strips.take_object))
        shell.settings_shown.connect(guarded(self.strips.show_settings))
