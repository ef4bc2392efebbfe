"""The paper's tables, computed."""

from kappaskin.cli.common import Pair, Switch, pair, print_json
from kappaskin.estimation import METHODS
from kappaskin.studies import misprints, misprints_text, paper_tables, tables_text


def tables(
    *,
    method: str = next(iter(METHODS)),
    basis: Pair = "8x8",
    json: Switch = False,
    as_printed: Switch = False,
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
    rows = misprints() if as_printed else paper_tables(method, pair(basis, "a basis"))
    if json:
        print_json(rows)
    else:
        print(misprints_text(rows) if as_printed else tables_text(rows))
