"""Commands on recordings: record, info, verify, repair, export, import, reconstruct."""

import math
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from kappaskin.cli.common import (
    FAILED,
    DescribedFingers,
    FingerMonitor,
    Limit,
    Pair,
    ProgressLine,
    SourceName,
    Sources,
    Switch,
    UsedTare,
    allow,
    check_output,
    check_time,
    fingers_of,
    lined,
    pair,
    print_result,
    result_of,
    save_arrays,
    show,
    stops,
)
from kappaskin.errors import Refusal

if TYPE_CHECKING:
    from kappaskin.live import Engine, Fingers, Status
    from kappaskin.recording import Recording

_POLL = 0.05  # s
_BEGIN = 10.0  # s within which something must come
_OPENED = 120.0  # s within which a source is open: a large mesh is prepared for the first time


def record(
    source: SourceName | None = None,
    /,
    out: Path | None = None,
    *,
    sources: Sources = None,
    seconds: float = math.inf,
    sensor: DescribedFingers = None,
    trust: Switch = False,
) -> int:
    """Record a source, or several at once, to a file, until stopped (Ctrl+C).

    Records every byte received and every estimate computed from it, to an MCAP file that Foxglove,
    PlotJuggler and the tools of ROS 2 open. It is called OUT.part until it is complete;
    `kappaskin repair` restores an incomplete one. Exit code 1 if the recording ended early, as on a
    full disk, if no readings arrived, or if the connection was lost in the end. A source that
    ends, as a file does, ends the recording.

    Of a hand each finger has a source, a sensor and a tare of its own, and all are in one file. One
    that is lost, stalls or dies is reported and leaves the others alone; the exit code is 1 then.

    Example: `kappaskin record sim: press.mcap --seconds 10`

    Example: `kappaskin record hand.mcap --source thumb=/dev/ttyACM0 --source index=/dev/ttyACM1`

    Parameters
    ----------
    source
        `sim:`, `sim:SCENE`, `feed:NAME`, or a port or URL for pyserial; of a hand `hand:NAME`, or
        the file of its description.
    out
        The file; it must not exist yet.
    sources
        The source of one finger of a hand, as NAME=SOURCE; may be given several times.
    seconds
        How long to record, from the first frame computed.
    trust
        Let the scene name files outside its folder.
    """
    from kappaskin.estimation import slope_warning
    from kappaskin.live import LOST, Engine
    from kappaskin.pipeline import Setup
    from kappaskin.recording import TABLES, ReplayedSource

    check_time(seconds, "record")
    if sources and out is None and source is not None:  # the one by place is the file then
        source, out = None, Path(source)
    if out is None:
        raise Refusal("expected a file to record to, such as press.mcap, got none; give it")
    if out.suffix.lower() in TABLES:
        made = f"kappaskin export {out.stem}.mcap --to {out.name}"
        raise Refusal(f"{out}: a recording is an MCAP file; record to {out.stem}.mcap, then {made}")
    fingers = fingers_of(source, sources, sensor)
    for source in fingers.values():
        if source.startswith(ReplayedSource.SCHEME):
            raise Refusal(f"expected a live source to record, got {source}; copy its file")
    stopped = stops()
    if "" not in fingers:
        return _record_hand(fingers, out, seconds, trust, stopped)
    source = fingers[""]
    with Engine(Setup(quantities=())) as engine:
        # Before there is a source, so that nothing of it is missed.
        engine.record(out)
        engine.connect(source, trust)
        try:
            with ProgressLine() as show_progress:
                slope = _recorded(engine, seconds, stopped, show_progress)
        except Refusal:
            if not _ended(engine).recording.trouble:
                out.unlink(missing_ok=True)  # ours, with nothing in it
            raise
        status = _ended(engine)
        why = _UNRESPONSIVE if status.recording.active else "" if engine.alive else _DIED
    if why and not out.exists():
        return _broken_off(out, why)
    written = status.recording
    show(
        f"{written.path or out}: {written.messages:,} messages in {written.seconds:.1f} s, "
        f"{written.size / 1e6:.1f} MB; {status.accounting.words}"
    )
    if written.lost:
        show(f"{written.lost:,} messages were not recorded: the disk is too slow")
    if slope:
        _warn(slope_warning(slope))
    for event in status.events:
        if event.kind == "noise":
            _warn(event.text)
    gone = status.message if status.state == LOST and not status.ended else ""
    for why in filter(None, (written.trouble, status.refusal, gone)):
        show(f"kappaskin: {why}", error=True)
    failed = written.trouble or status.refusal or gone or written.lost
    return FAILED if failed or not status.accounting.accepted else 0


