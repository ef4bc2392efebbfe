"""What a person asks of the settings, as undoable changes."""

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any

from kappaskin_app.shell.history import History
from kappaskin_app.shell.session import Session
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.settings.publishing import PublishSettings
from kappaskin_app.shell.simulation import with_consequences


class Requests:
    """Turns requests of panels, menus and views into commands of the history."""

    def __init__(self, history: History, session: Session) -> None:
        self._history, self._session = history, session

    def set(self, name: str, value: Any) -> None:
        """Make the setting `name` what is asked for, and change what follows from it."""
        changed = with_consequences(self._history.settings, self._session.scene, name, value)
        self._history.wish(name, **changed)

    def toggle(self, name: str) -> None:
        self.set(name, not getattr(self._history.settings, name))

    def switch_theme(self) -> None:
        self.set("theme", "light" if self._history.settings.theme == "dark" else "dark")

    def reset(self) -> None:
        """Have all settings as they are at first, but for calibration, tare and publishing."""
        now = self._history.settings
        kept = Settings(calibration=now.calibration, tare=now.tare)  # no matter of taste
        sending = {
            field.name: getattr(now, field.name) for field in fields(PublishSettings)
        }  # nor this
        self._history.change("Reset settings", -1, **vars(kept) | sending)

    def reset_panel(self, title: str, names: Sequence[str]) -> None:
        """Have some settings as they are at first, with what follows from each."""
        now, first = self._history.settings, Settings()
        for name in names:
            if getattr(now, name) != (value := getattr(first, name)):
                now = replace(now, **with_consequences(now, self._session.scene, name, value))
        changed = {field.name: getattr(now, field.name) for field in fields(Settings)}
        self._history.change(f"Reset {title}", -1, **changed)
