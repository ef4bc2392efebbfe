"""A design study's measures against the first thing that it varies, with their intervals."""

import io
import math
from collections.abc import Sequence
from itertools import cycle
from typing import Any

from kappaskin.studies.design.known import Known
from kappaskin.studies.design.measures import MEASURES
from kappaskin.studies.design.study import Study
from kappaskin.studies.design.table import value_text
from kappaskin.studies.design.vary import Axis
from kappaskin.studies.figures import style
from kappaskin.studies.figures.registry import KINDS

_COLOURS = (style.BLUE, style.ORANGE, "#63a878", "#7a4b9a", "#c9a227", "#3f9aa5", "#c2487a",
            style.FAINT, style.GREY)  # fmt: skip
_PANEL = (18.0, 14.0, 92.0, 62.0)  # mm: left, bottom, width, height
_ALONE = 150.0  # mm: the width of one without names of curves beside it
_WIDE = 20.0  # from the least to the largest by such a factor: shown by factors
_LONGEST = 44  # characters of the name of a curve


def draw_study(study: Study, known: Sequence[Known]) -> dict[str, str]:
    """The SVG of a figure for every measure, by its name; none where nothing is varied."""
    drawn = dict[str, str]()
    for name in study.measures if study.axes else ():
        made = io.StringIO()
        with style.sheet() as figure:
            _draw(figure, study, known, name)
            figure.savefig(made, format="svg", metadata=KINDS["svg"])
        drawn[name] = made.getvalue()
    return drawn


def _draw(figure: style.Figure, study: Study, known: Sequence[Known], name: str) -> None:
    style.resize(figure, style.DOUBLE, 80)
    (first, *others), measure = study.axes, MEASURES[name]
    left, bottom, width, height = _PANEL
    axes = style.place(figure, (left, bottom, width if others else _ALONE, height))
    along = [next(iter(values.values())) for values in first]
    x = [float(value) if _is_number(value) else at for at, value in enumerate(along)]
    line = "" if any(isinstance(value, str) for value in along) else "-"  # names have no order
    curves = _curves(study, known, first)
    for (label, curve), colour in zip(curves.items(), cycle(_COLOURS), strict=False):
        means = [one.mean(name) for one in curve]
        y = [measure.scale * mean.mean for mean in means]
        half = [0.0 if math.isnan(m.half) else measure.scale * m.half for m in means]
        look = {"color": colour, "marker": "o", "capsize": 2, "elinewidth": 0.8, "ls": line}
        axes.errorbar(x, y, half, label=label[:_LONGEST], **look)
    axes.set_xlabel(", ".join(map(study.called, first.places)))
    axes.set_ylabel(f"{measure.title} [{measure.unit}]")
    _limit(axes)
    _label(axes, x, along)
    if others:
        axes.legend(loc="upper left", bbox_to_anchor=(1.02, 1.0))


def _limit(axes: style.Axes) -> None:
    """Show what differs by large factors by factors, and what cannot be below zero from there."""
    shown = [y for line in axes.get_lines() for y in line.get_ydata() if math.isfinite(y)]
    if _by_factors(shown):
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter("{x:g}")
    elif shown and min(shown) >= 0:
        axes.set_ylim(bottom=0)


def _label(axes: style.Axes, x: list[float], values: list[Any]) -> None:
    """Ticks at the values themselves where these are no numbers."""
    if all(map(_is_number, values)):
        if _by_factors(x):
            axes.set_xscale("log")
            axes.xaxis.set_major_formatter("{x:g}")
        return
    axes.set_xticks(x, [value_text(value) for value in values])
    texts = axes.get_xticklabels()
    if sum(len(text.get_text()) for text in texts) > 60:
        axes.tick_params(axis="x", rotation=40)


def _by_factors(values: Sequence[float]) -> bool:
    return bool(values) and min(values) > 0 and max(values) > _WIDE * min(values)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _curves(study: Study, known: Sequence[Known], first: Axis) -> dict[str, list[Known]]:
    """The points of each curve: those that are alike in all but the `first` axis."""
    curves = dict[str, list[Known]]()
    for one in known:
        label = ", ".join(
            f"{study.called(place).rpartition('.')[2]} {value_text(value)}"
            for place, value in one.point.values.items()
            if place not in first.places
        )
        curves.setdefault(label, []).append(one)
    return curves