def _record_hand(
    sources: dict[str, str], out: Path, seconds: float, trust: bool, stopped: list[int]
) -> int:
    """Record all fingers of a hand; the exit code."""
    from kappaskin.estimation import slope_warning
    from kappaskin.live import LOST, Fingers
    from kappaskin.pipeline import Setup

    with Fingers(sources, Setup(quantities=())) as hand:
        hand.record(out)
        hand.connect(sources, trust)
        monitors = {finger: FingerMonitor(finger, each) for finger, each in hand.engines.items()}
        with ProgressLine() as show_progress:
            statuses = _hand_recorded(hand, monitors, seconds, stopped, show_progress)
        written = hand.end_recording()
        began = any(status.accounting.accepted for status in statuses.values())
    if not began and not written.trouble:
        out.unlink(missing_ok=True)  # ours, with nothing in it
    size = f"{written.messages:,} messages in {written.seconds:.1f} s, {written.size / 1e6:.1f} MB"
    show(f"{written.path}: {size}" if began else f"{out}: nothing was recorded")
    failed = not began
    for finger, status in statuses.items():
        show(f"  {finger}: {status.accounting.words}")
        lost = status.recording.lost
        if lost:
            show(f"  {finger}: {lost:,} messages were not recorded: the disk is too slow")
        if monitors[finger].slope:
            _warn(f"{finger}: {slope_warning(monitors[finger].slope)}")
        gone = status.state == LOST and not status.ended
        gone |= any(event.kind == "engine" for event in status.events)  # and was started again
        failed |= bool(lost or gone or status.refusal or not status.accounting.accepted)
    if written.trouble:
        _warn(written.trouble)
    return FAILED if failed or written.trouble else 0


def _hand_recorded(
    hand: "Fingers",
    monitors: dict[str, FingerMonitor],
    seconds: float,
    stopped: list[int],
    show_progress: ProgressLine,
) -> "dict[str, Status]":
    """Record until it is over: stopped, all sources ended, or none comes; the last statuses."""
    from kappaskin.live import LOST

    began = recording = time.monotonic()
    while True:
        hand.revive()
        statuses = {finger: monitor() for finger, monitor in monitors.items()}
        now, written = time.monotonic(), hand.recording
        if all(status.slot is None for status in statuses.values()) and now - began <= _BEGIN:
            recording = now
        lost = all(status.state == LOST for status in statuses.values()) or now - began > _OPENED
        none = lost and not any(monitor.tared.connections for monitor in monitors.values())
        over = none or all(status.ended for status in statuses.values())
        if stopped or written.trouble or over or now - recording >= seconds:
            return statuses
        rates = (f"{finger} {status.rate:.0f}" for finger, status in statuses.items())
        size = f"{written.seconds:7.1f} s  {written.size / 1e6:8.1f} MB"
        show_progress(f"{size}  frames/s: {', '.join(rates)}")
        time.sleep(_POLL)


def _warn(text: str) -> None:
    show(f"kappaskin: {text}", error=True)


def _recorded(
    engine: "Engine", seconds: float, stopped: list[int], show_progress: ProgressLine
) -> float:
    """Record until it is over; the largest slope that was neglected though it matters."""
    from kappaskin.live import LOST, STREAMING

    began = recording = time.monotonic()
    tared, slope = UsedTare(engine), 0.0
    while True:
        status, now = engine.status(), time.monotonic()
        slope = max(slope, status.slope)
        written = status.recording
        prepared = status.slot is not None or now - began > _BEGIN
        recording = recording if written.active and prepared else now
        if not engine.alive or engine.silent > _BEGIN:
            return slope
        if written.trouble and not written.seconds:
            raise Refusal(written.trouble)
        tared(status)
        if stopped or written.trouble or now - recording >= seconds:
            return slope
        if status.ended and status.accounting.accepted:
            return slope
        if status.state == LOST and not tared.connections:
            raise Refusal(status.message)
        most = _BEGIN if status.source else _OPENED
        if status.state != STREAMING and not tared.connections and now - began > most:
            raise Refusal(f"{status.source or 'source'}: no readings within {most:g} s")
        show_progress(_line(status))
        time.sleep(_POLL)


