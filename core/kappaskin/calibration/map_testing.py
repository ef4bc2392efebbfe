"""A source to a verdict on its channel map: asks for one element after the other."""

import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace

import numpy as np

from kappaskin.calibration.channel_map import Verdict
from kappaskin.calibration.press_listener import Phase
from kappaskin.calibration.press_procedure import PressTest, elements_to_press
from kappaskin.calibration.sweeping import Listener, Tell, Virtual
from kappaskin.errors import Refusal
from kappaskin.frames import Frame
from kappaskin.mechanics import PointLoad
from kappaskin.scenes import Scene, load_scene
from kappaskin.sensing import Sensor
from kappaskin.sources import SIMULATION, SimulatedSource, open_source

_OF_THE_RANGE = 0.5  # of what a channel can read, that a simulated finger makes of it
_FINEST = 15  # functions along each side at least: or a bent strip answers everywhere alike
_HELD = 0.2  # s that it stays
_GIVEN_UP = 5.0  # s after which nothing will answer to it
_READ = 0.02  # s that one read may wait
_LONGEST = 3600.0  # s that one may take to press


def _ask(test: PressTest, tell: Tell) -> None:
    layout, asked = test.sensor.layout, test.asked
    if asked is not None:
        x, y = layout.positions[asked] * 1e3
        number = f"{len(test.done) + 1}/{len(test.elements)}"
        tell(f"{number}  press element {asked}, at ({x:.1f}, {y:.1f}) mm, and let go")


def _fed(test: PressTest, sensor: Sensor, frames: list[Frame], tell: Tell) -> None:
    for frame in frames:
        if pressed := test.take(frame.device_time, sensor.nominal(frame)):
            tell(f"    {pressed}")
            _ask(test, tell)


def _follow(listener: Listener, test: PressTest, patience: float, tell: Tell) -> None:
    """Wait for whoever presses; what does not answer for `patience` s is gone on from."""
    _ask(test, tell)
    done, waited = 0, time.monotonic()
    while not test.over:
        _fed(test, listener.sensor, listener.frames(), tell)
        if len(test.done) > done:
            done, waited = len(test.done), time.monotonic()
        elif time.monotonic() - waited > patience and (pressed := test.nothing_came()):
            tell(f"    {pressed}")
            _ask(test, tell)


def _finger(scene: Scene) -> Callable[[int], Scene]:
    """The scene with one element pressed so that it reads half of what it can."""
    patch = scene.plate.patch
    Ri, Rj = (max(_FINEST, count) for count in scene.reference)
    bare = replace(scene.touched_by(), reference=(Ri, 1 if patch.strip else Rj))
    chain, M = bare.transduction, bare.layout.curvature_operator(bare.basis)
    most = _OF_THE_RANGE * chain.resolution * min(abs(limit) for limit in chain.limits)

    def pressed(element: int) -> Scene:
        x, y = bare.layout.positions[element].tolist()
        load = PointLoad(x, y, 1.0)
        c = bare.plate.deflection([load], bare.basis).ravel()
        return bare.touched_by(load.scaled(most / float(np.abs(M @ c).max())))

    return pressed


def _simulated(name: str, quick: bool, tell: Tell) -> PressTest:
    """The scene called `name`, pressed by itself as fast as it can be computed."""
    clock, pressed = Virtual(), _finger(load_scene(name))
    bare = replace(pressed(0), stimuli=())
    source = SimulatedSource(bare, clock, clock.sleep)
    test = PressTest(source.sensor, elements_to_press(bare.layout, quick))
    _ask(test, tell)
    while (asked := test.asked) is not None:
        for scene, until in ((bare, Phase.PRESS), (pressed(asked), Phase.RELEASE)):
            source.play(scene)
            _wait(source, test, tell, lambda until=until: test.phase is until)
        end = clock() + _HELD
        _wait(source, test, tell, lambda end=end: clock() > end)
        source.play(bare)
        before = len(test.done)
        _wait(source, test, tell, lambda before=before: len(test.done) > before)
    return test


def _wait(source: SimulatedSource, test: PressTest, tell: Tell, ended: Callable[[], bool]) -> None:
    """Read until something has `ended`, or for so long that nothing will come of it."""
    frames = 0
    while not ended() and test.asked is not None:
        came = source.read(_READ)
        frames += len(came)
        _fed(test, source.sensor, came, tell)
        if frames > _GIVEN_UP * source.sensor.rate:
            if pressed := test.nothing_came():
                tell(f"    {pressed}")
                _ask(test, tell)
            return


def press_elements(
    name: str, tell: Tell, *, quick: bool = False, patience: float = 20.0
) -> tuple[PressTest, Verdict]:
    """The test of the source called `name` and its verdict on the channel map.

    Asks for each element, or where `quick` for the few that tell of a grid's lines, and takes what
    answers. A simulation presses by itself. After `patience` s without an answer it goes on.
    """
    if not 0 < patience <= _LONGEST:
        raise Refusal(
            f"expected a patience above zero and at most {_LONGEST:g} s, got {patience:g}"
        )
    if name.startswith(SIMULATION):
        test = _simulated(name.removeprefix(SIMULATION), quick, tell)
        return test, test.verdict()
    with closing(open_source(name)) as source:
        listener = Listener(source)
        test = PressTest(listener.sensor, elements_to_press(listener.sensor.layout, quick))
        _follow(listener, test, patience, tell)
        return test, test.verdict()
