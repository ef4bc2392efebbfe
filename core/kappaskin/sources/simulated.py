"""A scene, played in real time as frames."""

import time
from collections.abc import Callable

from kappaskin.frames import Frame
from kappaskin.scene import Scene
from kappaskin.sensor import Sensor
from kappaskin.simulate import Simulator
from kappaskin.sources.wire import Accounting

_BACKLOG = 0.25  # s behind its own clock after which frames are skipped, and counted as lost
_ROUNDING = 1e-3  # of a frame: a clock that was slept to may stand a rounding error before it


class SimulatedSource:
    """Yields the frames of a scene at its rate; the scene may change while it plays."""

    def __init__(
        self,
        scene: Scene,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._simulator, self._sensor = Simulator(scene), scene.sensor()
        self._clock, self._sleep = clock, sleep
        self._start, self._n = clock(), 0
        self._accepted = self._lost = 0

    @property
    def sensor(self) -> Sensor:
        return self._sensor

    def play(self, scene: Scene) -> None:
        """Go on with another scene on the same skin, from the same moment."""
        self._simulator.change(scene)

    def read(self, timeout: float) -> list[Frame]:
        rate = self._sensor.rate
        due = self._start + self._n / rate
        now = self._clock()
        if due > now:
            self._sleep(min(due - now, timeout))
            now = self._clock()
        ready = int((now - self._start) * rate + _ROUNDING) + 1 - self._n
        if ready <= 0:
            return []
        skipped = max(0, ready - max(1, int(_BACKLOG * rate)))
        self._lost += skipped
        self._n += skipped
        frames = [self._simulator.frame(self._n + q, self._clock) for q in range(ready - skipped)]
        self._n += len(frames)
        self._accepted += len(frames)
        return frames

    def accounting(self) -> Accounting:
        return Accounting(
            good=self._accepted,
            accepted=self._accepted,
            lost=self._lost,
            span=self._accepted + self._lost,
        )

    def close(self) -> None:
        """Nothing is held open."""
