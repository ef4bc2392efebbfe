"""Calibration from a sweep: residual errors, and the channels that failed."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from datetime import datetime
from typing import Any, TypeVar

import numpy as np

from kappaskin.calibration.calibration import Calibration, fingerprint
from kappaskin.calibration.identification import (
    LineFits,
    fit_lines,
    identify_creep,
    identify_hysteresis,
    play_thresholds,
    unseen_error,
)
from kappaskin.calibration.sweep import Sweep
from kappaskin.errors import Refusal
from kappaskin.frames import COMPONENTS, Array, Mask
from kappaskin.scenes.cylinders import FACES, FEWEST_RADII, CylinderStep, check_strain, step_pairs
from kappaskin.scenes.effects import RunningEffect
from kappaskin.sensing import PrandtlIshlinskii, Sensor, StandardLinearSolid

DEAD = "dead, reported by the device"

_Part = TypeVar("_Part", LineFits, PrandtlIshlinskii)
_WORST = 5  # channels that are named


@dataclass(frozen=True)
class ChannelLimits:
    """What a channel must keep within to pass.

    The gain relative to nominal; the offset, the error of a reading left out of the fit and the
    noise of one frame as shares of the largest curvature applied; and how much of a small change
    must show at once, the rest being hidden in the loops.
    """

    least_gain: float = 0.5
    most_gain: float = 2.0
    offset: float = 0.5
    error: float = 0.05
    noise: float = 0.1
    linear: float = 0.25

    def reason(
        self, most: float, gain: float, offset: float, error: float, noise: float, linear: float
    ) -> str | None:
        """Why a channel fails that was bent up to `most` in 1/m; None when it passes."""
        offset_limit, error_limit, noise_limit = (
            share * most for share in (self.offset, self.error, self.noise)
        )
        # Not >, or NaN would pass.
        judged = (
            (
                self.least_gain <= gain <= self.most_gain,
                f"gain {gain:.3g}, expected {self.least_gain:g} to {self.most_gain:g}; check for a "
                "broken gage, reversed wires or swapped faces",
            ),
            (
                abs(offset) <= offset_limit,
                f"offset {offset:.3g} 1/m, expected at most {offset_limit:.3g}; balance the bridge",
            ),
            (
                error <= error_limit,
                f"error {error:.3g} 1/m, expected at most {error_limit:.3g}; check the bond of the "
                "gage, and that the skin lay flat on the cylinders",
            ),
            (
                noise <= noise_limit,
                f"noise {noise:.3g} 1/m, expected at most {noise_limit:.3g}; look for a loose wire",
            ),
            (
                linear >= self.linear,
                f"reads {100 * linear:.0f} % of a small change at once, expected at least "
                f"{100 * self.linear:.0f} %; the rest is hysteresis",
            ),
        )
        return next((why for fine, why in judged if not fine), None)


def failures_of(
    sweep: Sweep,
    sensor: Sensor,
    limits: ChannelLimits,
    fitted: LineFits,
    noise: Array,
    linear: Array,
) -> dict[int, str]:
    """Why each channel failed that did; `noise` in 1/m and `linear` are (C,)."""
    most = np.repeat(np.abs(sweep.curvature).max(axis=0), sensor.channels // 3)
    dead = ~sensor.layout.live.ravel()
    found: dict[int, str] = {}
    for c in range(sensor.channels):
        missing = np.flatnonzero(np.isnan(sweep.readings[:, c]))
        numbers = (most, fitted.gain, fitted.offset, fitted.left_out, noise, linear)
        if dead[c]:
            found[c] = DEAD
        elif len(missing):
            found[c] = (
                f"saturated or not read on {len(missing)} of {len(sweep.steps)} steps, first on "
                f"step {missing[0] + 1}; lower the amplifier's gain"
            )
        elif why := limits.reason(*(float(values[c]) for values in numbers)):
            found[c] = why
    return found


@dataclass(frozen=True, eq=False)
class CalibrationReport:
    """A calibration and how good it is, channel by channel.

    `line` is the paper's least-squares line per gage pair, `fitted` what the calibration applies:
    the same where no loops were found. `gaps` (2, C) are the widest difference between the ways at
    one cylinder on the inner and on the outer face, `gaps_left` what the calibration leaves of
    them, `noise` (C,) the standard deviation of one frame, `error` (C,) the standard error of what
    is corrected on a path that the sweep did not take; all four as curvature in 1/m.
    """

    calibration: Calibration
    line: LineFits
    fitted: LineFits
    gaps: Array
    gaps_left: Array
    noise: Array
    error: Array

    @property
    def passed(self) -> Mask:
        return np.isfinite(self.calibration.gain)

    @property
    def failed(self) -> dict[int, str]:
        """Why each channel failed of those that the device says are alive."""
        return {c: why for c, why in self.calibration.failures if why != DEAD}

    def to_json(self) -> dict[str, Any]:
        """Everything as JSON values, None for what is not a number."""
        calibration = self.calibration
        columns = {
            "gain": self.fitted.gain,
            "offset": self.fitted.offset,
            "gain_sd": self.fitted.gain_sd,
            "offset_sd": self.fitted.offset_sd,
            "line_gain": self.line.gain,
            "line_offset": self.line.offset,
            "line_error": self.line.left_out,
            "error": self.error,
            "gap_inner": self.gaps[0],
            "gap_outer": self.gaps[1],
            "gap_inner_left": self.gaps_left[0],
            "gap_outer_left": self.gaps_left[1],
            "noise": self.noise,
        }
        failures = dict(calibration.failures)  # the dead ones too
        P = len(calibration.gain) // 3
        return {
            "device": calibration.name,
            "serial_number": calibration.serial_number,
            "date": calibration.date.isoformat(),
            "creep": calibration.creep and calibration.creep.time_constant,
            "passed": int(self.passed.sum()),
            "failed": len(self.failed),
            "channels": [
                {
                    "channel": c,
                    "component": COMPONENTS[c // P],
                    "element": c % P,
                    "passed": c not in failures,
                    "reason": failures.get(c),
                    **{name: _known(values[c]) for name, values in columns.items()},
                }
                for c in range(3 * P)
            ],
        }

    def summary(self) -> list[str]:
        """The report as lines of text: passed channels, ranges, the worst, and why any failed."""
        calibration, P = self.calibration, len(self.noise) // 3

        def spread(values: Array) -> str:
            return f"{values.min():.3g} to {values.max():.3g}"

        lines = [
            f"{calibration.name} {calibration.serial_number}: {int(self.passed.sum())} of "
            f"{int(self.passed.sum()) + len(self.failed)} channels passed; curvature in 1/m",
            f"{'':<11}{'gain':<18}{'offset':<18}{'widest loop (remaining)':<25}"
            "error (straight line)",
        ]
        for c, name in enumerate(COMPONENTS):
            here = np.flatnonzero(self.passed[c * P : (c + 1) * P]) + c * P
            if here.size:
                loops = self.gaps[:, here].max(), self.gaps_left[:, here].max()
                errors = self.error[here].max(), self.line.left_out[here].max()
                lines.append(
                    f"{name:<11}{spread(self.fitted.gain[here]):<18}"
                    f"{spread(self.fitted.offset[here]):<18}"
                    f"{'{:.2f} ({:.2f})'.format(*loops):<25}{errors[0]:.3f} ({errors[1]:.2f})"
                )
        if calibration.creep:
            share = float(np.median(calibration.creep.share[self.passed]))
            lines.append(
                f"creep      {100 * share:.1f} % in {calibration.creep.time_constant:.3g} s"
            )
        worst = np.argsort(np.where(self.passed, -self.error, 0.0))[:_WORST]
        named = (f"{_named(c, P)} {self.error[c]:.3f}" for c in worst)
        lines.append(f"worst      {', '.join(named)}")
        told = float(np.sqrt((self.error[self.passed] ** 2).mean()))
        lines.append(f"expect a standard error of {told:.2g} 1/m of corrected curvature in use")
        return lines + [f"failed     {_named(c, P)}: {why}" for c, why in self.failed.items()]


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _check_way(steps: tuple[CylinderStep, ...], x: Array, face: int, what: str) -> None:
    k = np.unique((face * x[face * x > 0]).round(9))
    if not len(k):
        raise Refusal(
            f"no cylinder bends {what}; a calibration needs both faces, since one alone does not "
            "separate the offset from the hysteresis"
        )
    if len(k) < FEWEST_RADII:
        raise Refusal(
            f"expected at least {FEWEST_RADII} radii that bend {what}, got {len(k)}; add cylinders"
        )
    if not step_pairs(steps, x, face):
        raise Refusal(
            f"no cylinder that bends {what} was captured with rising radius; without it hysteresis "
            "cannot be measured"
        )


def _check(sweep: Sweep, sensor: Sensor) -> None:
    """Refuse a sweep from which no channel could be calibrated, or only wrongly."""
    check_strain(sweep.steps, sensor)
    if sweep.readings.shape[1] != sensor.channels:
        raise Refusal(
            f"expected readings of the {sensor.channels} channels of {sensor.name}, got "
            f"{sweep.readings.shape[1]}; use the sweep of this sensor"
        )
    sensed = [bool(live.any()) for live in sensor.layout.live]
    for name, x, live in zip(COMPONENTS, sweep.curvature.T, sensed, strict=True):
        for face, called in FACES.items() if live else ():
            _check_way(sweep.steps, x, face, f"{name} with the {called}")
    if not np.isfinite(sweep.readings).all(axis=0).any():
        raise Refusal(
            "every channel was dead or saturated on some step; lower the amplifier's gain, or "
            "leave out the smallest cylinders"
        )


def _in_time(sweep: Sweep, run: RunningEffect) -> Array:
    """What `run` makes of the readings (S, C), given also the course of the hold."""
    times = np.concatenate([sweep.times, sweep.moments])
    readings = np.concatenate([sweep.readings, sweep.course])
    out = np.empty_like(readings)
    for k in np.argsort(times, kind="stable"):
        out[k] = run(readings[k], float(times[k]))
    return out[: len(sweep.times)]


def _creep(sweep: Sweep, least: float) -> tuple[StandardLinearSolid | None, Array]:
    """The creep seen during the hold, if there was one, and the readings (S, C) without it."""
    if not len(sweep.moments):
        return None, sweep.readings
    if not sweep.steps[0].flat:
        raise Refusal("expected a hold after a flat table, got a cylinder as first step")
    rest = sweep.readings[0]
    creep = identify_creep(sweep.moments, sweep.course - rest, least)
    if creep is None:
        return None, sweep.readings
    restore = creep.start_inverse()
    return creep, _in_time(sweep, lambda reading, time: restore(reading - rest, time) + rest)


def _informative(x: Array, flat: Mask) -> Mask:
    """The steps (S,) to fit channels of curvature `x` (S,) to; some of the steps are `flat` (S,).

    Those that do not bend them would blame on them what bending across them does. And before the
    skin was first bent as far as it ever was, its loops are those of an unknown past: then every
    play is dragged along, wherever it was.
    """
    since = np.arange(len(x)) >= np.argmax(np.abs(x) > (1 - 1e-9) * np.abs(x).max())
    return since & (flat | (x != 0))


def _fitted_components(
    sweep: Sweep, readings: Array, least: float
) -> tuple[LineFits, LineFits, PrandtlIshlinskii]:
    """Lines, fits and loops of all channels, fitted component by component."""
    flat = np.array([step.flat for step in sweep.steps])
    radii = len({step.radius for step in sweep.steps if not step.flat})
    parts: list[tuple[LineFits, LineFits, PrandtlIshlinskii]] = []
    for x, y in zip(sweep.curvature.T, np.split(readings, 3, axis=1), strict=True):
        used = _informative(x, flat)
        line = fit_lines(x[used], y[used])
        parts.append(
            (line, *identify_hysteresis(x, y, used, play_thresholds(x, radii), line, least))
        )
    of_lines, fitted, loops = zip(*parts, strict=True)
    return _joined(LineFits, of_lines), _joined(LineFits, fitted), _joined(PrandtlIshlinskii, loops)


def _joined(kind: type[_Part], parts: Sequence[_Part]) -> _Part:
    """The channels of all `parts`, side by side."""
    names = [field.name for field in fields(kind)]
    return kind(*(np.concatenate([getattr(p, n) for p in parts], axis=-1) for n in names))


def _unseen(sweep: Sweep, readings: Array, fitted: LineFits, loops: PrandtlIshlinskii) -> Array:
    """The error (C,) in 1/m of curvature in each direction of bending and face that is left out."""
    keys = [(step.along, step.face) for step in sweep.steps]
    ways = {way: k for k, way in enumerate(dict.fromkeys(keys))}
    flat = np.array([step.flat for step in sweep.steps])
    number = np.where(flat, -1, [ways[key] for key in keys])
    radii = len({step.radius for step in sweep.steps if not step.flat})
    errors: list[Array] = []
    for k, (x, y) in enumerate(zip(sweep.curvature.T, np.split(readings, 3, axis=1), strict=True)):
        here = slice(k * y.shape[1], (k + 1) * y.shape[1])
        used, parts = _informative(x, flat), np.where(x == 0, -1, number)
        of_fit = LineFits(*(getattr(fitted, field.name)[here] for field in fields(LineFits)))
        names = [field.name for field in fields(PrandtlIshlinskii)]
        of_loops = PrandtlIshlinskii(*(getattr(loops, name)[..., here] for name in names))
        errors.append(unseen_error(x, y, used, parts, play_thresholds(x, radii), of_fit, of_loops))
    return np.concatenate(errors)


def _steadied(error: Array, passed: Mask) -> Array:
    """The `error` (C,) of each channel and of all that `passed` in its component, half and half.

    A few ways tell one channel's own error badly, and the gages of a component are made alike.
    """
    squares = np.where(passed, error, np.nan).reshape(3, -1) ** 2
    known = np.isfinite(squares)
    mean = np.where(known, squares, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1)
    return np.sqrt((squares + mean[:, None]) / 2).ravel()


def _gaps(sweep: Sweep, values: Array) -> Array:
    """Widest difference between the ways (2, C) of `values` (S, C), on the inner and outer face."""
    out: list[Array] = []
    for x, v in zip(sweep.curvature.T, np.split(values, 3, axis=1), strict=True):
        ways = (np.array(step_pairs(sweep.steps, x, face), int).reshape(-1, 2).T for face in FACES)
        widest = [np.abs(v[back] - v[there]).max(axis=0, initial=0.0) for there, back in ways]
        out.append(np.stack(widest))
    return np.concatenate(out, axis=1)


def _needed(loops: PrandtlIshlinskii, passed: Mask) -> PrandtlIshlinskii | None:
    """The loops without those of failed channels and without plays that no channel needs."""
    p = np.where(passed, loops.weights, 0.0)
    needed = p.any(axis=1)
    if not needed.any():
        return None
    q, a = (np.where(passed, part, 1.0) for part in (loops.linear, loops.stretch))
    return PrandtlIshlinskii(loops.thresholds[needed], p[needed], q, a)


def calibrate(
    sweep: Sweep, sensor: Sensor, date: datetime, limits: ChannelLimits | None = None
) -> CalibrationReport:
    """The calibration that a `sweep` of `sensor`, taken on `date`, gives, and how good it is.

    Refused when it has fewer than three radii, one face only, no way back or strains beyond the
    elastic limit, or when no channel passes.
    """
    _check(sweep, sensor)
    least = sensor.transduction.resolution
    creep, readings = _creep(sweep, least)
    line, fitted, loops = _fitted_components(sweep, readings, least)
    with np.errstate(divide="ignore", invalid="ignore"):  # a stuck channel, which fails
        noise = np.sqrt((sweep.noise**2).mean(axis=0)) / np.abs(fitted.gain)
        by_line = (sweep.readings - line.offset) / line.gain
    failures = failures_of(sweep, sensor, limits or ChannelLimits(), fitted, noise, loops.linear)
    passed = np.ones(sensor.channels, bool)
    passed[list(failures)] = False
    if not passed.any():
        c, reason = next(iter(failures.items()))
        P = sensor.channels // 3
        raise Refusal(
            f"none of {sensor.channels} channels passed; {COMPONENTS[c // P]} of element {c % P}: "
            f"{reason}"
        )
    error = _steadied(_unseen(sweep, readings, fitted, loops), passed)
    calibration = Calibration(
        sensor.name,
        sensor.serial_number,
        sensor.firmware,
        fingerprint(sensor.layout),
        date,
        np.where(passed, fitted.gain, np.nan),
        np.where(passed, fitted.offset, np.nan),
        np.where(passed, fitted.gain_sd, np.nan),
        np.where(passed, fitted.offset_sd, np.nan),
        _needed(loops, passed),
        creep,
        tuple(failures.items()),
        error=error,
    )
    left = _in_time(sweep, calibration.start())
    return CalibrationReport(
        calibration, line, fitted, _gaps(sweep, by_line), _gaps(sweep, left), noise, error
    )


def _named(channel: int, elements: int) -> str:
    return f"{COMPONENTS[channel // elements]} of element {channel % elements}"
