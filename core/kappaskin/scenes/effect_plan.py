"""Plan of a simulation: which effects are needed for the requested accuracy, and why."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from kappaskin.scenes.effects import (
    EFFECTS,
    NOTHING,
    DeadElements,
    Effect,
    FiniteSlopeEffect,
    Fluid,
    Foam,
    GageLength,
    IntermittentElements,
    Quantisation,
    Saturation,
    Size,
    Skew,
    StatedNoise,
    StretchingEffect,
    Survey,
    Temperature,
    Tension,
)
from kappaskin.scenes.scene import EffectSelection, Scene, survey
from kappaskin.sensing import DigitalReadings


@dataclass(frozen=True)
class PlanEntry:
    """One effect in a plan: its size, whether it is `kept` (simulated), and why."""

    name: str
    size: Size
    kept: bool
    why: str
    effect: Effect | None = field(default=None, repr=False)

    def to_json(self) -> dict[str, Any]:
        return {
            "effect": self.name,
            "size": self.size.number,
            "formula": (self.effect or EFFECTS[self.name]).formula,
            "error": self.size.error,
            "kept": self.kept,
            "why": self.why,
        }


@dataclass(frozen=True)
class Plan:
    """What is simulated of a scene: an entry for every effect that is known.

    Those `kept` are in physical order.
    """

    entries: tuple[PlanEntry, ...]
    kept: tuple[Effect, ...]

    @property
    def left_out(self) -> float:
        """Error of a reading by all omitted effects, as a share of the peak."""
        return sum(entry.size.error for entry in self.entries if not entry.kept)

    def __iter__(self) -> Iterator[PlanEntry]:
        return iter(self.entries)


def effects_of(scene: Scene) -> dict[str, Effect]:
    """All effects in `scene`, by name, in physical order."""
    plate, layout = scene.plate, scene.layout
    there: list[Effect] = []
    if plate.tension and plate.rigidity:  # a drum head is no skin without its tension
        there.append(Tension(plate.tension))
    if plate.foundation:
        there.append(Foam(plate.foundation))
    if plate.fluid:
        there.append(Fluid())
    if plate.stretches and plate.thickness is not None:
        there.append(StretchingEffect(plate.thickness))
    if layout.gage_length:
        there.append(GageLength(layout.gage_length))
    if dead := tuple(layout.dead):
        there.append(DeadElements(dead))
    if layout.senses_curvature and not (any(plate.patch.curvatures) or scene.laid):
        there.append(FiniteSlopeEffect())
    electronics = scene.transduction
    if scene.moves and not isinstance(electronics, DigitalReadings):
        there.append(Skew())
    there += [
        effect.on(layout) if isinstance(effect, Temperature) else effect for effect in scene.effects
    ]
    if electronics.noise:
        stated = layout.stated(electronics.noise)
        noise = tuple(np.array(stated)[layout.kind[:: len(layout)]].tolist())
        there.append(StatedNoise(max(noise), noise))
    if not isinstance(electronics, DigitalReadings):
        there.append(Saturation(electronics))
    there.append(Quantisation(electronics))
    return {effect.name: effect for effect in there}


def plan(scene: Scene) -> Plan:
    """Plan of `scene` by its `choice`, with the size of every effect.

    Of readings that differ in unit, the largest share of a peak counts.
    """
    there, sizes = effects_of(scene), dict[str, Size]()
    for unit in dict.fromkeys(scene.layout.kind_units):
        part = replace(scene, layout=scene.layout.in_unit(unit))
        for name, size in _sizes(effects_of(part), survey(part)).items():
            sizes[name] = max(sizes.get(name, size), size, key=lambda each: each.error)
    reasons = _reasons(scene.choice, there, sizes)
    return Plan(
        tuple(
            PlanEntry(name, sizes[name], *reasons[name], there[name])
            if name in there
            else PlanEntry(name, NOTHING, False, "not in this scene")
            for name in dict.fromkeys((*EFFECTS, *there))
        ),
        tuple(effect for name, effect in there.items() if reasons[name][0]),
    )


def _sizes(there: dict[str, Effect], seen: Survey) -> dict[str, Size]:
    """The size of each effect in `there`, in physical order, among all the others.

    Whichever are left out, a reading that one of them changes is off by what those before it add
    at most, and what it changes is amplified by those after it.
    """
    sizes, carried = dict[str, Size](), 0.0
    for name, effect in there.items():
        sizes[name] = effect.size(replace(seen, carried=carried))
        carried += sizes[name].error * seen.peak
        if isinstance(effect, IntermittentElements):  # which drop to 0 from whatever they read
            carried += seen.most * seen.peak
    after = 1.0
    for name in reversed(sizes):
        sizes[name] = replace(sizes[name], error=after * sizes[name].error)
        after *= max(1.0, there[name].amplification(seen))
    return sizes


def _reasons(
    choice: EffectSelection, there: dict[str, Effect], sizes: dict[str, Size]
) -> dict[str, tuple[bool, str]]:
    """For each effect whether it is simulated, and why."""
    found, spent = dict[str, tuple[bool, str]](), 0.0
    for name in sorted(there, key=lambda name: sizes[name].error):
        error = sizes[name].error
        if there[name].authored:
            found[name] = True, "a failure in the scene"
        elif name in choice.on | choice.off:
            found[name] = name in choice.on, "as set in the scene"
        elif isinstance(there[name], StatedNoise):
            found[name] = True, "error bars rely on it"
        elif not choice.auto:
            found[name] = True, "the scene requests all effects"
        elif spent + error <= choice.accuracy:
            spent += error
            found[name] = (
                False,
                f"at most {_percent(error)} of the peak, {_percent(spent)} with smaller ones",
            )
        else:
            left = choice.accuracy - spent
            found[name] = (
                True,
                f"up to {_percent(error)} of the peak, where {_percent(left)} may be omitted",
            )
    return found


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %"


def kept_effects(scene: Scene) -> tuple[Effect, ...]:
    """The effects that `plan` keeps; without a survey of the scene where its choice needs none."""
    if scene.choice.auto:
        return plan(scene).kept
    there, off = effects_of(scene), scene.choice.off
    return tuple(effect for name, effect in there.items() if effect.authored or name not in off)


def planned(scene: Scene) -> Scene:
    """The scene with the effects that its plan keeps chosen by name: nothing is left to plan."""
    kept = {effect.name for effect in kept_effects(scene)}
    accuracy = scene.choice.accuracy
    return replace(scene, choice=EffectSelection(accuracy=accuracy, off=frozenset(EFFECTS) - kept))
