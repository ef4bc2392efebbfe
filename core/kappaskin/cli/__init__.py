"""The command `kappaskin`: a file for each subcommand, in a few lines."""

import os
import sys
from importlib import metadata

from cyclopts import App, CycloptsError

from kappaskin.cli import (
    calibrate,
    compare,
    cost,
    device,
    doctor,
    drill,
    export,
    figures,
    info,
    listen,
    monitor,
    plan,
    press,
    publish,
    reconstruct,
    record,
    regions,
    repair,
    report,
    simulate,
    stability,
    study,
    tables,
    tare,
    verify,
)
from kappaskin.cli.common import FAILED as FAILED
from kappaskin.cli.common import REFUSED as REFUSED
from kappaskin.errors import Refusal

app = App(
    name="kappaskin",
    help="Shape and contact from curvature-sensing tactile skins.",
    version=metadata.version("kappaskin"),
    help_format="markdown",
)
for command in (
    tables.tables,
    reconstruct.reconstruct,
    calibrate.calibrate,
    tare.tare,
    press.press,
    regions.regions,
    cost.cost,
    compare.compare,
    stability.stability,
    study.study,
    report.report,
    plan.plan,
    simulate.simulate,
    device.device,
    drill.drill,
    export.export,
    monitor.monitor,
    record.record,
    info.info,
    verify.verify,
    repair.repair,
    publish.publish,
    listen.listen,
    figures.figures,
    doctor.doctor,
):
    app.command(command)


def _add_commands() -> None:
    for entry in metadata.entry_points(group="kappaskin.commands"):
        if entry.name not in app:
            app.command(entry.load(), name=entry.name)


def _named(arguments: list[str] | None) -> str:
    """The command that was typed, as far as there is one."""
    first, *_ = (sys.argv[1:] if arguments is None else arguments) or [""]
    return f"kappaskin {first}" if first and first in app else "kappaskin"


def main(arguments: list[str] | None = None) -> int:
    """Run one command; the exit code is 0 when done, 1 or 2 as `FAILED` and `REFUSED` say."""
    _add_commands()
    try:
        code = app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
        sys.stdout.flush()
        return int(code or 0)
    except Refusal as refusal:
        print(f"kappaskin: {refusal}", file=sys.stderr)
        return REFUSED
    except CycloptsError as error:
        print(f"kappaskin: {error} See `{_named(arguments)} --help`.", file=sys.stderr)
        return REFUSED
    except MemoryError as error:
        print(f"kappaskin: {error}; ask for less of it, or of finer things", file=sys.stderr)
        return REFUSED
    except BrokenPipeError:
        # Whoever read our output has gone; what is still buffered must have somewhere to go.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 0
