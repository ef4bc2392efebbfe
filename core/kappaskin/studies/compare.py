"""Comparisons with other software: error, time and memory on the same problems."""

import importlib
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import cycle, groupby
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline
from scipy.sparse.linalg import SuperLU, lsqr, splu

from kappaskin.bases import SineBasis, basis_for
from kappaskin.errors import missing
from kappaskin.estimation import column_lengths, estimator_for
from kappaskin.frames import Array, Mask
from kappaskin.mechanics import GaussianLoad, Plate
from kappaskin.scenes import Scene, load_scene
from kappaskin.sensing import SensorLayout
from kappaskin.skin import Patch
from kappaskin.studies.accuracy import medians_in_turn, points_on, seconds, traced
from kappaskin.studies.paper import LoadCase, fingertip_scene


@dataclass(frozen=True, eq=False)
class Solver:
    """A solver, made once for what does not change from one question to the next.

    `solve` takes a question, readings (..., 3, P) in 1/m or a load, to `count` unknowns (..., U);
    `at` makes of points (G, 2) in m the matrix (G, U) from unknowns to displacements. `kept` are
    bytes that it holds where Python does not count them.
    """

    solve: Callable[[Any], Array]
    at: Callable[[Array], Any]
    count: int
    error_bars: bool = False
    kept: int = 0


# Readings to coefficients, by our estimators and by what NumPy and SciPy have for it


def kappaskin_solver(
    case: LoadCase, method: str, functions: tuple[int, int] | None = None, error_bars: bool = False
) -> Solver:
    """One of our methods, with the case's functions or so many others."""
    scene = case.scene
    basis = basis_for(scene.plate.patch, scene.edge, *(functions or case.fit.basis.shape))
    fit = estimator_for(method, basis, scene.layout)

    def solve(curvature: Array) -> Array:
        found = fit(curvature)
        if error_bars:
            _ = found.sd  # made when asked for
        return found.coefficients.reshape(*curvature.shape[:-2], -1)

    return Solver(solve, basis.at, basis.size, error_bars)


# The others are given our operator and functions, which their user would have to write first.


def _operator(case: LoadCase) -> tuple[Array, Mask]:
    """M (R, N), and which readings (3, P) are its rows."""
    layout = case.scene.layout
    return layout.operator(case.fit.basis)[layout.live.ravel()], layout.live


def lstsq_solver(case: LoadCase) -> Solver:
    """LAPACK's least squares, anew in each frame."""
    M, live = _operator(case)

    def solve(curvature: Array) -> Array:
        return cast("Array", np.linalg.lstsq(M, curvature[..., live].T)[0]).T

    return Solver(solve, case.fit.basis.at, M.shape[1])


def pinv_solver(case: LoadCase) -> Solver:
    """The pseudo-inverse, made once, and a product per frame."""
    M, live = _operator(case)
    inverse = np.linalg.pinv(M, rcond=max(M.shape) * np.finfo(float).eps).T  # as lstsq has it

    def solve(curvature: Array) -> Array:
        return curvature[..., live] @ inverse

    return Solver(solve, case.fit.basis.at, M.shape[1])


def lsqr_solver(case: LoadCase) -> Solver:
    """LSQR with its usual tolerances, on columns of unit length."""
    M, live = _operator(case)
    length = column_lengths(M)
    A = M / length

    def solve(curvature: Array) -> Array:
        if curvature.ndim > 2:
            return np.stack([solve(frame) for frame in curvature])
        return cast("Array", lsqr(A, curvature[live])[0]) / length

    return Solver(solve, case.fit.basis.at, M.shape[1])


# Finite elements: a hinged plate's deflection, and what their other uses here share


def scikit_fem() -> Any:
    """scikit-fem; raises a `Refusal` where it is not installed."""
    try:
        return importlib.import_module("skfem")
    except ImportError as error:
        raise missing("scikit-fem", "a comparison", error) from error