_DIED = "the engine process ended unexpectedly"
_UNRESPONSIVE = "the engine process did not respond and was ended"


def _broken_off(out: Path, ended: str) -> int:
    """Complete the file of an engine that ended, and report it; the exit code."""
    from kappaskin.recording import Repaired, part_of, repair_command

    part = part_of(out)
    try:
        done = result_of(Repaired.steps(part, out), Repaired)
    except Refusal as reason:
        repair = repair_command(out)
        raise Refusal(f"{ended}; the recording was not completed: {reason}; try {repair}") from None
    if not done.total:
        raise Refusal(f"{ended}; nothing was recorded: {done.words}")
    part.unlink()
    show(f"kappaskin: {ended}; saved up to then: {out}: {done.words}", error=True)
    return FAILED


def _line(status: "Status") -> str:
    from kappaskin.live import LOST

    written = status.recording
    return (
        f"{written.seconds:7.1f} s  {written.size / 1e6:8.1f} MB  {status.rate:6.0f} frames/s  "
        f"{status.accounting.lost} lost" + "  not connected, retrying" * (status.state == LOST)
    )


def _ended(engine: "Engine") -> "Status":
    """End the recording; the status once the file is complete."""
    engine.record(None)
    asked = time.monotonic()
    for _ in range(round(_BEGIN / _POLL)):
        status = engine.status()
        if not engine.alive or (not status.recording.active and status.reported > asked):
            break
        time.sleep(_POLL)
    return engine.status()


def info(file: Path, *, json: Switch = False, limit: Limit = "") -> None:
    """Show what a recording contains: time, duration, devices, settings, events.

    An unfinished recording is shown up to its last complete message.

    Example: `kappaskin info press.mcap`

    Parameters
    ----------
    file
        The recording.
    json
        Print one JSON object instead.
    """
    from kappaskin.recording import Recording

    allow(limit)
    hand = dict[str, dict[str, Any]]()
    for finger in _fingers(file):
        with Recording(file, finger) as recording:
            hand[finger] = _contents(recording)
    contents = hand.get("", {"fingers": hand})
    texts = [_contents_text(_of(file, finger), each) for finger, each in hand.items()]
    print_result(contents, json, lambda: "\n".join(texts))


def _fingers(file: Path) -> tuple[str, ...]:
    """The fingers in a recording; an empty name where it has one without a name."""
    from kappaskin.recording import Recording

    with Recording(file) as recording:
        return recording.fingers


def _of(file: Path, finger: str) -> str:
    """The file, and the finger in it."""
    return f"{file} ({finger})" if finger else str(file)


def _contents_text(file: str, contents: dict[str, Any]) -> str:
    whole = "" if contents["whole"] else " (unfinished: see `kappaskin repair`)"
    seconds, began = contents["seconds"], contents["began"]
    by = f"{contents['library']}, revision {contents['revision'] or 'unknown'}"
    lines = [f"{file}: {seconds:.1f} s from {began}, by {by}{whole}"]
    for name in ("devices", "setups", "attachments", "events"):
        lines.append(f"{name}:" if contents[name] else f"{name}: none")
        lines += [f"  {line}" for line in contents[name]]
    counts = sorted(contents["messages"].items())
    return lined([*lines, "messages:", *(f"  {count:>10,}  {topic}" for topic, count in counts)])


def _contents(recording: "Recording") -> dict[str, Any]:
    devices = dict.fromkeys(text for _, text in recording.devices())
    return {
        "began": datetime.fromtimestamp(recording.first * 1e-9, UTC).isoformat(),
        "seconds": recording.seconds(recording.last),
        "library": recording.library,
        "revision": recording.revision,
        "whole": recording.whole,
        "devices": [_device(text) for text in devices],
        "setups": [text for _, text in recording.setups()],
        "attachments": list(recording.attachments),
        "events": [f"{e.time:.3f} s {e.kind}: {e.text}" for e in recording.events()],
        "messages": recording.counts,
    }


