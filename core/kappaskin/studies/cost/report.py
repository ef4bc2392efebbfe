"""Cost reports: JSON rows, tables, a plot, and the cheapest setting of a requested accuracy."""

import math
import re
import textwrap
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import chain, cycle, repeat
from pathlib import Path
from typing import Any

from kappaskin._files import write_whole
from kappaskin._text import ONE_SIGMA, printable, with_error
from kappaskin.errors import Refusal
from kappaskin.scenes import Scene
from kappaskin.studies.cost import (
    ALIKE,
    ALL,
    PRECISIONS,
    Cost,
    Refused,
    Setting,
    cheapest,
    frontier,
    own_elements,
)
from kappaskin.studies.cost.bench import DRAWS, FRAMES, EffectCost
from kappaskin.studies.figures import style

_HEAD = (
    f"   {'method':<14}{'basis':<6}{'elements':<9}{'bits':>4}{'channels':>12}{'set-up':>8}"
    f"{'frame':>7}{'/lstsq':>7}{'memory':>7}{'scan':>6}{'exact':>8}{'RMS':>7}"
    f"{'summed':>7}{'E at load':>15}\n"
    f"{'':48}{'ms':>8}{'us':>7}{'':>7}{'KiB':>7}{'ms':>6}{'mm':>8}{'mm':>7}{'mm':>7}{'mm':>15}"
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
    """One of `cost_rows`, without its place among the others."""
    setting = _setting(cost.setting)
    if isinstance(cost, Refused):
        return setting | dict.fromkeys(_FIGURES) | {"refused": cost.reason}
    return setting | {name: figure(cost) for name, figure in _FIGURES.items()} | {"refused": None}


def _in_mm(length: float | None) -> float | None:
    return None if length is None else 1e3 * length


_FIGURES: dict[str, Callable[[Cost], float | None]] = {
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
    "summed_e_exact_mm": lambda cost: _in_mm(cost.summed and cost.summed.e_exact),
    "summed_rms_exact_mm": lambda cost: _in_mm(cost.summed and cost.summed.rms_exact),
    "summed_e_mm": lambda cost: _in_mm(cost.summed and cost.summed.e),
    "summed_rms_mm": lambda cost: _in_mm(cost.summed and cost.summed.rms),
}


def cost_rows(scene: Scene, costs: Sequence[Cost | Refused]) -> list[dict[str, Any]]:
    """`costs` as JSON values; the figures of a refused setting are None, `refused` says why.

    `frontier` is whether no other row beats it in both `rms_mm` and `frame_s`, where errors that
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
    """The costs `found` of effects, with `setting`, as JSON values; `error` is the bound."""
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
    """The costs `found` of effects, with `setting`, as a table."""
    how = setting.method, "{} x {} functions".format(*setting.functions)
    lines = [
        f"What each effect costs in the scene {printable(scene.name)}, with {', '.join(how)}",
        "us      computing time that it adds to a simulated frame",
        "bound   largest change of a reading if it is omitted, as a share of the peak",
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
        return f"{marks} {_named(cost)}{_figures_text(cost)}"

    best = sorted({*by_frame, *by_total}, key=lambda cost: cost.time_per_frame)
    sections = {
        "No other setting beats these in both error and time": best,
        "The methods, on all of the scene's own elements": _methods(scene, costs),
        "Other elements, precision and fewer channels": _others(costs),
    }
    lines = [_intro(scene)]
    for title, shown in sections.items():
        lines += ["", title, _HEAD, *(line(cost) for cost in shown)]
    return "\n".join([*lines, "", _outro(costs)])


def _intro(scene: Scene) -> str:
    patch, each = scene.plate.patch, scene.transduction.channel_time
    name = printable(scene.name)
    return f"""\
What accuracy costs in the scene {name}: a {patch.name}, {1e6 * each:g} us per channel
frame   median from readings to coefficients, and over numpy.linalg.lstsq on the same operator
scan    conversion of the channels; set-up to the first answer, memory at its highest point
RMS     error over the skin, mean of {DRAWS} frames with the scene's noise; exact: without noise
summed  RMS with noise, where the skin's response is summed beyond the scene's functions
E       signed error at the load, mean +- standard deviation of those frames
* +     more accurate, by {100 * ALIKE:.0f} % at least, than all faster ones: *frame, +with scan"""


def _outro(costs: Sequence[Cost | Refused]) -> str:
    refused = Counter(cost.setting.method for cost in costs if isinstance(cost, Refused))
    text = f"{len(costs)} settings tried; --json prints them all."
    if refused:
        each = ", ".join(f"{method} {count}" for method, count in refused.items())
        text += f" Refused: {each}."
    return text


def _named(cost: Cost | Refused) -> str:
    s = cost.setting
    elements = "x".join(map(str, s.elements)) if s.elements else "own"
    return f"{s.method:<14}{'x'.join(map(str, s.functions)):<6}{elements:<9}{s.precision[-2:]:>4}"


def _figures_text(cost: Cost | Refused) -> str:
    if isinstance(cost, Refused):
        reason = textwrap.shorten(cost.reason, 66, placeholder="...")
        return f"  {cost.setting.scanned}: refused, {reason}"
    c = cost
    return (
        f"{f'{c.setting.scanned} {c.channels}':>12}{1e3 * c.setup_time:>8.2f}"
        f"{1e6 * c.time_per_frame:>7.0f}{c.ratio:>7.2f}{c.memory / 1024:>7.0f}"
        f"{1e3 * c.conversion_time:>6.2f}{_mm(c.rms_exact, 8)}{_mm(c.rms, 7)}"
        f"{_mm(c.summed.rms, 7) if c.summed else ' ' * 6 + '-'}"
        f"{f'{1e3 * c.e:+.3f} +-{1e3 * c.e_sd:.3f}':>15}"
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


# An accuracy that is asked for: the cheapest setting that reaches it, or what is missing

_UNITS = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "μm": 1e-6}


def parse_length(text: str) -> float:
    """Metres of a text such as 0.02mm, 20um or 2e-5m."""
    found = re.fullmatch(r"\s*([0-9.]+(?:e[-+]?[0-9]+)?)\s*(m|mm|[uµμ]m)\s*", text, re.ASCII | re.I)
    try:
        metres = float(found[1]) * _UNITS[found[2].lower()] if found else math.nan
    except ValueError:  # such as 1.2.3
        metres = math.nan
    if not 0 < metres < math.inf:
        raise Refusal(
            "expected an accuracy above zero with its unit, mm, um or m, such as 0.02mm; got "
            f"{text!r:.80}"
        )
    return metres


@dataclass(frozen=True)
class AccuracyVerdict:
    """Whether an accuracy is `reached`, the setting's `cost`, and the answer in `lines` of text.

    `cost` is that of the cheapest setting that reaches it; when none does, that of the most
    accurate one.
    """

    reached: bool
    cost: Cost | None
    lines: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """The verdict as JSON values."""
        return {
            "reached": self.reached,
            "setting": None if self.cost is None else row(self.cost),
            "said": list(self.lines),
        }


def accuracy_verdict(
    scene: Scene, costs: Sequence[Cost | Refused], within: float
) -> AccuracyVerdict:
    """Which of the `costs` measured on `scene` reaches an RMS error of `within` m most cheaply.

    Cheapest is the one whose answer is there first: conversion and arithmetic together.
    """
    found = cheapest(costs, within)
    if found is not None:
        lines = (f"{_mm_text(within)} is reached; in the least time with", *described(found))
        return AccuracyVerdict(True, found, (*lines, *_remarks(scene, costs, within, found)))
    known = [cost for cost in costs if isinstance(cost, Cost)]
    if not known:
        return AccuracyVerdict(False, None, ("No measured setting gives a shape.",))
    best = min(known, key=lambda cost: cost.errors.rms)
    line = f"{_mm_text(within)} is reached by none of {len(known)} settings; the nearest is"
    return AccuracyVerdict(False, best, (line, *described(best), *_missing(scene, known, within)))


def _mm_text(length: float) -> str:
    return f"{1e3 * length:.3g} mm"


def _s(time: float) -> str:
    return f"{1e6 * time:.3g} us" if time < 1e-3 else f"{1e3 * time:.3g} ms"


def elements_text(cost: Cost) -> str:
    """The elements of a cost, as 10 x 10, or their number where they are the scene's own."""
    return "{} x {}".format(*cost.setting.elements) if cost.setting.elements else f"{cost.count}"


def described(cost: Cost) -> tuple[str, ...]:
    """A setting and its figures, in three lines."""
    s, error = cost.setting, cost.errors
    scanned = f"{'all' if s.scanned == ALL else s.scanned + ','} {cost.channels} channels scanned"
    return (
        f"  {s.method}, {s.functions[0]} x {s.functions[1]} functions, {s.precision}, "
        f"{elements_text(cost)} elements, {scanned}",
        f"  RMS error {_mm_text(error.rms)}, {_mm_text(error.rms_exact)} without noise; at the "
        f"load {with_error(1e3 * error.e, 1e3 * cost.e_sd, 'mm', sign='+')} ({ONE_SIGMA})",
        f"  an estimate after {_s(cost.total_time)}: {_s(cost.conversion_time)} of conversion, "
        f"{_s(cost.time_per_frame)} of arithmetic",
    )


def _remarks(
    scene: Scene, costs: Sequence[Cost | Refused], within: float, found: Cost
) -> list[str]:
    """Remarks on the setting `found`: other elements than the scene's, too high a rate."""
    lines: list[str] = []
    own = own_elements(scene)
    if found.setting.elements != own:
        mine = [c for c in costs if isinstance(c, Cost) and c.setting.elements == own]
        with_mine = cheapest(mine, within)
        nearest = min(mine, key=lambda cost: cost.errors.rms, default=None)
        if with_mine is not None:
            lines += [
                "That is another sensor; with the scene's own elements",
                *described(with_mine),
            ]
        elif nearest is not None:
            lines += ["The scene's own elements do not reach it; nearest is", *described(nearest)]
    slowest = max(found.conversion_time, found.time_per_frame)
    if slowest * scene.rate > 1 + 1e-9:
        what, remedy = "computing a frame", "a faster computer"
        if found.conversion_time > found.time_per_frame:
            each = 1e6 / scene.rate / found.channels
            what, remedy = "a scan", f"a converter that takes {each:.3g} us per channel"
        lines.append(
            f"At the scene's {scene.rate:g} frames/s {what} may take {_s(1 / scene.rate)}, not "
            f"{_s(slowest)}: it needs {remedy}, or at most {1 / slowest:.0f} frames/s."
        )
    return lines


def _missing(scene: Scene, known: Sequence[Cost], within: float) -> list[str]:
    """What it would take to reach `within`, which none of `known` does."""
    whole = [cost for cost in known if cost.setting.scanned == ALL] or known
    able = [cost for cost in whole if cost.errors.rms_exact < within]
    if not able:
        least = min(whole, key=lambda cost: cost.errors.rms_exact)
        Ni, Nj = least.setting.functions
        return [
            "More functions are needed, and elements to distinguish them: without noise the error "
            f"is {_mm_text(least.errors.rms_exact)}",
            f"at best, with {Ni} x {Nj} functions on {elements_text(least)} elements. Neither a "
            "faster conversion nor more time helps.",
        ]
    cost = min(able, key=lambda cost: math.ceil(_times(cost, within)) * cost.total_time)
    (Ni, Nj), times = cost.setting.functions, _times(cost, within)
    frames = math.ceil(times)
    return [
        f"More readings are needed: without noise {Ni} x {Nj} functions on {elements_text(cost)} "
        f"elements reach {_mm_text(cost.errors.rms_exact)}. It takes {times:.2g} times as many:",
        f"  more elements: {_more_elements(scene, cost, times)}",
        f"  or more time: about {frames} frames averaged, {_s(frames * cost.total_time)} for an "
        "estimate, while the load is constant",
    ]


def _times(cost: Cost, within: float) -> float:
    """How many times the readings of `cost` bring its error down to `within`."""
    # Independent noise: its share of the error goes with 1 / sqrt(readings).
    error = cost.errors
    return (error.rms**2 - error.rms_exact**2) / (within**2 - error.rms_exact**2)


def _more_elements(scene: Scene, cost: Cost, times: float) -> str:
    if cost.setting.elements is None or scene.layout.patch.strip:
        count = math.ceil(cost.count * times)
        name = f"{count} elements"
    else:
        m, n = (math.ceil(along * math.sqrt(times)) for along in cost.setting.elements)
        count, name = m * n, f"{m} x {n} elements"
    allowed, now = (
        1 / scene.rate / (len(scene.layout.kinds) * count),
        scene.transduction.channel_time,
    )
    if allowed >= now:
        return f"about {name}, which the conversion allows at {scene.rate:g} frames/s"
    return (
        f"about {name}, at {scene.rate:g} frames/s with a conversion {now / allowed:.2g} times as "
        f"fast, {1e6 * allowed:.2g} us per channel"
    )


# The plot of error against time of every setting, and of those that no other beats

_COLOURS = (style.BLUE, style.GREY, style.FAINT, "#63a878", style.ORANGE, "#7a4b9a", "#3f9aa5",
            "#c9a227", "#c2487a")  # fmt: skip
_SIZES = (2.2, 3.4, 4.8, 6.0)  # of marks in points, by the number of elements
_PANEL = 70.0, 66.0  # mm
_LABEL, _APART = 22.5, 2.6  # mm: room for a label, and from one to the next


def check_plot(path: Path) -> None:
    """Refuse a `path` that a plot cannot be written to, before anything is measured."""
    if path.suffix.lower()[1:] not in style.KINDS:
        raise Refusal(
            f"{path}: expected a file that ends in {' or '.join(map('.{}'.format, style.KINDS))}"
        )
    if path.is_dir() or not path.parent.is_dir():
        raise Refusal(f"{path}: cannot be written (no such folder); choose another place")
    style.loaded()


def write_plot(path: Path, scene: Scene, costs: Sequence[Cost | Refused]) -> None:
    """Draw `costs` into the file `path`, as SVG or PNG by its ending."""
    check_plot(path)
    kind = path.suffix.lower()[1:]
    drawn = style.drawn(lambda figure: draw(figure, scene, costs), kind)
    write_whole(path, drawn[kind])


def draw(figure: style.Figure, scene: Scene, costs: Sequence[Cost | Refused]) -> None:
    """Arithmetic alone left, with the conversion right; `costs` as they were measured."""
    known = [cost for cost in costs if isinstance(cost, Cost)]
    # An answer of zero has an error as large as the shape.
    shown = [cost for cost in known if cost.rms < cost.shape_rms]
    if not shown:
        raise Refusal("expected a setting whose error is smaller than the shape, got none to draw")
    style.resize(figure, style.DOUBLE, 97)
    style.letter(figure, 1, 96, "a", "arithmetic of a frame")
    style.letter(figure, 92, 96, "b", "until the estimate, conversion included")
    panels = [style.place(figure, (left, 22, *_PANEL)) for left in (13, 103)]
    for axes, total in zip(panels, (False, True), strict=True):
        axes.set(xscale="log", yscale="log")
        _limit(axes, shown, total)
        _draw_panel(axes, shown, total)
        axes.set(xlabel="time per frame [ms]", ylabel="RMS error of the shape, with noise [mm]")
    style.key(figure, panels[0], 9.5)
    more = len(known) - len(shown)
    for y, text in (
        (4.8, f"scene {scene.name}; line: no other setting beats these in both; "
              "its labels: functions on elements"),
        (1.8, "larger: more elements; hollow: not all channels scanned"
              + (f"; left out: {more} with errors above the shape itself" if more else "")),
    ):  # fmt: skip
        style.write(figure, style.DOUBLE / 2, y, text, color=style.FAINT, ha="center",
                    va="center", size=6.5)  # fmt: skip


def _draw_panel(axes: style.Axes, costs: Sequence[Cost], total: bool) -> None:
    methods = list(dict.fromkeys(cost.setting.method for cost in costs))
    colours = dict(zip(methods, cycle(_COLOURS), strict=False))
    counts = sorted({cost.count for cost in costs})
    sizes = dict(zip(counts, chain(_SIZES, repeat(_SIZES[-1])), strict=False))
    best = frontier(costs, total)
    for method in methods:
        axes.plot([], [], "o", color=colours[method], label=method)
    for cost in costs:
        colour = colours[cost.setting.method]
        look = {
            "mfc": colour if cost.setting.scanned == ALL else "white",
            "mec": colour,
            "mew": 0.6,
        }
        if cost in best:
            look |= {"mew": 1.2, "zorder": 4}
        axes.plot(1e3 * cost.time(total), 1e3 * cost.rms, "o", ms=sizes[cost.count], **look)
    _draw_frontier(axes, best, total, colours)


def _limit(axes: style.Axes, costs: Sequence[Cost], total: bool) -> None:
    """Show all `costs`, with room for a label left of the fastest and below the most accurate."""
    x = [1e3 * cost.time(total) for cost in costs]
    y = [1e3 * cost.rms for cost in costs]
    right = 1.4 * max(x)
    left = min(x) * (min(x) / right) ** (_LABEL / (_PANEL[0] - _LABEL))
    axes.set(xlim=(left, right), ylim=(min(y) / 1.7, max(y) * 1.3))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter("{x:g}")


def _draw_frontier(
    axes: style.Axes, best: Sequence[Cost], total: bool, colours: dict[str, str]
) -> None:
    x = [1e3 * cost.time(total) for cost in best]
    y = [1e3 * cost.rms for cost in best]
    right, top = axes.get_xlim()[1], axes.get_ylim()[1]
    axes.plot([x[0], *x, right], [top, *y, y[-1]], drawstyle="steps-post", color=style.INK, lw=0.7,
              zorder=3)  # fmt: skip
    low, high = axes.get_ylim()
    last = -math.inf
    for cost, at, error in reversed(list(zip(best, x, y, strict=True))):
        height = math.log(error / low) / math.log(high / low) * _PANEL[1]
        if height - last < _APART:
            continue  # its label would stand on that of a more accurate one
        last = height
        axes.annotate(_label(cost), (at, error), (-3.5, -1.5), textcoords="offset points",
                      color=colours[cost.setting.method], size=6, ha="right", va="top")  # fmt: skip


def _label(cost: Cost) -> str:
    """Functions on elements, and which of them are scanned where not all are."""
    functions = "×".join(map(str, cost.setting.functions))
    elements = "×".join(map(str, cost.setting.elements or (cost.count,)))
    part = "" if cost.setting.scanned == ALL else f", {cost.setting.scanned}"
    return f"{functions} on {elements}{part}"
