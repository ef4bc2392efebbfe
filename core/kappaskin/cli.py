"""The command `kappaskin`: each subcommand in a few lines."""

import json
import os
import signal
import sys
from dataclasses import replace
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import App, CycloptsError, Parameter

from kappaskin.calibration import calibrate as calibrated
from kappaskin.calibration import check_place, save_calibration
from kappaskin.doctor import examine
from kappaskin.errors import Refusal
from kappaskin.figures import FIGURES, write_figures
from kappaskin.figures.cost import check_plot, write_plot
from kappaskin.fit import METHODS
from kappaskin.guide import summary, take_sweep
from kappaskin.reconstruct import reconstruct as reconstructed
from kappaskin.scene import Scene, load_scene
from kappaskin.studies.as_printed import misprints
from kappaskin.studies.cost import (
    Cost,
    Measuring,
    Refused,
    costs_text,
    length_of,
    rows,
    settings_to_try,
    verdict,
)
from kappaskin.studies.regions import regions as measured_regions
from kappaskin.studies.stability import stability as measured_stability
from kappaskin.studies.stability import stability_text
from kappaskin.studies.tables import tables as computed_tables
from kappaskin.studies.text import misprints_text, regions_text, tables_text

FAILED = 1
"""Exit code of a command that was done, with something in the result that failed."""

REFUSED = 2
"""Exit code of a command that cannot be done, with the reason on standard error."""

app = App(
    name="kappaskin",
    help="Shape and contact from curvature-sensing tactile skins.",
    version=metadata.version("kappaskin"),
    help_format="markdown",
)


def _pair(text: str, what: str) -> tuple[int, int]:
    try:
        first, second = (int(part) for part in text.lower().split("x"))
    except ValueError:
        raise Refusal(f"expected {what} as two numbers such as 8x8, got {text!r}") from None
    return first, second


# A hyphen is let through so that -1x8 is refused as a basis, not as an option.
_Pair = Annotated[str, Parameter(allow_leading_hyphen=True)]


