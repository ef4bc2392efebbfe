"""What each effect of a scene costs, and what leaving it out does to the shape."""

from dataclasses import dataclass, replace

import numpy as np

from kappaskin.bases import basis_for
from kappaskin.errors import Refusal
from kappaskin.estimation import METHODS, estimator_for
from kappaskin.frames import Array
from kappaskin.scenes import EffectSelection, Scene, Simulator, kept_effects, plan, survey_duration
from kappaskin.scenes.effects import (
    EFFECTS,
    CorruptedFrames,
    DeadElements,
    DroppedFrames,
    Effect,
    Saturation,
)
from kappaskin.sensing import SensorLayout
from kappaskin.studies.cost.bench import SETTLING, Bench, points_on, with_elements
from kappaskin.studies.cost.settings import SCANS, Setting, own_elements
from kappaskin.studies.simulation import costs_of

_PLACES, _EACH = 20, 2  # moments of the scene, and frames that are judged at each of them
FRAMES = _PLACES * _EACH
"""Frames that the errors of an effect are averaged over."""
_MOST = 8  # functions along a side, as the app begins with


@dataclass(frozen=True)
class EffectCost:
    """What an effect of a scene takes and does; `kept` where the plan has it simulated.

    `time_per_frame` in s is what it adds to simulating a frame. Leaving it out changes no reading
    by more than `bound`, a share of the peak curvature; None of a failure that a scene's author
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
                method, basis_for(scene.plate.patch, scene.edge, *functions), scene.layout
            )
        except Refusal:
            continue
        return Setting(method, functions, own_elements(scene))
    raise Refusal(f"expected elements that carry a shape, got the {len(scene.layout)} of the scene")


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
    seconds, judge = costs_of(scene, planned), _Judge(scene, setting, bench.contact)
    now = judge.answer(scene, kept)
    found: list[EffectCost] = []
    for entry in planned:
        name, effect = entry.name, entry.effect
        if effect is None:
            continue
        rms: tuple[float, float] | tuple[None, None] = (None, None)
        if not isinstance(effect, DroppedFrames | CorruptedFrames):
            other = judge.answer(_without(scene, effect), kept ^ {name})
            has, has_not = (now, other) if entry.kept else (other, now)
            rms = judge.rms(has, has), judge.rms(has_not, has)
        bound = None if effect.authored else entry.size.error
        found.append(EffectCost(name, entry.kept, seconds[name], bound, *rms))
    return tuple(found)


def _without(scene: Scene, effect: Effect) -> Scene:
    """The scene without a failure; any other effect is for its choice to leave out."""
    if isinstance(effect, DeadElements):
        live = np.array(scene.layout.live)
        # Of a strip, only what bends is there to be read.
        live[np.ix_(np.flatnonzero(live.any(axis=1)), np.array(effect.elements))] = True
        return replace(scene, layout=replace(scene.layout, live=live))
    if effect.authored:
        others = tuple(one for one in scene.effects if one.name != effect.name)
        return replace(scene, effects=others)
    return scene


@dataclass(frozen=True, eq=False)
class _Answer:
    """Coefficients of the true shapes (T, Ri, Rj) and of those fitted (T, Ni, Nj), in m."""

    true: Array
    fitted: Array


class _Judge:
    """What a setting makes of a whole scene, and its errors."""

    def __init__(self, scene: Scene, setting: Setting, contact: Array) -> None:
        self._setting = setting
        self._basis = basis_for(scene.plate.patch, scene.edge, *setting.functions)
        points = points_on(scene.plate.patch)
        self._at, self._true_at = self._basis.at(points), scene.basis.at(points)
        self._scanned = SCANS[setting.scanned](scene.layout, contact)
        frames = np.arange(SETTLING + _EACH) / scene.rate
        # One after the other, however short the scene.
        apart = max(survey_duration(scene) / _PLACES, len(frames) / scene.rate)
        self._times = np.add.outer(apart * np.arange(_PLACES), frames)

    def answer(self, scene: Scene, names: frozenset[str]) -> _Answer:
        """The frames judged of `scene` with the effects of these `names`."""
        scene = replace(scene, choice=EffectSelection(off=frozenset(EFFECTS) - names))
        simulator, scan = Simulator(scene), scene.sensor().scan()
        shapes, read = list[Array](), list[Array]()
        for time in self._times.ravel().tolist():
            truth, curvature = simulator.reading(scan, time)
            if truth is not None:
                shapes.append(truth.coefficients)
                read.append(curvature)
        curvature = np.array(read)
        if Saturation.name in names:
            electronics = scene.transduction
            curvature[electronics.saturated(electronics.counts(curvature))] = np.nan
        fitted = self._fitted(scene.layout, curvature)
        return _Answer(self._judged(np.array(shapes)), self._judged(fitted))

    def _fitted(self, layout: SensorLayout, curvature: Array) -> Array:
        """The coefficients (T, Ni, Nj) of `curvature` (T, 3 P), of which some is not scanned."""
        live, s = layout.live & self._scanned, self._setting
        fit = estimator_for(s.method, self._basis, replace(layout, live=live), dtype=s.precision)
        K = np.where(live, curvature.reshape(-1, *live.shape), np.nan)
        with np.errstate(all="ignore"):  # what is not finite is refused
            fitted = fit(K).coefficients.astype(float)
        if not np.isfinite(fitted).all():
            raise Refusal("the coefficients are not finite: the arithmetic overflowed")
        return fitted

    def _judged(self, each: Array) -> Array:
        """Of something for every frame, that of those after the settling, flat."""
        return each.reshape(*self._times.shape, -1)[:, SETTLING:].reshape(FRAMES, -1)

    def rms(self, answer: _Answer, truth: _Answer) -> float:
        """RMS error of the shapes fitted in `answer` from the true ones of `truth`, in m."""
        error = answer.fitted @ self._at.T - truth.true @ self._true_at.T
        return float(np.sqrt(np.mean(error**2, axis=1)).mean())
