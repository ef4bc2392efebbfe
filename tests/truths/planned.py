"""How far readings move when a scene is simulated without one of its effects, beside the plan."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from kappaskin import (
    GaussianLoad,
    Patch,
    Plate,
    PointLoad,
    Scene,
    SensorLayout,
    Simulator,
    Transduction,
    load_scene,
)
from kappaskin.scenes import SCENES, EffectSelection, Orbit, plan
from kappaskin.scenes.effects import (
    EFFECTS,
    FIRST_GENERATION_LOOPS,
    SECOND_GENERATION_LOOPS,
    Creep,
    CrossTalk,
    FlickerNoise,
    GaussianNoise,
    IntermittentElements,
    MainsHum,
    StrainLimit,
    Temperature,
    Tolerance,
    UniformNoise,
)
from kappaskin.scenes.scene import survey
from kappaskin.scenes.stimulus import HoldStep, MotionPath, PressStep, ReleaseStep, TapStep
from kappaskin.sensing import Amplifier, HalfBridge

MOMENTS = 40
OFTEN = 0.4  # how often each effect is in a random scene


def without(scene: Scene, name: str) -> Scene:
    """The scene with all of its effects but one, before readings are rounded to counts."""
    return replace(scene, choice=EffectSelection(off=frozenset({name, "quantisation"})))


def readings(scene: Scene, times) -> np.ndarray:
    """The curvature (T, 3 P) in 1/m that is read at `times` in s."""
    simulator, scan = Simulator(scene), scene.sensor().scan()
    return np.array([simulator.reading(scan, time)[1] for time in times])


def moments(scene: Scene) -> np.ndarray:
    """Times all over the scene, none of them one of those that it was surveyed at."""
    length = scene.duration if scene.moves or scene.laid else 60.0
    return (np.arange(MOMENTS) + 0.37) * length / MOMENTS


def measured(scene: Scene) -> Iterator[tuple[str, float, float]]:
    """Each effect, the plan's error and what omitting it alone does, as shares of the peak."""
    times, peak = moments(scene), survey(scene).peak
    whole = readings(without(scene, "quantisation"), times)
    for entry in plan(scene):
        if entry.effect is None or entry.effect.authored or entry.name == "quantisation":
            continue
        change = readings(without(scene, entry.name), times) - whole
        yield entry.name, entry.size.error, float(np.abs(change).max()) / peak


def random_scene(rng: np.random.Generator) -> Scene:
    """A scene with one or two loads, moving or not, and any of the effects of any size."""
    a, b = rng.uniform(0.06, 0.15, 2)
    patch, there = Patch(a, b), lambda: rng.random() < OFTEN
    plate = Plate(
        patch,
        tension=there() * 10 ** rng.uniform(0, 2),
        foundation=there() * 10 ** rng.uniform(4, 6),
    )
    length = 3e-3 if there() else 0.0
    layout = replace(SensorLayout.regular(patch, 5, 4), gage_length=length)
    loads = [
        PointLoad(*(rng.uniform(0.35, 0.65, 2) * (a, b)), 10 ** rng.uniform(-2, 0)),
        GaussianLoad(*(rng.uniform(0.35, 0.65, 2) * (a, b)), 3e-3, 10 ** rng.uniform(-2, 0)),
    ]
    motions = (
        None,
        Orbit(rng.uniform(2e-3, 8e-3), 10 ** rng.uniform(-1, 1)),
        MotionPath((PressStep(0.3), HoldStep(1.0), ReleaseStep(0.2), HoldStep(0.5))),
        MotionPath((TapStep(10 ** rng.uniform(-1, 0), times=3),)),
    )
    loops = (FIRST_GENERATION_LOOPS, SECOND_GENERATION_LOOPS)[rng.integers(2)]
    rms = (10 ** rng.uniform(-2, 0.5, 4)).tolist()
    thick = Transduction(HalfBridge(substrate_thickness=8e-3))
    effects = (
        StrainLimit(thick, rng.uniform(0.05, 0.3)),
        replace(loops, asymmetry=rng.uniform(0.6, 1.7)),
        Creep(rng.uniform(0.02, 0.4), 10 ** rng.uniform(-1, 1)),
        Temperature(
            *(rng.uniform(-15, 15), 10 ** rng.uniform(-2, 2), rng.uniform(-0.5, 0.5)),
            spread=rng.uniform(0, 1),
            gain=rng.uniform(-2e-3, 2e-3),
            seed=int(rng.integers(99)),
            gradient_x=there() * rng.uniform(-20, 20),
        ),
        Tolerance(rng.uniform(0, 0.15), rng.uniform(0, 10), seed=int(rng.integers(99))),
        IntermittentElements((2, 7)),
        MainsHum(rms[0]),
        CrossTalk(rng.uniform(0, 0.5)),
        FlickerNoise(rms[1]),
        GaussianNoise(rms[2]),
        UniformNoise(rms[3]),
    )
    often = [0.15 if isinstance(e, IntermittentElements) else OFTEN for e in effects]
    often[7] = 0.8
    chosen = tuple(e for e, share in zip(effects, often, strict=True) if rng.random() < share)
    gain = rng.choice([500.0, 100.0, 1500.0])
    return Scene(
        *("random", plate, layout),
        effects=chosen,
        seed=int(rng.integers(2**31)),
        transduction=Transduction(amplifier=Amplifier(gain=gain)),
    ).touched_by(*loads[: rng.integers(1, 3)], motion=motions[rng.integers(4)])


def effects_table(scenes: int = 300) -> Iterator[str]:
    """The plan's errors over all ready scenes and so many random ones, as a table in Markdown."""
    rng = np.random.default_rng(27)
    every = [load_scene(name) for name in SCENES] + [random_scene(rng) for _ in range(scenes)]
    found: dict[str, list[tuple[float, float]]] = {name: [] for name in EFFECTS}
    for scene in every:
        for name, error, change in measured(scene):
            found[name].append((error, change))
    yield "| effect | scenes | exceeded | largest change / error | median |"
    yield "|---|---|---|---|---|"
    for name, pairs in found.items():
        ratios = [change / error for error, change in pairs if error > 0]
        exceeded = sum(change > error * (1 + 1e-6) + 1e-9 for error, change in pairs)
        if ratios:
            shares = f"{max(ratios):.2f} | {np.median(ratios):.2f}"
            yield f"| {name} | {len(pairs)} | {exceeded} | {shares} |"
