"""What is in a scene: a skin, what touches it, and what spoils its readings."""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from kappaskin.bases import Basis, basis_for
from kappaskin.errors import Refusal
from kappaskin.mechanics import Load, Plate
from kappaskin.scenes.choice import LINEAR, Choice
from kappaskin.scenes.cylinders import Presentation
from kappaskin.scenes.effects.effect import Effect, ReadingEffect
from kappaskin.scenes.motion import Motion
from kappaskin.scenes.stimulus import Indenter, Stimulus
from kappaskin.sensing import Sensor, SensorLayout, Transduction


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
    transduction: Transduction = field(default_factory=Transduction)
    rate: float = 500.0
    seed: int = 0
    reference: tuple[int, int] = (15, 15)
    edge: str = "hinged"
    laid: Presentation | None = None
    choice: Choice = LINEAR
    title: str = ""
    text: str = ""

    def __post_init__(self) -> None:
        if self.laid and self.stimuli:
            raise Refusal(f"expected no loads on a skin that lies on cylinders, got {self.loads}")
        if self.seed < 0:
            raise Refusal(f"expected a seed of at least 0, got {self.seed}")
        names = [effect.name for effect in self.effects]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise Refusal(f"expected each effect once, got {', '.join(twice)} more than once")
        if self.indenter and len(self.stimuli) > 1:
            raise Refusal(
                f"expected a rigid object to press alone, got {len(self.stimuli)} stimuli; what "
                "else presses would bend the skin below it: take loads, or one object"
            )
        for stimulus in self.stimuli:
            stimulus.check(self.plate)

    @cached_property
    def basis(self) -> Basis:
        return basis_for(self.plate.patch, self.edge, *self.reference)

    def sensor(self) -> Sensor:
        """What the simulated device says it is."""
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
        """The same scene under other loads, all of which move as `motion` says."""
        return replace(self, stimuli=tuple(Stimulus(load, motion) for load in loads))

    def laid_on(self, laid: Presentation) -> "Scene":
        """The same skin laid on one cylinder after the other."""
        return replace(self, stimuli=(), laid=laid)

    @property
    def loads(self) -> tuple[Load, ...]:
        """The loads where they are before they move, pressing wholly."""
        each = (stimulus.what for stimulus in self.stimuli)
        return tuple(what for what in each if not isinstance(what, Indenter))

    @property
    def indenter(self) -> Stimulus | None:
        """The rigid object that presses, if one does."""
        return next((s for s in self.stimuli if isinstance(s.what, Indenter)), None)

    def loads_at(self, time: float) -> tuple[Load, ...]:
        """The loads that press, where they are at `time` in s."""
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


def scaled_to(plate: Plate, load: Load, displacement: float, basis: Basis) -> Load:
    """The load whose point of application moves by `displacement` in m."""
    compliance = plate.compliance(basis)
    at = float(basis.at(load.centre()[None])[0] @ compliance(load.modal(basis)).ravel())
    if not at / load.force > 1e-12 * np.max(compliance.values):
        raise Refusal(
            f"expected a load that moves the skin where it presses, got {load}; the edges are "
            "held, press further inside"
        )
    return load.scaled(displacement / at)
