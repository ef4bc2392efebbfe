"""Panel of the estimator and its basis."""

from kappaskin.bases import edges_of
from kappaskin.live import Status
from kappaskin_app.shell.badge import in_use
from kappaskin_app.shell.form import Form
from kappaskin_app.shell.pages import LIVE
from kappaskin_app.shell.window import MainWindow


class EstimatorFeature:
    name = "estimator"

    def install(self, shell: MainWindow) -> None:
        self.basis = shell.panels.add(LIVE, BasisPanel())


class BasisPanel(Form):
    """The form of the basis, the estimator and the boundary condition."""

    purpose = (
        "The basis functions of the shape, w(x, y) = \u03a3 c\u1d62\u2c7c "
        "\u03c6\u1d62\u2c7c(x, y), and the estimator of their coefficients c from the curvatures."
    )
    guide_page = "accuracy"

    def __init__(self) -> None:
        super().__init__("Basis", ("functions_x", "functions_y", "method", "fit_edge"))

    def show_status(self, status: Status, simulating: bool) -> None:
        if status.sensor is not None:
            self.offer("fit_edge", ("", *edges_of(status.sensor.layout.patch)))
        computing = "Computing\N{HORIZONTAL ELLIPSIS}"
        self.show_message(computing if status.computing else in_use(status))
