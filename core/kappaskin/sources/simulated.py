"""Simulated source: a scene, played in real time as frames."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from kappaskin.contact import ForceTorqueSensor, Wrench
from kappaskin.errors import Refusal
from kappaskin.estimation import Scanner
from kappaskin.frames import Event, Frame
from kappaskin.scenes import Playback, Scene, Simulator, load_scene
from kappaskin.sensing import Scan, Sensor
from kappaskin.sources.clock import ClockState
from kappaskin.sources.commands import in_few_runs
from kappaskin.sources.decoder import Accounting
from kappaskin.sources.information import sensor_from_json, sensor_to_json
from kappaskin.sources.source import InputRecorder, register_scheme
from kappaskin.sources.wire import MOST_RUNS, encode_scan, pack_runs

_BACKLOG = 0.25  # s behind real time after which the simulated time waits for the computing
_WHILE = 2.0  # s over which the pace is taken
_DEPTH = 0.02  # m from the middle of the skin down to the force/torque sensor
_ROUNDING = 1e-3  # of a frame: a clock that was slept to may stand a rounding error before it


@dataclass
class VirtualClock:
    """A clock that moves when someone sleeps by it: no waiting for a simulation."""

    now: float = 0.0

    def __call__(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


class SimulatedSource:
    """Yields the frames of a scene at its rate; scene and scan may change while it plays.

    Where its frames cannot be computed in real time its own time goes slower, and none is lost.
    With `follows_clock` the scene's time is that of the clock nevertheless, from its zero on: two
    sources that share a clock show the same moment of a course.
    Another skin, other elements or electronics are another device on the same line: `sensor` is
    then another one.
    """

    SCHEME = "sim:"
    """Begins the names of such sources."""

    def __init__(
        self,
        scene: Scene,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
        follows_clock: bool = False,
    ) -> None:
        self._clock, self._sleep, self._follows = clock, sleep, follows_clock
        self._start, self._n = clock(), 0
        begin = self._start % scene.duration if follows_clock else 0.0
        self._become(scene, 0.0, Playback(begin))
        self._base_noise = np.random.default_rng(scene.seed)
        self._taken = 0.0  # device time of the last frame
        self._accepted = self._lost = 0
        self._recorder: InputRecorder | None = None
        self._paced, self._pace = (self._start, 0.0), 1.0
        self._listed, self._runs = np.empty(0, np.intp), b""

    def _become(self, scene: Scene, due: float, playing: Playback) -> None:
        """Be the device of `scene`, whose next frame is due at device time `due` in s."""
        text = sensor_to_json(scene.sensor())
        # As anybody else would know it from what it says: in the last bit not what the scene has.
        sensor = sensor_from_json(text)
        self._simulator, self._text, self._sensor = Simulator(scene, playing), text, sensor
        # Since frame `_first`, due at device time `_since`, frames come at `_rate`.
        self._first, self._since = self._n, due
        self._rate: float = self._sensor.rate
        self._all = self._sensor.scan()
        self._scanner: Scanner | None = None
        patch = scene.plate.patch
        self.base = ForceTorqueSensor((patch.a / 2, patch.b / 2, -_DEPTH))
        """The simulated force/torque sensor that carries the skin."""

    @property
    def sensor(self) -> Sensor:
        return self._sensor

    @property
    def scene(self) -> Scene:
        return self._simulator.scene

    def play(self, scene: Scene) -> None:
        """Continue with another scene from the same moment; a refused one changes nothing."""
        if sensor_to_json(scene.sensor()) == self._text:
            self._change(scene)
            return
        self._become(scene, self._due(), self.playing)
        # The next frame is due now: making what the skin needs took a while, but nothing is lost.
        self._start = self._clock() - self._since
        self.record(self._recorder)

    def _change(self, scene: Scene) -> None:
        was = self.scene
        try:
            self._simulator.change(scene)
        except Refusal:
            self._simulator.change(was)
            raise

    def record(self, recorder: InputRecorder | None) -> None:
        """Give `recorder` from now on what such a device would send; nobody without one."""
        self._recorder = recorder
        if recorder is not None:
            recorder.connected(self._text)
            self._record_clock(recorder)

    def _record_clock(self, recorder: InputRecorder) -> None:
        state = ClockState((0.0, self._start, 0.0, 0.0, 0.0, False), 0, math.nan)
        recorder.clock(math.nan, state)

    def _record(self, recorder: InputRecorder, frames: list[Frame]) -> None:
        width = self._simulator.scene.transduction.count_bytes
        for frame in frames:
            recorder.simulated(frame)
            if frame.channels is not self._listed:  # scans of one list share it
                self._listed, self._runs = frame.channels, pack_runs(frame.channels)
            sent = frame.sequence, frame.device_time, self._runs, frame.counts, width
            recorder.received(frame.host_time, encode_scan(*sent))

    @property
    def playing(self) -> Playback:
        """Where in its scene it is."""
        return self._simulator.playing

    def seek(self, at: float | None, speed: float) -> None:
        """Go on from the scene's time `at` in s, or from where it is, at another `speed`."""
        due = self._due()
        self._simulator.play(Playback(self.playing.time(due) if at is None else at, due, speed))

    def scan(self, scanner: Scanner | None) -> None:
        """Read what `scanner` chooses from the next frame on; all channels without one."""
        self._scanner = scanner

    def _due(self) -> float:
        """Device time of the next frame."""
        return self._since + (self._n - self._first) / self._rate

    def _next(self) -> Frame:
        """The next frame; its scan decides when the one after it begins."""
        due, scan, rate = self._due(), self._all, self._sensor.rate
        if self._scanner is not None:
            scan = self._fitted_to_wire(self._scanner())
            rate = min(self._scanner.rate, scan.rate)
        if rate != self._rate:
            self._first, self._since, self._rate = self._n, due, rate
        self._n, self._taken = self._n + 1, due
        frame = self._simulator.scanned(scan, self._n - 1, due, self._clock)
        # A device sends its time in whole us.
        time = round(due * 1e6) * 1e-6
        return replace(frame, device_time=time, taken=time + self._start, taken_sd=0.0)

    def _fitted_to_wire(self, scan: Scan) -> Scan:
        """The scan, with as few more channels as let it fit into one scan list on the wire."""
        if len(scan.channels) <= MOST_RUNS:
            return scan
        channels = in_few_runs(scan.channels)
        return scan if len(channels) == len(scan.channels) else self._sensor.scan(channels)

    def wrench(self) -> Wrench:
        """What `base` reads of the contact, at the time of the last frame."""
        patch, loads = self._sensor.layout.patch, self._simulator.loads(self._taken)
        return self.base.read(patch, loads, self._base_noise)

    def read(self, timeout: float) -> list[Frame]:
        now, due = self._clock(), self._start + self._due()
        if due > now:
            self._sleep(min(due - now, timeout))
            now = self._clock()
        late = now - self._start - self._due()
        if late > max(_BACKLOG, 1 / self._rate):
            self._start += late
            if self._follows:
                now_at = self.playing.time(self._due()) + self.playing.speed * late
                self.seek(now_at, self.playing.speed)
            if self._recorder is not None:
                self._record_clock(self._recorder)
        frames: list[Frame] = []
        while (now - self._start - self._due()) * self._rate + _ROUNDING >= 0:
            frames.append(self._next())
        arrived = [frame for frame in frames if not self._simulator.failure(frame.sequence)]
        if self._recorder is not None:
            self._record(self._recorder, arrived)
        self._accepted += len(arrived)
        self._lost += len(frames) - len(arrived)
        return arrived

    @property
    def pace(self) -> float:
        """Simulated seconds per second of the last two or more: below 1 where it is slower."""
        now = self._clock()
        then, time = self._paced
        if now - then >= _WHILE:
            until = min(now - self._start, self._due())
            self._pace = max(until - time, 0.0) / (now - then)
            self._paced = now, until
        return self._pace

    @property
    def patient(self) -> bool:
        return False

    @property
    def trouble(self) -> str:
        return ""

    @property
    def temperature(self) -> float:
        return self._simulator.temperature(self._taken)

    def events(self) -> list[Event]:
        return []

    def accounting(self) -> Accounting:
        return Accounting(
            good=self._accepted,
            accepted=self._accepted,
            lost=self._lost,
            span=self._accepted + self._lost,
        )

    def close(self) -> None:
        """Nothing is held open."""


register_scheme(
    SimulatedSource.SCHEME, lambda name, trust: SimulatedSource(load_scene(name, trust))
)
