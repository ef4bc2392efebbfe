"""What a plan saves, and that it costs nothing itself: batches of readings, turn by turn."""

import time
from dataclasses import replace

import numpy as np
import pytest

from kappaskin import PointLoad, Simulator, load_scene
from kappaskin.scenes import SCENES, EffectSelection, kept_effects
from kappaskin.scenes.effect_plan import effects_of
from kappaskin.scenes.effects import EFFECTS

NONE = EffectSelection(off=frozenset(EFFECTS))


def reading(scene, frames):
    """Reads so many frames of the scene, one after the other."""
    simulator, scan = Simulator(scene), scene.sensor().scan()
    moments = ((np.arange(frames) + 0.5) * scene.duration / frames).tolist()

    def run() -> None:
        for moment in moments:
            simulator.reading(scan, moment)

    return run


def test_a_scene_without_effects_costs_little_more_than_the_bare_plate(
    medians, figure, ratio
) -> None:
    scene = replace(load_scene("circle"), choice=NONE)
    basis, compliance = scene.basis, scene.plate.compliance(scene.basis)
    M, times = scene.layout.operator(basis), (np.arange(1000) / 250).tolist()

    def bare() -> None:
        for moment in times:
            pose = scene.stimuli[0].pose_at(moment)
            load = scene.stimuli[0].what.shifted(pose.dx, pose.dy)
            assert isinstance(load, PointLoad)
            M @ compliance(load.modal(basis)).ravel()

    ours, theirs = medians(reading(scene, 1000), bare, turns=7, calls=1, clock=time.thread_time)

    figure(
        f"a scene without effects: {1e3 * ours:.0f} us a frame, {ours / theirs:.2f} times the bare "
        f"plate ({1e3 * theirs:.0f} us)"
    )
    ratio("a scene without effects, against the bare plate", ours / theirs, at_most=1.2)


@pytest.mark.parametrize("name", ["tapping", "hot-room", "failing-elements"])
def test_a_plan_costs_no_more_than_what_it_keeps(name, medians, figure, ratio) -> None:
    scene = load_scene(name)
    kept = frozenset(effect.name for effect in kept_effects(scene))
    alone = replace(scene, choice=EffectSelection(off=frozenset(EFFECTS) - kept))

    planned, direct = medians(
        reading(scene, 1000), reading(alone, 1000), turns=7, calls=1, clock=time.thread_time
    )

    figure(f"{name}: a frame as planned takes {planned / direct:.2f} times what it keeps")
    ratio(f"{name} as planned, against what is kept of it", planned / direct, at_most=1.15)


def test_on_the_ready_scenes_a_plan_saves_most_of_the_time(medians, figure, ratio) -> None:
    planned, everything = 0.0, 0.0
    for name in SCENES:
        scene = replace(load_scene(name), choice=EffectSelection(auto=True))
        every = replace(scene, choice=EffectSelection())
        auto, whole = medians(
            reading(scene, 60), reading(every, 60), turns=3, calls=1, clock=time.thread_time
        )
        planned, everything = planned + auto, everything + whole
        assert len(effects_of(scene)) >= len(kept_effects(scene))

    figure(
        f"the {len(SCENES)} ready scenes: everything that is in them costs "
        f"{everything / planned:.1f} times what is called for at 1 %"
    )
    ratio("ready scenes whole, against as planned", everything / planned, at_least=3)
