"""Estimates to a test of the channel map, as a person presses one element after the other."""

from PySide6.QtCore import QObject, Signal

from kappaskin.calibration import MapVerdict, PressPhase, PressTest, elements_to_press
from kappaskin.errors import Refusal
from kappaskin.frames import Estimate
from kappaskin.live import Status

_ENDED = "The test ended: the line was lost, or another skin answered. Begin anew."


class MapTesting(QObject):
    """A press-here test: `test` while one is done or was, with its `verdict` once it is over.

    `changed` tells of anything new, `asked` which element is to be pressed now, -1 for none, and
    `begun` that one begins; `message` says why there is none.
    """

    changed = Signal()
    asked = Signal(int)
    begun = Signal()

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._status, self._meeting = Status(), 0
        self.test: PressTest | None = None
        self.verdict: MapVerdict | None = None
        self.message = ""
        self._phase: PressPhase | None = None

    @property
    def running(self) -> bool:
        return self.test is not None and self.verdict is None

    def begin(self, quick: bool) -> None:
        """Ask for all elements, or where `quick` for a few that tell of a grid's lines."""
        try:
            sensor = self._status.sensor
            if sensor is None or self._status.state != "streaming":
                raise Refusal("no sensor is connected; connect one, then begin")
            self.test = PressTest(sensor, elements_to_press(sensor.layout, quick))
        except Refusal as refusal:
            self._tell(str(refusal))
            return
        self.verdict, self._meeting = None, self._status.meetings
        self.begun.emit()
        self._tell("")

    def skip(self) -> None:
        if self.running and self.test is not None:
            self.test.skip()
            self._tell("")

    def nothing_came(self) -> None:
        if self.running and self.test is not None:
            self.test.nothing_came()
            self._tell("")

    def back(self) -> None:
        self.verdict = None
        self.follow(self._status)  # who read the verdict may have another skin by now
        if self.test is not None:
            self.test.back()
            self._tell("")

    def stop(self, why: str = "") -> None:
        """End the test and forget what was pressed."""
        self.test = self.verdict = None
        self._tell(why)

    def follow(self, status: Status) -> None:
        """End a test whose device has gone."""
        self._status = status
        gone = status.state != "streaming" or status.meetings != self._meeting
        if self.running and gone:
            self.stop(_ENDED)

    def receive(self, estimate: Estimate) -> None:
        """Take in the readings of an estimate, not the shape that trusts the map."""
        test = self.test
        if not self.running or test is None:
            return
        readings = estimate.curvature.ravel()
        if readings.size != test.sensor.channels:
            return  # a last one of the skin before
        if test.take(estimate.device_time, readings) or test.phase is not self._phase:
            self._tell("")

    def _tell(self, message: str) -> None:
        test, self.message = self.test, message
        self._phase = None if test is None else test.phase
        if test is not None and test.over and self.verdict is None:
            self.verdict = test.verdict()
        now = test.asked if test is not None and self.running else None
        self.asked.emit(-1 if now is None else now)
        self.changed.emit()
