"""Figures of hysteresis: the paper's Fig. 8, and errors against the base curvature."""

import math
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any

import numpy as np

from kappaskin.bases import Basis, SineBasis
from kappaskin.calibration import CalibrationReport, Procedure, Sweep, calibrate
from kappaskin.estimation import LeastSquares
from kappaskin.frames import Array
from kappaskin.mechanics import Plate
from kappaskin.scenes import Scene, Simulator, load_scene
from kappaskin.scenes.cylinders import RADII, Presentation, schedule
from kappaskin.scenes.effects import (
    FIRST_GENERATION_LOOPS,
    SECOND_GENERATION_LOOPS,
    Hysteresis,
    ReadingEffect,
    RunningEffect,
)
from kappaskin.sensing import SensorLayout
from kappaskin.skin import Patch
from kappaskin.studies.accuracy import root_mean_square
from kappaskin.studies.figures import style
from kappaskin.studies.paper import RADIUS

PAIR = 4
"""Which of the ten gage pairs is drawn."""
UNSEEN = tuple(1 / k for k in range(75, 0, -10))
"""Radii in m of cylinders that lie between those of the calibration."""
_FRAMES = 50  # averaged on each cylinder
_WHEN = datetime(2002, 1, 1, tzinfo=UTC)  # no figure shows it


@dataclass(frozen=True, eq=False)
class _LoopRun:
    """A calibration's sweep, what it found, and a later sweep on cylinders `UNSEEN`."""

    sweep: Sweep
    report: CalibrationReport
    later: Sweep

    @property
    def errors(self) -> tuple[Array, Array]:
        """Errors (S,) in 1/m of the later sweep: straight line, and hysteresis compensated."""
        line, correct = self.report.line, self.report.calibration.start()
        by_line = (self.later.readings[:, PAIR] - line.offset[PAIR]) / line.gain[PAIR]
        steps = zip(self.later.readings, self.later.times, strict=True)
        undone = np.array([correct(reading, float(time))[PAIR] for reading, time in steps])
        applied = self.later.curvature[:, 0]
        return by_line - applied, undone - applied


def _skin(loops: Hysteresis) -> Scene:
    """A strip of ten gage pairs with these `loops`, otherwise as uncalibrated as the scene's."""
    scene, patch = load_scene("calibration"), Patch(0.1, 0.01, strip=True)
    return replace(
        scene,
        plate=Plate(patch),
        layout=SensorLayout.regular(patch, 10, 1),
        effects=(loops, *scene.effects[1:]),
        reference=(15, 1),
    )


def _laid(skin: Scene, radii: tuple[float, ...], seed: int) -> Sweep:
    """What the `skin` reads on cylinders of `radii` in m, through all of its electronics."""
    steps, sensor = schedule(radii, strip=True), skin.sensor()
    laid = Presentation(steps, _FRAMES / skin.rate)
    simulator, procedure = Simulator(replace(skin, laid=laid, seed=seed)), Procedure(sensor, steps)
    for number in range(len(steps)):
        numbers = range(number * _FRAMES, (number + 1) * _FRAMES)
        frames = [simulator.frame(n, lambda: 0.0) for n in numbers]
        times = np.array([frame.device_time for frame in frames])
        procedure.take(times, np.array([sensor.nominal(frame) for frame in frames]))
    return procedure.sweep()


def loop_run(loops: Hysteresis) -> _LoopRun:
    """A skin with these `loops` calibrated as the paper did, then laid on other cylinders."""
    skin = _skin(loops)
    sweep = _laid(skin, RADII, seed=0)
    return _LoopRun(sweep, calibrate(sweep, skin.sensor(), _WHEN), _laid(skin, UNSEEN, seed=1))


def draw_loops(figure: style.Figure) -> None:
    """The loop with the calibration line left, errors on other cylinders right."""
    first, second = loop_run(FIRST_GENERATION_LOOPS), loop_run(SECOND_GENERATION_LOOPS)
    style.resize(figure, style.DOUBLE, 84)
    style.letter(figure, 1, 83, "a", "one gage pair on cylinders, falling and rising radius")
    style.letter(figure, 93, 83, "b", "its error on cylinders not calibrated on")
    _draw_loop(style.place(figure, (13, 10, 71, 67)), first, second)
    _draw_errors(style.place(figure, (104, 10, 67, 67)), second)


