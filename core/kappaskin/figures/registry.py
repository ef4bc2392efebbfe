"""Names to figures, and figures to files."""

from collections.abc import Callable, Iterable
from pathlib import Path
from tempfile import TemporaryDirectory

from kappaskin.errors import Refusal
from kappaskin.figures import fig1, fig2, fig6, fig8, fig9, initial_curvature, style

FIGURES: dict[str, Callable[[style.Figure], None]] = {
    "fig1": fig1.draw,
    "fig2": fig2.draw,
    "fig6": fig6.draw,
    "fig8": fig8.draw,
    "fig9": fig9.draw,
    "initial-curvature": initial_curvature.draw,
}
"""What draws each figure on an empty matplotlib.figure.Figure; fig1 to fig9 are the paper's."""

# Neither a date nor a version: the same run gives the same bytes.
_KINDS = {"svg": {"Date": None, "Creator": "kappaskin"}, "png": {"Software": "kappaskin"}}


def _known(names: Iterable[str]) -> list[str]:
    wanted = list(dict.fromkeys(names))
    unknown = [name for name in wanted if name not in FIGURES]
    if unknown or not wanted:
        got = ", ".join(map(repr, unknown)) or "none"
        raise Refusal(f"expected figures among {', '.join(FIGURES)}; got {got}")
    return wanted


def write_figures(out: Path, names: Iterable[str]) -> list[Path]:
    """Draw the figures `names` into the folder `out`, each as SVG and as PNG: the files written.

    The folder is made when there is none. Nothing in it is replaced before all are drawn.
    """
    wanted = _known(names)
    style.loaded()  # or refused before a folder is made
    try:
        out.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(prefix=".figures-", dir=out) as room:
            made = [path for name in wanted for path in _draw_into(Path(room), name)]
            return [path.replace(out / path.name) for path in made]
    except OSError as error:
        raise Refusal(
            f"{out}: expected a folder that can be written to ({error}); choose another"
        ) from error


def _draw_into(room: Path, name: str) -> list[Path]:
    paths = [room / f"{name}.{kind}" for kind in _KINDS]
    with style.sheet() as figure:
        FIGURES[name](figure)
        for path, metadata in zip(paths, _KINDS.values(), strict=True):
            figure.savefig(path, metadata=metadata)
    return paths
