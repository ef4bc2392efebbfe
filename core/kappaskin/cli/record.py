"""A source to a recording, without a window."""

import math
import sys
import time
from dataclasses import replace
from pathlib import Path

from kappaskin.calibration import TareStore, tare_folder
from kappaskin.cli.common import FAILED, check_time, stops
from kappaskin.errors import Refusal
from kappaskin.live import LOST, STREAMING, Engine, Status
from kappaskin.pipeline import Setup
from kappaskin.recording import REPLAY
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


def _recorded(engine: Engine, seconds: float, stopped: list[int]) -> Status:
    """Record until it is over; how the engine was then."""
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


def _use_tare(engine: Engine, sensor: Sensor) -> None:
    if not sensor.simulated:
        tare = TareStore(tare_folder()).load(sensor.serial_number).fit_for(sensor)
        engine.set_up(replace(Setup(), tare=tare))


def _line(status: Status) -> str:
    written = status.recording
    return (
        f"{written.seconds:7.1f} s  {written.size / 1e6:8.1f} MB  {status.rate:6.0f} frames/s  "
        f"{status.accounting.lost} lost"
    )


def _ended(engine: Engine) -> Status:
    """End the recording; how the engine is once the file is whole."""
    engine.record(None)
    asked = time.monotonic()
    for _ in range(round(_BEGIN / _LOOK)):
        status = engine.status()
        if not status.recording.active and status.reported > asked:
            break
        time.sleep(_LOOK)
    return engine.status()
