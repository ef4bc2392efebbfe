"""Values in a notebook: a table with units, and a picture where Matplotlib is installed."""

import html
import math
from base64 import b64encode
from collections.abc import Callable
from functools import partial, singledispatch
from typing import Any, NamedTuple

import numpy as np

from kappaskin._text import printable, with_error
from kappaskin.errors import Refusal
from kappaskin.estimation import METHODS, Fit
from kappaskin.frames import Array, Estimate
from kappaskin.pipeline import SEQUENTIAL, readouts
from kappaskin.recording import Recording, contacts_in
from kappaskin.studies.design.report import draw_measure, header_of, rows_of, value_text
from kappaskin.studies.design.results import StudyFolder, stored_results
from kappaskin.studies.design.study import Study
from kappaskin.studies.figures import style

_SIDE = 65  # points of a surface along each axis
_MOST = 50_000  # contacts of a recording that a table's picture reads
_NORMAL_95 = 1.96


class Representation(NamedTuple):
    """What is shown of a value; `draw` is None where there is nothing to draw."""

    title: str
    rows: list[list[str]]
    draw: Callable[[style.Figure], None] | None
    head: list[str] | None = None
    quick: bool = True
    """Whether drawing it takes less than a second."""


@singledispatch
def shown(value: object) -> Representation:
    raise Refusal(f"expected a value that a notebook shows, got a {type(value).__name__}")


@shown.register
def _(fit: Fit) -> Representation:
    estimator, basis = fit.estimator, fit.estimator.basis
    patch, layout = basis.patch, estimator.layout
    x, y = patch.grid(_SIDE, _SIDE)
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    first = fit.coefficients.reshape(-1, *basis.shape)[0]
    w = np.where(patch.contains(points), basis.on_grid(x, y)(first).ravel(), np.nan)
    frames = "" if fit.coefficients.ndim == len(basis.shape) else f"{len(fit.coefficients)}"
    rows = [
        ["method", next((name for name, of in METHODS.items() if of is type(estimator)), "")],
        ["frames", f"{frames}; the first is drawn" if frames else ""],
        ["functions", " × ".join(map(str, basis.shape))],
        ["elements", str(len(layout))],
        ["noise of a reading", with_error(float(np.median(fit.noise)), unit=layout.units)],
        ["residual, RMS", with_error(_rms(fit.residual), unit=layout.units)],
        ["warnings", "; ".join(fit.warnings)],
    ]
    if not frames:
        most = points[int(np.nanargmax(np.abs(w)))]
        half = _NORMAL_95 * float(fit.surface_sd(most[None])[0])
        depth = with_error(1e3 * float(w[np.nanargmax(np.abs(w))]), 1e3 * half, "mm")
        at = " ".join(f"{1e3 * each:.1f}" for each in most)
        rows.insert(4, ["largest displacement", f"{depth} (95 %), at {at} mm"])
    elements = None if patch.strip else 1e3 * layout.positions
    extent = (0.0, 1e3 * float(x[-1]), 0.0, 1e3 * float(y[-1]))
    w = 1e3 * w.reshape(len(y), len(x))
    draw = partial(_draw_strip, 1e3 * x, w[0]) if patch.strip else partial(
        _draw_surface, w, extent, elements
    )  # fmt: skip
    return Representation("Fit", rows, draw)


@shown.register
def _(estimate: Estimate) -> Representation:
    rows = [["frame", str(estimate.sequence)]]
    for each in readouts(estimate):
        value = each.words or with_error(each.value, each.half_width, each.unit, each.digits)
        rows.append([each.label, value + " (95 %)" * math.isfinite(each.half_width)])
    w = 1e3 * estimate.surface
    draw = partial(_draw_surface, w, None, None) if np.isfinite(w).any() else None
    if w.ndim == 2 and 1 in w.shape and draw:
        draw = partial(_draw_strip, None, w.ravel())
    return Representation("Estimate", rows, draw)


@shown.register
def _(recording: Recording) -> Representation:
    rows = [
        ["length", f"{recording.seconds(recording.last):.1f} s"],
        ["recorded by", recording.made_by],
        ["ended in order", "yes" if recording.whole else "no"],
        *([f"messages on {topic}", str(n)] for topic, n in sorted(recording.counts.items())),
    ]
    contacts = recording.counts.get("/kappaskin/contact", 0)
    draw = partial(_draw_force, recording) if contacts else None
    return Representation(f"Recording: {recording.path.name}", rows, draw, quick=contacts <= _MOST)


