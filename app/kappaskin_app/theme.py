"""Colours: two themes for the window, and the colour maps of what is measured.

The palette of the application has the theme in use, and its property `colourMap` the name of the
colour map. Qt repaints every widget when the palette changes: what is painted with the colours of
`current` follows by itself, and so do labels whose foreground role is `FAINT` or `ALERT`. Widgets
with other colours use `follow_look`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from itertools import cycle
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QObject, QTimer
from PySide6.QtGui import QColor, QFont, QFontDatabase, QGuiApplication, QPalette
from PySide6.QtWidgets import QApplication, QWidget

Colours = NDArray[np.uint8]


@dataclass(frozen=True)
class Theme:
    """Every colour of the window, as #rrggbb."""

    window: str
    base: str
    text: str
    faint: str
    line: str
    accent: str
    on_accent: str
    scene: str
    scene_top: str
    missing: str
    good: str
    simulated: str
    replayed: str
    warning: str
    bad: str
    off: str
    alert: str
    disabled: str


LIGHT = Theme(
    window="#f3f4f6",
    base="#ffffff",
    text="#16191d",
    faint="#5b6470",
    line="#c6ccd4",
    accent="#1f6fb2",
    on_accent="#ffffff",
    scene="#dfe4ea",
    scene_top="#f8fafc",
    missing="#9aa3ad",
    good="#1b7f4b",
    simulated="#1f6fb2",
    replayed="#6d4aa8",
    warning="#9a5b00",
    bad="#b3261e",
    off="#5f6873",
    alert="#a3201a",
    disabled="#6b7480",
)
DARK = Theme(
    window="#1b1f24",
    base="#2a3038",
    text="#e8ebef",
    faint="#a0a9b4",
    line="#3a424c",
    accent="#5aa9e6",
    on_accent="#0f1216",
    scene="#0f1216",
    scene_top="#2b323b",
    missing="#59626d",
    good="#1b7f4b",
    simulated="#1f6fb2",
    replayed="#6d4aa8",
    warning="#9a5b00",
    bad="#b93a32",
    off="#5a636e",
    alert="#ff9a90",
    disabled="#8a939e",
)
_LATER, _APART, _TURNS = 20, 6, 10  # ms after which hidden widgets follow, in so many turns
_PAINTED = 1  # ms: a timer of none is no turn of its own
_turns = cycle(range(_TURNS))
THEMES = {"light": LIGHT, "dark": DARK}
FAINT, ALERT = QPalette.ColorRole.PlaceholderText, QPalette.ColorRole.BrightText
"""The roles of a theme's colours `faint` and `alert` in its palette."""


def palette(theme: Theme) -> QPalette:
    """Fusion's palette in the theme's colours; Qt's own dark scheme needs a platform theme."""
    roles = QPalette.ColorRole
    made = QPalette()
    for role, colour in {
        roles.Window: theme.window,
        roles.WindowText: theme.text,
        roles.Base: theme.base,
        roles.AlternateBase: theme.window,
        roles.Text: theme.text,
        roles.Button: theme.window,
        roles.ButtonText: theme.text,
        FAINT: theme.faint,
        ALERT: theme.alert,
        roles.ToolTipBase: theme.base,
        roles.ToolTipText: theme.text,
        roles.Highlight: theme.accent,
        roles.HighlightedText: theme.on_accent,
        roles.Link: theme.accent,
        roles.Mid: theme.line,
    }.items():
        made.setColor(role, QColor(colour))
    for role in (roles.WindowText, roles.Text, roles.ButtonText):
        made.setColor(QPalette.ColorGroup.Disabled, role, QColor(theme.disabled))
    return made


def bar_palette(theme: Theme) -> QPalette:
    """That of scroll bars: on a dark ground Fusion's handle is darker than what it slides in."""
    made = palette(theme)
    if QColor(theme.base).lightness() < 128:
        made.setColor(QPalette.ColorRole.Button, QColor(theme.off))
        made.setColor(QPalette.ColorRole.Base, QColor(theme.window))
    return made


def current() -> Theme:
    """The theme of the application's palette; light where it is another's."""
    window = QGuiApplication.palette().window().color().name()
    return next((theme for theme in THEMES.values() if theme.window == window), LIGHT)


def apply_look(theme: Theme, percent: float = 100.0, colours: str = "standard") -> None:
    """Show every window in `theme`, with letters of so many percent of the system's size.

    `colours` is the name of a colour map of `COLOUR_MAPS`. Windows are painted in a turn of the
    event loop after that in which their widgets get the palette.
    """
    for window in filter(QWidget.isVisible, QApplication.topLevelWidgets()):
        window.setUpdatesEnabled(False)
        QTimer.singleShot(_PAINTED, window, partial(window.setUpdatesEnabled, True))
    application = QApplication.instance()
    if application is not None and application.property(_PROPERTY) != colours:
        application.setProperty(_PROPERTY, colours)
        for widget in QApplication.allWidgets():
            QApplication.sendEvent(widget, QEvent(QEvent.Type.PaletteChange))
    QApplication.setPalette(palette(theme))
    QApplication.setPalette(bar_palette(theme), "QScrollBar")  # pyright: ignore[reportArgumentType]
    if (font := letters(percent)) != QApplication.font():
        QApplication.setFont(font)


