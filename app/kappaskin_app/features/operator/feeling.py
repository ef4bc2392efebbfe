"""Feeling: what each finger feels, for tones and rumble, and nothing of old data."""

from PySide6.QtCore import QObject, Qt, QTimer, Signal

from kappaskin.live import STREAMING
from kappaskin.publish import CueGenerator, CueLimits
from kappaskin_app.guard import guarded
from kappaskin_app.shell.session import Session

_EVERY = 20  # ms between two
_RATE = 25.0  # 1/s: how fast the force may change, of the largest; it fades within 50 ms then


class Feeling(QObject):
    """While it is active, `felt` brings the force of each finger as a share of the largest.

    In the order of the fingers; 0 without a contact, and faded where data are old or lost.
    """

    felt = Signal(list)

    def __init__(self, session: Session) -> None:
        super().__init__()
        self._session, self._largest = session, 1.0
        self._cues = dict[str, CueGenerator]()
        self._taken = dict[str, tuple[int, int]]()
        self._timer = QTimer(self, interval=_EVERY, timerType=Qt.TimerType.PreciseTimer)  # pyright: ignore[reportCallIssue]
        self._timer.timeout.connect(guarded(self.feel))

    def set_active(self, active: bool, largest: float) -> None:
        """Feel, or not, forces up to the `largest` in N."""
        if largest != self._largest:
            self._largest = largest
            self._cues.clear()
        if active and not self._timer.isActive():
            self._timer.start()
        elif not active and self._timer.isActive():
            self._timer.stop()
            self._cues.clear()
            self.felt.emit([])

    def feel(self) -> None:
        """Emit what is felt now."""
        session, shares = self._session, list[float]()
        if session.closed:
            return
        fingers = session.fingers.engines if session.fingers else {"": session.engine}
        for finger, engine in fingers.items():
            if finger not in self._cues:
                limits = CueLimits(self._largest, _RATE * self._largest)
                self._cues[finger], self._taken[finger] = CueGenerator(limits), (0, -1)
            cues, status = self._cues[finger], engine.status()
            cues.streams = status.state == STREAMING
            estimate = engine.latest(status)
            if estimate is not None:
                number = estimate.generation, estimate.sequence
                if number != self._taken[finger]:
                    self._taken[finger] = number
                    cues.take(estimate)
            shares.append(cues().force / self._largest)
        self.felt.emit(shares)