@shown.register
def _(study: Study) -> Representation:
    rows = [["points", str(study.count)], ["measures", ", ".join(study.measures)]]
    for axis in study.axes:
        for place in axis.places:
            values = ", ".join(value_text(values[place]) for values in axis)
            rows.append([f"varied: {study.called(place)}", values])
    rows += [["drawn at random", place] for place, _ in study.base.draws]
    draw = partial(_draw_elements, 1e3 * study.base.scene.layout.positions)
    return Representation(f"Study: {study.title}", rows, draw)


@shown.register
def _(folder: StudyFolder) -> Representation:
    study = folder.study()
    known = stored_results(study, folder)
    draw = partial(draw_measure, study, known, study.measures[0]) if study.axes else None
    return Representation(f"Results: {study.title}", rows_of(study, known), draw, header_of(study))


def _rms(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if known.size else math.nan


def _axes(figure: style.Figure, width: float, height: float) -> style.Axes:
    """Axes that fill a figure of `width` x `height` mm."""
    style.resize(figure, width, height)
    figure.set_layout_engine("constrained")
    return figure.add_subplot()


def _draw_elements(positions: Array, figure: style.Figure) -> None:
    axes = _axes(figure, 90, 70)
    axes.plot(*positions.T, "s", color=style.BLUE)
    axes.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal", title="elements")


def _draw_surface(
    w: Array, extent: tuple[float, ...] | None, elements: Array | None, figure: style.Figure
) -> None:
    """The displacement `w` (ny, nx) in mm, from outside; `elements` (P, 2) in mm."""
    axes = _axes(figure, 90, 70)
    image = axes.imshow(w, cmap=style.colour_map(SEQUENTIAL), origin="lower", extent=extent)
    if elements is not None:
        axes.plot(*elements.T, ".", color="white", ms=2)
    lengths = "mm" if extent else "points"
    axes.set(xlabel=f"x [{lengths}]", ylabel=f"y [{lengths}]")
    figure.colorbar(image, label="displacement w [mm]")


def _draw_strip(x: Array | None, w: Array, figure: style.Figure) -> None:
    axes = _axes(figure, 90, 50)
    axes.plot(np.arange(len(w)) if x is None else x, w, color=style.BLUE)
    axes.set(xlabel="x [points]" if x is None else "x [mm]", ylabel="displacement w [mm]")


def _draw_force(recording: Recording, figure: style.Figure) -> None:
    """The force of the contact, or its displacement if that is not known, over time."""
    finger = f"#{recording.finger}" * bool(recording.finger)
    path = recording.path.with_name(recording.path.name + finger)
    parts = [(at, found) for _, at, found in contacts_in(path) if len(at)]
    at = np.concatenate([each for each, _ in parts])
    force, force_sd, depth, depth_sd = (
        np.concatenate([found[name] for _, found in parts])
        for name in ("force", "force_sd", "displacement", "displacement_sd")
    )
    known = bool(np.isfinite(force).any())
    value, sd = (force, force_sd) if known else (1e3 * depth, 1e3 * depth_sd)
    axes = _axes(figure, 90, 50)
    half = np.where(np.isfinite(sd), _NORMAL_95 * sd, 0.0)
    axes.errorbar(at, value, half, fmt=".", color=style.BLUE, ecolor=style.GREY, ms=2, lw=0.5)
    axes.set(xlabel="time [s]", ylabel=f"{'force [N]' if known else 'displacement w [mm]'} (95 %)")


def html_of(value: object) -> str:
    """The table as HTML, after the picture as a PNG where Matplotlib is installed."""
    what = shown(value)
    title, head, rows = what.title, what.head or [], [row for row in what.rows if row[-1]]
    lines = [("th", head)] * bool(head) + [("td", row) for row in rows]
    table = "".join(
        f"<tr>{''.join(f'<{kind}>{_safe(cell)}</{kind}>' for cell in cells)}</tr>"
        for kind, cells in lines
    )
    picture = ""
    if what.draw is not None and what.quick:
        try:
            style.loaded()
        except Refusal:
            pass
        else:
            png = style.drawn(what.draw, "png")["png"]
            source = f"data:image/png;base64,{b64encode(png).decode()}"
            picture = f'<img alt="{_safe(title)}" width="400" src="{source}"/>'
    return f"<div><p><b>{_safe(title)}</b></p>{picture}<table>{table}</table></div>"


def _safe(text: str) -> str:
    return html.escape(printable(text))


def plotted(value: object) -> Any:
    """The axes of a new figure of pyplot with the picture; a `Refusal` where there is none."""
    what = shown(value)
    if what.draw is None:
        raise Refusal(f"{what.title}: expected something to draw, got none; see its table")
    with style.sheet(pyplot=True) as figure:
        what.draw(figure)
    return figure.axes[0]
