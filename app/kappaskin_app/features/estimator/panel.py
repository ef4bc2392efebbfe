"""Which functions make the shape."""

from PySide6.QtWidgets import QWidget

from kappaskin.bases import edges_of
from kappaskin.live import Status
from kappaskin_app.shell.form import Form
from kappaskin_app.shell.settings.shown import METHOD_SHORT
from kappaskin_app.widgets.parts import sentence


def in_use(status: Status) -> str:
    """Why the fit is not the one asked for, and which it is; nothing when it is."""
    if not status.refusal:
        return ""
    if status.slot is None:
        return f"Nothing is in use. {sentence(status.refusal)}"
    setup, sensor = status.setup, status.sensor
    across = 1 if sensor is not None and sensor.layout.patch.strip else setup.Nj
    method = METHOD_SHORT.get(setup.method, setup.method)
    return f"In use: {method}, {setup.Ni} x {across} functions. {sentence(status.refusal)}"


class BasisPanel(Form):
    """Asks for Ni x Nj and the edge, and says why a choice was not taken."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Basis", ("functions_x", "functions_y", "method", "fit_edge"), parent)

    def show_status(self, status: Status, simulating: bool) -> None:
        if status.sensor is not None:
            self.offer("fit_edge", ("", *edges_of(status.sensor.layout.patch)))
        computing = "Computing\N{HORIZONTAL ELLIPSIS}"
        self.show_message(computing if status.computing else in_use(status))
