"""A scene: a skin, its stimuli, the effects on its readings, and its loads over time."""

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from kappaskin import _plugins
from kappaskin.bases import Basis, basis_for
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.mechanics import (
    Indentation,
    IndentationSolver,
    Load,
    Plate,
    PointLoad,
    Stretching,
    shapes_under,
)
from kappaskin.scenes.cylinders import Presentation
from kappaskin.scenes.effects import EFFECTS, Effect, ReadingEffect, StatedNoise, Survey
from kappaskin.scenes.stimulus import Indenter, Motion, Stimulus, contact_of
from kappaskin.sensing import DigitalReadings, Sensor, SensorLayout, Transduction


@dataclass(frozen=True)
class EffectSelection:
    """Selected effects: those that matter, or all; `on` and `off` by name.

    With `auto` an effect is left out when it and all others left out change no reading by more than
    `accuracy`, a share of the scene's peak reading.
    """

    auto: bool = False
    accuracy: float = 0.01
    on: frozenset[str] = frozenset()
    off: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        if not 0 < self.accuracy < 1:
            raise Refusal(f"expected an accuracy between 0 and 1 of the peak, got {self.accuracy}")
        for name in sorted(self.on | self.off):
            if name not in EFFECTS:
                why = _plugins.left_out(_plugins.EFFECTS, name)
                raise Refusal(f"expected effects among {', '.join(EFFECTS)}; got {name!r}{why}")
        if both := sorted(self.on & self.off):
            raise Refusal(f"expected an effect to be on or off, got {', '.join(both)} as both")


LINEAR = EffectSelection(off=frozenset({"finite-slope"}))
"""All there is of the electronics, on a skin of which the gages sense what Eqs. 3-5 say."""


_MOMENTS = 48  # evenly over the scene, besides those of its motions and those halfway
_LONGEST = 60.0  # s of a scene that nothing repeats in: what drifts has this long to do so


