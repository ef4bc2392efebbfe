"""Presenter view: the skin with large numbers, or a banner with the remedy of a fault."""

import math

from PySide6.QtCore import Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QHBoxLayout, QStackedWidget, QVBoxLayout, QWidget

from kappaskin._text import NO_FORCE, rounded
from kappaskin_app.features.presenter.feedback import Feedback, RadiusEstimate
from kappaskin_app.features.presenter.indicators import (
    Banner,
    ForceBar,
    Indicator,
    NumberIndicator,
    RadiusView,
    StatusStrip,
)
from kappaskin_app.features.presenter.pad import OperatorControls
from kappaskin_app.widgets.text import NONE, ErrorBars

_HEIGHT, _WIDTH = 1080.0, 1920.0  # px of the screen for which a unit is one px
_SKIN, _FIGURES = 51, 49  # shares of the width
_EDGE = 26.0  # units around the numbers
_RADIUS = "Radius of the object"
_FLAT = 1e3  # mm: a bound beyond says nothing of an object
_OBJECTS = {"sphere": "ball", "cylinder": "pipe", "plane": "flat face", "skin": "skin at contact"}


class PresenterView(QWidget):
    """The `skin` and, while `active`, numbers around it that are legible from afar.

    `fitted` emits the px of a unit while active, and 0 at the end.
    """

    fitted = Signal(float)

    def __init__(self, skin: QWidget) -> None:
        super().__init__()
        self.strip, self.controls, self.banner = StatusStrip(), OperatorControls(), Banner()
        self.force, self.bar = NumberIndicator("Force"), ForceBar()
        self.displacement, self.place = map(NumberIndicator, ("Depth", "Contact at x, y in mm"))
        self.radius, self.radius_view = NumberIndicator(_RADIUS), RadiusView()
        self.indicators: list[Indicator] = [
            *(self.strip, self.banner, self.force, self.bar),
            *(self.displacement, self.place, self.radius, self.radius_view),
        ]
        self.active = False
        self._arrange(skin)
        self._show_parts()

    def _arrange(self, skin: QWidget) -> None:
        self._figures = QWidget()
        column = QVBoxLayout(self._figures)
        for indicator in self.indicators[2:]:
            column.addWidget(indicator)
        self.pages = QStackedWidget()
        for page in (self._figures, self.banner):
            self.pages.addWidget(page)
        self.pages.setMinimumSize(1, 1)  # or the window could not be made smaller again
        left, row, whole = QVBoxLayout(), QHBoxLayout(), QVBoxLayout(self)
        left.addWidget(skin, 1)
        left.addWidget(self.controls)
        row.addLayout(left, _SKIN)
        row.addWidget(self.pages, _FIGURES)
        whole.addWidget(self.strip)
        whole.addLayout(row, 1)
        self._layouts = (left, row, whole)
        self._column = column

    def present(self, active: bool) -> None:
        self.active = active
        self._fit()
        if not active:
            self.fitted.emit(0.0)
        self._show_parts()

    def _show_parts(self) -> None:
        for part in (self.strip, self.pages, self.controls):
            part.setVisible(self.active)
        for layout in self._layouts:
            layout.setContentsMargins(0, 0, 0, 0)
            layout.setSpacing(0)

    def show_controls(self, there: bool) -> None:
        """Show the controls if `there` is a simulated object to move."""
        self.controls.setVisible(there and self.active)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    @property
    def unit(self) -> float:
        """The px of this view for one px of a screen of 1920 x 1080."""
        return min(self.height() / _HEIGHT, self.width() / _WIDTH)

    def _fit(self) -> None:
        if not self.active:
            return
        for part in (*self.indicators, self.controls):
            part.show_unit(self.unit)
        edge = round(_EDGE * self.unit)
        self._column.setContentsMargins(edge, 0, edge, edge)
        self.strip.edge = edge
        self._column.setSpacing(round(8 * self.unit))
        self.fitted.emit(self.unit)

    # Display.

    def show_feedback(
        self, feedback: Feedback | None, why_none: str = "no contact", recorded: bool = False
    ) -> None:
        """Write the feedback, or the reason why there is none; of a recording if `recorded`."""
        self.controls.pad.show_feedback(feedback)
        if feedback is None:
            for figure in (self.force, self.displacement, self.place):
                figure.show_figure(NONE, why_none if figure is self.force else "")
            self.radius.show_figure(NONE, name=_RADIUS)
            return
        least = "\N{GREATER-THAN OR EQUAL TO} " if feedback.force_is_lower_bound else ""
        force, off = _figure("N", feedback.force_off, feedback.force)
        if math.isfinite(feedback.force):
            self.force.show_figure(least + force, off)
        else:
            self.force.show_figure(NONE, NO_FORCE if feedback.near_rim else "unknown")
        depth, off = _figure("mm", 1e3 * feedback.displacement_off, 1e3 * feedback.displacement)
        self.displacement.show_figure(depth, off or "largest on the skin")
        x, y = (1e3 * value for value in feedback.position)
        place, off = _figure("mm", 1e3 * feedback.position_off, x, y)
        if feedback.near_rim:
            place, off = f"\N{ALMOST EQUAL TO} {x:.0f}, {y:.0f}", "near the rim: unreliable"
        self.place.show_figure(place.removesuffix(" mm"), off, faint=feedback.near_rim)
        self.radius.show_figure(*radius_in_words(feedback, recorded))

    def show_graphics(self, feedback: Feedback | None, now: float) -> None:
        """Draw the force bar and the circle of the radius."""
        force = (feedback.force, feedback.force_off) if feedback else (math.nan, math.nan)
        self.bar.show_force(*force, now)
        self.radius_view.show_radius(
            feedback.radius if feedback else None, bool(feedback and feedback.kind), now
        )

    def show_trouble(self, state: str, since: str, why: str) -> None:
        """Show a banner with the reason instead of the numbers; no banner without a `state`."""
        if state:
            self.banner.show_trouble(state, since, why)
        self.pages.setCurrentWidget(self.banner if state else self._figures)


