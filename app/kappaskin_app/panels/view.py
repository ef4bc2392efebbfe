"""How the skin is shown."""

from PySide6.QtWidgets import QWidget

from kappaskin_app.panels.form import Form


class ViewPanel(Form):
    """Asks for colours, height and what is drawn beside the skin."""

    def __init__(self, parent: QWidget | None = None) -> None:
        names = ("colour_by", "exaggeration", "show_elements", "show_truth", "theme", "letters")
        super().__init__("View", names, parent)
