"""Where the docks of a window are, in words, and the layouts that are ready."""

from collections.abc import Mapping
from dataclasses import dataclass

LEFT, RIGHT, TOP, BOTTOM, FLOATING = "left", "right", "top", "bottom", "floating"
AREAS = (LEFT, RIGHT, TOP, BOTTOM, FLOATING)
BESIDE = ("lesson", "settings", "curvature")
BELOW = (
    *("cost", "stability", "scene", "health", "compare", "design"),
    *("element", "traces", "numbers", "log", "guide"),
)
DOCKS = BESIDE + BELOW


@dataclass(frozen=True)
class Place:
    """Where a dock is.

    In an area the docks follow one another, are `tabbed` with the one before, or across the way
    they follow: `beside` it in a column, below it in a row. Of tabs the one in `front` is seen.
    Its `share` is that of the window's width, or height above and below the skin; `along` the
    area its share of the other. One that floats is `at` (x, y, width, height) in px.
    """

    area: str
    shown: bool = True
    tabbed: bool = False
    front: bool = False
    beside: bool = False
    share: float = 0.0
    along: float = 0.0
    at: tuple[int, int, int, int] | None = None


@dataclass(frozen=True)
class Layout:
    """The page of the panels, counted from 0, and the `docks` by name, in order within an area."""

    page: int
    docks: tuple[tuple[str, Place], ...]


def _ready(page: int, *below: str, share: float = 0.0, lesson: bool = False) -> Layout:
    """Settings and curvature beside the skin, and below it at most one dock, so high."""
    docks = [("lesson", Place(LEFT, shown=lesson, share=0.25 if lesson else 0.0))]
    docks += [("settings", Place(LEFT, share=0.25)), ("curvature", Place(RIGHT, share=0.22))]
    docks += [(name, Place(BOTTOM, share=share)) for name in below]
    docks += [(name, Place(BOTTOM, shown=False)) for name in BELOW if name not in below]
    return Layout(page, tuple(docks))


LIVE, PRESENTER = "Live", "Presenter"
READY: Mapping[str, Layout] = {
    LIVE: _ready(0),
    "Teach": _ready(0, lesson=True),
    "Calibrate": _ready(3, "health", share=0.3),
    "Study": _ready(0, "cost", share=0.36),
    PRESENTER: _ready(0),
}
