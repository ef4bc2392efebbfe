"""Commands on recordings: record, info, verify, repair, export, reconstruct."""

import math
import sys
import time
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from kappaskin.cli.common import (
    FAILED,
    Pair,
    Switch,
    check_time,
    pair,
    print_json,
    progress,
    save_arrays,
    stops,
)
from kappaskin.errors import Refusal

if TYPE_CHECKING:
    from kappaskin.live import Engine, Status
    from kappaskin.recording import Recording
    from kappaskin.sensing import Sensor

_LOOK = 0.05  # s
_TELL = 1.0  # s
_BEGIN = 10.0  # s within which something must come


def record(source: str, out: Path, *, seconds: float = math.inf) -> int:
    """Record a source to a file, until stopped (Ctrl+C).

    Every byte that comes, and what is made of it: an MCAP file that Foxglove, PlotJuggler and the
    tools of ROS 2 open. It is called OUT.part until it is ended; `kappaskin repair` makes it whole
    if it never was. Exit code 1 if it ended by itself, as on a full disk, or nothing came.

    Example: `kappaskin record sim: press.mcap --seconds 10`

    Parameters
    ----------
    source
        `sim:`, `sim:SCENE`, or a port or URL for pyserial.
    out
        The file, which must not be there yet.
    seconds
        How long to record.
    """
    from kappaskin.live import Engine
    from kappaskin.recording import REPLAY

    check_time(seconds, "record")
    if source.startswith(REPLAY):
        raise Refusal(f"expected a live source to record, got {source}; copy its file")
    stopped = stops()
    with Engine() as engine:
        # Before there is a source, so that nothing of it is missed.
        engine.record(out)
        engine.connect(source)
        try:
            status = _recorded(engine, seconds, stopped)
        except Refusal:
            if not _ended(engine).recording.trouble:
                out.unlink(missing_ok=True)  # ours, with nothing in it
            raise
        if engine.alive:
            status = _ended(engine)
        written = status.recording
    print(
        f"{written.path}: {written.messages:,} messages in {written.seconds:.1f} s, "
        f"{written.size / 1e6:.1f} MB; {status.accounting.words}"
    )
    if written.lost:
        print(f"{written.lost:,} messages were not recorded: the disk is too slow")
    if written.trouble:
        print(f"kappaskin: {written.trouble}", file=sys.stderr)
    return FAILED if written.trouble or written.lost or not status.accounting.accepted else 0


def _recorded(engine: "Engine", seconds: float, stopped: list[int]) -> "Status":
    """Record until it is over; how the engine was then."""
    from kappaskin.live import LOST, STREAMING

    began = told = time.monotonic()
    known: Sensor | None = None
    while True:
        status, now = engine.status(), time.monotonic()
        written = status.recording
        if written.trouble and not written.seconds:
            raise Refusal(written.trouble)
        if status.sensor is not known and status.sensor is not None:
            known = status.sensor
            _use_tare(engine, known)
        if stopped or written.trouble or written.seconds >= seconds or not engine.alive:
            return status
        if status.state == LOST and known is None:
            raise Refusal(status.message)
        if status.state != STREAMING and known is None and now - began > _BEGIN:
            raise Refusal(f"{status.source}: nothing came within {_BEGIN:g} s")
        if now - told >= _TELL and sys.stderr.isatty():
            told = now
            print(_line(status), end="\r", file=sys.stderr, flush=True)
        time.sleep(_LOOK)


def _use_tare(engine: "Engine", sensor: "Sensor") -> None:
    from kappaskin.calibration import Tares, data_folder
    from kappaskin.pipeline import Setup

    if not sensor.simulated:
        tare = Tares(data_folder()).load(sensor.serial_number).fit_for(sensor)
        engine.set_up(replace(Setup(), tare=tare))


def _line(status: "Status") -> str:
    written = status.recording
    return (
        f"{written.seconds:7.1f} s  {written.size / 1e6:8.1f} MB  {status.rate:6.0f} frames/s  "
        f"{status.accounting.lost} lost"
    )


def _ended(engine: "Engine") -> "Status":
    """End the recording; how the engine is once the file is whole."""
    engine.record(None)
    asked = time.monotonic()
    for _ in range(round(_BEGIN / _LOOK)):
        status = engine.status()
        if not status.recording.active and status.reported > asked:
            break
        time.sleep(_LOOK)
    return engine.status()


def info(file: Path, *, json: Switch = False) -> None:
    """Tell what is in a recording: when, how long, of which device, what happened.

    One that was not ended is told of up to where it breaks off.

    Example: `kappaskin info press.mcap`

    Parameters
    ----------
    file
        The recording.
    json
        Print one JSON object instead.
    """
    from kappaskin.recording import Recording

    with Recording(file) as recording:
        said = _said(recording)
    if json:
        print_json(said)
        return
    whole = "" if said["whole"] else " (not ended: see `kappaskin repair`)"
    print(f"{file}: {said['seconds']:.1f} s from {said['began']}, by {said['library']}{whole}")
    for name in ("devices", "setups", "attachments", "events"):
        print(f"{name}:", *([""] if said[name] else ["none"]))
        for line in said[name]:
            print(f"  {line}")
    print("messages:")
    for topic, count in sorted(said["messages"].items()):
        print(f"  {count:>10,}  {topic}")


