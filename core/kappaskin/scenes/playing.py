"""Device time to the time of the scene that is played: it goes on, slowly or not at all."""

import math
from dataclasses import dataclass

from kappaskin.errors import Refusal


@dataclass(frozen=True, slots=True)
class Playing:
    """A scene that stood at `at` s when device time was `since` s, `speed` times as fast since.

    At a speed of zero it stands still, while the device goes on reading it.
    """

    at: float = 0.0
    since: float = 0.0
    speed: float = 1.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.at) and math.isfinite(self.since)):
            raise Refusal(f"expected finite times in s to play a scene from, got {self}")
        if not 0 <= self.speed <= 10:
            raise Refusal(f"expected a speed of 0 to 10 to play a scene at, got {self.speed:g}")

    def time(self, device_time: float) -> float:
        """The time in s of the scene at `device_time` in s."""
        return self.at + self.speed * (device_time - self.since)


FROM_THE_BEGINNING = Playing()
