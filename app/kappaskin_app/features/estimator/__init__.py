"""The estimator: method and basis."""

from kappaskin_app.features.estimator.panel import BasisPanel
from kappaskin_app.shell.pages import LIVE
from kappaskin_app.shell.window import MainWindow


class EstimatorFeature:
    name = "estimator"

    def install(self, shell: MainWindow) -> None:
        self.basis = shell.panels.add(LIVE, BasisPanel())
