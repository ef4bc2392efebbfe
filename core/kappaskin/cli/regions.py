"""What scanning a region buys and costs."""

from kappaskin.cli.common import Switch, print_json
from kappaskin.studies.regions import regions as measured_regions
from kappaskin.studies.text import regions_text


def regions(*, json: Switch = False) -> None:
    """Measure what scanning a region of interest buys and costs, on a contact that moves.

    Example: `kappaskin regions --json`

    Parameters
    ----------
    json
        Print one JSON list of rows instead of a table.
    """
    rows = measured_regions()
    if json:
        print_json(rows)
    else:
        print(regions_text(rows))
