"""A sensor against cylinders of known radius."""

import sys
from datetime import UTC, datetime
from pathlib import Path

from kappaskin.calibration import calibrate as calibrated
from kappaskin.calibration import check_writable, save_calibration, take_sweep
from kappaskin.cli.common import FAILED, Switch, print_json
from kappaskin.errors import Refusal
from kappaskin.recording import ReplayedSource as ReplayedSource  # registers replay:


def _millimetres(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) / 1e3 for part in text.split(","))
    except ValueError:
        raise Refusal(f"expected radii in millimetres such as 100,50,25, got {text!r}") from None


def _asked(question: str) -> str:
    print(question, end="", file=sys.stderr, flush=True)
    if answer := sys.stdin.readline() if sys.stdin else "":
        return answer
    print(file=sys.stderr)
    raise Refusal(
        "standard input ended before the last step, nothing was written; run this in a terminal, "
        "or give --dwell if the device is laid on the cylinders by itself"
    )


def calibrate(
    source: str,
    *,
    out: Path,
    radii: str | None = None,
    seconds: float = 1.0,
    hold: float = 0.0,
    dwell: float | None = None,
    json: Switch = False,
) -> int:
    """Calibrate a sensor against cylinders of known radius.

    Names one cylinder after the other and waits for Enter; a simulated source is laid on them by
    itself. The exit code is 1 when some channel failed: the file is written, without that channel.

    Example: `kappaskin calibrate /dev/ttyACM0 --out skin.toml --radii 100,50,33,25,20`

    Parameters
    ----------
    source
        `sim:`, `sim:SCENE`, or a port or URL for pyserial.
    out
        The file to write.
    radii
        Radii of the cylinders in millimetres; those that the sensor can read when left out.
    seconds
        How long the readings on each cylinder are averaged.
    hold
        Seconds on the smallest cylinder from which creep is told; without it creep is not sought.
    dwell
        Ask nobody: the device is laid on the cylinders by itself, so many seconds each.
    json
        Print one JSON object with every channel instead of a summary.
    """
    check_writable(out)
    try:
        sensor, sweep = take_sweep(
            source,
            None if radii is None else _millimetres(radii),
            _asked,
            lambda line: print(line, file=sys.stderr),
            seconds=seconds,
            hold=hold,
            dwell=dwell,
        )
        report = calibrated(sweep, sensor, datetime.now(UTC))
        save_calibration(report.calibration, out)
    except KeyboardInterrupt:
        print(file=sys.stderr)
        raise Refusal("stopped before the last step; nothing was written") from None
    if json:
        print_json(report.to_json())
    else:
        print(*report.summary(), sep="\n")
    return FAILED if report.failed else 0