class _LookFollower(QTimer):
    """Calls `show` when the palette or font of a widget changes; of a hidden one a while later.

    All hidden ones at once would hold the window.
    """

    def __init__(self, widget: QWidget, show: Callable[[], object]) -> None:
        later = _LATER + _APART * next(_turns)
        super().__init__(widget, singleShot=True, interval=later)  # pyright: ignore[reportCallIssue]
        self._show = show
        self.timeout.connect(show)
        widget.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() in (QEvent.Type.PaletteChange, QEvent.Type.FontChange):
            self.start()
        if self.isActive() and isinstance(watched, QWidget) and watched.isVisible():
            self.stop()
            self._show()
        return False


def follow_look(widget: QWidget, show: Callable[[], object]) -> None:
    """Call `show` now, and again when the theme or the font changes.

    That is once the window is drawn, or the widget shown, where it is hidden. `widget` has no style
    sheet: Qt sends one with a style sheet no such events.
    """
    _LookFollower(widget, show)
    show()


def letters(percent: float) -> QFont:
    """The system's font, at so many percent of its size."""
    font = QFontDatabase.systemFont(QFontDatabase.SystemFont.GeneralFont)
    font.setPointSizeF(font.pointSizeF() * percent / 100)
    return font


def grown(px: float) -> int:
    """`px` of the system's font, scaled to the present one."""
    return round(px * QGuiApplication.font().pointSizeF() / letters(100).pointSizeF())


def slider_style() -> str:
    """A slider whose groove is seen on a dark ground too, where Fusion's is lost."""
    theme = current()
    off, on = theme.off, theme.accent
    handle = "QSlider::handle:horizontal"
    return (
        f"QSlider::groove:horizontal {{ height: 4px; background: {theme.line}; }}"
        f"{handle} {{ width: 14px; margin: -5px 0; border-radius: 7px; background: {on};"
        f" border: 1px solid {on}; }}"
        f"{handle}:focus {{ border-color: {theme.text}; }}"
        f"{handle}:disabled {{ background: {off}; border-color: {off}; }}"
    )


def _colour_map(*anchors: str) -> Colours:
    """256 colours (256, 3) that pass evenly through `anchors`."""
    rgb = np.array([[int(a[i : i + 2], 16) for i in (1, 3, 5)] for a in anchors], float)
    at = np.linspace(0, len(anchors) - 1, 256)
    return np.column_stack(
        [np.interp(at, range(len(anchors)), rgb[:, channel]) for channel in range(3)]
    ).astype(np.uint8)


# Blue to white to orange: told apart in every common colour blindness, and equally dark at
# equal distance from zero.
DIVERGING = _colour_map(
    "#08306b",
    "#2166ac",
    "#5b9fd0",
    "#b6d5ea",
    "#f6f6f4",
    "#f9cfa5",
    "#e8954a",
    "#bd5a14",
    "#6e2a04",
)
# Dark blue to yellow, brighter all the way.
SEQUENTIAL = _colour_map("#1a2a5e", "#2c5282", "#3f7f8f", "#63a878", "#a9c95b", "#f5e663")
PULLED = SEQUENTIAL[::-1]  # the same for what lies below zero


class ColourMap(NamedTuple):
    """Colours (256, 3) of values above zero, of those below it, and of both signs."""

    sequential: Colours
    pulled: Colours
    diverging: Colours


# Sequential and diverging maps of Matplotlib and of Peter Kovesi (CET), from pyqtgraph. All are
# ordered by lightness alone, and told apart in every common colour blindness.
COLOUR_MAPS = {
    "standard": ("", ""),
    "viridis": ("viridis", "CET-D1A"),
    "cividis": ("cividis", "CET-CBD1"),
    "inferno": ("inferno", "CET-D6"),
    "grey": ("CET-L2", "CET-D9"),
}
_PROPERTY = "colourMap"


@cache
def colour_map(name: str) -> ColourMap:
    """The colour map of this name in `COLOUR_MAPS`."""
    if name == "standard":
        return ColourMap(SEQUENTIAL, PULLED, DIVERGING)
    import pyqtgraph  # takes 0.3 s to load

    maps: Any = pyqtgraph.colormap
    sequential, diverging = (
        maps.get(each).getLookupTable(nPts=256)[:, :3].astype(np.uint8)
        for each in COLOUR_MAPS[name]
    )
    return ColourMap(sequential, sequential[::-1], diverging)


def colours_in_use() -> ColourMap:
    """The colour map of the application."""
    application = QGuiApplication.instance()
    used = application.property(_PROPERTY) if application is not None else None
    return colour_map(used or "standard")


# What is drawn over each: seen against every one of its colours.
LIGHT_INK, DARK_INK = "#f4f6f8", "#16191d"

# In 3-D views and their legend: an excluded element, the element to press, what is estimated of the
# contact.
OUT, WANTED, CONTACT = "#e8267d", "#ffd400", "#1fd17a"

# A reading on a rail: in none of the maps above.
SATURATED = "#9b30d0"

# Told apart in the common colour blindnesses (after Okabe and Ito), on a light and a dark ground.
SERIES = (
    ("#0072b2", "#5ab4e8"),
    ("#8a6d00", "#f0e060"),
    ("#5b6470", "#a0a9b4"),
    ("#00805c", "#1fc796"),
    ("#a8527f", "#e08fbd"),
    ("#c24e00", "#f08a3c"),
    ("#1a7a8a", "#7fe0e8"),
    ("#6a3fb5", "#b79bf0"),
)


def series(number: int) -> QColor:
    """The colour of the curve with this `number`, in the theme of now."""
    return QColor(SERIES[number % len(SERIES)][current() is DARK])
