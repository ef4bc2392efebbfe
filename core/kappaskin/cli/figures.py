"""The paper's figures, from runs of our own."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from kappaskin.cli.common import Switch, print_json
from kappaskin.studies import FIGURES, write_figures


def figures(
    *,
    out: Path,
    only: Annotated[tuple[str, ...], Parameter(consume_multiple=True, negative="")] = tuple(
        FIGURES
    ),
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
    written = [str(path) for path in write_figures(out, only)]
    if json:
        print_json(written)
        return
    print(*written, sep="\n")
