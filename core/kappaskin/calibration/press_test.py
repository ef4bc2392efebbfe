"""Press test of the channel map, element by element."""

import math
import time
from collections import deque
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from enum import Enum
from typing import cast

import numpy as np

from kappaskin.calibration.channel_map import (
    NOTHING,
    SKIPPED,
    MapVerdict,
    PressResult,
    judge_press,
    map_verdict,
)
from kappaskin.calibration.sweep import DeviceReadings, Report
from kappaskin.errors import Refusal
from kappaskin.frames import Array, Frame, Mask
from kappaskin.mechanics import PointLoad
from kappaskin.scenes import Scene, load_scene
from kappaskin.sensing import Sensor, SensorLayout
from kappaskin.sources import SimulatedSource, VirtualClock, open_source

_OFTEN = 0.005  # s between two readings that are kept
_STILL = 0.4  # s without motion are a rest
_LATELY = 0.1  # s that are averaged to see a press
_WHOLE = 0.8  # of that, at least, between the first reading kept and the last
_FEWEST, _FEWEST_AT_REST = 3, 6  # readings that are averaged, and of a rest
_CLEAR = 8.0  # standard deviations that a press stands out by
_MOVING = 6.0  # the same, that a skin at rest may move by
_LET_GO = 3.0  # times as far as it is bent in, it bulges where it was let go
_OVER = 0.25  # of its peak: less is left when a press is over

_MOST_ELEMENTS = 400  # elements: more nobody presses
_OF_THE_RANGE = 0.5  # of what a channel can read, that a simulated finger makes of it
_FINEST = 15  # functions along each side at least: or a bent strip answers everywhere alike
_HELD = 0.2  # s that it stays
_GIVEN_UP = 5.0  # s after which nothing will respond to it
_READ = 0.02  # s that one read may wait
_LONGEST = 3600.0  # s that one may take to press


class PressPhase(Enum):
    """What a press test waits for."""

    REST = "rest"
    PRESS = "press"
    RELEASE = "release"


class PressDetector:
    """Detects one press in the readings of C channels, wherever these are.

    `peak` (C,) in 1/m is their change from the rest before it when it was hardest; None until the
    press is over. `phase` says what is waited for: a rest, a press, the end of it.
    """

    def __init__(self, channels: int, resolution: float) -> None:
        """Readings of `channels` that come in steps of `resolution` in 1/m: never less noise."""
        self.phase = PressPhase.REST
        self.peak: Array | None = None
        self._held = np.full(channels, np.nan)
        self._recent: deque[tuple[float, Array]] = deque()
        self._rest, self._noise, self._least = np.zeros(channels), math.nan, resolution
        self._hardest, self._most, self._pressed = np.zeros(channels), 0.0, 0.0

    def __call__(self, time: float, readings: Array) -> None:
        """Take the `readings` (C,) in 1/m at `time` in s, NaN where one is missing."""
        if self._recent and time < self._recent[-1][0]:  # a device that restarted
            self._recent.clear()
        # A reading that is missing now, as on a rail, is taken for the last one there was.
        self._held = np.where(np.isnan(readings), self._held, readings)
        if self._recent and time - self._recent[-1][0] < _OFTEN:
            return
        self._recent.append((time, self._held))
        while time - self._recent[0][0] > _STILL:
            self._recent.popleft()
        if self.phase is PressPhase.REST:
            self._settle()
        elif self.peak is None:
            self._follow()

    def _last(self, count: int | None = None) -> Array:
        """The readings (n, C) kept last, at most `count` of them."""
        recent = list(self._recent) if count is None else list(self._recent)[-count:]
        return np.array([reading for _, reading in recent])

    def _whole(self) -> bool:
        """Whether what is kept is long enough to be a rest."""
        return self._recent[-1][0] - self._recent[0][0] >= _WHOLE * _STILL

    def _still(self, recent: Array) -> bool:
        """Whether nothing moved from the first half of `recent` (n, C) to the second."""
        half = len(recent) // 2
        moved = np.nan_to_num(np.abs(recent[half:].mean(axis=0) - recent[:half].mean(axis=0)))
        return bool(moved.max() <= _MOVING * self._noise * 2 / math.sqrt(len(recent)))

    def _settle(self) -> None:
        """Call it a rest once nothing has moved for a while."""
        if len(self._recent) < _FEWEST_AT_REST or not self._whole():
            return
        recent = self._last()
        noise = np.sqrt(np.mean(np.diff(recent, axis=0) ** 2, axis=0) / 2)
        self._noise = max(float(np.median(noise[~np.isnan(noise)])), self._least)
        if self._still(recent):
            self._rest, self.phase = recent.mean(axis=0), PressPhase.PRESS

    def _follow(self) -> None:
        now = self._recent[-1][0]
        count = sum(when >= now - _LATELY for when, _ in self._recent)
        lately = self._last(max(count, _FEWEST))
        change = lately.mean(axis=0) - self._rest
        change[np.isnan(change)] = 0.0
        most = float(np.abs(change).max())
        clear = most > _CLEAR * self._noise / math.sqrt(len(lately))
        if clear and change.max() > _LET_GO * -change.min():
            # It bulges: it was pressed already when it was called at rest.
            self.phase, self._hardest, self._most = PressPhase.REST, 0 * change, 0.0
            self._recent.clear()
            return
        if most > self._most:
            self._hardest, self._most = change, most
        if self.phase is PressPhase.PRESS and clear:
            self.phase, self._pressed = PressPhase.RELEASE, now
        elif self.phase is PressPhase.RELEASE and self._over(most, now):
            self.peak = self._hardest

    def _over(self, most: float, now: float) -> bool:
        """Whether it was let go, or lies still: then what comes next is the next press."""
        if most < _OVER * self._most:
            return True
        return now - self._pressed > _STILL and self._whole() and self._still(self._last())


