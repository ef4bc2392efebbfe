"""Forms of the load on the simulated skin, and of noise."""

from PySide6.QtWidgets import QComboBox, QLabel

from kappaskin.live import Status
from kappaskin_app.shell.form import Form, SimulationForm
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.settings.scene import (
    FREE_CASES,
    LOAD_CASES,
    SIZES,
    SPREAD_CASES,
    TABLE_1_CASES,
    TWO_ENDED,
)
from kappaskin_app.shell.simulation import is_table_1


class LoadPanel(SimulationForm):
    """The form of the load: case, force, position and size."""

    purpose = (
        "Load on the simulated skin: position, size and force. Press on the skin with the mouse, "
        "or enter numbers here."
    )
    guide_page = "scenes"

    def __init__(self) -> None:
        names = ("load_case", "force", "x", "y", "x_end", "y_end", "size", "size_y")
        super().__init__("Load", names)
        self._refusal = ""

    def show_settings(self, settings: Settings) -> None:
        for name, side in (("x", settings.side_x), ("y", settings.side_y)):
            self.show_limit(name, side)
            self.show_limit(f"{name}_end", side)
        self.show_limit("size", settings.side_x)
        self.show_limit("size_y", settings.side_y)
        self._show_cases(is_table_1(settings))
        super().show_settings(settings)
        self._show_rows_of(settings.load_case)

    def _show_rows_of(self, case: str) -> None:
        rows = {"load_case"} | ({"force", "x", "y"} if case in FREE_CASES else set())
        rows |= {"x_end", "y_end"} if case in TWO_ENDED else set()
        rows |= {"size"} if case in SPREAD_CASES else set()
        self.show_rows(rows | ({"size_y"} if case == "rectangle" else set()))
        label = self.form.labelForField(self.editor("size"))
        if isinstance(label, QLabel) and case in SIZES:
            label.setText(SIZES[case])

    def show_refusal(self, text: str) -> None:
        """Show why the requested load or skin is refused; nothing if it is not."""
        self._refusal = text

    def alarm(self, status: Status) -> str:
        return f"The previous load is still simulated: {self._refusal}." if self._refusal else ""

    def _show_cases(self, table_1: bool) -> None:
        """Mark the cases of Table 1 where they apply."""
        box = self.editor("load_case")
        for index, (case, words) in enumerate(LOAD_CASES):
            suffix = " (Table 1)" if table_1 and case in TABLE_1_CASES else ""
            if isinstance(box, QComboBox):
                box.setItemText(index, words + suffix)


class NoisePanel(SimulationForm):
    """The form of the noise of the simulated readings."""

    purpose = (
        "Noise added to every simulated reading: independent, of zero mean and of this RMS. The "
        "seed makes it repeatable."
    )
    guide_page = "scenes"

    def __init__(self) -> None:
        super().__init__("Noise", ("noise_kind", "noise_rms", "noise_seed"))

    def show_settings(self, settings: Settings) -> None:
        super().show_settings(settings)
        noisy = settings.noise_kind != "none"
        self.show_rows({"noise_kind"} | ({"noise_rms", "noise_seed"} if noisy else set()))


class AddedNoisePanel(Form):
    """The form of the noise added to what is shown of a device."""

    purpose = (
        "Noise added to the readings of the shown estimate, to see what it does: normal, of zero "
        "mean and of this RMS. Recordings, published estimates, tares and calibrations have none "
        "of it."
    )
    guide_page = "accuracy"

    def __init__(self) -> None:
        super().__init__("Added noise", ("added_noise",))

    def show_status(self, status: Status, simulating: bool) -> None:
        sensor, played = status.sensor, status.source.startswith("sim:") or status.replay
        self.setVisible(not played and sensor is not None and sensor.layout.senses_curvature_only)