def _said(recording: "Recording") -> dict[str, Any]:
    from kappaskin.recording import decode
    from kappaskin.recording import messages as m

    def texts(topic: m.Topic) -> list[str]:
        return [decode(m.STRING, got.data)["data"] for got in recording.messages_on(topic)]

    def when(stamp: int) -> float:
        return (stamp - recording.first) * 1e-9

    events = [(when(got.stamp), decode(m.LOG, got.data)) for got in recording.messages_on(m.EVENTS)]
    return {
        "began": datetime.fromtimestamp(recording.first * 1e-9, UTC).isoformat(),
        "seconds": when(recording.last),
        "library": recording.library,
        "whole": recording.whole,
        "devices": [_device(text) for text in dict.fromkeys(texts(m.DEVICE))],
        "setups": texts(m.SETUP),
        "attachments": list(recording.attachments),
        "events": [f"{time:.3f} s {said['name']}: {said['msg']}" for time, said in events],
        "messages": recording.counts,
    }


def _device(text: str) -> str:
    from kappaskin.sources import from_json

    sensor = from_json(text)
    return f"{sensor.name} {sensor.serial_number}, {sensor.layout}, firmware {sensor.firmware}"


def verify(file: Path) -> int:
    """Work out every recorded estimate once more from the recorded bytes, and compare bit for bit.

    Exit code 0 if all are the same, 1 if one is not, and then the first is told. Another processor
    may round differently in the last digits.

    Example: `kappaskin verify press.mcap`

    Parameters
    ----------
    file
        The recording.
    """
    # As the engine does: products are summed in another order by more than one thread.
    from kappaskin._background import Beside
    from kappaskin.recording import Verdict, verifying

    with Beside[float | Verdict]("verify", verifying, file) as work:
        verdict = progress(work.wait(), Verdict)
    print(f"{file}: {verdict.words}")
    return 0 if verdict.same else FAILED


_NOTHING = 3


def repair(file: Path, *, out: Path) -> int:
    """Save every whole message of a damaged or unfinished recording to a new file.

    Any MCAP file will do. Exit code 0 if nothing was lost, 1 if some of the file could not be read,
    3 if nothing of it could.

    Example: `kappaskin repair press.mcap.part --out press.mcap`

    Parameters
    ----------
    file
        The recording; it stays as it is.
    out
        The new one, which must not be there yet.
    """
    from kappaskin.recording import Repaired, repairing

    done = progress(repairing(file, out), Repaired)
    if not (done.total or done.attachments):
        print(f"{file}: {done.words}")
        return _NOTHING
    print(f"{out}: {done.words}")
    for topic, count in sorted(done.messages.items()):
        print(f"  {count:>10,}  {topic}")
    return FAILED if done.lost else 0


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
    from kappaskin.recording import Exported, Exporting, Wanted

    try:
        with Exporting(Wanted(recording, to, begin, until, every, at)) as exporting:
            done = progress(exporting.wait(), Exported)
    except KeyboardInterrupt:
        raise Refusal("stopped before the end; nothing was written") from None
    print(*exporting.files, sep="\n")
    print(done.words, file=sys.stderr)


def reconstruct(
    readings: Path,
    *,
    out: Path,
    basis: Pair = "8x8",
    grid: Pair | None = None,
    edge: str = "hinged",
    method: str = "least-squares",
    contact: Switch = False,
    objects: Switch = False,
) -> None:
    """Turn a file of curvature readings into a file of shapes.

    READINGS is an NPZ with `size` (2,) m, `positions` (P, 2) m, `curvature` (T, 3, P) or (3, P) in
    1/m with NaN for a missing reading, and optionally `sigma` in 1/m and `radius` in m, the base
    radius along x (infinite when flat). A `size` (1,) with `positions` (P, 1) is a strip, of whose
    curvature only xx is read. An `outline` (V, 2) m is that of a polygon, one number the radius of
    a disk; a `rigidity` in N m tells forces.

    Example: `kappaskin reconstruct in.npz --basis 8x8 --out out.npz --grid 101x101`

    Parameters
    ----------
    readings
        The NPZ to read.
    out
        The NPZ to write: coefficients, sd, residual and, with a grid, the surface w.
    basis
        Number of functions along x and y.
    grid
        Number of points of the surface along x and y; none when left out.
    edge
        How the skin is held: hinged, sliding, clamped or elastic.
    method
        How the coefficients are found: least-squares, as-printed, direct, fast, bayes,
        finite-slope, tracking or robust.
    contact
        Write the contact of each frame too, and the skin's geometry there.
    objects
        Write the contact and what it is: plane, cylinder, sphere or edge; some 50 ms a frame.
    """
    from kappaskin.pipeline import reconstruct as reconstructed

    points = pair(grid, "a grid") if grid else None
    functions = pair(basis, "a basis")
    found = reconstructed(readings, functions, points, edge, method, contact, objects)
    save_arrays(out, found)
    print(f"{out}: {len(found['coefficients'])} shapes", file=sys.stderr)