def _draw_loop(axes: style.Axes, first: _LoopRun, second: _LoopRun) -> None:
    since = slice(1, None)  # the first bend; before it the skin has an unknown past
    applied, read = second.sweep.curvature[since, 0], second.sweep.readings[since, PAIR]
    line = second.report.line
    ends = np.array([-85.0, 85.0])
    axes.plot(first.sweep.curvature[since, 0], first.sweep.readings[since, PAIR],
              color=style.GREY, lw=0.8, label="first prototype")  # fmt: skip
    axes.plot(ends, line.offset[PAIR] + line.gain[PAIR] * ends, color=style.INK, lw=0.8,
              label="least-squares line")  # fmt: skip
    axes.plot(applied, read, color=style.BLUE, lw=0.8, label="second prototype")
    back = np.array([step.back for step in second.sweep.steps[since]])
    for way, fill, name in ((~back, style.BLUE, "falling"), (back, "white", "rising")):
        axes.plot(applied[way], read[way], ls="", marker="o", mfc=fill, color=style.BLUE, mew=0.7,
                  label=name)  # fmt: skip
    axes.set(xlim=ends, ylim=(-100, 100), xticks=range(-80, 81, 40), yticks=range(-80, 81, 40))
    axes.set(xlabel="applied curvature [1/m]", ylabel="curvature read [1/m]")
    axes.legend(loc="upper left")
    lines = ["widest loop, κ > 0 / κ < 0:"]
    for name, found in (("first", first), ("second", second)):
        inner, outer = found.report.gaps[:, PAIR]
        lines.append(f"{name} {inner:.1f} / {outer:.1f} 1/m")
    axes.text(83, -97, "\n".join(lines), ha="right", va="bottom", linespacing=1.4)


def _draw_errors(axes: style.Axes, found: _LoopRun) -> None:
    applied = found.later.curvature[:, 0]
    looks = (("straight line", style.BLUE), ("hysteresis compensated", style.ORANGE))
    axes.axhline(0, color=style.LINE, lw=0.6)
    for error, (name, colour) in zip(found.errors, looks, strict=True):
        axes.plot(applied, error, color=colour, lw=1, marker="o", mec="white", mew=0.4,
                  label=f"{name}: RMS {root_mean_square(error):.2f} 1/m")  # fmt: skip
    axes.set(xlim=(-85, 85), ylim=(-5, 6), xticks=range(-80, 81, 40))
    axes.set(xlabel="applied curvature [1/m]", ylabel="error of curvature [1/m]")
    axes.legend(loc="upper left")


# The accuracy that a base curvature costs through hysteresis (the paper's section 6.2).
#
# The same strip of ten elements is bent to base radii from the fingertip's to flat, and the same
# dent, Eq. 10 as it must read, is pressed into it and released, slowly, several times. Assumed is:
#
# - The gages are bonded while flat and have no past; then the skin is bent to its base radius once.
#   So a gage on a fingertip begins each press at the far end of a loop, a gage on a flat skin at
#   the origin.
# - The skin at rest is then taken as zero (tare), and readings count with the slope of a long way.
#   The loops are not compensated.
# - All gages have the same loops, which depend on the way of the curvature alone, not on its rate.
# - The skin moves alike whatever its radius; the loads that make it do so differ.
# - The ends of a bent skin are pinned, those of the flat one hinged. That matters: pinned ends
#   decide the function k = 1, which on a flat strip must be read from small changes of curvature.

SHARES = (1.0, 0.8, 0.6, 0.4, 0.2, 0.1, 0.05, 0.0)
"""Base curvatures, as shares of the paper's fingertip's."""

_ELEMENTS, _CYCLES = 10, 3
_STEPS, _BENDING = 50, 101
_PRESS: Array = np.concatenate([np.linspace(0, 1, _STEPS + 1), np.linspace(1, 0, _STEPS + 1)[1:]])
_PACE = 0.02  # s a step, for effects that know time: a press takes a second


def _pressed(running: RunningEffect, base: float, change: Array) -> Array:
    """Readings (cycles, steps, P) of presses by up to `change` (P,) of a tared skin."""
    bending = np.multiply.outer(base * np.linspace(0, 1, _BENDING), np.ones_like(change))
    pressing = base + np.multiply.outer(np.tile(_PRESS, _CYCLES), change)
    way: Array = np.concatenate([bending, pressing])
    readings = np.array([running(way[n], n * _PACE) for n in range(len(way))])
    tared = readings[_BENDING:] - readings[_BENDING - 1]
    return tared.reshape(_CYCLES, len(_PRESS), len(change))


def _errors(basis: Basis, fit: LeastSquares, truth: Array, readings: Array) -> dict[str, float]:
    """What one cycle of `readings` (steps, P) makes of the dent `truth` (8, 1)."""
    change = fit.M[:_ELEMENTS] @ truth.ravel()
    true_readings: Array = np.multiply.outer(_PRESS, change)
    true_shapes: Array = np.multiply.outer(_PRESS, truth)
    K = np.zeros((len(_PRESS), 3, _ELEMENTS))
    K[:, 0] = readings
    shape = basis.on_grid(*basis.patch.grid(101, 2))
    off: Array = 1e3 * shape(fit(K).coefficients - true_shapes)[:, 0]
    going, coming = readings[: _STEPS + 1], readings[_STEPS:][::-1]
    return {
        "swing": float(np.abs(change).max()),
        "reading_rms": root_mean_square(readings - true_readings),
        "loop_width": float(np.abs(going - coming).max()),
        "e_max_mm": float(off[_STEPS, 50]),
        "rms_mm": root_mean_square(off),
        "rest_rms_mm": root_mean_square(off[-1:]),
    }


