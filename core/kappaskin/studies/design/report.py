"""Design reports: text table, CSV, figures and an HTML page."""

import csv
import html
import io
import math
import platform
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import cycle
from pathlib import Path
from typing import Any, cast

from kappaskin._files import write_whole
from kappaskin._text import cell, printable, with_error
from kappaskin.studies.design.measures import MEASURES, StudyMeasure
from kappaskin.studies.design.results import (
    Mean,
    PointResults,
    StudyFolder,
    stored_results,
    version,
)
from kappaskin.studies.design.study import Axis, Study
from kappaskin.studies.figures import style

_LONGEST_VALUE = 30  # characters of a value


def value_text(value: Any) -> str:
    """A value of what is varied, short: 9 x 9 for two whole numbers."""
    if isinstance(value, dict):
        table = cast("dict[str, Any]", value)
        return ", ".join(f"{key} {value_text(own)}" for key, own in table.items())
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list):
        many = cast("list[Any]", value)
        pair = len(many) == 2 and not isinstance(many[0], str)
        text = (" x " if pair else ", ").join(value_text(one) for one in many)
        return text if len(text) <= _LONGEST_VALUE else f"{len(many)} values"
    return str(value).lower() if isinstance(value, bool) else str(value)


def mean_text(mean: Mean, measure: StudyMeasure) -> str:
    """A mean and its interval in the unit of the measure, to the digits that are known."""
    if not mean.count:
        return "-"
    value, half = measure.scale * mean.mean, measure.scale * mean.half
    if math.isnan(half):
        return f"{value:.4g} ± ?"
    return with_error(value, half)


def header_of(study: Study) -> list[str]:
    """Heads of the columns of `rows_of`."""
    units = [f"{MEASURES[name].title} [{MEASURES[name].unit}]" for name in study.measures]
    return [*map(study.called, study.places), *units, "frames"]


def rows_of(study: Study, known: Sequence[PointResults]) -> list[list[str]]:
    """A line for every point: its values, each mean with its 95 % interval, how many frames."""
    rows: list[list[str]] = []
    for one in known:
        means = [mean_text(one.mean(name), MEASURES[name]) for name in study.measures]
        frames = str((one.done - len(one.failures)) * study.base.measure.frames)
        rows.append([*map(value_text, one.point.values.values()), *means, frames])
    return rows


def remarks_on(study: Study, known: Sequence[PointResults]) -> list[str]:
    """Remarks on the tables: failures, missing results, approximations."""
    remarks: list[str] = []
    for one in known:
        values = one.point.values.items()
        values_text = ", ".join(
            f"{study.called(place)} {value_text(value)}" for place, value in values
        )
        at = f"at {values_text}" if values_text else "everywhere"
        if failures := one.failures:
            failed = f"{len(failures)} of {one.done} blocks failed"
            remarks.append(f"{at}: {failed}: {failures[0]}")
        elif not one.complete:
            remarks.append(
                f"{at}: {one.done} of {one.required} blocks are computed by this version"
            )
        elif not one.enough:
            what = ", ".join(study.stop.of)
            remarks.append(
                f"{at}: {what} not known to {100 * study.stop.within:g} % after the "
                f"{study.stop.most} blocks allowed"
            )
    return remarks