class PressTest:
    """Asks for one of the `elements` after the other, and takes the readings of each press.

    `target` is the element to press now, `phase` whether a rest, the press or its end is waited
    for, `done` holds the results of those before. A test is over when none is asked for; then its
    `verdict` is complete.
    """

    def __init__(self, sensor: Sensor, elements: tuple[int, ...]) -> None:
        sensor.layout.check_curvature_sensor("a test of the channel map")
        P = len(sensor.layout)
        if not elements or any(not 0 <= p < P for p in elements):
            raise Refusal(f"expected elements from 0 to {P - 1} to press, got {elements!s:.80}")
        self.sensor, self.elements = sensor, elements
        self.done: list[PressResult] = []
        self._listen()

    @staticmethod
    def choose_elements(layout: SensorLayout, quick: bool) -> tuple[int, ...]:
        """The elements to press, all that are live, or of a grid a few in each row and column.

        Those few have two elements in each column and in each row. They reveal any exchange of
        rows, of columns and of components, but not of two elements that are both left out.
        """
        layout.check_curvature_sensor("a test of the channel map")
        live = cast("Mask", layout.live[:2].any(axis=0))
        chosen = np.flatnonzero(live)
        if quick and layout.shape and min(layout.shape) > 2:
            m, n = layout.shape
            k = np.arange(max(m, n))
            some = np.unique([k % m + m * (k % n), k % m + m * ((k + 1) % n)])
            chosen = some[live[some]]
        if not 0 < len(chosen) <= _MOST_ELEMENTS:
            raise Refusal(
                f"expected 1 to {_MOST_ELEMENTS} elements to press, got {len(chosen)}; on a grid, "
                "a few are enough (--quick)"
            )
        return tuple(chosen.tolist())

    def _listen(self) -> None:
        resolution = self.sensor.transduction.resolution
        self._listener = PressDetector(self.sensor.channels, resolution)

    @property
    def target(self) -> int | None:
        """The element to press, None when all are done."""
        return None if self.over else self.elements[len(self.done)]

    @property
    def over(self) -> bool:
        return len(self.done) == len(self.elements)

    @property
    def phase(self) -> PressPhase:
        return self._listener.phase

    def take(self, time: float, readings: Array) -> PressResult | None:
        """Take the `readings` (3 P,) in 1/m at `time` in s; the result of a press that is over.

        As the device numbers its channels, not as a fit that trusts the map sees them.
        """
        if readings.shape != (self.sensor.channels,):
            raise Refusal(f"expected readings ({self.sensor.channels},), got {readings.shape}")
        target = self.target
        if target is None:
            return None
        self._listener(time, readings)
        if self._listener.peak is None:
            return None
        answer = self._listener.peak.reshape(3, -1)
        return self._note(judge_press(self.sensor.layout, target, answer))

    def _note(self, pressed: PressResult) -> PressResult:
        self.done.append(pressed)
        self._listen()
        return pressed

    def nothing_came(self) -> PressResult | None:
        """Note that no element responded to the press, and continue."""
        return self._go_on(NOTHING)

    def skip(self) -> PressResult | None:
        """Leave this one out."""
        return self._go_on(SKIPPED)

    def _go_on(self, verdict: str) -> PressResult | None:
        if self.target is None:
            return None
        nothing = np.zeros((3, len(self.sensor.layout)))
        return self._note(PressResult(self.target, verdict, None, nothing))

    def back(self) -> None:
        """Press the last one again."""
        if self.done:
            self.done.pop()
            self._listen()

    def verdict(self) -> MapVerdict:
        """What the map is, as far as was pressed."""
        return map_verdict(self.sensor, tuple(self.done))