@dataclass(frozen=True, eq=False)
class Scene:
    """A simulated skin and what happens to it; `stimuli` and `effects` may be empty.

    `reference` is the number of functions (Ri, Rj) of the true shape: Table 1 defines its truth
    with 15 x 15, since the curvature under a point load grows with every further function. `edge`
    says how the skin is held, unless it is `laid` on one cylinder after the other instead. Of what
    spoils its readings, `choice` says what is simulated. `title` and `text` say what there is to
    see.
    """

    name: str
    plate: Plate
    layout: SensorLayout
    stimuli: tuple[Stimulus, ...] = ()
    effects: tuple[Effect, ...] = ()
    transduction: Transduction | DigitalReadings = field(default_factory=Transduction)
    rate: float = 500.0
    seed: int = 0
    reference: tuple[int, int] = (15, 15)
    edge: str = "hinged"
    laid: Presentation | None = None
    choice: EffectSelection = LINEAR
    title: str = ""
    text: str = ""

    def __post_init__(self) -> None:
        if self.laid and self.stimuli:
            raise Refusal(f"expected no loads on a skin that lies on cylinders, got {self.loads}")
        if self.seed < 0:
            raise Refusal(f"expected a seed of at least 0, got {self.seed}")
        if self.layout.reads:
            self._check_readings()
        names = [effect.name for effect in self.effects]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise Refusal(f"expected each effect once, got {', '.join(twice)} more than once")
        if self.indenter and len(self.stimuli) > 1:
            raise Refusal(
                f"expected a rigid object to press alone, got {len(self.stimuli)} touches; any "
                "other one would bend the skin below it: use loads only, or one object"
            )
        for stimulus in self.stimuli:
            stimulus.check(self.plate)

    def _check_readings(self) -> None:
        """Refuse what elements that read other than xx, yy and xy cannot have."""
        read = ", ".join(self.layout.each_reads)
        self.transduction.check(self.layout)
        if self.laid:
            self.layout.check_curvature_sensor("a skin that lies on cylinders")
        if not isinstance(self.transduction, DigitalReadings):
            return
        for effect in self.effects:
            if effect.of_gages:
                raise Refusal(
                    f"expected no {effect.name} of digital readings of {read}: {effect.of_gages}"
                )
            if effect.name == StatedNoise.name and self.transduction.noise:
                raise Refusal(
                    f"expected one noise, got that in [readings] and {effect.name}; leave one out"
                )

    @cached_property
    def basis(self) -> Basis:
        return basis_for(self.plate.patch, self.edge, *self.reference)

    def sensor(self) -> Sensor:
        """The description that the simulated device sends."""
        return Sensor(
            self.layout,
            self.transduction,
            self.plate,
            self.edge,
            self.rate,
            name="Simulated skin",
            serial_number="SIM-0001",
            firmware="kappaskin simulator",
            simulated=True,
        )

    def touched_by(self, *loads: Load, motion: Motion | None = None) -> "Scene":
        """The same scene under other loads, all moving by `motion`."""
        return replace(self, stimuli=tuple(Stimulus(load, motion) for load in loads))

    def laid_on(self, laid: Presentation) -> "Scene":
        """The same skin laid on one cylinder after the other."""
        return replace(self, stimuli=(), laid=laid)

    @property
    def loads(self) -> tuple[Load, ...]:
        """The loads before they move, at full force."""
        each = (stimulus.what for stimulus in self.stimuli)
        return tuple(what for what in each if not isinstance(what, Indenter))

    @property
    def indenter(self) -> Stimulus | None:
        """The rigid object in contact, if any."""
        return next((s for s in self.stimuli if isinstance(s.what, Indenter)), None)

    def loads_at(self, time: float) -> tuple[Load, ...]:
        """The loads in contact at `time` in s."""
        there = [stimulus.load_at(time) for stimulus in self.stimuli]
        return tuple([load for load in there if load is not None])

    @property
    def reading_effects(self) -> tuple[ReadingEffect, ...]:
        """Those of its effects that change one reading after the other."""
        return tuple(effect for effect in self.effects if isinstance(effect, ReadingEffect))

    @property
    def duration(self) -> float:
        """Seconds after which the longest motion begins anew; one where nothing moves."""
        if self.laid is not None:
            return self.laid.duration
        return max((s.motion.duration for s in self.stimuli if s.motion), default=1.0)

    @property
    def moments(self) -> list[float]:
        """Times in s, up to `duration`, at which a motion sets out, arrives or presses hardest."""
        each = (s.motion.moments for s in self.stimuli if s.motion)
        return sorted({time for moments in each for time in moments})

    @cached_property
    def moves(self) -> bool:
        """Whether anything that touches the skin moves."""
        return any(stimulus.motion is not None for stimulus in self.stimuli)

    @property
    def survey_times(self) -> list[float]:
        """The times in s, ascending, at which a survey samples the scene."""
        if not (self.moves or self.laid):
            return [0.0]
        evenly = np.arange(_MOMENTS) * self.duration / _MOMENTS
        each = [np.array(s.motion.moments) for s in self.stimuli if s.motion]
        fastest = [(moments[1:] + moments[:-1]) / 2 for moments in each]  # of what eases
        laid = self.laid.middles if self.laid else []
        return np.unique(np.concatenate([evenly, *each, *fastest, laid])).tolist()

    @property
    def survey_duration(self) -> float:
        """Seconds after which the scene repeats; `_LONGEST` of one in which nothing moves."""
        return self.duration if self.moves or self.laid else _LONGEST


def scaled_to(plate: Plate, load: Load, displacement: float, basis: Basis) -> Load:
    """The load whose point of application moves by `displacement` in m, stretched if it is."""
    compliance = plate.compliance(basis)
    at = float(basis.at(load.centre()[None])[0] @ compliance(load.modal(basis)).ravel())
    if not at / load.force > 1e-12 * np.max(compliance.values):
        raise Refusal(
            f"expected a load that moves the skin at its position, got {load}; the edges are "
            "held: choose a position further inside"
        )
    scaled = load.scaled(displacement / at)
    if not plate.stretches or not displacement:
        return scaled
    from scipy.optimize import brentq  # slow to import, and seldom needed

    stretching, modal = Stretching(plate, basis), scaled.modal(basis)
    there = basis.at(load.centre()[None])[0] / displacement

    def beyond(times: float) -> float:
        return float(there @ stretching(times * modal).ravel()) - 1

    most = 1.0
    while beyond(most) < 0:
        most *= 2
    return scaled.scaled(float(brentq(beyond, most / 2, most)) if most > 1 else 1.0)


