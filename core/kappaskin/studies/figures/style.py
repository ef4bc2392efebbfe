"""Style of the figures: sizes for print, colours, and reproducible files."""

import io
import re
from collections.abc import Callable, Generator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

import numpy as np

from kappaskin._text import printable
from kappaskin.errors import lacking
from kappaskin.frames import Array
from kappaskin.pipeline import SEQUENTIAL

Figure = Any
"""matplotlib.figure.Figure: Matplotlib is loaded when a figure is drawn, not to check types."""
Axes = Any
"""matplotlib.axes.Axes, flat or 3-D."""

DOUBLE = 174.0
"""Width in mm of two columns."""

INK, FAINT, GREY, LINE, FILL = "#16191d", "#5b6470", "#9aa3ad", "#c6ccd4", "#e9edf2"
BLUE, ORANGE = "#2166ac", "#bd5a14"
DIVERGING = ("#08306b", "#2166ac", "#5b9fd0", "#b6d5ea", "#f6f6f4", "#f9cfa5", "#e8954a",
             "#bd5a14", "#6e2a04")  # fmt: skip
"""The anchors of the app's colour map of both signs: blue to white to orange."""

_RULES = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans", "Verdana", "Arial", "Helvetica"],
    "text.parse_math": False,
    "font.size": 7.5,
    "axes.labelsize": 7.5,
    "axes.titlesize": 7.5,
    "legend.fontsize": 7.0,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.unicode_minus": True,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "grid.color": LINE,
    "grid.linewidth": 0.4,
    "lines.linewidth": 1.2,
    "lines.markersize": 3.5,
    "patch.linewidth": 0.0,
    "legend.frameon": False,
    "legend.handlelength": 1.6,
    "legend.borderaxespad": 0.2,
    "savefig.dpi": 300,
    # Text stays text, to be searched and edited; DejaVu Sans is wider than what may stand in. No
    # $formulas$: they come out letter by letter, which not every viewer puts in its place.
    "svg.fonttype": "none",
    "svg.hashsalt": "kappaskin",
}


# Neither a date nor a version: the same run gives the same bytes.
KINDS = {"svg": {"Date": None, "Creator": "kappaskin"}, "png": {"Software": "kappaskin"}}
"""What a figure can be written as, with the metadata of the file."""


def loaded() -> Any:
    """Matplotlib, or a refusal where it is missing."""
    try:
        import matplotlib.figure  # pyright: ignore[reportUnusedImport]
    except ImportError as error:
        raise lacking("plots", "a figure", error) from error
    return matplotlib


@contextmanager
def sheet(pyplot: bool = False) -> Generator[Figure]:
    """An empty figure, to be drawn and saved inside the context, whatever the user's own style.

    Of `pyplot` it is one that a notebook or a window shows.
    """
    mpl = loaded()
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_RULES)
        yield import_module("matplotlib.pyplot").figure() if pyplot else mpl.figure.Figure()


def drawn(draw: Callable[[Figure], None], *kinds: str) -> dict[str, bytes]:
    """What `draw` draws on an empty figure, as a file of each of some `KINDS`."""
    files = {kind: io.BytesIO() for kind in kinds}
    with sheet() as figure:
        draw(figure)
        for kind, file in files.items():
            figure.savefig(file, format=kind, metadata=KINDS[kind])
    return {kind: file.getvalue() for kind, file in files.items()}


def resize(figure: Figure, width: float, height: float) -> None:
    """Make `figure` of `width` x `height` mm."""
    figure.set_size_inches(width / 25.4, height / 25.4)


def place(figure: Figure, box: tuple[float, float, float, float], **kind: Any) -> Axes:
    """Axes in a `box` of left, bottom, width and height, all in mm of the sheet."""
    W, H = figure.get_size_inches() * 25.4
    left, bottom, width, height = box
    return figure.add_axes((left / W, bottom / H, width / W, height / H), **kind)


def write(figure: Figure, x: float, y: float, text: str, **look: Any) -> None:
    """Text that begins at `x`, `y` in mm of the sheet; a minus is as wide as a plus."""
    W, H = figure.get_size_inches() * 25.4
    text = printable(re.sub(r"-(?=\d)", "−", text), keep="\n")
    figure.text(x / W, y / H, text, parse_math=False, **look)  # a name may have a $


def letter(figure: Figure, x: float, y: float, text: str, title: str) -> None:
    """A panel's bold letter and its title, whose top left corner is at `x`, `y` in mm."""
    write(figure, x, y, text, weight="bold", size=9, va="top")
    write(figure, x + 5.5, y - 0.35, title, va="top")


def key(figure: Figure, axes: Axes, y: float) -> None:
    """One row that names everything labelled in `axes`, in the middle of the sheet at `y` mm."""
    handles, labels = axes.get_legend_handles_labels()
    _, H = figure.get_size_inches() * 25.4
    figure.legend(handles, labels, loc="center", bbox_to_anchor=(0.5, y / H), ncols=len(labels))


def arrow(axes: Axes, start: tuple[float, ...], end: tuple[float, ...], **look: Any) -> None:
    """An arrow from `start` to `end` in the axes' own units."""
    props = {"arrowstyle": "-|>", "lw": 1.2, "color": INK, "shrinkA": 0, "shrinkB": 0} | look
    axes.annotate("", end, start, arrowprops=props)


def dimension(axes: Axes, start: tuple[float, float], end: tuple[float, float]) -> None:
    """A thin arrow with a head at either end, as in a workshop drawing."""
    arrow(axes, start, end, arrowstyle="<|-|>", lw=0.6, mutation_scale=5)


def colour_map(anchors: tuple[str, ...]) -> Any:
    """Colours that pass evenly through `anchors`."""
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list("kappaskin", anchors)


def space(axes: Axes, box: tuple[float, float, float] = (4, 4, 2.6)) -> None:
    """Make 3-D `axes` a plain box seen in parallel projection, its labels close to its edges."""
    axes.set_proj_type("ortho")
    axes.view_init(26, -58)
    axes.set_box_aspect(box)
    axes.patch.set_alpha(0)  # or a panel's corner hides its neighbour's label
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_pane_color((1, 1, 1))
        axis.set_tick_params(pad=-3)
        axis.labelpad = -5
    axes.zaxis.labelpad = -9


def mesh(axes: Axes, points: Array, value: Array, limits: tuple[float, float]) -> None:
    """A surface of `points` (ny, nx, 3) in 3-D, coloured by `value` (ny, nx) inside `limits`."""
    low, high = limits
    corners = [
        value[i:ny, j:nx] for i, ny in ((0, -1), (1, None)) for j, nx in ((0, -1), (1, None))
    ]
    share = (np.mean(corners, axis=0) - low) / (high - low)
    axes.plot_surface(
        *np.moveaxis(points, -1, 0),
        facecolors=colour_map(SEQUENTIAL)(share),
        edgecolor=(1, 1, 1, 0.55), linewidth=0.3, shade=False, rstride=1, cstride=1,
    )  # fmt: skip
