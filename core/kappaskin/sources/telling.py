"""What happened on a line, in words: who is there, and what was lost."""

from collections.abc import Callable

from kappaskin.frames import Event
from kappaskin.sensing import Sensor
from kappaskin.sources.accounting import Sequence

_LONGEST = 500  # characters: a device may say anything of itself, and each status has 64 events
_SUMMED = 1.0  # s of which lost messages are told together


class Telling:
    """Gathers events until they are taken; what was lost is told of the numbers in `sequence`."""

    def __init__(self, sequence: Sequence, clock: Callable[[], float]) -> None:
        self._sequence, self._clock = sequence, clock
        self._events: list[Event] = []
        self._lost = self._restarts = 0  # that were told
        self._summed_at = 0.0

    def __call__(self, kind: str, text: str) -> None:
        """Tell this too."""
        self._events.append(Event(self._clock(), kind, text[:_LONGEST]))

    def taken(self) -> list[Event]:
        """What happened since the last time that this was asked."""
        told, self._events = self._events, []
        return told

    def met(self, was: Sensor | None, now: Sensor) -> None:
        """Tell what is new of the device that is there `now`."""
        name = _name(now)
        if was is None:
            self("met", f"{name}, firmware {now.firmware}")
        elif was.serial_number != now.serial_number:
            self("other", f"another device: {name} instead of {was.serial_number}")
        elif now.firmware != was.firmware:
            self("firmware", f"firmware {now.firmware} instead of {was.firmware}")
        elif now is not was:
            self("changed", f"{name} says something else of itself than before")

    def resumed(self, sensor: Sensor, away: float, same: bool, lost: int) -> None:
        """Tell that the `same` device is back after `away` s, in which so many were `lost`."""
        again = "" if self._sequence.restarts == self._restarts else ", from its beginning"
        self._lost, self._restarts = self._lost + lost, self._sequence.restarts
        if same:
            text = f"{_name(sensor)} is back after {away:.1f} s{again}: {lost} messages lost"
            self("back", text)

    def restarted(self) -> bool:
        """Whether the device started anew since the last look, which is told."""
        restarted = self._sequence.restarts > self._restarts
        if restarted:
            self._restarts = self._sequence.restarts
            self("restarted", "the device started anew while it was connected")
        return restarted

    def losses(self) -> None:
        """Tell of what was lost, now and then."""
        lost, now = self._sequence.lost - self._lost, self._clock()
        if lost and now - self._summed_at >= _SUMMED:
            if lost > 0:
                self("gap", f"{lost} messages lost")
            self._lost, self._summed_at = self._sequence.lost, now


def _name(sensor: Sensor) -> str:
    return f"{sensor.name} {sensor.serial_number}"