@app.command
def tables(
    *,
    method: str = next(iter(METHODS)),
    basis: _Pair = "8x8",
    json: Annotated[bool, Parameter(negative="")] = False,
    as_printed: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Compute the paper's Tables 1 and 2 and print them beside the printed numbers.

    Example: `kappaskin tables --method bayes --basis 15x15`

    Parameters
    ----------
    method
        How the coefficients are found, as in `kappaskin reconstruct`.
    basis
        Number of functions along x and y; on the fingertip of Table 2 those along the arc.
    json
        Print one JSON list of rows instead of tables.
    as_printed
        Instead, tell what the paper misprints, what that would give and why it is not meant.
    """
    rows = misprints() if as_printed else computed_tables(method, _pair(basis, "a basis"))
    if json:
        _print_json(rows)
    else:
        print(misprints_text(rows) if as_printed else tables_text(rows))


@app.command
def reconstruct(
    readings: Path,
    *,
    out: Path,
    basis: _Pair = "8x8",
    grid: _Pair | None = None,
    edge: str = "hinged",
    method: str = next(iter(METHODS)),
    contact: Annotated[bool, Parameter(negative="")] = False,
    objects: Annotated[bool, Parameter(negative="")] = False,
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
    points = _pair(grid, "a grid") if grid else None
    functions = _pair(basis, "a basis")
    found = reconstructed(readings, functions, points, edge, method, contact, objects)
    try:
        with out.open("wb") as file:
            np.savez(file, **found)  # pyright: ignore[reportArgumentType]
    except OSError as error:
        raise Refusal(f"{out}: cannot be written ({error}); choose another place") from error
    print(f"{out}: {len(found['coefficients'])} shapes", file=sys.stderr)


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


@app.command
def calibrate(
    source: str,
    *,
    out: Path,
    radii: str | None = None,
    seconds: float = 1.0,
    hold: float = 0.0,
    dwell: float | None = None,
    json: Annotated[bool, Parameter(negative="")] = False,
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
    check_place(out)
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
        _print_json(report.to_json())
    else:
        print(*summary(report), sep="\n")
    return FAILED if report.failed else 0


@app.command
def regions(*, json: Annotated[bool, Parameter(negative="")] = False) -> None:
    """Measure what scanning a region of interest buys and costs, on a contact that moves.

    Example: `kappaskin regions --json`

    Parameters
    ----------
    json
        Print one JSON list of rows instead of a table.
    """
    rows = measured_regions()
    if json:
        _print_json(rows)
    else:
        print(regions_text(rows))


def _measured(scene: Scene) -> list[Cost | Refused]:
    """What every setting costs; on a terminal, a line on standard error tells how far it is."""
    settings, found = settings_to_try(scene), list[Cost | Refused]()
    told = sys.stderr.isatty()
    try:
        with Measuring(scene, settings) as measuring:
            for cost in measuring.wait():
                found.append(cost)
                done = 40 * len(found) // len(settings)
                if told:
                    bar = f"\r[{'#' * done:<40}] {len(found)} of {len(settings)}"
                    print(bar, end="", file=sys.stderr, flush=True)
    except KeyboardInterrupt:
        raise Refusal("stopped before the last setting; nothing was written") from None
    finally:
        if told:
            print(file=sys.stderr)
    return found


@app.command
def cost(
    *,
    scene: str = "",
    within: _Pair | None = None,
    plot: Path | None = None,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Measure what accuracy costs: error, time and memory of every method and setting.

    Takes about a minute. Bases, elements, precisions and channels are combined with each method;
    marked are the settings that no other one beats in both error and time.

    Example: `kappaskin cost --within 0.02mm --plot cost.svg`

    Parameters
    ----------
    scene
        The scene to measure on; the default one when left out.
    within
        Instead of a table, name the setting that reaches this RMS error in the least time,
        conversion included, such as 0.02mm or 20um; or say what is missing, with exit code 1.
    plot
        The file, SVG or PNG, to draw error against time into.
    json
        Print one JSON list of rows instead of a table; with --within one object.
    """
    asked = None if within is None else length_of(within)
    on = load_scene(scene)
    if plot is not None:
        check_plot(plot)
    found = _measured(on)
    if plot is not None:
        write_plot(plot, on, found)
    if asked is None:
        if json:
            _print_json(rows(on, found))
        else:
            print(costs_text(on, found))
        return 0
    answer = verdict(on, found, asked)
    if json:
        _print_json(answer.to_json())
    else:
        print(*answer.said, sep="\n")
    return 0 if answer.reached else FAILED


@app.command
def stability(
    *,
    json: Annotated[bool, Parameter(negative="")] = False,
    long: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Run hard cases through every method that claims them, and judge each answer.

    Example: `kappaskin stability --json`

    Parameters
    ----------
    json
        Print one JSON list of rows instead of a table.
    long
        Run the longest cases too: a million frames, up to 512 functions a side.
    """
    told = sys.stderr.isatty()
    rows = measured_stability(long, lambda case: print(case, file=sys.stderr) if told else None)
    if json:
        _print_json(rows)
    else:
        print(stability_text(rows))


@app.command
def device(scene: str = "", *, rate: float | None = None, dwell: float | None = None) -> None:
    """Play a simulated sensor on a pseudo-terminal, as a real one would on a serial port.

    Prints one JSON line with the port, then serves until stopped (Ctrl+C); then tells on standard
    error how many messages it spent a sequence number on and how many it could not send.

    Example: `kappaskin device circle --rate 500`

    Parameters
    ----------
    scene
        What to simulate; the default scene when left out.
    rate
        Frames per second; the scene's when left out.
    dwell
        Seconds on each cylinder, in the scene `calibration`; one when left out.
    """
    try:
        from kappaskin.sources.device import PseudoDevice
    except ImportError as error:
        raise Refusal("expected a system with pseudo-terminals (Linux, macOS)") from error
    played = load_scene(scene)
    if dwell is not None:
        if played.laid is None:
            raise Refusal(
                f"the scene {played.name} has no cylinders to dwell on; leave --dwell out"
            )
        played = replace(played, laid=replace(played.laid, dwell=dwell))
    server = PseudoDevice(played if rate is None else replace(played, rate=rate))
    stopped: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda got, _: stopped.append(got))
    print(json.dumps({"port": server.port, "rate": server.rate}), flush=True)
    server.serve(lambda: bool(stopped))
    server.close()
    print(json.dumps({"spent": server.spent, "unsent": server.unsent}), file=sys.stderr)


@app.command
def figures(
    *,
    out: Path,
    only: Annotated[tuple[str, ...], Parameter(consume_multiple=True, negative="")] = tuple(
        FIGURES
    ),
    json: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Draw the paper's figures, from runs of our own, as SVG and PNG.

    Example: `kappaskin figures --out figures --only fig6 fig9`

    Parameters
    ----------
    out
        The folder to write to; made when there is none.
    only
        The figures to draw; all when left out.
    json
        Print one JSON list of the files instead of one a line.
    """
    written = [str(path) for path in write_figures(out, only)]
    if json:
        _print_json(written)
        return
    print(*written, sep="\n")


@app.command
def doctor(*, json: Annotated[bool, Parameter(negative="")] = False) -> None:
    """Tell what this machine has, what is missing, and the line that installs it.

    Example: `kappaskin doctor`

    Parameters
    ----------
    json
        Print one JSON object instead of text.
    """
    found = examine()
    if json:
        _print_json(found)
        return
    for name in ("kappaskin", "python", "system"):
        print(f"{name:<20}{found[name]}")
    for package, version in found["packages"].items():
        print(f"{package:<20}{version or 'not installed'}")
    print(f"{'display':<20}{found['display'] or 'none (a virtual one will be used)'}")
    for port in found["serial_ports"]:
        may = "" if port["opened"] else "  no permission: sudo usermod -aG dialout $USER"
        print(f"{port['port']:<19} {port['description']}{may}")
    if not found["serial_ports"]:
        print(f"{'serial ports':<20}none found")
    print(f"{'missing':<20}{' '.join(found['missing']) or 'nothing'}")
    if None in found["packages"].values():
        print("Install the desktop app's packages with: pip install 'kappaskin[app]'")
    if found["install"]:
        print(f"Install what is missing with: sudo {found['install']}")


def _print_json(value: Any) -> None:
    print(json.dumps(value, allow_nan=False))


def _add_commands() -> None:
    for entry in metadata.entry_points(group="kappaskin.commands"):
        if entry.name not in app:
            app.command(entry.load(), name=entry.name)


def main(arguments: list[str] | None = None) -> int:
    """Run one command; the exit code is 0 when done, 1 or 2 as said above."""
    _add_commands()
    try:
        code = app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
        sys.stdout.flush()
        return int(code or 0)
    except Refusal as refusal:
        print(f"kappaskin: {refusal}", file=sys.stderr)
        return REFUSED
    except CycloptsError as error:
        print(f"kappaskin: {error} See `kappaskin --help`.", file=sys.stderr)
        return REFUSED
    except BrokenPipeError:
        # Whoever read our output has gone; what is still buffered must have somewhere to go.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 0
