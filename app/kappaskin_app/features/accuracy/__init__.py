"""What accuracy costs in time, measured on the skin that is shown."""

from kappaskin_app.features.accuracy.costing import Costing
from kappaskin_app.features.accuracy.panel import CostPanel
from kappaskin_app.guard import guarded
from kappaskin_app.shell.window import MainWindow

_ABOUT = "What each method and setting takes and how far it errs; a click on a point takes it"


class AccuracyFeature:
    name = "accuracy"

    def install(self, shell: MainWindow) -> None:
        session = shell.session
        self.costing = Costing(shell.history, session, shell.tasks, shell)
        self.cost = CostPanel()
        shell.layouts.add("Study", "What accuracy costs below the skin")
        shell.docks.put_below(
            "cost", "Cost of accuracy", self.cost, "F9", _ABOUT, layouts={"Study": 0.36}
        )
        shell.docks["cost"].visibilityChanged.connect(guarded(self.costing.watch))
        session.reported.connect(guarded(self.costing.follow))
        session.estimated.connect(guarded(self.costing.receive))
        self.cost.attend(self.costing)
