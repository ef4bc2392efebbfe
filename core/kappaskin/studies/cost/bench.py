"""The bench: error, time and memory of each setting on a scene."""

import statistics
import time
import tracemalloc
from collections.abc import Callable, Generator, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import cycle
from typing import TypeVar

import numpy as np

from kappaskin.bases import Basis, basis_for
from kappaskin.errors import Refusal
from kappaskin.estimation import Estimator, estimator_for
from kappaskin.frames import Array
from kappaskin.scenes import AppliedLoads, LoadingHistory, Scene, Simulator, planned, survey_times
from kappaskin.sensing import Scan, Sensor, SensorLayout
from kappaskin.skin import Patch
from kappaskin.studies.cost.settings import SCANS, Cost, Refused, Setting

SETTLING, DRAWS = 8, 40
"""Frames that methods with a memory are given to settle, and those that are judged after them."""
_POINTS = 101  # of the surface along each side, edges included, as in Table 1
_TURNS, _BUDGET = (7, 41), 10e-3  # least and most of them that are timed, and about how long in s
_CALLS, _SLOW = 5, 1e-3  # in a turn; one of a method whose frame takes longer, in s
_Made = TypeVar("_Made")


@dataclass(frozen=True, eq=False)
class _Skin:
    """Elements, and what they read of the scene: (T, 3, P) in 1/m, `exact` and as it is `read`."""

    sensor: Sensor
    exact: Array
    read: Array

    @property
    def layout(self) -> SensorLayout:
        return self.sensor.layout


@dataclass(frozen=True, eq=False)
class _Judge:
    """Coefficients to errors, for one basis.

    The surface of c is S c on G points; with S = Q R its distance from the true w is the hypotenuse
    of R c - Q'w and of what no c can reach, w - Q Q'w.
    """

    basis: Basis
    at_load: Array
    true_at_load: Array
    R: Array
    reached: Array
    left: Array
    points: int

    @classmethod
    def of(cls, basis: Basis, points: Array, truth: "_Truth") -> "_Judge":
        Q, R = np.linalg.qr(basis.at(points))
        reached = truth.surface @ Q
        left = np.linalg.norm(truth.surface - reached @ Q.T, axis=1)
        at_load = basis.at(truth.contact)
        return cls(basis, at_load, truth.at_load, R, reached, left, len(points))

    def __call__(self, coefficients: Array) -> tuple[Array, Array]:
        """Signed error at the load and RMS over the skin, (T,) each in m."""
        c = coefficients.reshape(len(coefficients), -1).astype(float)
        rms = np.hypot(np.linalg.norm(c @ self.R.T - self.reached, axis=1), self.left)
        return np.vecdot(self.at_load, c) - self.true_at_load, rms / np.sqrt(self.points)


@dataclass(frozen=True, eq=False)
class _Truth:
    """What the skin does: coefficients (T, Ri, Rj), surface (T, G), contact (T, 2), all in m."""

    coefficients: Array
    surface: Array
    contact: Array
    at_load: Array


def points_on(patch: Patch) -> Array:
    """The points (G, 2) of the skin over which errors are averaged."""
    x, y = patch.grid(_POINTS, 2 if patch.strip else _POINTS)
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    return points[patch.contains(points)]


def with_elements(scene: Scene, elements: tuple[int, int] | None) -> Scene:
    """The scene with m x n `elements`, at a rate that they can keep; with its own when None."""
    if elements in (None, scene.layout.shape):
        return scene
    layout = SensorLayout.regular(scene.plate.patch, *elements)
    slowest = 1 / scene.transduction.scan_time(3 * len(layout))
    return replace(scene, layout=layout, rate=min(scene.rate, slowest))


def _pressed(scene: Scene, times: Array) -> list[AppliedLoads]:
    """What presses so many `times` in s after the skin is pressed hardest, or always then."""
    pressing = LoadingHistory(scene, scene.plate)
    found = {t: pressing(t) for t in survey_times(scene)}
    hardest = max(found, key=lambda t: sum(abs(load.force) for load in found[t].loads))
    after = [pressing(t) for t in (hardest + times).tolist()]
    pressed = all(np.isfinite(one.contact).all() for one in after)
    return after if pressed else [found[hardest]] * len(times)


