"""What spoils a reading; an empty list of effects spoils nothing."""

from kappaskin.effects.converter import Quantisation as Quantisation
from kappaskin.effects.converter import Saturation as Saturation
from kappaskin.effects.creep import Creep as Creep
from kappaskin.effects.cross_talk import CrossTalk as CrossTalk
from kappaskin.effects.effect import NOTHING as NOTHING
from kappaskin.effects.effect import Effect as Effect
from kappaskin.effects.effect import LayoutEffect as LayoutEffect
from kappaskin.effects.effect import ReadingEffect as ReadingEffect
from kappaskin.effects.effect import Running as Running
from kappaskin.effects.effect import Size as Size
from kappaskin.effects.effect import SkinEffect as SkinEffect
from kappaskin.effects.failures import DeadElements as DeadElements
from kappaskin.effects.failures import IntermittentElements as IntermittentElements
from kappaskin.effects.failures import StuckElements as StuckElements
from kappaskin.effects.finite_slope import FiniteSlope as FiniteSlope
from kappaskin.effects.flicker import FlickerNoise as FlickerNoise
from kappaskin.effects.gage_length import GageLength as GageLength
from kappaskin.effects.hum import MainsHum as MainsHum
from kappaskin.effects.hysteresis import FIRST_GENERATION_LOOPS as FIRST_GENERATION_LOOPS
from kappaskin.effects.hysteresis import SECOND_GENERATION_LOOPS as SECOND_GENERATION_LOOPS
from kappaskin.effects.hysteresis import Hysteresis as Hysteresis
from kappaskin.effects.link import CorruptedFrames as CorruptedFrames
from kappaskin.effects.link import DroppedFrames as DroppedFrames
from kappaskin.effects.noise import GaussianNoise as GaussianNoise
from kappaskin.effects.noise import UniformNoise as UniformNoise
from kappaskin.effects.parameters import Within as Within
from kappaskin.effects.parameters import parameters as parameters
from kappaskin.effects.skew import Skew as Skew
from kappaskin.effects.skin import Fluid as Fluid
from kappaskin.effects.skin import Foam as Foam
from kappaskin.effects.skin import Tension as Tension
from kappaskin.effects.strain_limit import StrainLimit as StrainLimit
from kappaskin.effects.survey import Survey as Survey
from kappaskin.effects.temperature import Temperature as Temperature
from kappaskin.effects.tolerance import Tolerance as Tolerance

_SKIN = (Tension, Foam, Fluid)
_GAGES = (
    *(FiniteSlope, GageLength, DeadElements),
    *(StrainLimit, Hysteresis, Creep, Temperature, Tolerance, IntermittentElements),
)
_ELECTRONICS = (
    *(MainsHum, Skew, CrossTalk, FlickerNoise, GaussianNoise, UniformNoise),
    *(Saturation, Quantisation, StuckElements),
)
_LINK = (DroppedFrames, CorruptedFrames)

EFFECTS: dict[str, type[Effect]] = {
    effect.name: effect for effect in (*_SKIN, *_GAGES, *_ELECTRONICS, *_LINK)
}
"""Every known effect by name, in the order in which they come about: in the skin, in its gages, in
the electronics, on the link."""
