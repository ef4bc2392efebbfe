"""What is in a scene: a skin, what touches it, and what spoils its readings."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from kappaskin.bases import Basis, SineBasis, basis_for
from kappaskin.calibration import Presentation, schedule
from kappaskin.effects import SECOND_GENERATION_LOOPS, ReadingEffect, Tolerance, UniformNoise
from kappaskin.errors import Refusal
from kappaskin.layout import SensorLayout
from kappaskin.mechanics import LineLoad, Load, Plate, PointLoad
from kappaskin.patch import Patch
from kappaskin.scene.motion import Motion, Orbit
from kappaskin.scene.stimulus import Stimulus
from kappaskin.sensor import Sensor
from kappaskin.transduction import Amplifier, Transduction

TABLE_1_NOISE = 0.40 / math.sqrt(3)
"""RMS of the noise of Table 1 in 1/m: uniform between -0.40 and 0.40."""


@dataclass(frozen=True, eq=False)
class Scene:
    """A simulated skin and what happens to it; `stimuli` and `effects` may be empty.

    `reference` is the number of functions (Ri, Rj) of the true shape: Table 1 defines its truth
    with 15 x 15, since the curvature under a point load grows with every further function. `edge`
    says how the skin is held, unless it is `laid` on one cylinder after the other instead.
    """

    name: str
    plate: Plate
    layout: SensorLayout
    stimuli: tuple[Stimulus, ...] = ()
    effects: tuple[ReadingEffect, ...] = ()
    transduction: Transduction = field(default_factory=Transduction)
    rate: float = 500.0
    seed: int = 0
    reference: tuple[int, int] = (15, 15)
    edge: str = "hinged"
    laid: Presentation | None = None

    def __post_init__(self) -> None:
        if self.laid and self.stimuli:
            raise Refusal(f"expected no loads on a skin that lies on cylinders, got {self.loads}")
        for stimulus in self.stimuli:
            self.plate.check(stimulus.load)
            for time in stimulus.motion.moments if stimulus.motion else ():
                if load := stimulus.load_at(time):
                    self.plate.check(load)

    @property
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
        return tuple(stimulus.load for stimulus in self.stimuli)

    def loads_at(self, time: float) -> tuple[Load, ...]:
        """The loads that press, where they are at `time` in s."""
        there = (stimulus.load_at(time) for stimulus in self.stimuli)
        return tuple(load for load in there if load is not None)

    @property
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


def _table_1(name: str, load: Load, displacement: float) -> Scene:
    patch = Patch(0.1, 0.1)
    plate = Plate(patch)
    load = scaled_to(plate, load, displacement, SineBasis(patch, 15, 15))
    layout = SensorLayout.regular(patch, 10, 10)
    return Scene(name, plate, layout, (Stimulus(load),), effects=(UniformNoise(TABLE_1_NOISE),))


def _circle() -> Scene:
    still = _table_1("circle", PointLoad(0.05, 0.05), 4.70e-3)
    return still.touched_by(*still.loads, motion=Orbit(radius=0.022, period=4.0))


def _calibration() -> Scene:
    """An uncalibrated second prototype, laid on the cylinders of a calibration, a second each."""
    patch = Patch(0.1, 0.1)
    return Scene(
        "calibration",
        Plate(patch),
        SensorLayout.regular(patch, 10, 10),
        effects=(
            SECOND_GENERATION_LOOPS,
            Tolerance(gain_sd=0.05, offset_sd=3.0),
            UniformNoise(TABLE_1_NOISE),
        ),
        # A third of the gain: the smallest cylinder bends twice as far as Table 1's skins read.
        transduction=Transduction(amplifier=Amplifier(gain=35.0)),
        laid=Presentation(schedule(), dwell=1.0),
    )


SCENES: dict[str, Callable[[], Scene]] = {
    "circle": _circle,
    "centre": lambda: _table_1("centre", PointLoad(0.05, 0.05), 4.70e-3),
    "off-centre": lambda: _table_1("off-centre", PointLoad(0.02, 0.08), 4.89e-3),
    "line": lambda: _table_1("line", LineLoad(0.01, 0.09, 0.09, 0.01), 4.68e-3),
    "calibration": _calibration,
}
"""Ready scenes by name: the paper's three load cases (Table 1), a load moving in a circle, and a
skin that is laid on the cylinders of a calibration (Figs. 7, 8)."""

DEFAULT_SCENE = "circle"


def load_scene(name: str = "") -> Scene:
    """The ready scene `name`, the default one when empty."""
    name = name or DEFAULT_SCENE
    if name not in SCENES:
        raise Refusal(f"expected a scene among {', '.join(SCENES)}; got {name!r}")
    return SCENES[name]()
