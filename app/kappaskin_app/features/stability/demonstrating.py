"""A hard case brought about: as one step to undo, with what follows once its skin is there."""

from kappaskin.live import Status
from kappaskin_app.features.stability.demonstrations import DEMONSTRATIONS, Demonstration
from kappaskin_app.shell.history import History
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.simulation import patch_of

_TITLES = {name[:1].lower() + name[1:] for name in (d.title for d in DEMONSTRATIONS)}


class Demonstrating:
    """Changes the settings of the `history` to those of a hard case."""

    def __init__(self, history: History) -> None:
        self._history = history
        self._begun: tuple[Demonstration, int, Settings] | None = None

    def demonstrate(self, demonstration: Demonstration) -> None:
        """Bring a hard case about, as one step."""
        gesture = self._history.new_gesture()
        self._history.change(demonstration.title, gesture, **demonstration.changes())
        if demonstration.then:
            self._begun = demonstration, gesture, self._history.settings

    @property
    def demonstrates(self) -> bool:
        """Whether the last step, which undoing takes back, brought a hard case about."""
        # By its words: Qt's own commands, asked for at every step, come and go with their wrappers.
        return self._history.stack.undoText() in _TITLES

    def follow(self, status: Status) -> None:
        """Go on with the hard case that was begun, once its skin is there."""
        if self._begun is None:
            return
        demonstration, gesture, settings = self._begun
        if self._history.settings != settings:
            self._begun = None  # something else was wished meanwhile
            return
        there = status.sensor is not None and status.sensor.plate.patch == patch_of(settings)
        if there and status.slot is not None and not status.computing:
            self._begun = None
            self._history.change(demonstration.title, gesture, **demonstration.then)
