"""The cost of accuracy: RMS error against computing time."""

from kappaskin_app.features.accuracy.measurement import CostMeasurement
from kappaskin_app.features.accuracy.panel import CostPanel
from kappaskin_app.guard import guarded
from kappaskin_app.shell.window import MainWindow

_ABOUT = "Computing time and RMS error of every estimator and basis; click a point to use it"


class AccuracyFeature:
    name = "accuracy"

    def install(self, shell: MainWindow) -> None:
        session = shell.session
        self.measurement = CostMeasurement(shell.history, session, shell.tasks, shell)
        self.cost = CostPanel()
        shell.layouts.add("Study", "Cost of accuracy below the skin")
        shell.docks.put_below(
            "cost", "Cost of accuracy", self.cost, "F9", _ABOUT, layouts={"Study": 0.36}
        )
        shell.docks["cost"].visibilityChanged.connect(guarded(self.measurement.set_active))
        session.reported.connect(guarded(self.measurement.follow))
        session.estimated.connect(guarded(self.measurement.receive))
        self.cost.connect_to(self.measurement)
