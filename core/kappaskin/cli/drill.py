"""Faults on a user's own set-up."""

import sys

from kappaskin.cli.common import FAILED, Switch, print_json
from kappaskin.errors import Refusal


def drill(source: str = "", *, json: Switch = False, long: Switch = False) -> int:
    """Inflict faults on the line to a device, and tell what became of each.

    A relay before the device spoils what passes: noise, cuts, floods, unplugged cables. Exit code 1
    if a drill fails. Close the app first: the port is used.

    Example: `kappaskin drill /dev/ttyACM0`

    Parameters
    ----------
    source
        The device's port, or a URL that pyserial opens; a simulated device when left out.
    json
        Print one JSON list of rows instead of a table.
    long
        Do each for longer: 100 times unplugged, ten seconds of noise.
    """
    try:
        from kappaskin.studies import drills_text, run_drills
    except ImportError as error:
        raise Refusal("expected a system with pseudo-terminals (Linux, macOS)") from error
    told = sys.stderr.isatty()
    rows = run_drills(
        source or None, long, lambda name: print(name, file=sys.stderr) if told else None
    )
    if json:
        print_json(rows)
    else:
        print(drills_text(rows))
    return FAILED if any(row["verdict"] == "failed" for row in rows) else 0
