"""How the skin is shown."""

from PySide6.QtWidgets import QWidget

from kappaskin_app.shell.form import Form


class ViewPanel(Form):
    """Asks for colours, height and what is drawn beside the skin."""

    def __init__(self, parent: QWidget | None = None) -> None:
        names = (
            *("colour_by", "colour_from", "maps", "one_range"),
            *("exaggeration", "show_elements", "show_truth", "show_directions", "show_band"),
            *("show_frame", "show_object", "show_pressed", "from_x", "to_x", "from_y", "to_y"),
            *("from_z", "to_z", "theme", "letters", "show_start"),
        )
        super().__init__("View", names, parent)