@dataclass(frozen=True, slots=True)
class Playback:
    """Playback of a scene: at `at` s when device time was `since` s, `speed` times as fast since.

    At a speed of zero it is paused, while the device continues to read it.
    """

    at: float = 0.0
    since: float = 0.0
    speed: float = 1.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.at) and math.isfinite(self.since)):
            raise Refusal(f"expected finite times in s to play a scene from, got {self}")
        if not 0 <= self.speed <= 10:
            raise Refusal(f"expected a speed of 0 to 10 to play a scene at, got {self.speed:g}")

    def time(self, device_time: float) -> float:
        """The time in s of the scene at `device_time` in s."""
        return self.at + self.speed * (device_time - self.since)


class AppliedLoads(NamedTuple):
    """The loads on a skin at one moment: modal `force` (Ri, Rj) in N and `contact` (2,) in m.

    That is the centre of force, NaN where nothing touches. `loads` make the force: those of the
    scene, or a point load wherever a rigid object bears.
    """

    force: Array
    contact: Array
    loads: tuple[Load, ...]


class LoadingHistory:
    """The loads on the skin of `scene` over time, as if the skin were `plate`.

    A rigid object is sought from where it was: asked in order, that is quick.
    """

    def __init__(self, scene: Scene, plate: Plate) -> None:
        self._plate, self._basis = plate, scene.basis
        self._press: IndentationSolver | None = None
        self._last: Indentation | None = None
        self.take(scene)

    def take(self, scene: Scene) -> None:
        """Continue with the stimuli of another `scene` of the same skin."""
        self._scene, self._indenter = scene, scene.indenter
        if self._indenter and self._press is None:
            self._press = IndentationSolver(self._plate, self._basis)

    def __call__(self, time: float) -> AppliedLoads:
        """The loads at `time` in s."""
        stimulus = self._indenter
        if stimulus is None or self._press is None or not isinstance(stimulus.what, Indenter):
            loads = self._scene.loads_at(time)
            force = np.zeros(self._basis.shape) if not loads else loads[0].modal(self._basis)
            for load in loads[1:]:
                force = force + load.modal(self._basis)
            return AppliedLoads(force, contact_of(loads), loads)
        pose = stimulus.pose_at(time)
        if not pose.amount:
            return AppliedLoads(np.zeros(self._basis.shape), np.full(2, np.nan), ())
        self._last = found = stimulus.what.into(self._press, pose, self._last)
        bearing = found.forces > 0
        places = zip(found.points[bearing].tolist(), found.forces[bearing].tolist(), strict=True)
        loads = tuple(PointLoad(x, y, force) for (x, y), force in places)
        return AppliedLoads(found.modal, found.centre, loads)


_STEP = 1e-3  # s over which a rate is taken; less of a motion that is as fast


def survey(scene: Scene) -> Survey:
    """The survey of one repetition of `scene`, by which the sizes of effects are judged.

    Its readings have one unit.
    """
    basis = scene.basis
    layout = replace(scene.layout, gage_length=0.0)
    times = np.array(scene.survey_times)
    M = layout.operator(basis, scene.plate)
    pressing = LoadingHistory(scene, scene.plate)
    step = min([_STEP, *(np.diff(s.motion.moments).min() / 4 for s in scene.stimuli if s.motion)])
    pairs = [(pressing(t), pressing(t + step) if scene.moves else None) for t in times.tolist()]
    forces = np.array([now.force.ravel() for now, _ in pairs])
    later = np.array([(then or now).force.ravel() for now, then in pairs])
    # In turn, so that what stretches is sought from where it was.
    both = np.stack([forces, later], axis=1).reshape(-1, basis.size)
    c, then = shapes_under(scene.plate, basis, both).reshape(-1, 2, basis.size).swapaxes(0, 1)
    curvature = (c @ M.T).reshape(len(times), *layout.frame_shape)
    if scene.laid is not None:
        laid = [np.repeat(scene.laid.curvature(t), len(layout)) for t in times.tolist()]
        curvature = np.reshape(laid, curvature.shape)
    scan, read_after = scene.sensor().scan(), np.zeros(layout.channels)
    read_after[scan.channels] = scan.times
    return Survey(
        scene.plate,
        basis,
        layout,
        scene.transduction,
        times,
        forces,
        c,
        curvature,
        np.abs((then - c) @ M.T).max(axis=0) / step,
        scene.survey_duration,
        read_after,
    )