def axes(sides: tuple[float, float], cells: int) -> list[Array]:
    """Where so many cells end along each of the two `sides` in m."""
    return [np.linspace(0.0, side, cells + 1) for side in sides]


class ConstrainedSystem:
    """Unknowns of which some are `held` at zero, with their matrix K (N, N) factored once."""

    def __init__(self, K: Any, held: NDArray[np.intp]) -> None:
        self._free = np.setdiff1d(np.arange(int(K.shape[0])), held)
        self._factors = cast("SuperLU", splu(K[self._free][:, self._free].tocsc()))
        self.kept = 12 * self._factors.nnz
        """Bytes of the factors, which SuperLU holds: a number and an index for each."""

    def __call__(self, force: Array) -> Array:
        """The unknowns (N,) or (N, T) that K makes of `force`, of the same shape."""
        found = np.zeros(force.shape)
        found[self._free] = self._factors.solve(force[self._free])
        return found


def plate_solver(plate: Plate, element: str, cells: int) -> Solver:
    """A plate hinged all round, of Argyris or Morley elements on cells x cells squares, halved.

    Its energy is D/2 ((1 - nu) w_ij w_ij + nu w_ii w_jj), integrated.
    """
    skfem, sides, nu = scikit_fem(), (plate.patch.a, plate.patch.b), plate.poisson
    mesh = skfem.MeshTri.init_tensor(*axes(sides, cells))
    basis = skfem.Basis(mesh, getattr(skfem, f"ElementTri{element}")(), intorder=8)

    def energy(u: Any, v: Any, _: Any) -> Any:
        (uxx, uxy), (_, uyy) = u.hess
        (vxx, vxy), (_, vyy) = v.hess
        product = uxx * vxx + 2 * uxy * vxy + uyy * vyy
        return plate.rigidity * ((1 - nu) * product + nu * (uxx + uyy) * (vxx + vyy))

    def held(axis: int, side: float, along: str) -> NDArray[np.intp]:
        def on_edge(places: Array) -> Mask:
            return np.isclose(places[axis] * (side - places[axis]), 0)

        # Where w is zero along an edge, so are its derivatives along it.
        zero = ["u", f"u_{along}", f"u_{2 * along}"]
        return basis.get_dofs(mesh.facets_satisfying(on_edge)).all(zero)

    rim = np.union1d(held(0, sides[0], "y"), held(1, sides[1], "x"))
    still = ConstrainedSystem(skfem.BilinearForm(energy).assemble(basis), rim)
    work, places = skfem.LinearForm(_work), np.asarray(basis.global_coordinates())

    def solve(load: GaussianLoad) -> Array:
        return still(work.assemble(basis, pressure=_pressure(load, places)))

    return Solver(solve, lambda points: basis.probes(points.T), int(basis.N), kept=still.kept)


def _work(v: Any, at: Any) -> Any:
    return at["pressure"] * v


def _pressure(load: GaussianLoad, places: Array) -> Array:
    """In Pa at `places` (2, ...) in m."""
    square = (places[0] - load.x) ** 2 + (places[1] - load.y) ** 2
    return load.force * np.exp(-square / (2 * load.sd**2)) / (2 * np.pi * load.sd**2)


# The slopes route, by scikit-fem's Poisson equations.
#
# p = w_x and q = w_y come of the curvature, and w of them, each by one equation in its weak form,
# which differentiates no reading:
#     (grad p, grad v) = ((xx, xy), grad v),    (grad q, grad v) = ((xy, yy), grad v),
#     (grad w, grad v) = ((p, q), grad v).
# What a hinged rim holds is zero: w all round, p where y is 0 or b, q where x is 0 or a.


