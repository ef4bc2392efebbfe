"""Figures of the paper: their names, the functions that draw them, and their files."""

from collections.abc import Callable, Iterable
from importlib import import_module
from pathlib import Path
from typing import Any

from kappaskin.errors import Refusal


def _drawn_by(module: str, name: str) -> Callable[[Any], None]:
    """The function of that `name`, whose module is imported when the figure is first drawn."""
    return lambda figure: getattr(import_module(f"{__name__}.{module}"), name)(figure)


FIGURES = {
    "fig1": _drawn_by("skins", "draw_strip"),
    "fig2": _drawn_by("skins", "draw_patch"),
    "fig6": _drawn_by("reconstruction", "draw_square"),
    "fig8": _drawn_by("hysteresis", "draw_loops"),
    "fig9": _drawn_by("reconstruction", "draw_fingertip"),
    "initial-curvature": _drawn_by("hysteresis", "draw_initial_curvature"),
}
"""What draws each figure on an empty matplotlib.figure.Figure; fig1 to fig9 are the paper's."""


def _known(names: Iterable[str]) -> list[str]:
    asked = list(dict.fromkeys(names))
    unknown = [name for name in asked if name not in FIGURES]
    if unknown or not asked:
        got = ", ".join(map(repr, unknown)) or "none"
        raise Refusal(f"expected figures among {', '.join(FIGURES)}; got {got}")
    return asked


def write_figures(out: Path, names: Iterable[str]) -> list[Path]:
    """Draw the figures `names` into the folder `out`, each as SVG and as PNG: the files written.

    The folder is made when there is none. Nothing in it is replaced before all are drawn.
    """
    from kappaskin._files import write_whole
    from kappaskin.studies.figures import style

    asked = _known(names)
    style.loaded()  # or refused before a folder is made
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise Refusal(
            f"{out}: expected a folder that can be written to ({error}); choose another"
        ) from error
    files = {
        out / f"{name}.{kind}": drawn
        for name in asked
        for kind, drawn in style.drawn(FIGURES[name], *style.KINDS).items()
    }
    for path, drawn in files.items():
        write_whole(path, drawn)
    return list(files)
