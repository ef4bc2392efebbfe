"""What every panel is: a titled box that shows what is so and says what a person wishes."""

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QGroupBox, QLabel, QVBoxLayout, QWidget

from kappaskin import Status
from kappaskin_app.settings import Settings
from kappaskin_app.theme import LIGHT, Theme


class Panel(QGroupBox):
    """A titled box with a message at its foot; `wished` says which setting is to be what."""

    wished = Signal(str, object)

    def __init__(self, title: str, parent: QWidget | None = None) -> None:
        super().__init__(title, parent)
        self.message = QLabel(wordWrap=True, visible=False)  # pyright: ignore[reportCallIssue]
        how = Qt.TextInteractionFlag
        self.message.setTextInteractionFlags(
            how.TextSelectableByMouse | how.TextSelectableByKeyboard
        )
        self._theme, self._hint = LIGHT, False
        self.body = QVBoxLayout()
        self._around = QVBoxLayout(self)
        self._around.setContentsMargins(8, 6, 8, 8)
        self._around.addLayout(self.body)
        self._around.addWidget(self.message)

    def show_settings(self, settings: Settings) -> None:
        """Show what is chosen."""

    def show_status(self, status: Status, simulating: bool) -> None:
        """Show how the engine is doing, and whether the app's own simulation is playing."""

    def show_theme(self, theme: Theme) -> None:
        self._theme = theme
        self._paint()

    def show_message(self, text: str, hint: bool = False) -> None:
        """Say something at the foot, or nothing: an alarm, or only a hint."""
        if (text, hint) != (self.message.text(), self._hint):
            self._hint = hint
            self.message.setText(text)
            self._paint()
        self.message.setVisible(bool(text))

    def _paint(self) -> None:
        colour = self._theme.faint if self._hint else self._theme.alert
        self.message.setStyleSheet(f"color: {colour};")