class Bench:
    """Measures settings on a `scene`; what they share is computed once.

    All are judged on the same frames, begun at the scene's rate from when the skin is pressed
    hardest; where it is let go meanwhile, they all show that moment. Each shows the skin standing
    still as it is when the frame begins, spoilt by what the scene calls for. Other elements than
    the scene's own have the same skin, loads and electronics.
    """

    def __init__(self, scene: Scene) -> None:
        self._times = np.arange(SETTLING + DRAWS) / scene.rate
        self._pressed = _pressed(scene, self._times)
        if not np.isfinite([pressed.contact for pressed in self._pressed]).all():
            why = "lies on cylinders" if scene.laid else "is not pressed"
            raise Refusal(
                f"expected a scene with a load to measure errors by, but the skin of {scene.name} "
                f"{why}; choose one such as centre"
            )
        # Planned once: what stands still calls for no skew, but the whole scene is to be judged.
        self.scene = planned(scene)
        self._skins: dict[tuple[int, int] | None, _Skin] = {}
        self._judges: dict[tuple[int, int], _Judge] = {}

    @property
    def contact(self) -> Array:
        """Where the skin is pressed (2,) in m, in the middle of the frames."""
        return self._pressed[len(self._times) // 2].contact

    @cached_property
    def _points(self) -> Array:
        return points_on(self.scene.plate.patch)

    @cached_property
    def _truth(self) -> _Truth:
        scene, basis = self.scene, self.scene.basis
        compliance = scene.plate.compliance(basis)
        contact = np.array([pressed.contact for pressed in self._pressed])
        shapes = np.array([compliance(pressed.force) for pressed in self._pressed])
        c = shapes.reshape(len(shapes), -1)
        at_load = np.vecdot(basis.at(contact), c)
        return _Truth(shapes, c @ basis.at(self._points).T, contact, at_load)

    def _skin(self, elements: tuple[int, int] | None) -> _Skin:
        if elements not in self._skins:
            self._skins[elements] = self._read_by(elements)
        return self._skins[elements]

    def _read_by(self, elements: tuple[int, int] | None) -> _Skin:
        scene = with_elements(self.scene, elements)
        sensor, simulator = scene.sensor(), Simulator(scene)
        read: list[Array] = []
        for n, (t, pressed) in enumerate(zip(self._times.tolist(), self._pressed, strict=True)):
            simulator.change(scene.touched_by(*pressed.loads))
            read.append(sensor.nominal(simulator.scanned(sensor.scan(), n, t, lambda: 0.0)))
        operator = scene.layout.curvature_operator(scene.basis)
        exact = self._truth.coefficients.reshape(len(read), -1) @ operator.T
        shape = (len(read), 3, len(scene.layout))
        return _Skin(sensor, exact.reshape(shape), np.reshape(read, shape))

    def _judge(self, functions: tuple[int, int]) -> _Judge:
        if functions not in self._judges:
            basis = basis_for(self.scene.plate.patch, self.scene.edge, *functions)
            self._judges[functions] = _Judge.of(basis, self._points, self._truth)
        return self._judges[functions]

    def __call__(self, setting: Setting) -> Cost | Refused:
        """What `setting` costs, or why it gives no answer."""
        try:
            with np.errstate(all="ignore"):  # what is not finite is refused
                return self._cost(setting)
        except (Refusal, np.linalg.LinAlgError) as error:
            return Refused(setting, str(error))

    def _scanned(self, setting: Setting, skin: _Skin) -> tuple[SensorLayout, Scan]:
        """The skin's layout with the channels outside the scan dead, and the scan."""
        elements = SCANS[setting.scanned](skin.layout, self.contact)
        layout = replace(skin.layout, live=skin.layout.live & elements)
        return layout, skin.sensor.scan(np.flatnonzero(np.tile(elements, 3)))

    def _cost(self, setting: Setting) -> Cost:
        skin, judge = self._skin(setting.elements), self._judge(setting.functions)
        layout, scan = self._scanned(setting, skin)
        exact, read = (
            np.where(layout.live, curvature, np.nan) for curvature in (skin.exact, skin.read)
        )

        def started(curvature: Array) -> Estimator:
            fit = estimator_for(setting.method, judge.basis, layout, dtype=setting.precision)
            fit(curvature[0])
            return fit

        exactly, memory = traced(lambda: started(exact))
        begun = time.perf_counter()
        fit = started(read)
        setup_time = time.perf_counter() - begun
        time_per_frame, lstsq_time = _medians(fit, layout, exact, read)
        e_exact, rms_exact = _judged(judge, exactly, exact)
        e, rms = _judged(judge, fit, read)
        return Cost(
            setting,
            len(layout),
            len(scan.channels),
            scan.duration,
            setup_time,
            time_per_frame,
            lstsq_time,
            memory,
            float(e_exact.mean()),
            float(rms_exact.mean()),
            float(e.mean()),
            float(e.std(ddof=1)),
            float(rms.mean()),
            float(np.sqrt(np.mean(self._truth.surface[SETTLING:] ** 2))),
        )


def _judged(judge: _Judge, fit: Estimator, curvature: Array) -> tuple[Array, Array]:
    """Errors (DRAWS,) at the load and over the skin in m, of the frames after the settling."""
    e, rms = (error[SETTLING:] for error in judge(fit(curvature).coefficients))
    if not (np.isfinite(e).all() and np.isfinite(rms).all()):
        raise Refusal("the coefficients are not finite: the arithmetic overflowed")
    return e, rms


def traced(made: Callable[[], _Made]) -> tuple[_Made, int]:
    """What is made, and the most bytes that were held while making it."""
    mine = not tracemalloc.is_tracing()
    if mine:
        tracemalloc.start()
    try:
        tracemalloc.reset_peak()
        before = tracemalloc.get_traced_memory()[0]
        thing = made()
        return thing, tracemalloc.get_traced_memory()[1] - before
    finally:
        if mine:
            tracemalloc.stop()


def _medians(
    fit: Estimator, layout: SensorLayout, exact: Array, read: Array
) -> tuple[float, float]:
    """Median seconds per frame of `fit` and of numpy.linalg.lstsq, turn by turn."""
    used = layout.live.ravel()
    M = fit.M[used].astype(fit.dtype)
    K = exact[0].ravel()[used].astype(fit.dtype)
    frames = cycle(read)
    calls = _CALLS if seconds(fit, next(frames)) < _SLOW else 1
    ours, theirs = medians_in_turn(
        [
            lambda: [seconds(fit, next(frames)) for _ in range(calls)],
            lambda: [seconds(np.linalg.lstsq, M, K)],
        ],
        _TURNS,
        _BUDGET,
    )
    return ours, theirs


def medians_in_turn(
    timed: Sequence[Callable[[], Iterable[float]]], turns: tuple[int, int], budget: float
) -> list[float]:
    """Median seconds of each of the things that are `timed` turn by turn, all in every turn.

    So what else the machine does slows all of them alike. `turns` are the least and the most; after
    about `budget` seconds no more than the least are begun.
    """
    taken = [list[float]() for _ in timed]
    (least, most), end = turns, time.perf_counter() + budget
    for turn in range(most):
        if turn >= least and time.perf_counter() >= end:
            break
        for times, run in zip(taken, timed, strict=True):
            times += run()
    return [statistics.median(times) for times in taken]


def seconds(call: Callable[..., object], *arguments: object) -> float:
    """How long a call with these `arguments` takes."""
    begun = time.perf_counter()
    call(*arguments)
    return time.perf_counter() - begun


def costs(scene: Scene, settings: Iterable[Setting]) -> Generator[Cost | Refused]:
    """What each of `settings` costs on `scene`, one by one as it is measured."""
    bench = Bench(scene)
    for setting in settings:
        yield bench(setting)
