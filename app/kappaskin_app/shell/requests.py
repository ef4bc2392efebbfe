"""Requests of changes of settings, as undoable commands."""

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any

from kappaskin_app.shell.history import History
from kappaskin_app.shell.session import Session
from kappaskin_app.shell.settings import LastingSettings, Settings, locking
from kappaskin_app.shell.settings.publishing import PublishSettings
from kappaskin_app.shell.simulation import with_consequences


class Requests:
    """Turns requests of panels, menus and views into commands of the history."""

    def __init__(self, history: History, session: Session) -> None:
        self._history, self._session = history, session

    def set(self, name: str, value: Any) -> None:
        """Change the setting `name`, and what follows from it."""
        changed = with_consequences(self._history.settings, self._session.scene, name, value)
        self._history.request(name, **changed)

    def toggle(self, name: str) -> None:
        self.set(name, not getattr(self._history.settings, name))

    def lock(self, name: str, limit: float) -> None:
        """Lock the colour range of the quantity `name` at a limit in SI units; zero unlocks it."""
        self._history.request(f"range_{name}", **locking({name: limit}, self._history.settings))

    def switch_theme(self) -> None:
        self.set("theme", "light" if self._history.settings.theme == "dark" else "dark")

    def reset(self) -> None:
        """Reset all settings except calibration, tare, publishing and lasting ones."""
        now = self._history.settings
        rest = Settings(calibration=now.calibration, tare=now.tare)
        kept = (field.name for kind in (PublishSettings, LastingSettings) for field in fields(kind))
        values = {name: getattr(now, name) for name in kept}
        self._history.reset("Reset settings", **vars(rest) | values)

    def reset_panel(self, title: str, names: Sequence[str]) -> None:
        """Reset some settings, with what follows from each."""
        was = now = self._history.settings
        first = Settings()
        for name in names:
            if getattr(now, name) != (value := getattr(first, name)):
                now = replace(now, **with_consequences(now, self._session.scene, name, value))
        every = {field.name: getattr(now, field.name) for field in fields(Settings)}
        changed = {n: v for n, v in every.items() if n in names or v != getattr(was, n)}
        self._history.reset(f"Reset {title}", **changed)
