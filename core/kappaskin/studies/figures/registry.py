"""Names to figures, and figures to files."""

from collections.abc import Callable, Iterable
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory

from kappaskin.errors import Refusal
from kappaskin.studies.figures import style

Draw = Callable[[style.Figure], None]


def _of(module: str) -> Draw:
    """What draws the figure of that module, which is imported when it is first drawn."""
    return lambda figure: import_module(f"kappaskin.studies.figures.{module}").draw(figure)


FIGURES: dict[str, Draw] = {
    "fig1": _of("fig1"),
    "fig2": _of("fig2"),
    "fig6": _of("fig6"),
    "fig8": _of("fig8"),
    "fig9": _of("fig9"),
    "initial-curvature": _of("initial_curvature"),
}
"""What draws each figure on an empty matplotlib.figure.Figure; fig1 to fig9 are the paper's."""

# Neither a date nor a version: the same run gives the same bytes.
KINDS = {"svg": {"Date": None, "Creator": "kappaskin"}, "png": {"Software": "kappaskin"}}


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
    paths = [room / f"{name}.{kind}" for kind in KINDS]
    with style.sheet() as figure:
        FIGURES[name](figure)
        for path, metadata in zip(paths, KINDS.values(), strict=True):
            figure.savefig(path, metadata=metadata)
    return paths
