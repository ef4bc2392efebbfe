"""What a sensor reads at rest, taken as its zero and kept."""

import math
import time
from contextlib import closing
from datetime import datetime

import numpy as np

from kappaskin.calibration import Rest, Tare, TareMeasurement, TareStore, tare_folder
from kappaskin.cli.common import Switch
from kappaskin.contact import LoadSeeker
from kappaskin.errors import Refusal
from kappaskin.recording import ReplayedSource as ReplayedSource  # registers replay:
from kappaskin.sensing import Sensor
from kappaskin.sources import Source, open_source

_READ = 0.05  # s that one read may wait


def tare(source: str, *, undo: Switch = False) -> None:
    """Take what a sensor reads at rest as its zero.

    Refused, with the reason, while the skin is loaded or moves. What is taken is kept for this
    sensor's serial number, and used whenever it is connected; a simulated sensor's is only told.

    Example: `kappaskin tare /dev/ttyACM0`

    Parameters
    ----------
    source
        `sim:`, `sim:SCENE`, or a port or URL for pyserial.
    undo
        Use no tare of this sensor any more, instead of taking one.
    """
    tares = TareStore(tare_folder())
    with closing(open_source(source)) as opened:
        sensor = _met(opened)
        if undo:
            tares.use(sensor.serial_number, None)
            print(f"{sensor.name} {sensor.serial_number}: no tare is in use")
            return
        used = None if sensor.simulated else tares.load(sensor.serial_number).fit_for(sensor)
        taken = _taken(opened, sensor, used)
    _tell(taken, used)
    if sensor.simulated:
        print("not kept: the sensor is simulated")
    else:
        tares.add(taken)
        print(f"kept in {tares.path(sensor.serial_number)}")


def _met(source: Source) -> Sensor:
    while source.sensor is None:
        source.read(_READ)
        if source.trouble:
            raise Refusal(source.trouble)
    return source.sensor


def _taken(source: Source, sensor: Sensor, used: Tare | None) -> Tare:
    taring = TareMeasurement(sensor, time.monotonic())
    while not taring.done(time.monotonic()):
        for frame in source.read(_READ):
            taring.take(frame.device_time, frame.host_time, sensor.nominal(frame))
        if source.sensor is not sensor:
            raise Refusal("another device answered, or the same one anew; tare again")
    zero = np.zeros(sensor.channels) if used is None else used.offset
    rest = Rest(zero, np.zeros(sensor.channels), used)
    now = datetime.now().astimezone()
    return taring.tare(LoadSeeker(sensor), rest, now, source.temperature)


def _tell(taken: Tare, before: Tare | None) -> None:
    """Print what was taken, beside the one in use before."""
    offset, error = (math.sqrt(float(np.nanmean(x**2))) for x in (taken.offset, taken.offset_sd))
    warm = "" if taken.temperature is None else f" at {taken.temperature:.1f} degrees Celsius"
    print(
        f"{taken.name} {taken.serial_number}: {np.isfinite(taken.offset).sum()} of {len(taken)} "
        f"channels tared{warm}, offsets of {offset:.3g} +- {error:.2g} 1/m (RMS)"
    )
    if before is not None:
        moved = math.sqrt(float(np.nanmean((taken.offset - before.offset) ** 2)))
        print(f"{moved:.3g} 1/m (RMS) from the tare of {before.date:%Y-%m-%d %H:%M}")
