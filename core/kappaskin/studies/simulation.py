"""Simulated scenes: readings with the truth, and the time that each effect takes."""

import json
import math
import statistics
import textwrap
import time
from collections.abc import Callable, Generator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kappaskin._text import printable
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.mechanics import Plate
from kappaskin.scenes import EffectSelection, Plan, Scene, Simulator, plan
from kappaskin.scenes.effects import EFFECTS, ReadingEffect
from kappaskin.skin import Cap, Disk, MeshSkin, Polygon

_MOST = 10_000_000  # readings: 80 MB for each array of them


def simulated_readings(
    scene: Scene, frames: int, seed: int | None = None
) -> dict[str, NDArray[Any]]:
    """Frames of `scene`: what `kappaskin simulate` writes, each array (T, ...).

    A frame that the link loses is NaN in `curvature` and -1 in `counts`, on all its channels. Of a
    sensor that reads other than xx, yy and xy the readings are `values`, each of an `element`, a
    `quantity` and a `direction`. `kappaskin reconstruct` reads the file, forces included.
    """
    layout, skin = scene.layout, scene.plate.patch
    C, shape = layout.channels, layout.frame_shape
    if not 1 <= frames <= _MOST // C:
        raise Refusal(f"expected 1 to {_MOST // C} frames of {C} channels, got {frames}")
    scene = scene if seed is None else replace(scene, seed=seed)
    simulator, scan = Simulator(scene), scene.sensor().scan()
    time = np.arange(frames) / scene.rate
    curvature = np.full((frames, C), np.nan)
    counts = np.full((frames, C), -1, np.int32)
    truth = np.full((frames, *scene.basis.shape), np.nan)
    contact = np.full((frames, 2), np.nan)
    for n, moment in enumerate(time.tolist()):
        true, reading = simulator.reading(scan, moment)
        if true is not None:
            truth[n], contact[n] = true.coefficients, true.contact
        if not simulator.failure(n):
            curvature[n] = reading
            counts[n] = scene.transduction.counts(reading)
    places = layout.positions
    read: dict[str, NDArray[Any]] = {"curvature": curvature.reshape(frames, *shape)}
    if layout.reads:
        own = layout.reads
        read = {"values": curvature, "element": own.element, "quantity": own.quantity}
        read["direction"] = own.direction
    if layout.gage_length:
        read["gage_length"] = np.array(layout.gage_length)
    if any(layout.cell):
        read["cell"] = np.array(layout.cell)
    if (sigma := scene.sensor().sigma) is not None:
        read["sigma"] = sigma
    return {
        "counts": counts.reshape(frames, *shape),
        **read,
        "truth": truth,
        "time": time,
        "contact": contact,
        "plan": np.array(json.dumps([entry.to_json() for entry in plan(scene)])),
        "positions": places[:, :1] if skin.strip else places,
        **_skin(scene.plate),
    }


def _skin(plate: Plate) -> dict[str, NDArray[Any]]:
    """Size, shape and stiffness of a skin, as `kappaskin reconstruct` reads them."""
    skin = plate.patch
    values: dict[str, Any] = {
        "size": (skin.a,) if skin.strip else (skin.a, skin.b),
        "radius": skin.radius,
        "rigidity": plate.rigidity,
        "thickness": plate.sheet_thickness,
        "poisson": plate.poisson,
        "inplane": plate.inplane or None,
    }
    match skin:
        case Cap():
            values |= {"angle": skin.angle, "stretch": skin.stretch}
        case Disk():
            values["outline"] = skin.rim_radius
        case MeshSkin():
            values |= {"size": None, "radius": None, "mesh": skin.text}
        case Polygon():
            values["outline"] = skin.vertices
        case _:
            pass
    return {name: np.array(value) for name, value in values.items() if value is not None}


# Computing time of each effect per frame, measured here, with its entry in the plan

_TURNS, _FRAMES, _LEAST = 7, 40, 4  # turns, and frames of each: usually, and at least
_TURN = 0.02  # s that the frames of one turn may take


def _only(scene: Scene, *names: str) -> Scene:
    """The scene with these effects alone."""
    return replace(scene, choice=EffectSelection(off=frozenset(EFFECTS) - set(names)))


