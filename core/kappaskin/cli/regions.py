"""What scanning a region buys and costs."""

from kappaskin.cli.common import Switch, print_json
from kappaskin.studies import regions_text, run_regions


def regions(*, json: Switch = False) -> None:
    """Measure what scanning a region of interest buys and costs, on a contact that moves.

    Example: `kappaskin regions --json`

    Parameters
    ----------
    json
        Print one JSON list of rows instead of a table.
    """
    rows = run_regions()
    if json:
        print_json(rows)
    else:
        print(regions_text(rows))
