"""Commands of the paper: tables, figures."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from kappaskin.cli.common import Pair, Switch, pair, print_result
from kappaskin.studies import FIGURES

Some = Annotated[tuple[str, ...], Parameter(consume_multiple=True, negative="")]
"""One or more names after the option."""


def tables(
    *,
    method: str = "least-squares",
    basis: Pair = "8x8",
    json: Switch = False,
    as_printed: Switch = False,
) -> None:
    """Compute the paper's Tables 1 and 2 and print them beside the printed numbers.

    Example: `kappaskin tables --method bayes --basis 15x15`

    Parameters
    ----------
    method
        The estimator, as in `kappaskin reconstruct`.
    basis
        Number of functions along x and y; on the fingertip of Table 2 those along the arc.
    json
        Print one JSON list of rows instead of tables.
    as_printed
        Instead, list the paper's misprints, what they would give and why they are not meant.
    """
    from kappaskin.studies import misprints, misprints_text, paper_tables, tables_text

    rows = misprints() if as_printed else paper_tables(method, pair(basis, "a basis"))
    text = misprints_text if as_printed else tables_text
    print_result(rows, json, lambda: text(rows))


def figures(
    *,
    out: Path,
    only: Some = tuple(FIGURES),
    json: Switch = False,
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
    from kappaskin.studies import write_figures

    written = [str(path) for path in write_figures(out, only)]
    print_result(written, json, lambda: "\n".join(written))
