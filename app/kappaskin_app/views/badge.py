"""One large word that always tells the truth about what is shown."""

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QMouseEvent
from PySide6.QtWidgets import QLabel, QWidget

from kappaskin_app.theme import Theme

LIVE, SIM, WAITING = "LIVE", "SIM", "WAITING"
STALE, LOST, OFF = "STALE", "LOST", "OFF"
_BESIDE = " \N{MIDDLE DOT} "  # parts a state from what more is true of it, below it
REPLAY, PAUSED, GAP = "REPLAY", f"REPLAY{_BESIDE}paused", f"REPLAY{_BESIDE}gap"

TIPS = {
    LIVE: "Readings of a real sensor, as they come.",
    SIM: "Readings of a simulation, not of a real sensor.",
    WAITING: "Connecting, or computing what this skin needs: the first reading is still to come.",
    STALE: "No reading has come for half a second: what is shown is old.",
    LOST: "The connection ended or could not be made: what is shown is the last that came. "
    "A device that comes back is gone on with by itself.",
    OFF: "Nothing is connected.",
    REPLAY: "A recording is played: what is shown was once so.",
    PAUSED: "A recording stands still: what is shown was once so.",
    GAP: "A recording, where nothing came for a while: what is shown is old.",
}


_MORE = "Click it, or F4, to read what happened."


class Badge(QLabel):
    """Shows one of the states in its colour; `clicked` asks what happened."""

    clicked = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.setFixedWidth(112)
        self._theme: Theme | None = None
        self.state = ""

    def show_state(self, state: str) -> None:
        if state != self.state:
            self.state = state
            self.setText(state.replace(_BESIDE, "\n"))
            self.setAccessibleName(state)
            self.setToolTip(f"{TIPS[state]}\n{_MORE}")
            self._paint()

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        self.clicked.emit()
        super().mouseReleaseEvent(event)

    def show_theme(self, theme: Theme) -> None:
        self._theme = theme
        self._paint()

    def _paint(self) -> None:
        if self._theme is None or not self.state:
            return
        size, padding = (13, 0) if _BESIDE in self.state else (20, 4)
        self.setStyleSheet(
            f"background: {colour_of(self.state, self._theme)}; color: white; font-weight: 700;"
            f"font-size: {size}px; border-radius: 6px; padding: {padding}px;"
        )


def colour_of(state: str, theme: Theme) -> str:
    """The ground on which a state is written in white."""
    return {
        LIVE: theme.good,
        SIM: theme.simulated,
        WAITING: theme.off,
        STALE: theme.warning,
        LOST: theme.bad,
        OFF: theme.off,
        REPLAY: theme.replayed,
        PAUSED: theme.replayed,
        GAP: theme.warning,
    }[state]
