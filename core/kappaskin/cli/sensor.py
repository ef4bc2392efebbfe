"""Commands on a sensor: calibrate, tare, press, monitor, device."""

import json
import math
import sys
import time
from contextlib import closing
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from kappaskin._text import ONE_SIGMA, with_error
from kappaskin.cli.common import (
    FAILED,
    Described,
    SourceName,
    Switch,
    check_output,
    check_time,
    lined,
    of_sensor,
    print_result,
    show,
    stops,
)
from kappaskin.errors import Refusal

if TYPE_CHECKING:
    from kappaskin.calibration import Rest, Tare, TareMeasurement
    from kappaskin.sensing import Sensor
    from kappaskin.sources import Source


def _millimetres(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) / 1e3 for part in text.split(","))
    except ValueError:
        raise Refusal(f"expected radii in millimetres such as 100,50,25, got {text!r}") from None


def _grams(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise Refusal(f"expected masses in grams such as 10,20,50, got {text!r}") from None


def _answer_to(question: str) -> str:
    show(question, error=True, end="")
    if answer := sys.stdin.readline() if sys.stdin else "":
        return answer
    show("", error=True)
    raise Refusal(
        "standard input ended before the last step, nothing was written; run this in a terminal, "
        "or give --dwell if the device moves to the cylinders automatically"
    )


def _report(text: str) -> None:
    show(*text.split("\n"), error=True)


def calibrate(
    source: SourceName,
    *,
    out: Path,
    radii: str | None = None,
    weights: str | None = None,
    calibration: Path | None = None,
    seconds: float = 1.0,
    hold: float = 0.0,
    dwell: float | None = None,
    sensor: Described = None,
    trust: Switch = False,
    json: Switch = False,
) -> int:
    """Calibrate a sensor against cylinders of known radius, or its skin against known weights.

    Asks for one cylinder or weight after the other and waits for Enter; a simulated source needs no
    help. The exit code is 1 if a channel failed: the file is written without that channel; or if a
    weight is told wrong by the others.

    Example: `kappaskin calibrate /dev/ttyACM0 --out skin.toml --radii 100,50,33,25,20`

    Example: `kappaskin calibrate /dev/ttyACM0 --out skin.toml --weights 5,10,20,10,5`

    Parameters
    ----------
    source
        `sim:`, `sim:SCENE`, `feed:NAME`, or a port or URL for pyserial.
    out
        The file to write.
    radii
        Radii of the cylinders in millimetres; by default those that the sensor can read.
    weights
        Masses in grams, each laid at another place: at least three. They give the rigidity of the
        skin, how it stiffens or how far its edge gives, so that forces need no Young's modulus.
    calibration
        A calibration of this sensor whose gains the weights are laid on with, and which is
        extended; without it the readings are taken as they are.
    seconds
        Averaging time on each cylinder or weight, in seconds.
    hold
        Seconds on the smallest cylinder to measure creep; without it creep is not measured.
    dwell
        Do not wait for Enter: a device that moves automatically stays on each cylinder for this
        many seconds.
    trust
        Let the scene name files outside its folder.
    json
        Print one JSON object with every channel instead of a summary.
    """
    from kappaskin.calibration import Calibration, take_sweep
    from kappaskin.calibration import calibrate as calibrated
    from kappaskin.hand import load_hand as load_hand  # registers hand:
    from kappaskin.recording import ReplayedSource as ReplayedSource  # registers replay:

    check_output(out, source.removeprefix("sim:"), *filter(None, [sensor]))
    if source == "-" and dwell is None:
        raise Refusal("expected --dwell: standard input is the sensor, and cannot answer; give it")
    source = of_sensor(source, sensor)
    Calibration.check_writable(out)
    if weights is not None:
        if radii is not None or hold or dwell is not None:
            raise Refusal("expected weights alone, without radii, hold and dwell; run it twice")
        return _weigh(source, out, _grams(weights), calibration, seconds, trust=trust, json=json)
    if calibration is not None:
        raise Refusal("expected --calibration together with --weights")
    try:
        swept, sweep = take_sweep(
            source,
            None if radii is None else _millimetres(radii),
            _answer_to,
            _report,
            seconds=seconds,
            hold=hold,
            dwell=dwell,
            trust=trust,
        )
        report = calibrated(sweep, swept, datetime.now(UTC))
        report.calibration.save(out)
    except KeyboardInterrupt:
        show("", error=True)
        raise Refusal("stopped before the last step; nothing was written") from None
    print_result(report.to_json(), json, lambda: lined(report.summary()))
    return FAILED if report.failed else 0


def _weigh(
    source: str,
    out: Path,
    masses: tuple[float, ...],
    calibration: Path | None,
    seconds: float,
    *,
    trust: bool,
    json: bool,
) -> int:
    """Fit the skin to known weights, and write the calibration with them."""
    from kappaskin.calibration import Calibration, take_weights

    before = None if calibration is None else Calibration.read(calibration)
    try:
        sensor, known = take_weights(
            source, masses, _answer_to, _report, seconds=seconds, trust=trust, before=before
        )
        now = datetime.now(UTC)
        (before or Calibration.nominal(sensor, now)).with_weights(known, now).save(out)
    except KeyboardInterrupt:
        show("", error=True)
        raise Refusal("stopped before the last step; nothing was written") from None
    print_result(known.to_json(), json, lambda: lined(known.lines()))
    return 0 if known.passed else FAILED


_READ = 0.05  # s that one read may wait


def tare(
    source: SourceName, *, undo: Switch = False, sensor: Described = None, trust: Switch = False
) -> None:
    """Tare a sensor: take its readings at rest as its zero.

    Refused, with the reason, while the skin is loaded or moves. The tare is saved under the
    sensor's serial number and used whenever it is connected; a simulated one is only printed.

    Example: `kappaskin tare /dev/ttyACM0`

    Parameters
    ----------
    source
        `sim:`, `sim:SCENE`, `feed:NAME`, or a port or URL for pyserial.
    undo
        Stop using this sensor's tare instead of taking one.
    trust
        Let the scene name files outside its folder.
    """
    # All of it before the source is opened: while modules load, readings wait.
    from kappaskin.calibration import TareMeasurement, TareStore
    from kappaskin.contact import LoadDetector
    from kappaskin.hand import load_hand as load_hand  # registers hand:
    from kappaskin.recording import ReplayedSource as ReplayedSource  # registers replay:
    from kappaskin.sources import open_source

    tares = TareStore(TareStore.user_folder())
    with closing(open_source(of_sensor(source, sensor), trust)) as opened:
        found = _answering(opened)
        if undo:
            tares.use(found.serial_number, None)
            show(f"{found.name} {found.serial_number}: no tare is in use")
            return
        used = None if found.simulated else tares.load(found.serial_number).fit_for(found)
        taring = TareMeasurement(found, time.monotonic())
        _take_readings(opened, found, taring)
        now = datetime.now().astimezone()
        taken = taring.tare(LoadDetector(found), _rest(found, used), now, opened.temperature)
    _print_tare(taken, used)
    if found.simulated:
        show("not saved: the sensor is simulated")
    else:
        tares.add(taken)
        show(f"saved in {tares.path(found.serial_number)}")


def _answering(source: "Source") -> "Sensor":
    while source.sensor is None:
        source.read(_READ)
        if source.trouble:
            raise Refusal(source.trouble)
    return source.sensor


def _take_readings(source: "Source", sensor: "Sensor", taring: "TareMeasurement") -> None:
    while not taring.done(time.monotonic()):
        for frame in source.read(_READ):
            taring.take(frame.device_time, frame.host_time, sensor.nominal(frame))
        if source.trouble:
            raise Refusal(source.trouble)
        if source.sensor is not sensor:
            raise Refusal("another device was connected, or the same one restarted; tare again")


def _rest(sensor: "Sensor", used: "Tare | None") -> "Rest":
    """What the sensor reads at rest as far as is known: the tare that is in use."""
    import numpy as np

    from kappaskin.calibration import Rest

    zero = np.zeros(sensor.channels) if used is None else used.offset
    return Rest(zero, np.zeros(sensor.channels), used)


def _print_tare(taken: "Tare", before: "Tare | None") -> None:
    """Print the tare that was taken, and how far it is from the one in use before."""
    import numpy as np

    offset, error = (math.sqrt(float(np.nanmean(x**2))) for x in (taken.offset, taken.offset_sd))
    warm = "" if taken.temperature is None else f" at {taken.temperature:.1f} degrees Celsius"
    show(
        f"{taken.name} {taken.serial_number}: {np.isfinite(taken.offset).sum()} of {len(taken)} "
        f"channels tared{warm}, offsets of {with_error(offset, error, '1/m')} ({ONE_SIGMA}, RMS)"
    )
    if before is not None:
        moved = math.sqrt(float(np.nanmean((taken.offset - before.offset) ** 2)))
        show(f"{moved:.3g} 1/m (RMS) from the tare of {before.date:%Y-%m-%d %H:%M}")


def press(
    source: str,
    *,
    quick: Switch = False,
    patience: float = 20.0,
    trust: Switch = False,
    json: Switch = False,
) -> int:
    """Verify the channel map: press one element after the other and see which one responds.

    Asks for one element after the other and detects when it is pressed and released; a simulated
    source needs no help. The exit code is 1 if the map is not confirmed.

    Example: `kappaskin press /dev/ttyACM0 --quick`

    Parameters
    ----------
    source
        `sim:`, `sim:SCENE`, `feed:NAME`, or a port or URL for pyserial.
    quick
        On a grid, press two elements in each row and column only: enough to see whether rows,
        columns or components are exchanged, but not every pair of elements.
    patience
        Seconds to wait for a response before asking for the next element.
    trust
        Let the scene name files outside its folder.
    json
        Print one JSON object with every press and the map that was found.
    """
    from kappaskin.calibration import press_elements
    from kappaskin.hand import load_hand as load_hand  # registers hand:
    from kappaskin.recording import ReplayedSource as ReplayedSource  # registers replay:

    try:
        test, verdict = press_elements(
            source,
            _report,
            quick=quick,
            patience=patience,
            trust=trust,
        )
    except KeyboardInterrupt:
        show("", error=True)
        raise Refusal("stopped before the last element; the map was not verified") from None
    value = {
        "confirmed": verdict.confirmed,
        "words": list(verdict.words),
        "order": None if verdict.order is None else verdict.order.tolist(),
        "pressed": [
            {"asked": p.target, "verdict": p.verdict, "answered": p.element} for p in test.done
        ],
    }
    print_result(value, json, lambda: lined(verdict.words))
    return 0 if verdict.confirmed else FAILED


_WAIT = 0.1  # s


def monitor(
    port: SourceName, *, seconds: float = math.inf, reset: Switch = False, sensor: Described = None
) -> int:
    """Print the messages of a device as readable lines, for bring-up.

    Every message with its sequence number, time and content (of scans, ten a second), every gap and
    every discarded byte, and a summary at the end (Ctrl+C). Exit code 1 if no message arrived, or
    the connection was lost.

    Example: `kappaskin monitor /dev/ttyACM0`

    Parameters
    ----------
    port
        A port, or a URL that pyserial opens.
    seconds
        How long to listen; until stopped when left out.
    reset
        Pulse DTR and RTS first, which resets many boards.
    """
    from kappaskin.sources import WireMonitor, load_description, parts_of

    check_time(seconds, "listen")
    file, url = parts_of(of_sensor(port, sensor))
    described = load_description(Path(file)) if file else None
    stopped = stops()
    end = time.monotonic() + seconds
    with closing(WireMonitor(url or port, description=described)) as listening:
        if reset:
            listening.reset()
        while not (stopped or listening.lost) and time.monotonic() < end:
            for line in listening.read(_WAIT):
                show(line)
    show(listening.summary())
    return (
        FAILED
        if (listening.lost and not listening.ended) or not listening.accounting().accepted
        else 0
    )


def device(
    scene: str = "",
    *,
    rate: float | None = None,
    dwell: float | None = None,
    sensor: Described = None,
    trust: Switch = False,
) -> None:
    """Run a simulated sensor on a pseudo-terminal, like a real one on a serial port.

    Prints one JSON line with the port, then serves until stopped (Ctrl+C); then prints on standard
    error how many messages it numbered and how many of these it could not send.

    Example: `kappaskin device circle --rate 500`

    Parameters
    ----------
    scene
        What to simulate; the default scene when left out.
    rate
        Frames per second; the scene's when left out.
    dwell
        Seconds on each cylinder, in the scene `calibration`; one when left out.
    trust
        Let the scene name files outside its folder.
    """
    from kappaskin.scenes import load_scene
    from kappaskin.sources import PseudoDevice, load_description

    described = None if sensor is None else load_description(sensor)
    played = load_scene(scene, trust)
    if dwell is not None:
        if played.laid is None:
            raise Refusal(
                f"the scene {played.name} has no cylinders to dwell on; leave --dwell out"
            )
        played = replace(played, laid=replace(played.laid, dwell=dwell))
    played = played if rate is None else replace(played, rate=rate)
    server = PseudoDevice(played, description=described)
    stopped = stops()
    show(json.dumps({"port": server.port, "rate": server.rate}))
    server.serve(lambda: bool(stopped))
    server.close()
    show(json.dumps({"spent": server.spent, "unsent": server.unsent}), error=True)
