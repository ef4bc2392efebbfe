"""Studies: draws per second against the loop they replace, and what a second worker is worth."""

import time
from pathlib import Path

import numpy as np
import psutil

from kappaskin import LeastSquares, Simulator, SineBasis, load_scene
from kappaskin.reconstruct import reconstruct
from kappaskin.studies.design import Folder, Task, processes, read_study, run, run_study
from kappaskin.studies.design.task import version

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
    return Task(next(study.points()).document, block, version())


def test_draws_against_a_loop_over_reconstruct(figure, medians, tmp_path):
    study, scene, file = study_of(1000, 2), load_scene("centre"), tmp_path / "frame.npz"
    simulator, scan, patch = Simulator(scene), scene.sensor().scan(), scene.plate.patch
    truth, _ = simulator.reading(scan, 0.0)
    size, positions = np.array([patch.a, patch.b]), scene.layout.positions
    grid, fit = patch.grid(101, 101), LeastSquares(SineBasis(patch, 8, 8), scene.layout)
    fitted, true = fit.basis.on_grid(*grid), scene.basis.on_grid(*grid)(truth.coefficients)
    blocks = iter(range(10_000))
    run(task_of(study, next(blocks)))

    def by_reconstruct():
        curvature = simulator.reading(scan, 0.0)[1].reshape(3, -1)
        np.savez(file, size=size, positions=positions, curvature=curvature)
        return np.sqrt(np.mean((reconstruct(file, (8, 8), (101, 101))["w"] - true) ** 2))

    def by_estimator():
        curvature = simulator.reading(scan, 0.0)[1].reshape(3, -1)
        return np.sqrt(np.mean((fitted(fit(curvature).coefficients) - true) ** 2))

    def by_study():
        return run(task_of(study, next(blocks)))

    whole, bare, block = medians(by_reconstruct, by_estimator, by_study, turns=15, calls=2)
    figure(
        f"study: {1000 / block:.0f} draws/s in one process, {1000 * whole / block:.0f} times a "
        f"loop over reconstruct, {1000 * bare / block:.1f} times one over the estimator alone"
    )
    assert 1000 * whole / block >= 20


def computed(study, folder, count):
    """Seconds and blocks once all workers are at work, and the largest memory of any process."""
    told, most = [], 0

    def tell(line):
        nonlocal most
        told.append((time.perf_counter(), int(line.split()[0])))
        if len(told) % 50 == 1:
            own = psutil.Process()
            most = max(p.memory_info().rss for p in (own, *own.children(recursive=True)))

    with processes(count) as workers:
        run_study(study, Folder.opened(folder, study), workers, tell)
    (began, first), (ended, last) = told[min(4 * count, len(told) - 2)], told[-1]
    return ended - told[0][0], (last - first) / (ended - began), most


def test_a_million_frames_and_a_second_worker(figure, tmp_path):
    study = study_of(1000, 1000)

    seconds, two, memory = computed(study, tmp_path / "two", 2)
    _, one, _ = computed(study_of(1000, 300), tmp_path / "one", 1)

    figure(
        f"study: 1e6 frames of 10 x 10 elements, 8 x 8 functions, by two workers in "
        f"{seconds:.1f} s; {two / one:.2f} times one worker; {memory / 1e6:.0f} MB at most"
    )
    assert seconds < 30
    assert two / one >= 1.7


def test_memory_does_not_grow_with_the_study(figure, tmp_path):
    sizes = [computed(study_of(1000, blocks), tmp_path / str(blocks), 1)[2] for blocks in (60, 600)]

    figure(f"study: {sizes[1] / sizes[0]:.2f} times the memory for ten times the frames")
    assert sizes[1] < 1.1 * sizes[0]
