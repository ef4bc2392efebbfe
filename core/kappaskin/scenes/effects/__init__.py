"""Effects on readings: in the skin, its gages, the electronics and on the link."""

from inspect import isabstract

from kappaskin import _plugins
from kappaskin._schema import fields_of
from kappaskin.scenes.effects.effect import NOTHING as NOTHING
from kappaskin.scenes.effects.effect import Effect as Effect
from kappaskin.scenes.effects.effect import LayoutEffect as LayoutEffect
from kappaskin.scenes.effects.effect import ReadingEffect as ReadingEffect
from kappaskin.scenes.effects.effect import RunningEffect as RunningEffect
from kappaskin.scenes.effects.effect import Size as Size
from kappaskin.scenes.effects.effect import SkinEffect as SkinEffect
from kappaskin.scenes.effects.effect import Survey as Survey
from kappaskin.scenes.effects.electronics import CrossTalk as CrossTalk
from kappaskin.scenes.effects.electronics import FlickerNoise as FlickerNoise
from kappaskin.scenes.effects.electronics import GaussianNoise as GaussianNoise
from kappaskin.scenes.effects.electronics import MainsHum as MainsHum
from kappaskin.scenes.effects.electronics import Quantisation as Quantisation
from kappaskin.scenes.effects.electronics import Saturation as Saturation
from kappaskin.scenes.effects.electronics import Skew as Skew
from kappaskin.scenes.effects.electronics import StatedNoise as StatedNoise
from kappaskin.scenes.effects.electronics import UniformNoise as UniformNoise
from kappaskin.scenes.effects.failures import CorruptedFrames as CorruptedFrames
from kappaskin.scenes.effects.failures import DeadElements as DeadElements
from kappaskin.scenes.effects.failures import DroppedFrames as DroppedFrames
from kappaskin.scenes.effects.failures import IntermittentElements as IntermittentElements
from kappaskin.scenes.effects.failures import StuckElements as StuckElements
from kappaskin.scenes.effects.gages import FIRST_GENERATION_LOOPS as FIRST_GENERATION_LOOPS
from kappaskin.scenes.effects.gages import SECOND_GENERATION_LOOPS as SECOND_GENERATION_LOOPS
from kappaskin.scenes.effects.gages import Creep as Creep
from kappaskin.scenes.effects.gages import FiniteSlopeEffect as FiniteSlopeEffect
from kappaskin.scenes.effects.gages import GageLength as GageLength
from kappaskin.scenes.effects.gages import Hysteresis as Hysteresis
from kappaskin.scenes.effects.gages import StrainLimit as StrainLimit
from kappaskin.scenes.effects.gages import Temperature as Temperature
from kappaskin.scenes.effects.gages import Tolerance as Tolerance
from kappaskin.scenes.effects.skin import Fluid as Fluid
from kappaskin.scenes.effects.skin import Foam as Foam
from kappaskin.scenes.effects.skin import StretchingEffect as StretchingEffect
from kappaskin.scenes.effects.skin import Tension as Tension

_SKIN = (Tension, Foam, Fluid, StretchingEffect)
_GAGES = (
    *(FiniteSlopeEffect, GageLength, DeadElements),
    *(StrainLimit, Hysteresis, Creep, Temperature, Tolerance, IntermittentElements),
)
_ELECTRONICS = (
    *(MainsHum, Skew, CrossTalk, FlickerNoise, GaussianNoise, UniformNoise),
    *(Saturation, Quantisation, StuckElements),
)
_LINK = (DroppedFrames, CorruptedFrames)

_OURS = {effect.name for effect in (*_SKIN, *_GAGES, *_ELECTRONICS, *_LINK)}


def _check(name: str, made: object) -> None:
    """Raise a `TypeError` for what is no effect of this `name`."""
    if not (isinstance(made, type) and issubclass(made, Effect)) or isabstract(made):
        raise TypeError(f"expected a class of Effect with all its methods, got {made!r:.60}")
    if made.name != name or not made.formula:
        raise TypeError(f"expected the name {name!r} and a formula, got {made.name!r:.60}")
    if not set(made.example) <= set(fields_of(made)):
        raise TypeError(f"expected an example of its fields, got {made.example!r:.60}")


_PLUGGED = _plugins.plug_ins(_plugins.EFFECTS, _check, _OURS).values()

EFFECTS: dict[str, type[Effect]] = {
    effect.name: effect for effect in (*_SKIN, *_GAGES, *_PLUGGED, *_ELECTRONICS, *_LINK)
}
"""Every known effect by name, in the order in which they act: in the skin, in its gages, of
plug-ins, in the electronics, on the link."""
