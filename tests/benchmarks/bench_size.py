"""Cost against size: from 36 to 1,048,576 readings in a frame, by ours and by what others have.

The readings are heights on an n x n grid, such as those of a camera's gel; n/2 x n/2 sine products
are fitted to them. Each way is measured in one run, up to the size at which it stops.
"""

import statistics
import time
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from history import PAGE
from matplotlib.figure import Figure
from scipy.fft import dst
from scipy.sparse.linalg import LinearOperator, lsqr

from kappaskin import Fast, LeastSquares, Patch, SensorLayout, SineBasis

SIDES = (6, 12, 24, 48, 96, 192, 384, 768, 1024)
PATCH = Patch(0.02, 0.02)
PLOT = PAGE.parent / "pictures" / "bench_size.png"
_LONG = 5.0  # s of a call, after which a larger size is not tried
_MATRIX = 1e9  # bytes of a matrix, beyond which it is not made
_MEASURED = 0.3  # s for which calls are repeated
_SLOW = 0.3  # s of a set-up, from which the table has it


@dataclass(frozen=True)
class Case:
    """One size: the layout, the basis and a frame of readings (n, n)."""

    n: int

    @property
    def layout(self) -> SensorLayout:
        every = np.arange(self.n**2)
        return SensorLayout.regular(PATCH, self.n, self.n).reading(every, "height")

    @property
    def basis(self) -> SineBasis:
        return SineBasis(PATCH, self.n // 2, self.n // 2)

    @property
    def readings(self) -> np.ndarray:
        return np.random.default_rng(0).normal(size=(self.n, self.n))

    @property
    def sines(self) -> np.ndarray:
        """The functions of one side at its elements (n, n/2)."""
        at = (np.arange(self.n) + 0.5) / self.n
        return np.sin(np.pi * np.multiply.outer(at, np.arange(1, self.n // 2 + 1)))

    def check_matrix(self) -> None:
        if 8 * self.n**4 / 4 > _MATRIX:
            raise MemoryError

    @property
    def matrix(self) -> np.ndarray:
        """All functions at all elements (n^2, n^2/4)."""
        self.check_matrix()
        return np.kron(self.sines, self.sines)


Way = Callable[[], object]


def by_fast(case: Case) -> Way:
    fit, K = Fast(case.basis, case.layout), case.readings.ravel()
    return lambda: fit(K).coefficients


def by_least_squares(case: Case) -> Way:
    case.check_matrix()
    fit, K = LeastSquares(case.basis, case.layout), case.readings.ravel()
    return lambda: fit(K).coefficients


def by_lstsq(case: Case) -> Way:
    return partial(np.linalg.lstsq, case.matrix, case.readings.ravel())


def by_lsqr(case: Case) -> Way:
    """Without a matrix: it is given the products along both sides."""
    S, n, half = case.sines, case.n, case.n // 2
    products = LinearOperator(
        (n * n, half * half),
        matvec=lambda c: (S @ c.reshape(half, half) @ S.T).ravel(),
        rmatvec=lambda K: (S.T @ K.reshape(n, n) @ S).ravel(),
    )
    return partial(lsqr, products, case.readings.ravel(), atol=1e-9, btol=1e-9)


def by_transforms(case: Case) -> Way:
    """The sine transforms along both sides, and nothing else."""
    K = case.readings
    return lambda: dst(dst(K, 2, axis=0), 2, axis=1, overwrite_x=True)


def one_read(case: Case) -> Way:
    return case.readings.sum


READ = "one read of the data"
WAYS = {
    "`fast`": by_fast,
    "`least-squares`": by_least_squares,
    "`lstsq` each frame": by_lstsq,
    "`lsqr` without a matrix": by_lsqr,
    "`scipy.fft` alone": by_transforms,
    READ: one_read,
}


@dataclass(frozen=True)
class Cost:
    """Seconds to set up and of a frame, and the most memory in bytes beyond the readings."""

    made: float
    frame: float
    memory: int


def measured(way: Callable[[Case], Way], case: Case) -> Cost | None:
    """What a way costs at one size; None where its matrix is too large."""
    start = time.perf_counter()
    try:
        call = way(case)
    except MemoryError:
        return None
    made = time.perf_counter() - start
    times, end = list[float](), time.perf_counter() + _MEASURED
    while not times or time.perf_counter() < end:
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    if made + times[0] > _LONG:  # tracing it again would take as long
        return Cost(made, statistics.median(times), 0)
    tracemalloc.start()
    way(case)()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return Cost(made, statistics.median(times), max(peak - case.readings.nbytes, 0))


def scaled(value: float, units: dict[str, float]) -> str:
    """A value in the largest of the `units`, by falling size, that it is one of."""
    unit, size = next((each for each in units.items() if value >= each[1]), (*units.items(),)[-1])
    return f"{float(f'{value / size:.2g}'):g} {unit}"


def time_of(seconds: float) -> str:
    return scaled(seconds, {"s": 1.0, "ms": 1e-3, "us": 1e-6})


def in_words(cost: Cost | None) -> str:
    if cost is None:
        return "stops"
    text = time_of(cost.frame)
    if cost.memory:
        text += f", {scaled(cost.memory, {'MB': 1e6, 'kB': 1e3})}"
    return text + (f", made in {time_of(cost.made)}" if cost.made > _SLOW else "")


def plotted(costs: dict[str, list[Cost | None]]) -> None:
    figure = Figure((7, 4.5), layout="constrained")
    axes = figure.subplots()
    for name, each in costs.items():
        there = [(n * n, cost.frame) for n, cost in zip(SIDES, each, strict=True) if cost]
        line = "--" if name == READ else "o-"
        axes.loglog(*zip(*there, strict=True), line, markersize=4, label=name.replace("`", ""))
    axes.set_xlabel("readings in a frame")
    axes.set_ylabel("time of a frame (s)")
    axes.grid(alpha=0.3)
    axes.legend()
    figure.savefig(PLOT, dpi=80)


def test_cost_against_size(figure, ratio) -> None:
    costs: dict[str, list[Cost | None]] = {name: [] for name in WAYS}
    for n in SIDES:
        for name, way in WAYS.items():
            last = costs[name][-1] if costs[name] else None
            ended = bool(costs[name]) and (last is None or last.made + last.frame > _LONG)
            costs[name].append(None if ended else measured(way, Case(n)))
    plotted(costs)
    columns = [name for name in WAYS if name != READ]
    rows = [
        f"| readings | functions | {' | '.join(columns)} | `fast`, of one read |\n",
        "|---" * (len(columns) + 3) + "|\n",
    ]
    for place, n in enumerate(SIDES):
        cells = " | ".join(in_words(costs[name][place]) for name in columns)
        share = costs["`fast`"][place].frame / costs[READ][place].frame
        rows.append(f"| {n * n:,} | {n // 2} x {n // 2} | {cells} | {share:.0f} times |\n")
    figure("".join(rows))
    ours, bare = costs["`fast`"][-1], costs["`scipy.fft` alone"][-1]
    ratio("1,048,576 heights, against scipy.fft alone", ours.frame / bare.frame, at_most=2)
