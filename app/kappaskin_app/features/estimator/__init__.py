"""Panel of the estimator and its basis."""

from kappaskin.bases import edges_of
from kappaskin.live import Status
from kappaskin.skin import MeshSkin
from kappaskin_app.shell.badge import in_use
from kappaskin_app.shell.form import Form
from kappaskin_app.shell.pages import LIVE
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.window import MainWindow

_SOFTEST = "N = {} functions: the softest shapes of the mesh."


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
        self._count = 0

    def show_settings(self, settings: Settings) -> None:
        super().show_settings(settings)
        self._count = settings.functions_x * settings.functions_y

    def show_status(self, status: Status, simulating: bool) -> None:
        if status.sensor is not None:
            self.offer("fit_edge", ("", *edges_of(status.sensor.layout.patch)))
        on_mesh = status.sensor is not None and isinstance(status.sensor.layout.patch, MeshSkin)
        self.show_functions("functions_x", "functions_y", on_mesh)
        if status.computing:
            self.show_message("Computing\N{HORIZONTAL ELLIPSIS}", hint=True)
        elif words := in_use(status):
            self.show_message(words)
        else:
            self.show_message(_SOFTEST.format(self._count) if on_mesh else "", hint=True)
