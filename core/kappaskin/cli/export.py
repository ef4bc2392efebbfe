"""A recording to files that other programs read."""

import math
import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from kappaskin.cli.common import progress
from kappaskin.errors import Refusal
from kappaskin.recording import Exported, ExportRequest, ExportTask


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
        with ExportTask(ExportRequest(recording, to, begin, until, every, at)) as exporting:
            done = progress(exporting.wait(), Exported)
    except KeyboardInterrupt:
        raise Refusal("stopped before the end; nothing was written") from None
    print(*exporting.files, sep="\n")
    print(done.words, file=sys.stderr)
