"""The health of 300 channels, against the pipeline that computes the same frames."""

import time

import numpy as np

from kappaskin import Pipeline, Setup, Simulator, load_scene
from kappaskin.health import HealthMonitor


def test_watching_costs_a_small_part_of_an_estimate(figure, ratio) -> None:
    scene = load_scene("circle")
    simulator = Simulator(scene)
    frames = [simulator.frame(n, time.monotonic) for n in range(2000)]
    monitor, pipeline = HealthMonitor(scene.sensor()), Pipeline(scene.sensor(), Setup())
    spent: list[tuple[float, bool]] = []
    for frame in frames:
        began = time.process_time()
        looked = monitor(frame)
        spent.append((time.process_time() - began, looked))
    began = time.process_time()
    for frame in frames:
        pipeline(frame)
    whole = (time.process_time() - began) / len(frames)

    watching = sum(seconds for seconds, _ in spent) / len(frames)
    look = float(np.median([seconds for seconds, looked in spent if looked]))
    figure(
        f"health of 300 channels at 500 frames/s: {watching * 1e6:.0f} us a frame, "
        f"{watching / whole:.3f} of an estimate ({whole * 1e6:.0f} us); a look, four times a "
        f"second, {look * 1e3:.1f} ms"
    )
    ratio("health of a frame, against its estimate", watching / whole, at_most=0.25)
    ratio("a look at health, of the 10 ms allowed", look / 10e-3, at_most=1)