def _announce(test: PressTest, report: Report) -> None:
    layout, target = test.sensor.layout, test.target
    if target is not None:
        x, y = layout.positions[target] * 1e3
        number = f"{len(test.done) + 1}/{len(test.elements)}"
        report(f"{number}  press element {target}, at ({x:.1f}, {y:.1f}) mm, and release it")


def _take_frames(test: PressTest, sensor: Sensor, frames: list[Frame], report: Report) -> None:
    for frame in frames:
        if pressed := test.take(frame.device_time, sensor.nominal(frame)):
            report(f"    {pressed}")
            _announce(test, report)


def _follow(listener: DeviceReadings, test: PressTest, patience: float, report: Report) -> None:
    """Wait for whoever presses; after `patience` s without a response it is the next element."""
    _announce(test, report)
    done, waited = 0, time.monotonic()
    while not test.over:
        _take_frames(test, listener.sensor, listener.frames(), report)
        if len(test.done) > done:
            done, waited = len(test.done), time.monotonic()
        elif time.monotonic() - waited > patience and (pressed := test.nothing_came()):
            report(f"    {pressed}")
            _announce(test, report)


def _finger(scene: Scene) -> Callable[[int], Scene]:
    """The scene with one element pressed so that it reads half of what it can."""
    patch = scene.plate.patch
    Ri, Rj = (max(_FINEST, count) for count in scene.reference)
    bare = replace(scene.touched_by(), reference=(Ri, 1 if patch.strip else Rj))
    chain = bare.transduction
    M = bare.layout.operator(bare.basis, bare.plate)
    most = _OF_THE_RANGE * chain.resolution * min(abs(limit) for limit in chain.limits)

    def pressed(element: int) -> Scene:
        x, y = bare.layout.positions[element].tolist()
        load = PointLoad(x, y, 1.0)
        c = bare.plate.deflection([load], bare.basis).ravel()
        return bare.touched_by(load.scaled(most / float(np.abs(M @ c).max())))

    return pressed


def _simulated(scene: Scene, quick: bool, report: Report) -> PressTest:
    """The test of the scene, pressed as fast as it can be computed."""
    clock, pressed = VirtualClock(), _finger(scene)
    bare = replace(pressed(0), stimuli=())
    source = SimulatedSource(bare, clock, clock.sleep)
    test = PressTest(source.sensor, PressTest.choose_elements(bare.layout, quick))
    _announce(test, report)
    while (target := test.target) is not None:
        for scene, until in ((bare, PressPhase.PRESS), (pressed(target), PressPhase.RELEASE)):
            source.play(scene)
            _wait(source, test, report, lambda until=until: test.phase is until)
        end = clock() + _HELD
        _wait(source, test, report, lambda end=end: clock() > end)
        source.play(bare)
        before = len(test.done)
        _wait(source, test, report, lambda before=before: len(test.done) > before)
    return test


def _wait(
    source: SimulatedSource, test: PressTest, report: Report, ended: Callable[[], bool]
) -> None:
    """Read until `ended()`, or for so long that nothing will respond."""
    frames = 0
    while not ended() and test.target is not None:
        came = source.read(_READ)
        frames += len(came)
        _take_frames(test, source.sensor, came, report)
        if frames > _GIVEN_UP * source.sensor.rate:
            if pressed := test.nothing_came():
                report(f"    {pressed}")
                _announce(test, report)
            return


def press_elements(
    name: str, report: Report, *, quick: bool, patience: float, trust: bool = False
) -> tuple[PressTest, MapVerdict]:
    """The test of the source called `name` and its verdict on the channel map.

    Asks for each element, or where `quick` for a few of a grid, and notices what responds. A
    simulation presses by itself. After `patience` s without a response the next one is asked for.
    With `trust` a scene may name files outside its folder.
    """
    if not 0 < patience <= _LONGEST:
        raise Refusal(
            f"expected a waiting time above zero and at most {_LONGEST:g} s, got {patience:g}"
        )
    if name.startswith(SimulatedSource.SCHEME):
        scene = load_scene(name.removeprefix(SimulatedSource.SCHEME), trust)
        test = _simulated(scene, quick, report)
        return test, test.verdict()
    with closing(open_source(name)) as source:
        listener = DeviceReadings(source)
        test = PressTest(listener.sensor, PressTest.choose_elements(listener.sensor.layout, quick))
        _follow(listener, test, patience, report)
        return test, test.verdict()