def radius_in_words(feedback: Feedback, recorded: bool = False) -> tuple[str, str, str]:
    """Value, note and name of the radius."""
    if feedback.kind == "edge":
        return "edge", f"{1e3 * feedback.length:.0f} mm long", "Object"
    if feedback.radius is None:
        return _OBJECTS.get(feedback.kind, NONE), "" if feedback.kind else "unknown", "Object"
    what = _OBJECTS.get(feedback.radius.what, "object")
    return *_radius(feedback.radius, recorded), f"Radius of the {what}"


def _radius(estimate: RadiusEstimate, recorded: bool) -> tuple[str, str]:
    """Value and note: the value only where both ends of its interval are known."""
    low, high = (1e3 * radius for radius in estimate.interval)
    if low == math.inf:
        return "flat", ""
    if low > 0 and high < math.inf:
        half = (high - low) / 2
        value, low, high = (rounded(r, half)[0] for r in (1e3 * estimate.value, low, high))
        return f"{value} mm", "exact" if low == high else f"95 %: {low} to {high} mm"
    if low > 0:
        return NONE, f"unknown, over {low:.3g} mm"
    hint = "pressed too lightly" if recorded else "press harder"
    return NONE, f"unknown, under {high:.3g} mm: {hint}" if high < _FLAT else "unknown"


def _figure(unit: str, half: float, *values: float) -> tuple[str, str]:
    """The values with their unit, and their error bar `half`, with which one that is."""
    found = [rounded(value, half, 3 if unit == "N" else 1) for value in values]
    bar = found[0][1]
    text = f"{', '.join(text for text, _ in found)} {unit}"
    off = f"\N{PLUS-MINUS SIGN} {bar} {unit} ({ErrorBars.now.label})"
    return text, off if bar not in ("", "exact") else bar