def _device(text: str) -> str:
    from kappaskin.sources import sensor_from_json

    try:
        sensor = sensor_from_json(text)
    except Refusal as reason:
        return str(reason)
    skin = f"{sensor.layout} on a {sensor.edge} {sensor.layout.patch.name}"
    return f"{sensor.name} {sensor.serial_number}, {skin}, firmware {sensor.firmware}"


def verify(file: Path, *, limit: Limit = "") -> int:
    """Recompute every recorded estimate from the recorded bytes and compare bit for bit.

    Exit code 0 if all are the same, 1 if one differs; the first that does is printed. Another
    processor may round differently in the last digits. A recording of another revision of the
    estimates is recomputed by this one: the largest difference of each quantity is printed, and the
    exit code is 0 unless results cannot be recomputed.

    Example: `kappaskin verify press.mcap`

    Parameters
    ----------
    file
        The recording.
    """
    # As the engine does: products are summed in another order by more than one thread.
    from kappaskin._processes import BackgroundProcess
    from kappaskin.recording import Verification

    allow(limit)
    passed = True
    for finger in _fingers(file):
        about = "verify", Verification.steps, file, finger
        with BackgroundProcess[float | Verification](*about) as work:
            verdict = result_of(work.wait(), Verification)
        show(f"{_of(file, finger)}: {verdict.words}", *(f"  {line}" for line in verdict.changed))
        passed = passed and verdict.passed
    return 0 if passed else FAILED


_NOTHING = 3


def repair(file: Path, *, out: Path, limit: Limit = "") -> int:
    """Save every complete message of a damaged or unfinished recording to a new file.

    Works for any MCAP file. Exit code 0 if nothing was lost, 1 if part of the file could not be
    read, 3 if nothing could be read.

    Example: `kappaskin repair press.mcap.part --out press.mcap`

    Parameters
    ----------
    file
        The recording; it is not changed.
    out
        The new recording; it must not exist yet.
    """
    from kappaskin.recording import Repaired

    allow(limit)
    done = result_of(Repaired.steps(file, out), Repaired)
    if not (done.total or done.attachments):
        show(f"{file}: {done.words}")
        return _NOTHING
    show(f"{out}: {done.words}")
    for topic, count in sorted(done.messages.items()):
        show(f"  {count:>10,}  {topic}")
    return FAILED if done.lost else 0


def export(
    recording: Path,
    *,
    to: Path,
    preset: str = "contact",
    begin: Annotated[float, Parameter("--from")] = 0.0,
    until: float = math.inf,
    every: float = 0.0,
    at: float | None = None,
    finger: str | None = None,
    limit: Limit = "",
) -> int:
    """Export a recording: contact, readings or everything as a table, or the surface as a mesh.

    The suffix selects the format. A .parquet, .csv, .npz or .h5 has a row for each frame,
    recomputed from the recorded bytes with the recorded settings; the preset selects its columns.
    A .vtp or .stl is the skin in space at one moment, a .pvd a series of .vtp files. A .glb (glTF)
    is the skin at one moment, as it moves with the time between two shapes, or at its deepest. A
    .rrd has all that Rerun shows: the skin, the contact, readings and numbers over time. A .lerobot
    is a folder in the form of LeRobot 3.0: contact and readings at a regular rate, as one episode.
    Every file states units, settings, calibration, tare and device. Of a hand each finger has a
    file of its own, named as TO and the finger: press-thumb.csv; exit code 1 if there is none of
    one of them.

    Example: `kappaskin export press.mcap --to press.csv --from 2 --until 4`

    Parameters
    ----------
    recording
        The recording to read.
    to
        The file to write; refused where it exists already.
    preset
        The columns of a table: contact (time, contact, force and depth with their standard
        deviations, 12 columns), readings (counts and readings) or everything; the first two with
        7 digits.
    begin
        Start, in seconds since the recording began.
    until
        End, in seconds since the recording began; that of the recording when left out.
    every
        Seconds between two rows or surfaces; every frame when left out, or the median rate of
        frames in a .lerobot.
    at
        The time of a single surface, in seconds since the recording began.
    finger
        The one finger of a hand to export, to the file TO.
    """
    from kappaskin.recording import Exported, ExportRequest, ExportTask

    allow(limit)
    fingers = _fingers(recording) if finger is None else (finger,)
    several = len(fingers) > 1
    each = [(name, to.with_stem(f"{to.stem}-{name}") if several else to) for name in fingers]
    requests = [  # all of them first: one may be refused
        ExportRequest(recording, out, begin, until, every, at, preset=preset, finger=name)
        for name, out in each
    ]
    code = 0
    for request in requests:
        try:
            with ExportTask(request) as exporting:
                done = result_of(exporting.wait(), Exported)
        except KeyboardInterrupt:
            which = f"{request.to} was not" if several else "nothing was"
            raise Refusal(f"stopped before the end; {which} written") from None
        except Refusal as refusal:
            if not several:
                raise
            _warn(f"{request.finger}: {refusal}")
            code = FAILED
            continue
        show(*exporting.files)
        show(done.words, error=True)
    return code


