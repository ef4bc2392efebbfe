"""Costs as rows for a program and as a table for people."""

import textwrap
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

from kappaskin.scenes import Scene
from kappaskin.studies.cost.bench import DRAWS
from kappaskin.studies.cost.choice import ALIKE, frontier
from kappaskin.studies.cost.effects import FRAMES, EffectCost
from kappaskin.studies.cost.setting import ALL, PRECISIONS, Cost, Refused, Setting, own_elements

_HEAD = (
    f"   {'method':<14}{'basis':<6}{'elements':<9}{'bits':>4}{'channels':>12}{'set-up':>8}"
    f"{'frame':>7}{'/lstsq':>7}{'memory':>7}{'scan':>6}{'exact':>9}{'RMS':>8}{'E at load':>16}\n"
    f"{'':48}{'ms':>8}{'us':>7}{'':>7}{'KiB':>7}{'ms':>6}{'mm':>9}{'mm':>8}{'mm':>16}"
)


def _setting(s: Setting) -> dict[str, Any]:
    return {
        "method": s.method,
        "functions": list(s.functions),
        "elements": list(s.elements) if s.elements else None,
        "precision": s.precision,
        "scanned": s.scanned,
    }


def row(cost: Cost | Refused) -> dict[str, Any]:
    """One of `rows`, without its place among the others."""
    told = _setting(cost.setting)
    if isinstance(cost, Refused):
        return told | dict.fromkeys(_FIGURES) | {"refused": cost.reason}
    return told | {name: figure(cost) for name, figure in _FIGURES.items()} | {"refused": None}


_FIGURES: dict[str, Callable[[Cost], float]] = {
    "element_count": lambda cost: cost.count,
    "channels": lambda cost: cost.channels,
    "setup_s": lambda cost: cost.setup_time,
    "frame_s": lambda cost: cost.time_per_frame,
    "lstsq_s": lambda cost: cost.lstsq_time,
    "ratio_to_lstsq": lambda cost: cost.ratio,
    "conversion_s": lambda cost: cost.conversion_time,
    "total_s": lambda cost: cost.total_time,
    "memory_bytes": lambda cost: cost.memory,
    "e_exact_mm": lambda cost: 1e3 * cost.e_exact,
    "rms_exact_mm": lambda cost: 1e3 * cost.rms_exact,
    "e_mm": lambda cost: 1e3 * cost.e,
    "e_sd_mm": lambda cost: 1e3 * cost.e_sd,
    "rms_mm": lambda cost: 1e3 * cost.rms,
    "shape_rms_mm": lambda cost: 1e3 * cost.shape_rms,
}


def rows(scene: Scene, costs: Sequence[Cost | Refused]) -> list[dict[str, Any]]:
    """`costs` as JSON values; the figures of a refused setting are None, `refused` says why.

    `frontier` says whether no other row beats it in both `rms_mm` and `frame_s`, where errors that
    are `ALIKE` count as equal, `frontier_total` the same of `total_s`; `exact` stands for readings
    without noise.
    """
    by_frame, by_total = frontier(costs), frontier(costs, total=True)
    return [
        {"scene": scene.name}
        | row(cost)
        | {"frontier": cost in by_frame, "frontier_total": cost in by_total}
        for cost in costs
    ]


def effect_rows(
    scene: Scene, setting: Setting, found: Sequence[EffectCost]
) -> list[dict[str, Any]]:
    """What was `found` of effects, with `setting`, as JSON values; `error` is the bound."""
    return [
        {"scene": scene.name, "effect": cost.name, "kept": cost.kept}
        | _setting(setting)
        | {
            "microseconds": 1e6 * cost.time_per_frame,
            "error": cost.bound,
            "rms_with_mm": None if cost.rms_with is None else 1e3 * cost.rms_with,
            "rms_without_mm": None if cost.rms_without is None else 1e3 * cost.rms_without,
        }
        for cost in found
    ]


def effects_text(scene: Scene, setting: Setting, found: Sequence[EffectCost]) -> str:
    """What was `found` of effects, with `setting`, for people."""
    said = setting.method, "{} x {} functions".format(*setting.functions)
    lines = [
        f"What each effect costs in the scene {scene.name}, with {', '.join(said)}",
        "us      what it adds to simulating a frame",
        "bound   by how much leaving it out changes a reading at most, as a share of the peak",
        f"RMS     error over the skin, mean of {FRAMES} frames all over the scene",
        "",
        f"{'effect':<18}{'kept':<5}{'us':>8}{'bound':>10}{'RMS with':>12}{'without it':>12}",
        f"{'':<41}{'mm':>12}{'mm':>12}",
    ]
    for cost in found:
        rms = (cost.rms_with, cost.rms_without)
        bound = "-" if cost.bound is None else f"{cost.bound:.2g}"
        with_it, without = ("-" if each is None else f"{1e3 * each:.3g}" for each in rms)
        lines.append(
            f"{cost.name:<18}{'yes' if cost.kept else 'no':<5}{1e6 * cost.time_per_frame:>8.1f}"
            f"{bound:>10}{with_it:>12}{without:>12}"
        )
    return "\n".join(lines)


