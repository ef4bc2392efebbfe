"""How many functions make the shape."""

from PySide6.QtWidgets import QWidget

from kappaskin import Status
from kappaskin_app.panels.form import Panel


class BasisPanel(Panel):
    """Asks for Ni x Nj and says why a number was not taken."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Basis", ("functions_x", "functions_y"), parent)

    def show_status(self, status: Status) -> None:
        setup = status.setup
        kept = f"In use: {setup.Ni} x {setup.Nj}. {status.refusal}." if status.refusal else ""
        self.show_message("Computing\N{HORIZONTAL ELLIPSIS}" if status.computing else kept)
