"""What presses on the simulated skin, and what noise its readings have."""

from PySide6.QtWidgets import QWidget

from kappaskin_app.panels.form import Panel
from kappaskin_app.settings import FREE_CASES, TWO_ENDED, Settings
from kappaskin_app.theme import Theme

_REAL = "Only for the simulation inside the app (Ctrl+M)."


class _SimulationPanel(Panel):
    """A panel that belongs to the simulation, and says so while a real sensor is connected."""

    def show_simulating(self, simulating: bool) -> None:
        for editor in self.editors():
            editor.setEnabled(simulating)
        self.show_message("" if simulating else _REAL)

    def show_theme(self, theme: Theme) -> None:
        self.message.setStyleSheet(f"color: {theme.faint};")  # a hint, not an alarm


class LoadPanel(_SimulationPanel):
    """Asks for the load case; a free one has its place and its force."""

    def __init__(self, parent: QWidget | None = None) -> None:
        names = ("load_case", "force", "x", "y", "x_end", "y_end")
        super().__init__("Load", names, parent)

    def show_settings(self, settings: Settings) -> None:
        super().show_settings(settings)
        free, two = settings.load_case in FREE_CASES, settings.load_case in TWO_ENDED
        rows = {"load_case"} | ({"force", "x", "y"} if free else set())
        self.show_rows(rows | ({"x_end", "y_end"} if two else set()))


class NoisePanel(_SimulationPanel):
    """Asks for the noise of the simulated readings."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Noise", ("noise_kind", "noise_rms", "noise_seed"), parent)

    def show_settings(self, settings: Settings) -> None:
        super().show_settings(settings)
        noisy = settings.noise_kind != "none"
        self.show_rows({"noise_kind"} | ({"noise_rms", "noise_seed"} if noisy else set()))
