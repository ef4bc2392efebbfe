"""The same work by others."""

from dataclasses import asdict

from kappaskin.cli.common import Switch, print_json
from kappaskin.studies import compared, compared_text


def compare(*, json: Switch = False) -> None:
    """Run the same work through what one would use instead: error, time and memory side by side.

    NumPy's and SciPy's least squares and scikit-fem's finite elements, each set as well as it can
    be. Needs `kappaskin[compare]`; takes some seconds.

    Example: `kappaskin compare --json`

    Parameters
    ----------
    json
        Print one JSON list of rows instead of a table.
    """
    rows = compared()
    if json:
        print_json([asdict(row) for row in rows])
    else:
        print(compared_text(rows))
