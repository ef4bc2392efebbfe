"""The plot of error against time of every setting, and of those that no other beats."""

import math
from collections.abc import Sequence
from itertools import chain, cycle, repeat
from pathlib import Path

from kappaskin.errors import Refusal
from kappaskin.scenes import Scene
from kappaskin.studies.cost.settings import ALL, Cost, Refused, frontier
from kappaskin.studies.figures import style

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
    try:
        path.write_bytes(drawn[kind])
    except OSError as error:
        raise Refusal(f"{path}: cannot be written ({error}); choose another place") from error


def draw(figure: style.Figure, scene: Scene, costs: Sequence[Cost | Refused]) -> None:
    """Arithmetic alone left, with the conversion right; `costs` as they were measured."""
    known = [cost for cost in costs if isinstance(cost, Cost)]
    # An answer of zero has an error as large as the shape.
    shown = [cost for cost in known if cost.rms < cost.shape_rms]
    if not shown:
        raise Refusal("expected a setting whose error is smaller than the shape, got none to draw")
    style.resize(figure, style.DOUBLE, 97)
    style.letter(figure, 1, 96, "a", "arithmetic of a frame")
    style.letter(figure, 92, 96, "b", "until the answer is there, conversion included")
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


def _time(cost: Cost, total: bool) -> float:
    """In ms."""
    return 1e3 * (cost.total_time if total else cost.time_per_frame)


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
        axes.plot(_time(cost, total), 1e3 * cost.rms, "o", ms=sizes[cost.count], **look)
    _draw_frontier(axes, best, total, colours)


def _limit(axes: style.Axes, costs: Sequence[Cost], total: bool) -> None:
    """Show all `costs`, with room for a label left of the fastest and below the most accurate."""
    x = [_time(cost, total) for cost in costs]
    y = [1e3 * cost.rms for cost in costs]
    right = 1.4 * max(x)
    left = min(x) * (min(x) / right) ** (_LABEL / (_PANEL[0] - _LABEL))
    axes.set(xlim=(left, right), ylim=(min(y) / 1.7, max(y) * 1.3))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter("{x:g}")


def _draw_frontier(
    axes: style.Axes, best: Sequence[Cost], total: bool, colours: dict[str, str]
) -> None:
    x = [_time(cost, total) for cost in best]
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