def costs_text(scene: Scene, costs: Sequence[Cost | Refused]) -> str:
    """The settings that no other beats, then the methods, then what else a setting changes."""
    by_frame, by_total = frontier(costs), frontier(costs, total=True)

    def line(cost: Cost | Refused) -> str:
        marks = ("*" if cost in by_frame else " ") + ("+" if cost in by_total else " ")
        return f"{marks} {_named(cost)}{_told(cost)}"

    best = sorted({*by_frame, *by_total}, key=lambda cost: cost.time_per_frame)
    sections = {
        "No other setting beats these in both error and time": best,
        "The methods, on all of the scene's own elements": _methods(scene, costs),
        "What elements, precision and fewer channels change": _others(costs),
    }
    lines = [_intro(scene)]
    for title, shown in sections.items():
        lines += ["", title, _HEAD, *(line(cost) for cost in shown)]
    return "\n".join([*lines, "", _outro(costs)])


def _intro(scene: Scene) -> str:
    patch, each = scene.plate.patch, scene.transduction.channel_time
    return f"""\
What accuracy costs in the scene {scene.name}: a {patch.name}, {1e6 * each:g} us per channel
frame   median from readings to coefficients, and over numpy.linalg.lstsq on the same operator
scan    conversion of the channels; set-up to the first answer, memory at its highest point
RMS     error over the skin, mean of {DRAWS} frames with the scene's noise; exact: without noise
E       signed error at the load, mean +- standard deviation of those frames
* +     more accurate, by {100 * ALIKE:.0f} % at least, than all faster ones: *frame, +with scan"""


def _outro(costs: Sequence[Cost | Refused]) -> str:
    refused = Counter(cost.setting.method for cost in costs if isinstance(cost, Refused))
    said = f"{len(costs)} settings tried; --json prints them all."
    if refused:
        each = ", ".join(f"{method} {count}" for method, count in refused.items())
        said += f" Refused: {each}."
    return said


def _named(cost: Cost | Refused) -> str:
    s = cost.setting
    elements = "x".join(map(str, s.elements)) if s.elements else "own"
    return f"{s.method:<14}{'x'.join(map(str, s.functions)):<6}{elements:<9}{s.precision[-2:]:>4}"


def _told(cost: Cost | Refused) -> str:
    if isinstance(cost, Refused):
        reason = textwrap.shorten(cost.reason, 66, placeholder="...")
        return f"  {cost.setting.scanned}: refused, {reason}"
    c = cost
    return (
        f"{f'{c.setting.scanned} {c.channels}':>12}{1e3 * c.setup_time:>8.2f}"
        f"{1e6 * c.time_per_frame:>7.0f}{c.ratio:>7.2f}{c.memory / 1024:>7.0f}"
        f"{1e3 * c.conversion_time:>6.2f}{_mm(c.rms_exact, 9)}{_mm(c.rms, 8)}"
        f"{f'{1e3 * c.e:+.3f} +-{1e3 * c.e_sd:.3f}':>16}"
    )


def _mm(length: float, width: int) -> str:
    mm = 1e3 * length
    return f"{mm:>{width}.4f}" if mm < 100 else f"{mm:>{width}.3g}"


def _methods(scene: Scene, costs: Sequence[Cost | Refused]) -> list[Cost | Refused]:
    """Every method and number of functions, on everything that the scene has, in float64."""
    chosen = [
        cost
        for cost in costs
        if (cost.setting.elements, cost.setting.precision, cost.setting.scanned)
        == (own_elements(scene), PRECISIONS[0], ALL)
    ]
    methods = [cost.setting.method for cost in chosen]
    return sorted(chosen, key=lambda cost: methods.index(cost.setting.method))


def _others(costs: Sequence[Cost | Refused]) -> list[Cost | Refused]:
    """The first method with the most functions that are seldom refused, on all there is."""
    if not costs:
        return []
    method = costs[0].setting.method
    its = [cost for cost in costs if cost.setting.method == method]
    refused = Counter(c.setting.functions for c in its if isinstance(c, Refused))
    functions = min((c.setting.functions for c in its), key=lambda N: (refused[N], -N[0]))
    return [cost for cost in its if cost.setting.functions == functions]
