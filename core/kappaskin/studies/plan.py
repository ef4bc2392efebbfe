"""What each effect of a scene costs per frame, measured here, beside its place in the plan."""

import statistics
import textwrap
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from kappaskin.effects import EFFECTS, ReadingEffect
from kappaskin.scene import Choice, Plan, Scene, plan
from kappaskin.simulate import Simulator

_TURNS, _FRAMES = 7, 40


def _only(scene: Scene, *names: str) -> Scene:
    """The scene with these effects alone."""
    return replace(scene, choice=Choice(off=frozenset(EFFECTS) - set(names)))


def _frame(scene: Scene, *names: str) -> Callable[[float], object]:
    simulator, scan = Simulator(_only(scene, *names)), scene.sensor().scan()
    return lambda moment: simulator.reading(scan, moment)


def _running(scene: Scene, effect: ReadingEffect) -> Callable[[float], object]:
    """The effect at work on the readings of the scene as it begins."""
    bare = Simulator(_only(scene))
    _, curvature = bare.reading(scene.sensor().scan(), 0.0)
    running = effect.start(curvature.shape, np.random.default_rng(0))
    return lambda moment: running(curvature, moment)


def costs_of(scene: Scene, plan: Plan) -> dict[str, float]:
    """Seconds per frame that each effect there is adds to the bare plate: medians, in turn."""
    runs = {"": _frame(scene)}
    for entry in plan:
        if isinstance(entry.effect, ReadingEffect):
            runs[entry.name] = _running(scene, entry.effect)
        elif entry.effect is not None:
            runs[entry.name] = _frame(scene, entry.name)
    taken = {name: list[float]() for name in runs}
    for turn in range(_TURNS):
        moments = [(turn * _FRAMES + n) / scene.rate for n in range(_FRAMES)]
        for name, run in runs.items():
            start = time.perf_counter()
            for moment in moments:
                run(moment)
            taken[name].append((time.perf_counter() - start) / _FRAMES)
    median = {name: statistics.median(times) for name, times in taken.items()}
    bare = median.pop("")
    alone = {e.name for e in plan if isinstance(e.effect, ReadingEffect)}
    return {name: own if name in alone else max(own - bare, 0.0) for name, own in median.items()}


def plan_rows(scene: Scene) -> list[dict[str, Any]]:
    """One row for every known effect: its entry in the plan, and `microseconds` per frame.

    That is None for an effect that there is nothing of in the scene.
    """
    made = plan(scene)
    costs = costs_of(scene, made)
    return [
        entry.to_json() | {"microseconds": 1e6 * costs[entry.name] if entry.name in costs else None}
        for entry in made
    ]


def plan_text(scene: Scene, rows: list[dict[str, Any]]) -> str:
    """The rows of `plan_rows` for people, those of the scene first."""
    there = [row for row in rows if row["microseconds"] is not None]
    lines = [
        f"{scene.title}: errors as shares of the peak curvature, of which "
        f"{scene.choice.accuracy:.2g} may be left out",
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