def slopes_solver(case: LoadCase) -> Solver:
    """The surface of a flat hinged skin with elements on a regular grid."""
    skfem, layout = scikit_fem(), case.scene.layout
    shape, sides = cast("tuple[int, int]", layout.shape), (layout.patch.a, layout.patch.b)
    # As many cells as elements: twice as many take thrice the time for a tenth of the error.
    mesh = skfem.MeshQuad.init_tensor(*axes(sides, max(shape)))
    basis = skfem.Basis(mesh, skfem.ElementQuad2())
    K = skfem.BilinearForm(_stiffness).assemble(basis)
    on_x, on_y = (skfem.BilinearForm(form).assemble(basis) for form in (_pull_x, _pull_y))
    places = np.asarray(basis.doflocs)
    at_x, at_y = (
        np.flatnonzero(np.isclose(along * (side - along), 0))
        for along, side in zip(places, sides, strict=True)
    )
    for_p, for_q, for_w = (
        ConstrainedSystem(K, at_y),
        ConstrainedSystem(K, at_x),
        ConstrainedSystem(K, np.union1d(at_x, at_y)),
    )
    odd, even = (_splines(shape, sides, places, mirror) for mirror in (-1, 1))

    def solve(curvature: Array) -> Array:
        xx, yy, xy = (np.asarray(curvature[..., k, :]).T for k in range(3))
        xx, yy, xy = odd @ xx, odd @ yy, even @ xy
        p, q = for_p(on_x @ xx + on_y @ xy), for_q(on_x @ xy + on_y @ yy)
        return for_w(on_x @ p + on_y @ q).T

    kept = for_p.kept + for_q.kept + for_w.kept
    return Solver(solve, lambda points: basis.probes(points.T), int(basis.N), kept=kept)


def _stiffness(u: Any, v: Any, _: Any) -> Any:
    return u.grad[0] * v.grad[0] + u.grad[1] * v.grad[1]


def _pull_x(u: Any, v: Any, _: Any) -> Any:
    return u * v.grad[0]


def _pull_y(u: Any, v: Any, _: Any) -> Any:
    return u * v.grad[1]


def _splines(
    shape: tuple[int, int], sides: tuple[float, float], places: Array, mirror: int
) -> Array:
    """The matrix (G, P) from one component's readings to the cubic spline at `places` (2, G).

    What lies beyond a hinged rim mirrors what lies inside: xx and yy with the other sign, -1, xy
    with the same.
    """
    X, Y = (_spline(*each, mirror) for each in zip(shape, sides, places, strict=True))
    return np.einsum("gp,gq->gqp", X, Y).reshape(places.shape[1], -1)


def _spline(count: int, side: float, along: Array, mirror: int) -> Array:
    """The same along one side, (G, count)."""
    centres = (np.arange(-count, 2 * count) + 0.5) * side / count
    there = np.eye(count)
    beyond = mirror * there[::-1]
    return make_interp_spline(centres, np.vstack([beyond, there, beyond]), k=3)(along)


# Questions with known answers, each answered by every solver: errors, time and memory

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
    points = np.vstack([points_on(scene.plate.patch), scene.loads[0].centre()])
    return Comparison(
        name,
        {by: partial(make, case) for by, make in makers.items()},
        case.curvature,
        case.noisy(),
        True,
        points,
        scene.basis.at(points) @ case.truth[0],
    )


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
"""Kappaskin by its functions along each side, the others by their cells; coarse ones first."""


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
    layout = SensorLayout.regular(centre.plate.patch, 24, 24)
    finer = replace(centre, layout=layout, reference=(31, 31))
    yield _read("24 x 24 elements, 16 x 16 functions", finer, 16, _SOLVERS | _FAST | _SLOPES)
    name = "Table 2, 0.63 mm: 10 elements on half a circle, 8 functions"
    yield _read(name, fingertip_scene(0.63), 8, _SOLVERS)
    yield _pressed()


_TURNS, _BUDGET = (7, 201), 0.1  # least and most answers timed, and about how long in s


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
The same problems solved by Kappaskin and by alternatives
N        unknowns that are solved for
E        signed error at the load; with noise the mean +- standard deviation of 200 draws
RMS      error over the skin; with noise the mean of the draws
bars     error bars available
set-up   until the first answer; answer: median of the next ones, and its ratio to the first row
held     peak memory of both, with that of SuperLU"""


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
