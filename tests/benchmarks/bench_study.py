"""Studies: draws per second against the loop they replace, and what a second worker is worth."""

import time
from pathlib import Path

import numpy as np
import psutil

from kappaskin import LeastSquares, Simulator, SineBasis, load_scene
from kappaskin.pipeline import reconstruct
from kappaskin.studies import StudyFolder, run_study
from kappaskin.studies.design import processes
from kappaskin.studies.design.results import BlockTask, run_task, version
from kappaskin.studies.design.study import read_study

TEXT = """
format = 1
rate = 10.0
[skin]
size = [0.1, 0.1]
[effects]
choose = "linear"
[effects.uniform-noise]
rms = 0.23094010767585033
[[touch]]
what = "point"
x = 0.05
y = 0.05
displacement = 4.70e-3
[measure]
what = ["rms"]
frames = {frames}
[stop]
least = {blocks}
most = {blocks}
"""


def study_of(frames, blocks):
    return read_study(TEXT.format(frames=frames, blocks=blocks), Path("bench.toml"))


def task_of(study, block):
    return BlockTask(next(study.points()).document, block, version())


def test_draws_against_a_loop_over_reconstruct(figure, ratio, medians, tmp_path):
    study, scene, file = study_of(1000, 2), load_scene("centre"), tmp_path / "frame.npz"
    simulator, scan, patch = Simulator(scene), scene.sensor().scan(), scene.plate.patch
    truth, _ = simulator.reading(scan, 0.0)
    size, positions = np.array([patch.a, patch.b]), scene.layout.positions
    grid, fit = patch.grid(101, 101), LeastSquares(SineBasis(patch, 8, 8), scene.layout)
    fitted, true = fit.basis.on_grid(*grid), scene.basis.on_grid(*grid)(truth.coefficients)
    blocks = iter(range(10_000))
    run_task(task_of(study, next(blocks)))

    def by_reconstruct():
        curvature = simulator.reading(scan, 0.0)[1].reshape(3, -1)
        np.savez(file, size=size, positions=positions, curvature=curvature)
        return np.sqrt(np.mean((reconstruct(file, (8, 8), (101, 101))["w"] - true) ** 2))

    def by_estimator():
        curvature = simulator.reading(scan, 0.0)[1].reshape(3, -1)
        return np.sqrt(np.mean((fitted(fit(curvature).coefficients) - true) ** 2))

    def by_study():
        return run_task(task_of(study, next(blocks)))

    whole, bare, block = medians(by_reconstruct, by_estimator, by_study, turns=15, calls=2)
    figure(
        f"study: {1000 / block:.0f} draws/s in one process, {1000 * whole / block:.0f} times a "
        f"loop over reconstruct, {1000 * bare / block:.1f} times one over the estimator alone"
    )
    ratio("a loop over reconstruct, against a study", 1000 * whole / block, at_least=20)


def computed(study, folder, workers):
    """Seconds that a study takes, and the largest memory of any process meanwhile."""
    most, told = 0, 0

    def tell(line):
        nonlocal most, told
        told += 1
        if told % 50 == 1:
            own = psutil.Process()
            most = max(p.memory_info().rss for p in (own, *own.children(recursive=True)))

    began = time.perf_counter()
    run_study(study, StudyFolder.opened(folder, study), workers, tell)
    return time.perf_counter() - began, most


def test_a_million_frames_in_bounded_memory(figure, ratio, tmp_path):
    with processes(2) as two:
        _, few = computed(study_of(1000, 100), tmp_path / "few", two)
        seconds, many = computed(study_of(1000, 1000), tmp_path / "many", two)

    figure(
        f"study: 1e6 frames of 10 x 10 elements, 8 x 8 functions, by two workers in "
        f"{seconds:.1f} s; {many / 1e6:.0f} MB at most, {many / few:.2f} times those of 1e5 frames"
    )
    ratio("1e6 frames by two workers, of the 30 s allowed", seconds / 30, at_most=1)
    ratio("memory of 1e6 frames, against 1e5", many / few, at_most=1.1)


def test_a_second_worker(figure, ratio, tmp_path):
    study, folders = study_of(1000, 80), (tmp_path / str(n) for n in range(100))
    with processes(1) as one, processes(2) as two:
        turns = [[computed(study, next(folders), w)[0] for w in (one, two)] for _ in range(10)]

    alone, both = np.median(turns[1:], axis=0)  # the first turn begins the processes
    figure(f"study: {alone / both:.2f} times the blocks per second with two workers as with one")
    ratio("blocks of two workers, against one", alone / both, at_least=1.7)
