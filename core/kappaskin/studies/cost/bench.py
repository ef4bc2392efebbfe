"""Cost bench: error, time and memory of settings on a scene, and of the effects in it."""

import time
from collections.abc import Generator, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import cycle, islice
from typing import cast

import numpy as np

from kappaskin.bases import basis_for
from kappaskin.errors import Refusal
from kappaskin.estimation import METHODS, Estimator, estimator_for
from kappaskin.frames import Array
from kappaskin.mechanics import shapes_under
from kappaskin.scenes import (
    AppliedLoads,
    EffectSelection,
    LoadingHistory,
    Scene,
    Simulator,
    kept_effects,
    plan,
    planned,
)
from kappaskin.scenes.effects import (
    EFFECTS,
    CorruptedFrames,
    DeadElements,
    DroppedFrames,
    Effect,
    Saturation,
)
from kappaskin.sensing import Scan, Sensor, SensorLayout
from kappaskin.studies.accuracy import (
    medians_in_turn,
    rms_distance,
    root_mean_square,
    seconds,
    traced,
)
from kappaskin.studies.cost import SCANS, Cost, Refused, Setting, ShapeErrors, own_elements
from kappaskin.studies.simulation import costs_of
from kappaskin.studies.summed import SummedResponse

SETTLING, DRAWS = 8, 40
"""Frames that methods with a memory are given to settle, and those that are judged after them."""
_JUDGED = slice(SETTLING, None)
_EXACTLY = slice(SETTLING, None, DRAWS // 4)  # nothing is random in exact readings: fewer will do
_TURNS, _BUDGET = (7, 41), 10e-3  # least and most of them that are timed, and about how long in s
_CALLS, _SLOW = 5, 1e-3  # in a turn; one of a method whose frame takes longer, in s


@dataclass(frozen=True, eq=False)
class _SkinReadings:
    """Elements, and what they read of the scene: T frames, `exact` and as it is `read`.

    (T, 3, P) in 1/m of a curvature sensor, (T, R) of other readings in units of theirs.

    `beyond` is what they read of the skin's response beyond the scene's functions, where that is
    known.
    """

    sensor: Sensor
    exact: Array
    read: Array
    beyond: Array | None

    @property
    def layout(self) -> SensorLayout:
        return self.sensor.layout


def with_elements(scene: Scene, elements: tuple[int, int] | None) -> Scene:
    """The scene with m x n `elements`, at a rate that they can keep; with its own when None."""
    if elements in (None, scene.layout.shape):
        return scene
    layout, own = SensorLayout.regular(scene.plate.patch, *elements), scene.layout
    if own.reads:
        layout = replace(own.read_alike(layout.positions), shape=layout.shape)
    scan_time = scene.transduction.scan_time(layout.channels)
    return replace(
        scene, layout=layout, rate=min(scene.rate, 1 / scan_time if scan_time else np.inf)
    )


def _pressed(scene: Scene, times: Array) -> list[AppliedLoads]:
    """What presses so many `times` in s after the skin is pressed hardest, or always then."""
    pressing = LoadingHistory(scene, scene.plate)
    found = {t: pressing(t) for t in scene.survey_times}
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
        self._skins: dict[tuple[int, int] | None, _SkinReadings] = {}

    @property
    def contact(self) -> Array:
        """Where the skin is pressed (2,) in m, in the middle of the frames."""
        return self._pressed[len(self._times) // 2].contact

    @cached_property
    def _truth(self) -> Array:
        """Coefficients (T, Nr) in m of what the skin does."""
        forces = np.array([pressed.force.ravel() for pressed in self._pressed])
        return shapes_under(self.scene.plate, self.scene.basis, forces)

    @cached_property
    def _response(self) -> SummedResponse | None:
        """The skin's response beyond the scene's functions, where it is known."""
        if not SummedResponse.is_known(self.scene):
            return None
        return SummedResponse(self.scene, [pressed.loads for pressed in self._pressed])

    def _skin(self, elements: tuple[int, int] | None) -> _SkinReadings:
        if elements not in self._skins:
            self._skins[elements] = self._read_by(elements)
        return self._skins[elements]

    def _read_by(self, elements: tuple[int, int] | None) -> _SkinReadings:
        scene = with_elements(self.scene, elements)
        sensor, simulator = scene.sensor(), Simulator(scene)
        read: list[Array] = []
        for n, (t, pressed) in enumerate(zip(self._times.tolist(), self._pressed, strict=True)):
            simulator.change(scene.touched_by(*pressed.loads))
            read.append(sensor.nominal(simulator.scanned(sensor.scan(), n, t, lambda: 0.0)))
        operator = scene.layout.operator(scene.basis, scene.plate)
        shape = (len(read), *scene.layout.frame_shape)
        beyond = None if self._response is None else self._response.readings(scene.layout)
        exact = (self._truth @ operator.T).reshape(shape)
        return _SkinReadings(sensor, exact, np.reshape(read, shape), beyond)

    def __call__(self, setting: Setting) -> Cost | Refused:
        """What `setting` costs, or why it gives no answer."""
        try:
            with np.errstate(all="ignore"):  # what is not finite is refused
                return self._cost(setting)
        except (Refusal, np.linalg.LinAlgError) as error:
            return Refused(setting, str(error))

    def _scanned(self, setting: Setting, skin: _SkinReadings) -> tuple[SensorLayout, Scan]:
        """The skin's layout with the channels outside the scan dead, and the scan."""
        scanned = SCANS[setting.scanned](skin.layout, self.contact)[skin.layout.element]
        live = skin.layout.live & scanned.reshape(skin.layout.frame_shape)
        return replace(skin.layout, live=live), skin.sensor.scan(np.flatnonzero(scanned))

    def _cost(self, setting: Setting) -> Cost:
        skin = self._skin(setting.elements)
        basis = basis_for(self.scene.plate.patch, self.scene.edge, *setting.functions)
        layout, scan = self._scanned(setting, skin)
        exact, read = (
            np.where(layout.live, curvature, np.nan) for curvature in (skin.exact, skin.read)
        )

        def started(curvature: Array) -> Estimator:
            sigma, precision = skin.sensor.sigma, setting.precision
            fit = estimator_for(setting.method, basis, layout, sigma, dtype=precision)
            fit(curvature[0])
            return fit

        exactly, memory = traced(lambda: started(exact))
        begun = time.perf_counter()
        fit = started(read)
        setup_time = time.perf_counter() - begun
        time_per_frame, lstsq_time = _medians(fit, layout, exact, read)
        e_exact, rms_exact = self._errors(exactly, exact, _EXACTLY)
        e, rms = self._errors(fit, read, _JUDGED)
        summed = None
        if skin.beyond is not None:
            of_exact, of_read = (
                self._summed_errors(fit, curvature + skin.beyond, frames)
                for fit, curvature, frames in (
                    (exactly, exact, _EXACTLY),
                    (fit, read, _JUDGED),
                )
            )
            summed = ShapeErrors(*of_exact, *of_read)
        reference, w = self.scene.basis, self._truth[SETTLING:]
        shape = rms_distance(reference, np.zeros_like(w), reference, w)
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
            root_mean_square(shape),
            summed,
        )

    def _summed_errors(
        self, fit: Estimator, curvature: Array, frames: slice
    ) -> tuple[float, float]:
        """Means of the errors at the load and over the skin, beside the whole response."""
        response, c = cast("SummedResponse", self._response), _fitted(fit, curvature, frames)
        contact = np.array([pressed.contact for pressed in self._pressed[frames]])
        e, rms = response.errors(fit.basis, c, self._truth[frames], contact, frames)
        check_finite(e, rms)
        return float(e.mean()), float(rms.mean())

    def _errors(self, fit: Estimator, curvature: Array, frames: slice) -> tuple[Array, Array]:
        """Errors (T,) at the load and over the skin in m, in T of the `frames`."""
        c = _fitted(fit, curvature, frames)
        contact = np.array([pressed.contact for pressed in self._pressed[frames]])
        reference, w = self.scene.basis, self._truth[frames]
        e = np.vecdot(fit.basis.at(contact), c) - np.vecdot(reference.at(contact), w)
        rms = rms_distance(fit.basis, c, reference, w)
        check_finite(e, rms)
        return e, rms


def _fitted(fit: Estimator, curvature: Array, frames: slice) -> Array:
    """The coefficients (T, N) in m of some of the `frames`; a memory takes all of them in."""
    if fit.has_memory:
        found = fit(curvature).coefficients[frames]
    else:
        found = fit(curvature[frames]).coefficients
    return found.reshape(-1, fit.basis.size).astype(float)


def check_finite(*values: Array) -> None:
    """Raise a `Refusal` where something computed from coefficients is no number."""
    if not all(np.isfinite(each).all() for each in values):
        raise Refusal("the coefficients are not finite: the arithmetic overflowed")


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


def costs(scene: Scene, settings: Iterable[Setting]) -> Generator[Cost | Refused]:
    """What each of `settings` costs on `scene`, one by one as it is measured."""
    bench = Bench(scene)
    for setting in settings:
        yield bench(setting)


# What each effect of a scene costs, and what leaving it out does to the shape

_PLACES, _EACH = 20, 2  # moments of the scene, and frames that are judged at each of them
FRAMES = _PLACES * _EACH
"""Frames that the errors of an effect are averaged over."""
_MOST = 8  # functions along a side, as the app begins with


@dataclass(frozen=True)
class EffectCost:
    """What an effect of a scene takes and does; `kept` where the plan has it simulated.

    `time_per_frame` in s is what it adds to simulating a frame. Leaving it out changes no reading
    by more than `bound`, a share of the peak reading; None of a failure that a scene's author
    decides on. `rms_with` and `rms_without` are RMS errors of the shape in m, with everything else
    as planned; None of a failure of the link, of which the frames that do arrive show nothing.
    """

    name: str
    kept: bool
    time_per_frame: float
    bound: float | None
    rms_with: float | None
    rms_without: float | None


def usual_setting(scene: Scene) -> Setting:
    """Least squares on the scene's own elements, with 8 x 8 functions or as many as they carry."""
    method = next(iter(METHODS))
    for N in range(_MOST, 0, -1):
        functions = N, 1 if scene.plate.patch.strip else N
        try:
            estimator_for(
                method,
                basis_for(scene.plate.patch, scene.edge, *functions),
                scene.layout,
                scene.sensor().sigma,
            )
        except Refusal:
            continue
        return Setting(method, functions, own_elements(scene))
    raise Refusal(f"expected enough elements for a shape, got the {len(scene.layout)} of the scene")


def effect_costs(scene: Scene, setting: Setting) -> tuple[EffectCost, ...]:
    """What every effect of `scene` costs, with `setting` as the estimator.

    Errors are means over twenty moments all over the scene, on a skin that moves: `Bench` looks
    where it is pressed hardest and stands still, when nothing drifts and no scan is skewed. All
    that is random is drawn alike with an effect and without it. An effect that makes another skin,
    tension, foam or fluid, changes the shape itself: the error is always from the shape of the skin
    that has it. The setting knows dead elements, and how long gages are. Steps and rails count
    where they are simulated, though a frame has both whatever is planned.

    Refuses what `Bench` refuses, and a setting that gives no answer.
    """
    bench = Bench(scene)
    scene = with_elements(scene, setting.elements)
    planned, kept = plan(scene), frozenset(effect.name for effect in kept_effects(scene))
    seconds, judge = costs_of(scene, planned), _EffectJudge(scene, setting, bench.contact)
    now = judge.answer(scene, kept)
    found: list[EffectCost] = []
    for entry in planned:
        name, effect = entry.name, entry.effect
        if effect is None:
            continue
        rms: tuple[float, float] | tuple[None, None] = (None, None)
        if not isinstance(effect, DroppedFrames | CorruptedFrames):
            other = judge.answer(_without(scene, effect), kept ^ {name})
            (has, true), (has_not, _) = (now, other) if entry.kept else (other, now)
            rms = judge.rms(has, true), judge.rms(has_not, true)
        bound = None if effect.authored else entry.size.error
        found.append(EffectCost(name, entry.kept, seconds[name], bound, *rms))
    return tuple(found)


def _without(scene: Scene, effect: Effect) -> Scene:
    """The scene without a failure; any other effect is for its choice to leave out."""
    if isinstance(effect, DeadElements):
        layout, live = scene.layout, scene.layout.live.ravel()
        # Of a strip, only what bends is there to be read.
        read = np.isin(layout.kind, layout.kind[live])
        live = live | (read & np.isin(layout.element, effect.elements))
        return replace(scene, layout=replace(layout, live=live.reshape(layout.frame_shape)))
    if effect.authored:
        others = tuple(one for one in scene.effects if one.name != effect.name)
        return replace(scene, effects=others)
    return scene


class _EffectJudge:
    """What a setting makes of a whole scene, and its errors."""

    def __init__(self, scene: Scene, setting: Setting, contact: Array) -> None:
        self._setting = setting
        self._basis = basis_for(scene.plate.patch, scene.edge, *setting.functions)
        self._reference = scene.basis
        scanned = SCANS[setting.scanned](scene.layout, contact)[scene.layout.element]
        self._scanned = scanned.reshape(scene.layout.frame_shape)
        frames = np.arange(SETTLING + _EACH) / scene.rate
        # One after the other, however short the scene.
        spacing = max(scene.survey_duration / _PLACES, len(frames) / scene.rate)
        self._times = np.add.outer(spacing * np.arange(_PLACES), frames)

    def answer(self, scene: Scene, names: frozenset[str]) -> tuple[Array, Array]:
        """Coefficients in m, fitted (T, N) and true (T, Nr), of the frames judged of `scene`.

        It has the effects of these `names`.
        """
        scene = replace(scene, choice=EffectSelection(off=frozenset(EFFECTS) - names))
        simulator, scan = Simulator(scene), scene.sensor().scan()
        shapes, read = list[Array](), list[Array]()
        for moment in self._times.ravel().tolist():
            truth, curvature = simulator.reading(scan, moment)
            if truth is not None:
                shapes.append(truth.coefficients)
                read.append(curvature)
        curvature = np.array(read)
        if Saturation.name in names:
            electronics = scene.transduction
            curvature[electronics.saturated(electronics.counts(curvature))] = np.nan
        fitted = self._fitted(scene.sensor(), curvature)
        return self._judged(fitted), self._judged(np.array(shapes))

    def _fitted(self, sensor: Sensor, curvature: Array) -> Array:
        """The coefficients (T, Ni, Nj) of `curvature` (T, R), of which some is not scanned."""
        live, s = sensor.layout.live & self._scanned, self._setting
        layout = replace(sensor.layout, live=live)
        fit = estimator_for(s.method, self._basis, layout, sensor.sigma, dtype=s.precision)
        K = np.where(live, curvature.reshape(-1, *live.shape), np.nan)
        with np.errstate(all="ignore"):  # what is not finite is refused
            fitted = fit(K).coefficients.astype(float)
        check_finite(fitted)
        return fitted

    def _judged(self, each: Array) -> Array:
        """Of something for every frame, that of those after the settling, flat."""
        return each.reshape(*self._times.shape, -1)[:, SETTLING:].reshape(FRAMES, -1)

    def rms(self, fitted: Array, true: Array) -> float:
        """RMS error of the shapes, in m."""
        return float(rms_distance(self._basis, fitted, self._reference, true).mean())


# All of them, in the order in which they are waited for

EffectCosts = tuple[EffectCost, ...] | Refused
"""What a scene's effects cost with a setting, or why that setting is refused."""


def cost_steps(
    scene: Scene, settings: Sequence[Setting], effects_with: Setting | None = None
) -> Generator[Cost | Refused | tuple[Setting, EffectCosts]]:
    """What each of `settings` costs on `scene`, as soon as it is measured.

    What the scene's effects cost with the setting `effects_with` comes after the first of them,
    with that setting. Refuses what `Bench` refuses. To be run in a background process.
    """
    found = costs(scene, settings)
    yield from islice(found, 1)  # the setting that is most waited for
    if effects_with is not None:
        try:
            yield effects_with, effect_costs(scene, effects_with)
        except Refusal as refusal:
            yield effects_with, Refused(effects_with, str(refusal))
    yield from found