def import_(
    file: Path,
    *,
    sensor: Annotated[Path, Parameter(help="TOML file that describes the sensor and its lines.")],
    out: Path,
    topic: str = "",
    limit: Limit = "",
) -> int:
    """Turn a file of another program into a recording of a described sensor.

    FILE is text, JSON lines or binary records as the description has them; an .npz with `values`
    (T, columns) and `time` (T,) in s, or an array for each column; a .parquet table; or an .mcap
    or .db3 file, or a bag's folder, of ROS 2. Of a bag the messages of one topic are read:
    std_msgs Float32MultiArray, Float64MultiArray or String, or JSON. Numbers are those of the
    description's columns in order, of its readings alone, or of columns of these names. Headings,
    comments and empty lines are passed over.

    Exit code 1 if rows were left out that are no records; they are counted by reason. A file with
    more of them than others is refused.

    Example: `kappaskin import last-week.csv --sensor board.toml --out last-week.mcap`

    Parameters
    ----------
    file
        The file, or the folder of a bag.
    out
        The recording; it must not exist yet.
    topic
        The topic of a bag; the only one that fits when left out.
    """
    from kappaskin.recording import Imported, ImportRequest, ImportTask

    allow(limit)
    try:
        with ImportTask(ImportRequest(file, out, sensor, topic)) as importing:
            done = result_of(importing.wait(), Imported)
    except KeyboardInterrupt:
        raise Refusal("stopped before the end; nothing was written") from None
    show(f"{out}: {done.words}")
    for bad in done.bad:
        _warn(bad.words)
    return FAILED if done.bad else 0


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
    limit: Limit = "",
) -> None:
    """Turn a file of readings into a file of shapes.

    READINGS is an NPZ with `size` (2,) m, `positions` (P, 2) m, `curvature` (T, 3, P) or (3, P) in
    1/m with NaN for a missing reading, and optionally `sigma` in 1/m and `radius` in m, the base
    radius along x (infinite when flat). Instead of `curvature` it may have `values` (T, R) of an
    `element` (R,) each, an index into `positions`, with the `quantity` (R,) height, slope,
    curvature or twist, its `direction` (R,) in rad from x, its `sigma` (R,) or (T, R), and in
    `datum` the quantities of an unknown zero. A `size` (1,) with `positions` (P, 1) is a strip, for
    which only curvature xx is used. An `outline` in m is a polygon (V, 2) or the radius of a disk.
    Instead of `size`, `mesh` is the text of a mesh, `MeshSkin(...).text`.
    With a `rigidity` in N m, forces are computed too; without it contacts are found by the shape
    alone. A `gage_length` in m is that of gages, `cell` (2,) in m the sides that heights and slopes
    are the mean over. A `thickness` in m, `poisson` and `inplane`
    (held, diaphragm, free; hoop of a bent skin) say how the skin stretches.

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
        The boundary condition: hinged, sliding, clamped, elastic or cantilever (a flat strip).
    method
        The estimator: least-squares, as-printed, direct, fast, bayes, finite-slope, tracking or
        robust.
    contact
        Write the contact of each frame too, and the skin's geometry there.
    objects
        Write the contact and the object: plane, cylinder, sphere or edge; some 50 ms a frame.
    """
    from kappaskin.pipeline import reconstruct as reconstructed

    allow(limit)
    check_output(out, readings)
    points = pair(grid, "a grid") if grid else None
    functions = pair(basis, "a basis")
    found = reconstructed(readings, functions, points, edge, method, contact, objects, _warn)
    save_arrays(out, found)
    show(f"{out}: {len(found['coefficients'])} shapes", error=True)
