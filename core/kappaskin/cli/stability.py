"""Hard cases through every method."""

import sys

from kappaskin.cli.common import Switch, print_json
from kappaskin.studies import run_stability, stability_text


def stability(
    *,
    json: Switch = False,
    long: Switch = False,
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
    rows = run_stability(long, lambda case: print(case, file=sys.stderr) if told else None)
    if json:
        print_json(rows)
    else:
        print(stability_text(rows))
