"""A simulated load that rests while a person presses, so that nothing else moves the skin."""

from kappaskin_app.features.health.map_testing import MapTesting
from kappaskin_app.shell.session import Session


class Resting:
    """Holds what a `session` simulates still while a `testing` of its channel map goes on."""

    def __init__(self, session: Session, testing: MapTesting) -> None:
        self._session, self._testing = session, testing
        self._held = False

    def hold(self) -> None:
        if self._session.inside and self._session.running:
            self._held = True
            self._session.run(False)

    def let_go(self) -> None:
        """Let it go on after the test."""
        if self._held and not self._testing.running:
            self._held = False
            self._session.run(True)
