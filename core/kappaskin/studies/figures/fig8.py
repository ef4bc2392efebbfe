"""The paper's Fig. 8: a gage pair's loop on known cylinders, its calibration, and what is left."""

from dataclasses import dataclass, replace
from datetime import UTC, datetime

import numpy as np

from kappaskin.calibration import CalibrationReport, Procedure, Sweep, calibrate
from kappaskin.frames import Array
from kappaskin.mechanics import Plate
from kappaskin.scenes import RADII, Presentation, Scene, Simulator, load_scene, schedule
from kappaskin.scenes.effects import FIRST_GENERATION_LOOPS, SECOND_GENERATION_LOOPS, Hysteresis
from kappaskin.sensing import SensorLayout
from kappaskin.skin import Patch
from kappaskin.studies.figures import style

PAIR = 4
"""Which of the ten gage pairs is drawn."""
UNSEEN = tuple(1 / k for k in range(75, 0, -10))
"""Radii in m of cylinders that lie between those of the calibration."""
_FRAMES = 50  # averaged on each cylinder
_WHEN = datetime(2002, 1, 1, tzinfo=UTC)  # no figure shows it


@dataclass(frozen=True, eq=False)
class _Run:
    """A calibration's sweep, what it found, and a later sweep on cylinders `UNSEEN`."""

    sweep: Sweep
    report: CalibrationReport
    later: Sweep

    @property
    def errors(self) -> tuple[Array, Array]:
        """Errors (S,) in 1/m of the later sweep by the line alone, and with the loops undone."""
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


def run(loops: Hysteresis) -> _Run:
    """A skin with these `loops` calibrated as the paper did, then laid on other cylinders."""
    skin = _skin(loops)
    sweep = _laid(skin, RADII, seed=0)
    return _Run(sweep, calibrate(sweep, skin.sensor(), _WHEN), _laid(skin, UNSEEN, seed=1))


def draw(figure: style.Figure) -> None:
    """The loop with the calibration line left, errors on other cylinders right."""
    first, second = run(FIRST_GENERATION_LOOPS), run(SECOND_GENERATION_LOOPS)
    style.resize(figure, style.DOUBLE, 84)
    style.letter(figure, 1, 83, "a", "one gage pair on cylinders, there and back")
    style.letter(figure, 93, 83, "b", "its error on cylinders not calibrated on")
    _draw_loop(style.place(figure, (13, 10, 71, 67)), first, second)
    _draw_errors(style.place(figure, (104, 10, 67, 67)), second)


def _draw_loop(axes: style.Axes, first: _Run, second: _Run) -> None:
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
    for way, fill, name in ((~back, style.BLUE, "way there"), (back, "white", "way back")):
        axes.plot(applied[way], read[way], ls="", marker="o", mfc=fill, color=style.BLUE, mew=0.7,
                  label=name)  # fmt: skip
    axes.set(xlim=ends, ylim=(-100, 100), xticks=range(-80, 81, 40), yticks=range(-80, 81, 40))
    axes.set(xlabel="applied curvature [1/m]", ylabel="curvature read [1/m]")
    axes.legend(loc="upper left")
    lines = ["widest gap, κ > 0 / κ < 0:"]
    for name, found in (("first", first), ("second", second)):
        inner, outer = found.report.gaps[:, PAIR]
        lines.append(f"{name} {inner:.1f} / {outer:.1f} 1/m")
    axes.text(83, -97, "\n".join(lines), ha="right", va="bottom", linespacing=1.4)


def _draw_errors(axes: style.Axes, found: _Run) -> None:
    applied = found.later.curvature[:, 0]
    looks = (("line alone", style.BLUE), ("loops undone", style.ORANGE))
    axes.axhline(0, color=style.LINE, lw=0.6)
    for error, (name, colour) in zip(found.errors, looks, strict=True):
        rms = np.sqrt(np.mean(error**2))
        axes.plot(applied, error, color=colour, lw=1, marker="o", mec="white", mew=0.4,
                  label=f"{name}: RMS {rms:.2f} 1/m")  # fmt: skip
    axes.set(xlim=(-85, 85), ylim=(-5, 6), xticks=range(-80, 81, 40))
    axes.set(xlabel="applied curvature [1/m]", ylabel="error of curvature [1/m]")
    axes.legend(loc="upper left")
