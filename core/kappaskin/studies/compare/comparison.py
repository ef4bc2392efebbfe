"""Questions with known answers, each answered by every solver: errors, time and memory."""

from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import cycle, groupby
from typing import Any

import numpy as np

from kappaskin.bases import SineBasis
from kappaskin.frames import Array
from kappaskin.mechanics import GaussianLoad, Plate
from kappaskin.scenes import Scene, load_scene
from kappaskin.sensing import SensorLayout
from kappaskin.skin import Patch
from kappaskin.studies.compare.solvers import (
    Solver,
    kappaskin_solver,
    lsqr_solver,
    lstsq_solver,
    pinv_solver,
    plate_solver,
    scikit_fem,
    slopes_solver,
)
from kappaskin.studies.cost.bench import medians_in_turn, seconds, traced
from kappaskin.studies.paper import LoadCase, fingertip_scene

WITHIN = 1e-2
"""RMS error that every solver of a plate must reach, as a share of the RMS deflection."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """A question whose answer is known, and the `solvers` of it, ours first.

    `points` (G, 2) in m are those of the surface and last the load's place, `truth` (G,) in m what
    is there. `question` is without noise, `draws` are those that are timed; `noisy` is whether they
    are the same question with noise.
    """

    name: str
    solvers: Mapping[str, Callable[[], Solver]]
    question: Any
    draws: Sequence[Any] | Array
    noisy: bool
    points: Array
    truth: Array

    def errors(self, solver: Solver, unknowns: Array) -> tuple[Array, Array]:
        """Signed error at the load and RMS over the surface, (T,) each in mm, of (T, U)."""
        off = 1e3 * ((solver.at(self.points) @ unknowns.T).T - self.truth)
        return off[:, -1], np.sqrt(np.mean(off[:, :-1] ** 2, axis=1))


# Readings to a shape

_MakesSolver = Callable[[LoadCase], Solver]
_SOLVERS: dict[str, _MakesSolver] = {
    "Kappaskin, least squares": partial(kappaskin_solver, method="least-squares"),
    "Kappaskin, with error bars": partial(
        kappaskin_solver, method="least-squares", error_bars=True
    ),
    "numpy.linalg.lstsq": lstsq_solver,
    "numpy.linalg.pinv, once": pinv_solver,
    "scipy.sparse.linalg.lsqr": lsqr_solver,
}
_BAYES: dict[str, _MakesSolver] = {
    "Kappaskin, bayes, 15 x 15": partial(
        kappaskin_solver, method="bayes", functions=(15, 15), error_bars=True
    )
}
_FAST: dict[str, _MakesSolver] = {"Kappaskin, fast": partial(kappaskin_solver, method="fast")}
_SLOPES: dict[str, _MakesSolver] = {"scikit-fem, slopes route": slopes_solver}


def _read(name: str, scene: Scene, N: int, makers: Mapping[str, _MakesSolver]) -> Comparison:
    """The shape of a scene from its readings, with N functions along each side."""
    case = LoadCase.of(scene, "least-squares", (N, N))
    surface = np.stack(np.meshgrid(*case.grid), axis=-1).reshape(-1, 2)
    return Comparison(
        name,
        {by: partial(make, case) for by, make in makers.items()},
        case.curvature,
        case.noisy(),
        True,
        np.vstack([surface, scene.loads[0].centre()]),
        np.append(case.true_surface, case.true_at_load) / 1e3,
    )


def _finer(scene: Scene, elements: int) -> Scene:
    """The scene with so many elements along each side and a truth of 31 x 31 functions."""
    layout = SensorLayout.regular(scene.plate.patch, elements, elements)
    return replace(scene, layout=layout, reference=(31, 31))


# A plate under a load

_EXACT = 64  # functions along each side: under that load the series is summed to rounding


def _series(plate: Plate, N: int) -> Solver:
    basis = SineBasis(plate.patch, N, N)
    compliance = plate.compliance(basis)
    return Solver(lambda load: compliance(load.modal(basis)).ravel(), basis.at, basis.size)


_PLATES: dict[str, tuple[Callable[[Plate, int], Solver], range]] = {
    "Kappaskin, {0} x {0}": (_series, range(2, 33)),
    "scikit-fem Argyris, {0} x {0}": (lambda p, n: plate_solver(p, "Argyris", n), range(2, 13)),
    "scikit-fem Morley, {0} x {0}": (lambda p, n: plate_solver(p, "Morley", n), range(20, 65, 4)),
}
"""Ours by its functions along each side, theirs by their squares; the coarser ones first."""


def _pressed() -> Comparison:
    """A plate pressed in by 1 mm, with the coarsest of each solver that is accurate enough."""
    patch = Patch(0.1, 0.1)
    plate, load = Plate(patch), GaussianLoad(0.04, 0.055, 5e-3)
    exact = _series(plate, _EXACT)
    surface = np.stack(np.meshgrid(*patch.grid(21, 21)), axis=-1).reshape(-1, 2)
    points = np.vstack([surface, load.centre()])
    load = load.scaled(1e-3 / float(exact.at(points[-1:])[0] @ exact.solve(load)))
    truth = exact.at(points) @ exact.solve(load)
    draws = [load.shifted(dx, 0.0) for dx in np.linspace(-0.01, 0.01, 8).tolist()]
    name = f"A plate under a fingertip, within {WITHIN:.0%}"
    comparison = Comparison(name, {}, load, draws, False, points, truth)
    return replace(comparison, solvers=dict(_coarsest(comparison, plate)))


def _coarsest(comparison: Comparison, plate: Plate) -> Generator[tuple[str, Callable[[], Solver]]]:
    enough = WITHIN * 1e3 * float(np.sqrt(np.mean(comparison.truth[:-1] ** 2)))
    for name, (make, sizes) in _PLATES.items():
        for size in sizes:
            solver = make(plate, size)
            if comparison.errors(solver, solver.solve(comparison.question)[None])[1] <= enough:
                yield name.format(size), partial(make, plate, size)
                break


def comparisons() -> Generator[Comparison]:
    """All that is compared, one after the other."""
    centre, off_centre = load_scene("centre"), load_scene("off-centre")
    for scene in (centre, off_centre):
        name = f"Table 1, {scene.name}: 10 x 10 elements, 8 x 8 functions"
        yield _read(name, scene, 8, _SOLVERS | _BAYES | _SLOPES)
    finer = _finer(centre, 24)
    yield _read("24 x 24 elements, 16 x 16 functions", finer, 16, _SOLVERS | _FAST | _SLOPES)
    name = "Table 2, 0.63 mm: 10 elements on half a circle, 8 functions"
    yield _read(name, fingertip_scene(0.63), 8, _SOLVERS)
    yield _pressed()


_TURNS, _BUDGET = (
    (7, 201),
    0.1,
)  # least and most answers timed, and about how long in s


# Every solver in a comparison: its errors, its time, its memory


@dataclass(frozen=True)
class ComparisonRow:
    """One solver in one comparison; lengths in mm, times in s, memory in bytes.

    `error_bars` is whether the answers have some, None where there is no noise.
    `e_mm` and `rms_mm` are means over draws with noise of the signed error at the load and of the
    RMS error over the skin, `e_sd_mm` is that error's standard deviation; None where there is no
    noise. Those of exact readings are `exact`. `setup_s` goes to the first answer, `frame_s` is the
    median of the next ones, and `ratio` is that over the median of our first solver.
    `memory_bytes` is the most that the set-up and an answer held at once.
    """

    work: str
    by: str
    unknowns: int
    error_bars: bool | None
    e_exact_mm: float
    rms_exact_mm: float
    e_mm: float | None
    e_sd_mm: float | None
    rms_mm: float | None
    setup_s: float
    frame_s: float
    ratio: float
    memory_bytes: int


def compared() -> list[ComparisonRow]:
    """All comparisons with all solvers; raises a `Refusal` when what they need is not installed."""
    scikit_fem()  # at once, not after half of the work
    return [row for comparison in comparisons() for row in _through(comparison)]


def _through(comparison: Comparison) -> list[ComparisonRow]:
    made = [_first_answer(make, comparison.question) for make in comparison.solvers.values()]
    answering = [partial(_answer_next, solver, cycle(comparison.draws)) for solver, _, _ in made]
    medians = medians_in_turn(answering, _TURNS, _BUDGET)
    return [
        ComparisonRow(
            comparison.name,
            by,
            solver.count,
            solver.error_bars if comparison.noisy else None,
            *_errors(comparison, solver),
            setup,
            median,
            median / medians[0],
            memory,
        )
        for by, (solver, setup, memory), median in zip(
            comparison.solvers, made, medians, strict=True
        )
    ]


def _errors(
    comparison: Comparison, solver: Solver
) -> tuple[float, float, float | None, float | None, float | None]:
    found = solver.solve(comparison.question)[None]
    if not comparison.noisy:
        (e,), (rms,) = comparison.errors(solver, found)
        return float(e), float(rms), None, None, None
    e, rms = comparison.errors(solver, np.vstack([found, solver.solve(comparison.draws)]))
    noisy = float(e[1:].mean()), float(e[1:].std(ddof=1)), float(rms[1:].mean())
    return float(e[0]), float(rms[0]), *noisy


def _answer_next(solver: Solver, draws: Iterator[Any]) -> list[float]:
    """Seconds of the answer to the next of the `draws`."""
    return [seconds(solver.solve, next(draws))]


def _first_answer(make: Callable[[], Solver], question: Any) -> tuple[Solver, float, int]:
    """A solver that has answered once, the seconds until then and the bytes."""

    def answered() -> Solver:
        solver = make()
        solver.solve(question)
        return solver

    solver, memory = traced(answered)
    return solver, seconds(answered), memory + solver.kept


# The comparison as text for people

_HEAD = (
    f"{'':<26}{'N':>5}{'exact E':>8}{'RMS':>8}{'noisy E':>15}{'RMS':>8}{'bars':>5}"
    f"{'set-up':>7}{'answer':>7}{'/ours':>6}{'held':>6}\n"
    f"{'':<26}{'':>5}{'mm':>8}{'mm':>8}{'mm':>15}{'mm':>8}{'':>5}{'ms':>7}{'us':>7}{'':>6}{'KiB':>6}"
)
_LEGEND = """\
The same work by Kappaskin and by what one would use instead
N        unknowns that are solved for
E        signed error at the load; with noise the mean +- standard deviation of 200 draws
RMS      error over the skin; with noise the mean of the draws
bars     whether the answer comes with error bars
set-up   until the first answer; answer: median of the next ones, and over that of our first way
held     most memory at once in both, with what SuperLU holds"""


def errors_text(row: ComparisonRow) -> str:
    """A row as far as it is the same on every machine."""
    noisy = f"{'':>28}"
    if row.e_mm is not None:
        drawn = f"{row.e_mm:+z.3f} +-{row.e_sd_mm:.3f}"
        noisy = f"{drawn:>15}{row.rms_mm:>8.4f}{'yes' if row.error_bars else 'no':>5}"
    return f"{row.by:<26}{row.unknowns:>5}{row.e_exact_mm:>+z8.3f}{row.rms_exact_mm:>8.4f}{noisy}"


def _line(row: ComparisonRow) -> str:
    return (
        f"{errors_text(row)}{1e3 * row.setup_s:>7.1f}{1e6 * row.frame_s:>7.0f}{row.ratio:>6.1f}"
        f"{row.memory_bytes / 1024:>6.0f}"
    )


def compared_text(rows: Sequence[ComparisonRow]) -> str:
    """A table of each work, and what its columns are."""
    lines = [_LEGEND]
    for work, its in groupby(rows, lambda row: row.work):
        lines += ["", work, _HEAD, *(_line(row) for row in its)]
    return "\n".join(lines)
