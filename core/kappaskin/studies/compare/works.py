"""What is compared: load cases of a skin, and a plate under a load."""

from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from kappaskin.bases import SineBasis
from kappaskin.frames import Array
from kappaskin.mechanics import GaussianLoad, Plate
from kappaskin.scenes import Scene, load_scene
from kappaskin.sensing import SensorLayout
from kappaskin.skin import Patch
from kappaskin.studies.compare.elements import bent
from kappaskin.studies.compare.slopes import integrated
from kappaskin.studies.compare.solvers import iterated, lstsq, ours, pinv
from kappaskin.studies.compare.way import Way
from kappaskin.studies.tables import Case, fingertip_scene

WITHIN = 1e-2
"""RMS error of a plate's deflection that every way is to reach, as a share of the deflection's."""


@dataclass(frozen=True, eq=False)
class Work:
    """A question whose answer is known, and the `ways` to answer it, ours first.

    `points` (G, 2) in m are those of the surface and last the load's place, `truth` (G,) in m what
    is there. `asked` is the question without noise, `draws` are those that are timed; `noisy` are
    they when they are the same question with noise.
    """

    name: str
    ways: Mapping[str, Callable[[], Way]]
    asked: Any
    draws: Sequence[Any] | Array
    noisy: bool
    points: Array
    truth: Array

    def errors(self, way: Way, unknowns: Array) -> tuple[Array, Array]:
        """Signed error at the load and RMS over the surface, (T,) each in mm, of (T, U)."""
        off = 1e3 * ((way.at(self.points) @ unknowns.T).T - self.truth)
        return off[:, -1], np.sqrt(np.mean(off[:, :-1] ** 2, axis=1))


# Readings to a shape

_Maker = Callable[[Case], Way]
_SOLVERS: dict[str, _Maker] = {
    "Kappaskin, least squares": partial(ours, method="least-squares"),
    "Kappaskin, with error bars": partial(ours, method="least-squares", error_bars=True),
    "numpy.linalg.lstsq": lstsq,
    "numpy.linalg.pinv, once": pinv,
    "scipy.sparse.linalg.lsqr": iterated,
}
_BAYES: dict[str, _Maker] = {
    "Kappaskin, bayes, 15 x 15": partial(ours, method="bayes", functions=(15, 15), error_bars=True)
}
_FAST: dict[str, _Maker] = {"Kappaskin, fast": partial(ours, method="fast")}
_SLOPES: dict[str, _Maker] = {"scikit-fem, slopes route": integrated}


def _read(name: str, scene: Scene, N: int, makers: Mapping[str, _Maker]) -> Work:
    """The shape of a scene from its readings, with N functions along each side."""
    case = Case.of(scene, "least-squares", (N, N))
    surface = np.stack(np.meshgrid(*case.grid), axis=-1).reshape(-1, 2)
    return Work(
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


def _series(plate: Plate, N: int) -> Way:
    basis = SineBasis(plate.patch, N, N)
    compliance = plate.compliance(basis)
    return Way(lambda load: compliance(load.modal(basis)).ravel(), basis.at, basis.size)


_PLATES: dict[str, tuple[Callable[[Plate, int], Way], range]] = {
    "Kappaskin, {0} x {0}": (_series, range(2, 33)),
    "scikit-fem Argyris, {0} x {0}": (lambda p, n: bent(p, "Argyris", n), range(2, 13)),
    "scikit-fem Morley, {0} x {0}": (lambda p, n: bent(p, "Morley", n), range(20, 65, 4)),
}
"""Ours by its functions along each side, theirs by their squares; the coarser ones first."""


def _pressed() -> Work:
    """A plate that a fingertip presses in by 1 mm, by the coarsest of each way that is enough."""
    patch = Patch(0.1, 0.1)
    plate, load = Plate(patch), GaussianLoad(0.04, 0.055, 5e-3)
    exact = _series(plate, _EXACT)
    surface = np.stack(np.meshgrid(*patch.grid(21, 21)), axis=-1).reshape(-1, 2)
    points = np.vstack([surface, load.centre()])
    load = load.scaled(1e-3 / float(exact.at(points[-1:])[0] @ exact.solve(load)))
    truth = exact.at(points) @ exact.solve(load)
    draws = [load.shifted(dx, 0.0) for dx in np.linspace(-0.01, 0.01, 8).tolist()]
    name = f"A plate under a fingertip, within {WITHIN:.0%}"
    work = Work(name, {}, load, draws, False, points, truth)
    return replace(work, ways=dict(_coarsest(work, plate)))


def _coarsest(work: Work, plate: Plate) -> Generator[tuple[str, Callable[[], Way]]]:
    enough = WITHIN * 1e3 * float(np.sqrt(np.mean(work.truth[:-1] ** 2)))
    for name, (make, sizes) in _PLATES.items():
        for size in sizes:
            way = make(plate, size)
            if work.errors(way, way.solve(work.asked)[None])[1] <= enough:
                yield name.format(size), partial(make, plate, size)
                break


def works() -> Generator[Work]:
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
