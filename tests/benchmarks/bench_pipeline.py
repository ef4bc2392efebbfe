"""Counts to coefficients to surface, against lstsq per frame and direct summation."""

import itertools
import time
from dataclasses import replace

import numpy as np

from kappaskin import Pipeline, Scene, Setup, Simulator, load_scene


class Bench:
    """The scene of Table 1's first row with its pipeline, and the textbook's way to a surface."""

    def __init__(self) -> None:
        self.scene = load_scene("centre")
        simulator = Simulator(self.scene)
        self.frames = [simulator.frame(n, time.monotonic) for n in range(64)]
        self.pipeline = Pipeline(self.scene.sensor(), Setup())
        self._M = self.scene.layout.operator(self.pipeline.basis)

    def lstsq(self) -> np.ndarray:
        curvature = self.scene.transduction.curvature(self.frames[0].counts)
        return np.linalg.lstsq(self._M, curvature)[0].reshape(8, 8)

    def lstsq_and_summation(self) -> np.ndarray:
        a, b = self.scene.plate.patch.a, self.scene.plate.patch.b
        x, y = self.scene.plate.patch.grid(65, 65)
        c = self.lstsq()
        w = np.zeros((65, 65))
        for i in range(8):
            for j in range(8):
                w += c[i, j] * np.outer(
                    np.sin((j + 1) * np.pi * y / b), np.sin((i + 1) * np.pi * x / a)
                )
        return w


def test_a_frame_is_fifty_times_faster_than_lstsq_and_summation(medians, figure, ratio) -> None:
    bench = Bench()
    frame, pipeline = bench.frames[0], bench.pipeline
    surface_of = pipeline.basis.on_grid(*bench.scene.plate.patch.grid(65, 65))

    def ours() -> np.ndarray:
        return surface_of(pipeline.fit(pipeline.curvature(frame)).coefficients)

    assert np.allclose(ours(), bench.lstsq_and_summation())
    fast, slow = medians(ours, bench.lstsq_and_summation)
    figure(
        f"counts to 65 x 65 surface: {fast * 1e6:.1f} us, {slow / fast:.0f} times faster than "
        f"lstsq and summation ({slow * 1e6:.0f} us)"
    )
    ratio("lstsq and summation, against counts to a surface", slow / fast, at_least=50)
    ratio("counts to a surface, of the 60 us allowed", fast / 60e-6, at_most=1)


def test_a_whole_estimate_is_four_times_faster_than_lstsq_and_summation(
    medians, spaced, figure, ratio
) -> None:
    bench = Bench()
    of_sim = itertools.cycle(bench.frames)
    of_device = itertools.cycle([replace(frame, truth=None) for frame in bench.frames])
    each = (
        lambda: bench.pipeline(next(of_sim)),
        lambda: bench.pipeline(next(of_device)),
        bench.lstsq_and_summation,
    )

    warm, cold = medians(*each), spaced(*each)

    figure(
        f"whole estimate with contact: {warm[0] * 1e6:.0f} us with a truth, {warm[1] * 1e6:.0f} us "
        f"without one, {warm[2] / warm[1]:.1f} times faster than lstsq and summation; when calls "
        f"are 1 ms apart {cold[0] * 1e6:.0f} us, {cold[1] * 1e6:.0f} us, "
        f"{cold[2] / cold[1]:.1f} times"
    )
    ratio("lstsq and summation, against a whole estimate", warm[2] / warm[1], at_least=4)
    ratio(
        "lstsq and summation, against a whole estimate, 1 ms apart", cold[2] / cold[1], at_least=4
    )


def test_a_whole_estimate_called_each_millisecond_is_a_part_of_one_lstsq(
    spaced, figure, ratio
) -> None:
    bench = Bench()
    of_device = itertools.cycle([replace(frame, truth=None) for frame in bench.frames])
    runs = [spaced(lambda: bench.pipeline(next(of_device)), bench.lstsq) for _ in range(5)]
    shares = sorted(ours / theirs for ours, theirs in runs)
    ours, theirs = np.median(runs, axis=0)
    figure(
        f"whole estimate, calls 1 ms apart: {ours * 1e6:.0f} us, {shares[2]:.2f} of one lstsq of "
        f"the same size called alike ({theirs * 1e6:.0f} us); five runs, {shares[0]:.2f} to "
        f"{shares[-1]:.2f}"
    )
    ratio("whole estimate, of one lstsq, both 1 ms apart", shares[2], at_most=0.15)


def test_a_cap_is_set_up_in_a_few_times_what_a_flat_skin_takes(figure, ratio) -> None:
    scenes = load_scene("demo"), load_scene("fingertip-cap")

    def set_up(scene: Scene, turn: int) -> float:
        plate = scene.plate  # another rigidity each time, or what is cached would be found
        other = replace(plate, rigidity=plate.rigidity * (1 + 1e-9 * turn))
        sensor = replace(scene, plate=other).sensor()
        began = time.process_time()
        Pipeline(sensor, Setup())
        return time.process_time() - began

    taken = np.array([[set_up(scene, turn) for scene in scenes] for turn in range(9)])
    flat, cap = np.median(taken, axis=0)
    figure(
        f"set-up of a pipeline, processor time: {cap:.2f} s of the scene fingertip-cap, "
        f"{cap / flat:.1f} times that of a flat skin ({flat:.2f} s)"
    )
    ratio("set-up of a cap, against that of a flat skin", cap / flat, at_most=8)
