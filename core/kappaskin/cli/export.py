"""A recording to files that other programs read."""

import math
import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from kappaskin.cli.common import progress
from kappaskin.errors import Refusal
from kappaskin.export import Exported, Exporting, Wanted


def export(
    recording: Path,
    *,
    to: Path,
    begin: Annotated[float, Parameter("--from")] = 0.0,
    until: float = math.inf,
    every: float = 0.0,
    at: float | None = None,
) -> None:
    """Export a recording: readings and estimates as a table, or the skin's surface as a mesh.

    The suffix says what is written. A .csv, .npz or .h5 has a row for each frame: counts, readings,
    coefficients, contact and geometry with their error bars, worked out anew from the recorded
    bytes with the recorded settings. A .vtp or .stl is the skin in space at one moment, a .pvd a
    series of .vtp files. Every file tells units, settings, calibration, tare and device.

    Example: `kappaskin export press.mcap --to press.csv --from 2 --until 4`

    Parameters
    ----------
    recording
        The recording to read.
    to
        The file to write; refused where it is there already.
    begin
        Seconds since the recording began from which frames are taken.
    until
        Seconds since the recording began until which they are.
    every
        Seconds between two rows or surfaces; every frame when left out.
    at
        Seconds since the recording began, of the one surface that is wanted.
    """
    try:
        with Exporting(Wanted(recording, to, begin, until, every, at)) as exporting:
            with progress() as show:
                for now in exporting.wait():
                    show(now.share, _counted(now))
            for place in exporting.files:
                print(place)
            print(_told(exporting.now), file=sys.stderr)
    except KeyboardInterrupt:
        raise Refusal("stopped before the end; nothing was written") from None


def _counted(now: Exported) -> str:
    return f"{now.written} frame{'s' * (now.written != 1)}"


def _told(now: Exported) -> str:
    """What was written, and what was not."""
    told = [_counted(now)]
    if now.unsettled:
        told.append(f"{now.unsettled} that came before there were settings are left out")
    if now.shapeless:
        told.append(f"{now.shapeless} whose readings decide no shape are left out")
    if not now.whole:
        told.append(
            "the recording was not ended as it should be: this is up to where it breaks off"
        )
    return "; ".join(told)
