"""What is known of one element, in words."""

import math

import numpy as np

from kappaskin.calibration import Calibration
from kappaskin.frames import COMPONENTS, Estimate
from kappaskin.live import Status
from kappaskin.sensing import Sensor

_PM, _DASH = "\N{PLUS-MINUS SIGN}", "\N{EN DASH}"
_HEADS = ("", "reads [1/m]", "fit leaves [1/m]", "gain", "offset [1/m]", "channel", "health")


def facts(element: int, sensor: Sensor, status: Status, estimate: Estimate) -> str:
    """A table in HTML of the three channels of an element."""
    rows = [_row(element, number, sensor, status, estimate) for number in range(3)]
    cells = ["".join(f"<th align='left'>{head}&nbsp;&nbsp;</th>" for head in _HEADS)]
    cells += ["".join(f"<td>{cell}&nbsp;&nbsp;</td>" for cell in row) for row in rows]
    return (
        "<table style='white-space: nowrap'>"
        + "".join(f"<tr>{row}</tr>" for row in cells)
        + "</table>"
    )


def title(element: int, sensor: Sensor, moved: float, moved_sd: float) -> str:
    """Which element it is, where, and how far in mm the skin `moved` there."""
    x, y = 1e3 * sensor.layout.positions[element]
    sure = f" {_PM} {moved_sd:.3f}" if math.isfinite(moved_sd) else ""
    return _signed(
        f"<b>Element {element}</b> at ({x:.1f}, {y:.1f}) mm; the skin moved in by "
        f"{moved:.3f}{sure} mm there"
    )


def _row(
    element: int, number: int, sensor: Sensor, status: Status, estimate: Estimate
) -> tuple[str, ...]:
    channel = number * len(sensor.layout) + element
    name = COMPONENTS[number]
    found = [f for f in status.health.findings if f.channel == channel]
    health = "; ".join(f"{f.kind}: {f.figure}" for f in found) or "well"
    read, left = estimate.curvature[number, element], estimate.residual[number, element]
    return (
        f"<b>{name}</b>",
        f"{_number(read, '+z.2f')} {_PM} {_number(estimate.noise, '.2f')}",
        _number(left, "+z.2f"),
        *_calibrated(status.setup.calibration, channel),
        str(_converted(sensor, channel)),
        "dead: the device says so" if sensor.layout.lacking[number, element] else health,
    )


def _calibrated(calibration: Calibration | None, channel: int) -> tuple[str, str]:
    if calibration is None:
        return "1 (nominal)", "0 (nominal)"
    c = calibration
    return (
        f"{_number(c.gain[channel], '.3f')} {_PM} {_number(c.gain_sd[channel], '.3f')}",
        f"{_number(c.offset[channel], '+z.2f')} {_PM} {_number(c.offset_sd[channel], '.2f')}",
    )


def _converted(sensor: Sensor, channel: int) -> int:
    """The number on the wire of what reads this channel."""
    wired = sensor.channel_map
    return channel if wired is None else int(np.flatnonzero(wired == channel)[0])


def _number(value: float, digits: str) -> str:
    return _signed(f"{value:{digits}}") if math.isfinite(value) else _DASH


def _signed(text: str) -> str:
    return text.replace("-", "\N{MINUS SIGN}")
