"""What undoing gains, loops and creep adds to a frame, against the same frame without."""

import itertools
import time
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np

from kappaskin import Calibration, Pipeline, Setup, Simulator, load_scene
from kappaskin.calibration.calibration import fingerprint
from kappaskin.scenes.effects import SECOND_GENERATION_LOOPS, Creep, Hysteresis


def test_a_corrected_frame_costs_at_most_eight_uncorrected_ones(medians, figure, ratio) -> None:
    scene = load_scene("centre")
    sensor = scene.sensor()
    # As many plays as a sweep over the ready radii finds.
    loops = Hysteresis(tuple(3.8 * j for j in range(1, 14)), (0.02,) * 13, 1.6)
    calibration = Calibration(
        sensor.name,
        sensor.serial_number,
        sensor.firmware,
        fingerprint(sensor.layout),
        datetime(2026, 1, 1, tzinfo=UTC),
        *(np.ones(300), np.zeros(300), np.zeros(300), np.zeros(300)),
        loops.operator(300),
        Creep(0.03, 20.0).solid(300),
    )
    frames = [Simulator(scene).frame(n, time.monotonic) for n in range(40)]
    plain = Pipeline(sensor, Setup())
    corrected = Pipeline(sensor, Setup(calibration=calibration))
    holed = [replace(f, counts=np.where(f.channels % 50, f.counts, 32767)) for f in frames]
    loops_alone = SECOND_GENERATION_LOOPS.start((300,), np.random.default_rng(0))
    curvature = plain.curvature(frames[0]).ravel()

    def over(what, given):
        turn = itertools.cycle(given)
        return lambda: what(next(turn))

    without, with_all, with_holes, whole, forward = medians(
        over(plain.curvature, frames),
        over(corrected.curvature, frames),
        over(corrected.curvature, holed),
        over(plain, frames),
        lambda: loops_alone(curvature, 0.0),
    )
    more, holes = (1e6 * (t - without) for t in (with_all, with_holes))
    figure(
        f"counts to curvature, 300 channels: {1e6 * without:.1f} us; to undo gains, loops and "
        f"creep: {more:.1f} us more ({holes:.1f} us with missing readings); a simulated skin's "
        f"loops: {1e6 * forward:.1f} us; a whole estimate: {1e6 * whole:.0f} us"
    )
    ratio("corrected curvature, against uncorrected", with_all / without, at_most=8)