def initial_curvature(
    effect: ReadingEffect = SECOND_GENERATION_LOOPS, applied: float = 1.27
) -> list[dict[str, Any]]:
    """Errors by base curvature for readings that `effect` spoils, as rows ready for a figure.

    `applied` is the displacement under the load in mm. For each of `SHARES` a row of the first
    cycle and one of the last, settled one: `swing` (the largest change of curvature), `reading_rms`
    and `loop_width` (the widest) in 1/m;
    `e_max_mm` at the load when fully pressed, `rms_mm` over the skin and the cycle, `rest_rms_mm`
    over the skin after release, when there is no dent. `base_radius_mm` is None when flat.
    """
    truth = np.zeros((8, 1))
    truth[0], truth[2] = applied / 4e3, -3 * applied / 4e3
    rows: list[dict[str, Any]] = []
    for share in SHARES:
        base = share / RADIUS
        patch = Patch(math.pi * RADIUS, 0.02, 1 / base if base else math.inf, strip=True)
        basis = SineBasis(patch, 8, 1)
        fit = LeastSquares(basis, SensorLayout.regular(patch, _ELEMENTS, 1))
        running = effect.start((_ELEMENTS,), np.random.default_rng(0))
        cycles = _pressed(running, base, fit.M[:_ELEMENTS] @ truth.ravel())
        for name, readings in (("first", cycles[0]), ("settled", cycles[-1])):
            row = {
                "base_curvature": base,
                "base_radius_mm": 1e3 / base if base else None,
                "ends": "pinned" if base else "hinged",
                "applied_mm": applied,
                "cycle": name,
            }
            rows.append(row | _errors(basis, fit, truth, readings))
    return rows


def draw_initial_curvature(figure: style.Figure) -> None:
    """Errors of the readings left, of the shape right."""
    rows = initial_curvature()
    style.resize(figure, style.DOUBLE, 70)
    applied = rows[0]["applied_mm"]
    style.letter(figure, 1, 69, "a", f"readings while {applied:.2f} mm are pressed in and released")
    style.letter(figure, 97, 69, "b", "the shape estimated from them")
    readings, shape = (style.place(figure, (left, 10, 66, 52)) for left in (13, 105))
    for cycle, colour in (("first", style.BLUE), ("settled", style.ORANGE)):
        name = f"{cycle} cycle"
        _draw_column(readings, rows, cycle, "reading_rms", 1.0, {"color": colour, "label": name})
        _draw_column(shape, rows, cycle, "rms_mm", 1e3, {"color": colour, "label": name})
    look = {"color": style.INK, "label": "once released"}
    _draw_column(shape, rows, "settled", "rest_rms_mm", 1e3, look)
    readings.set(ylabel="RMS error of curvature [1/m]", ylim=(0, 4.8))
    shape.set(ylabel="RMS error of shape [µm]", ylim=(0, 120))
    for axes in (readings, shape):
        axes.plot([], [], "o", mfc="white", color=style.FAINT, mew=0.7, label="flat, ends hinged")
        axes.axvline(1 / RADIUS, color=style.LINE, lw=0.6, zorder=0)
        axes.text(1 / RADIUS - 1, axes.get_ylim()[1] / 40, f"fingertip, {1e3 * RADIUS:.1f} mm",
                  ha="right", va="bottom", color=style.FAINT)  # fmt: skip
        axes.set(xlim=(-3, 83), xticks=range(0, 81, 20), xlabel="base curvature 1/R₀ [1/m]")
        axes.legend(loc="upper left")


def _draw_column(
    axes: style.Axes,
    rows: list[dict[str, Any]],
    cycle: str,
    column: str,
    unit: float,
    look: dict[str, str],
) -> None:
    """One `column` of a `cycle` against the base curvature; the flat skin is held otherwise."""
    here = [row for row in rows if row["cycle"] == cycle]
    for ends, fill, label in (("pinned", look["color"], look["label"]), ("hinged", "white", None)):
        shown = [row for row in here if row["ends"] == ends]
        x = [row["base_curvature"] for row in shown]
        y = [unit * row[column] for row in shown]
        axes.plot(x, y, marker="o", mfc=fill, mew=0.7, **look | {"label": label})
