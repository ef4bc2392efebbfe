"""The operator's view around the skin: what is felt in large figures, and what to do when lost."""

import math

from PySide6.QtCore import Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QHBoxLayout, QStackedWidget, QVBoxLayout, QWidget

from kappaskin_app.features.presenter.feedback import Cue, Roundness
from kappaskin_app.features.presenter.indicators import (
    Banner,
    Board,
    Figure,
    ForceBar,
    RoundView,
    Strip,
)
from kappaskin_app.features.presenter.pad import Operator
from kappaskin_app.widgets.parts import number
from kappaskin_app.widgets.text import NONE

_HEIGHT, _WIDTH = 1080.0, 1920.0  # of the picture that a unit is a pixel of
_SKIN, _FIGURES = 51, 49  # how they share the width
_EDGE = 26.0  # units around the figures
_RADIUS = "Radius of what touches"
_TOUCHES = {"sphere": "ball", "cylinder": "pipe", "plane": "flat face"}


class Stage(QWidget):
    """Holds the `skin` and, while `presenting`, all that is read from afar around it.

    `fitted` tells the px of a unit then, and 0 when it is over.
    """

    fitted = Signal(float)

    def __init__(self, skin: QWidget) -> None:
        super().__init__()
        self.strip, self.operator, self.banner = Strip(), Operator(), Banner()
        self.force, self.bar = Figure("Force"), ForceBar()
        self.displacement, self.place = Figure("Displacement"), Figure("Contact at x, y")
        self.radius, self.round = Figure(_RADIUS), RoundView()
        self.boards: list[Board] = [
            *(self.strip, self.banner, self.force, self.bar),
            *(self.displacement, self.place, self.radius, self.round),
        ]
        self.presenting = False
        self._arrange(skin)
        self._show_parts()

    def _arrange(self, skin: QWidget) -> None:
        self._figures = QWidget()
        column = QVBoxLayout(self._figures)
        for board in self.boards[2:]:
            column.addWidget(board)
        self.pages = QStackedWidget()
        for page in (self._figures, self.banner):
            self.pages.addWidget(page)
        self.pages.setMinimumSize(1, 1)  # or the window could not be made smaller again
        left, row, whole = QVBoxLayout(), QHBoxLayout(), QVBoxLayout(self)
        left.addWidget(skin, 1)
        left.addWidget(self.operator)
        row.addLayout(left, _SKIN)
        row.addWidget(self.pages, _FIGURES)
        whole.addWidget(self.strip)
        whole.addLayout(row, 1)
        self._layouts = (left, row, whole)
        self._column = column

    def present(self, presenting: bool) -> None:
        self.presenting = presenting
        self._fit()
        if not presenting:
            self.fitted.emit(0.0)
        self._show_parts()

    def _show_parts(self) -> None:
        for part in (self.strip, self.pages, self.operator):
            part.setVisible(self.presenting)
        for layout in self._layouts:
            layout.setContentsMargins(0, 0, 0, 0)
            layout.setSpacing(0)

    def show_operating(self, there: bool) -> None:
        """Whether there is anything that a hand could move."""
        self.operator.setVisible(there and self.presenting)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    @property
    def unit(self) -> float:
        """The px of this picture for one of 1080 of its height, or 1920 of its width."""
        return min(self.height() / _HEIGHT, self.width() / _WIDTH)

    def _fit(self) -> None:
        if not self.presenting:
            return
        for part in (*self.boards, self.operator):
            part.show_unit(self.unit)
        edge = round(_EDGE * self.unit)
        self._column.setContentsMargins(edge, 0, edge, edge)
        self.strip.edge = edge
        self._column.setSpacing(round(8 * self.unit))
        self.fitted.emit(self.unit)

    # What it shows.

    def show_cue(
        self, cue: Cue | None, why_none: str = "nothing felt", recorded: bool = False
    ) -> None:
        """Write what is felt, or `why_none` is; of what is `recorded` nothing can be done."""
        self.operator.pad.show_cue(cue)
        if cue is None:
            for figure in (self.force, self.displacement, self.place):
                figure.show_figure(NONE, why_none if figure is self.force else "")
            self.radius.show_figure(NONE, name=_RADIUS)  # nothing is a ball now
            return
        self.force.show_figure(f"{number(cue.force, '.3f')} N", _off(cue.force_95, 3, "N"))
        off = _off(1e3 * cue.displacement_95, 2, "mm") or "at its deepest"
        self.displacement.show_figure(f"{number(1e3 * cue.displacement, '.2f')} mm", off)
        x, y = (number(1e3 * value, ".1f") for value in cue.position)
        where = "near the rim: not sure" if cue.near_rim else _off(1e3 * cue.position_95, 1, "mm")
        self.place.show_figure(f"{x}, {y} mm", where)
        self.radius.show_figure(*radius_in_words(cue, recorded))

    def show_felt(self, cue: Cue | None, now: float) -> None:
        """Draw the bar and the circle, as often as there is a picture."""
        nothing = (math.nan, math.nan)
        self.bar.show_force(*(nothing if cue is None else (cue.force, cue.force_95)), now)
        self.round.show_roundness(cue.roundness if cue else None, bool(cue and cue.kind), now)

    def show_trouble(self, state: str, since: str, why: str) -> None:
        """Say instead of the figures why there are none; nothing of no `state`."""
        if state:
            self.banner.show_trouble(state, since, why)
        self.pages.setCurrentWidget(self.banner if state else self._figures)


def radius_in_words(cue: Cue, recorded: bool = False) -> tuple[str, str, str]:
    """Value, note and name of the radius that is felt."""
    if cue.kind == "edge":
        return "edge", f"{number(1e3 * cue.length, '.0f')} mm long", "What touches"
    if cue.roundness is None:
        return _TOUCHES.get(cue.kind, cue.kind), "", "What touches"
    skin = cue.roundness.what == "skin"
    what = "skin there" if skin else _TOUCHES.get(cue.roundness.what, cue.roundness.what)
    return *_radius(cue.roundness, recorded), f"Radius of the {what}"


def _radius(round_: Roundness, recorded: bool) -> tuple[str, str]:
    low, high = (_digits(1e3 * radius) for radius in round_.between)
    if round_.between[0] == math.inf:
        return "flat", ""
    if round_.between[1] == math.inf:
        return (f"> {low} mm", "") if round_.between[0] > 0 else (NONE, "unknown")
    if not round_.between[0] > 0:
        return f"< {high} mm", "pressed too lightly" if recorded else "press harder"
    return f"{_digits(1e3 * round_.radius)} mm", f"{low} to {high} mm"


def _digits(value: float) -> str:
    """Three digits."""
    if not math.isfinite(value):
        return "flat"
    digits = max(0, 2 - math.floor(math.log10(value))) if value > 0 else 1
    return f"{value:.{min(digits, 2)}f}"


def _off(half: float, digits: int, unit: str) -> str:
    return f"\N{PLUS-MINUS SIGN} {half:.{digits}f} {unit}" if math.isfinite(half) else ""