def _frame(scene: Scene, *names: str) -> Callable[[float], object]:
    simulator, scan = Simulator(_only(scene, *names)), scene.sensor().scan()
    return lambda moment: simulator.reading(scan, moment)


def _running(curvature: Array, effect: ReadingEffect) -> Callable[[float], object]:
    """The effect at work on readings `curvature` (k, P), k of each element."""
    running = effect.start(curvature.shape, np.random.default_rng(0))
    return lambda moment: running(curvature, moment)


def _seconds(run: Callable[[float], object], moments: list[float]) -> float:
    """Seconds that a call took, on average over `moments`."""
    start = time.perf_counter()
    for moment in moments:
        run(moment)
    return (time.perf_counter() - start) / len(moments)


def costs_of(scene: Scene, plan: Plan) -> dict[str, float]:
    """Seconds per frame that each effect of the plan adds to the bare plate: medians, in turn.

    Frames follow one another, or where so few can be afforded, lie evenly over the scene.
    """
    bare = Simulator(_only(scene))
    _, curvature = bare.reading(scene.sensor().scan(), 0.0)
    curvature = curvature.reshape(-1, len(scene.layout))  # by reading and element
    runs = {"": _frame(scene)}
    for entry in plan:
        if isinstance(entry.effect, ReadingEffect):
            runs[entry.name] = _running(curvature, entry.effect)
        elif entry.effect is not None:
            runs[entry.name] = _frame(scene, entry.name)
    once = _seconds(runs[""], [scene.duration * n / _LEAST for n in range(_LEAST)])
    frames = min(max(int(_TURN / once), _LEAST), _FRAMES)
    step = max(1 / scene.rate, scene.duration / (_TURNS * frames) if frames < _FRAMES else 0.0)
    taken = {name: list[float]() for name in runs}
    for turn in range(_TURNS):
        moments = [(turn * frames + n) * step for n in range(frames)]
        for name, run in runs.items():
            taken[name].append(_seconds(run, moments))
    median = {name: statistics.median(times) for name, times in taken.items()}
    alone = {e.name for e in plan if isinstance(e.effect, ReadingEffect)}
    whole = median.pop("")
    return {name: own if name in alone else max(own - whole, 0.0) for name, own in median.items()}


def plan_updates(scene: Scene) -> Generator[list[dict[str, Any]]]:
    """One row for every known effect: its entry in the plan, and `microseconds` per frame.

    That is None for an effect that the scene has nothing of. The rows come twice: at once, with NaN
    for times that are not measured yet, and then with all.
    """
    made = plan(scene)
    yield _rows(made, {entry.name: math.nan for entry in made if entry.effect is not None})
    yield _rows(made, costs_of(scene, made))


def _rows(plan: Plan, costs: dict[str, float]) -> list[dict[str, Any]]:
    """The entries of a plan with what their effects cost, in s per frame, where they are there."""
    return [
        entry.to_json() | {"microseconds": 1e6 * costs[entry.name] if entry.name in costs else None}
        for entry in plan
    ]


def plan_rows(scene: Scene) -> list[dict[str, Any]]:
    """The rows of `plan_updates` with all times."""
    *_, rows = plan_updates(scene)
    return rows


def plan_text(scene: Scene, rows: list[dict[str, Any]]) -> str:
    """The rows of `plan_rows` for people, those of the scene first."""
    there = [row for row in rows if row["microseconds"] is not None]
    read = " or ".join(dict.fromkeys(name for name, _ in scene.layout.kinds))
    if not scene.layout.reads:
        read = "curvature"
    lines = [
        f"{printable(scene.title)}: errors as shares of the peak {read}, of which "
        f"{scene.choice.accuracy:.2g} may be omitted",
        "",
        f"{'effect':<18}{'size':>9}{'error':>9}{'us':>7}  kept  why",
    ]
    for row in there:
        lines += [
            f"{row['effect']:<18}{row['size']:>9.2g}{row['error']:>9.2g}"
            f"{row['microseconds']:>7.1f}  {'yes' if row['kept'] else 'no':<5} {row['why']}",
            f"{'':<18}size: {row['formula']}",
        ]
    absent = ", ".join(row["effect"] for row in rows if row["microseconds"] is None)
    return "\n".join([*lines, "", *textwrap.wrap(f"Not in this scene: {absent}.", 100)])