def table_text(study: Study, known: Sequence[PointResults]) -> str:
    """The table and the remarks on it, as text."""
    short = [*(place.rpartition(".")[2] for place in study.places)]
    short += [f"{name} [{MEASURES[name].unit}]" for name in study.measures] + ["frames"]
    rows = [short, *rows_of(study, known)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = [
        "  ".join(f"{cell:>{width}}" for cell, width in zip(row, widths, strict=True))
        for row in rows
    ]
    title = f"{printable(study.title)}: means with their 95 % intervals"
    return "\n".join([title, "", *lines, *([""] if remarks_on(study, known) else []),
                      *remarks_on(study, known)])  # fmt: skip


def table_csv(study: Study, known: Sequence[PointResults]) -> str:
    """The same as CSV, with all digits: of each measure mean, half of the interval, sd, frames."""
    text = io.StringIO()
    write = csv.writer(text, lineterminator="\n").writerow
    parts = ("mean", "half of 95 % interval", "sd", "frames")
    write([*study.places, *(f"{name} {part}{_unit(name, part)}" for name in study.measures
                            for part in parts), "blocks", "blocks failed"])  # fmt: skip
    for one in known:
        values = [cell(value) if isinstance(value, str)
                  else value if isinstance(value, float | int) else value_text(value)
                  for value in one.point.values.values()]  # fmt: skip
        figures = list[Any]()
        for name in study.measures:
            mean, scale = one.mean(name), MEASURES[name].scale
            figures += [scale * mean.mean, scale * mean.half, scale * mean.sd, mean.count]
        write([*values, *figures, one.done, len(one.failures)])
    return text.getvalue()


def _unit(name: str, part: str) -> str:
    return "" if part == "frames" else f" [{MEASURES[name].unit}]"


# One HTML page that needs no network

_STYLE = """
:root { color-scheme: light dark; }
body { font: 15px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.6rem; margin-bottom: .2rem; } h2 { font-size: 1.15rem; margin-top: 2rem; }
figure { margin: 1rem 0; padding: .6rem; background: #fff; color: #16191d;
  border: 1px solid #c6ccd4; border-radius: 6px; }
figure svg { width: 100%; height: auto; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .9rem; }
th, td { padding: .25rem .7rem; text-align: right; border-bottom: 1px solid #9aa3ad55; }
td { white-space: nowrap; } th { vertical-align: bottom; max-width: 11rem; }
pre { overflow-x: auto; padding: .8rem; border: 1px solid #9aa3ad88; border-radius: 6px;
  font-size: .82rem; line-height: 1.4; }
.faint { opacity: .75; }
"""


def page_of(study: Study, known: Sequence[PointResults], figures: Mapping[str, str]) -> str:
    """The page, with `figures` as SVG by the name of what they show."""
    drawn = [
        f"<figure role='img' aria-label='{html.escape(MEASURES[name].title)}'>{_bare(svg)}</figure>"
        for name, svg in figures.items()
    ]
    remarks = "".join(f"<li>{html.escape(remark)}</li>" for remark in remarks_on(study, known))
    computed = sum(one.done for one in known)
    parts = [
        f"<h1>{html.escape(study.title)}</h1>",
        f"<p>{html.escape(study.description.strip())}</p>",
        f"<p class='faint'>{len(known)} points, {computed} blocks of "
        f"{study.base.measure.frames} frames. Bars and ± are 95 % intervals of the mean. "
        "The parameters have the units of scene files: m, 1/m, N and s.</p>",
        f"<h2>Remarks</h2><ul>{remarks}</ul>" if remarks else "",
        *drawn,
        "<h2>Table</h2>",
        f"<div class='wide'>{_table(study, known)}</div>",
        "<h2>How to repeat this study</h2>",
        f"<p>Save this as {html.escape(study.name)}.toml and run "
        f"<code>kappaskin study {html.escape(study.name)}.toml</code>, with "
        f"{html.escape(version())} (here on Python {platform.python_version()}). The numbers "
        "are bit-identical, except times.</p>",
        f"<pre>{html.escape(study.text)}</pre>",
    ]
    return printable(
        f"<!doctype html>\n<html lang='en'><head><meta charset='utf-8'><meta name='viewport' "
        f"content='width=device-width'><title>{html.escape(study.title)}</title>"
        f"<style>{_STYLE}</style></head><body>\n" + "\n".join(filter(None, parts))
        + "\n</body></html>\n",
        keep="\n\t",
    )  # fmt: skip


def _bare(svg: str) -> str:
    """The SVG as it stands inside a page: without what begins a file."""
    return svg[svg.index("<svg") :]


def _table(study: Study, known: Sequence[PointResults]) -> str:
    def line(cells: Sequence[str], kind: str) -> str:
        return "<tr>" + "".join(f"<{kind}>{html.escape(cell)}</{kind}>" for cell in cells) + "</tr>"

    rows = "\n".join(line(row, "td") for row in rows_of(study, known))
    head = line(header_of(study), "th")
    return f"<table><thead>{head}</thead><tbody>\n{rows}\n</tbody></table>"


# Figures: measures against the first thing that is varied, with their intervals

_COLOURS = (style.BLUE, style.ORANGE, "#63a878", "#7a4b9a", "#c9a227", "#3f9aa5", "#c2487a",
            style.FAINT, style.GREY)  # fmt: skip
_PANEL = (18.0, 14.0, 92.0, 62.0)  # mm: left, bottom, width, height
_ALONE = 150.0  # mm: the width of one without a legend
_WIDE = 20.0  # from the least to the largest by such a factor: shown by factors
_LONGEST_LABEL = 44  # characters of the name of a curve


def draw_study(study: Study, known: Sequence[PointResults]) -> dict[str, str]:
    """The SVG of a figure for every measure, by its name; none where nothing is varied."""
    drawn = dict[str, str]()
    for name in study.measures if study.axes else ():
        files = style.drawn(partial(draw_measure, study, known, name), "svg")
        drawn[name] = files["svg"].decode()
    return drawn


def draw_measure(
    study: Study, known: Sequence[PointResults], name: str, figure: style.Figure
) -> None:
    """The means of a measure against the first thing that is varied."""
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
        axes.errorbar(x, y, half, label=label[:_LONGEST_LABEL], **look)
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


def _curves(
    study: Study, known: Sequence[PointResults], first: Axis
) -> dict[str, list[PointResults]]:
    """The points of each curve: those that are alike in all but the `first` axis."""
    curves = dict[str, list[PointResults]]()
    for one in known:
        label = ", ".join(
            f"{study.called(place).rpartition('.')[2]} {value_text(value)}"
            for place, value in one.point.values.items()
            if place not in first.places
        )
        curves.setdefault(label, []).append(one)
    return curves


# All of it in the study's folder


def write_report(folder: Path) -> list[Path]:
    """Write report.html, report.csv and an SVG of each figure from the results in a `folder`."""
    results = StudyFolder(folder)
    study = results.study()
    known = stored_results(study, results)
    figures = draw_study(study, known)
    files = {f"{name}.svg": svg for name, svg in figures.items()}
    files |= {"report.csv": table_csv(study, known), "report.html": page_of(study, known, figures)}
    for name, text in files.items():
        write_whole(folder / name, text, "copy the study's folder elsewhere")
    return [folder / name for name in files]
