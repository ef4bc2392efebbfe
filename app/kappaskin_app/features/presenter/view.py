"""Presenter view: the skin with large numbers and controls of the object, or a fault's remedy."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import (
    QButtonGroup,
    QGridLayout,
    QHBoxLayout,
    QPushButton,
    QSizePolicy,
    QStackedWidget,
    QVBoxLayout,
    QWidget,
)

from kappaskin._text import rounded
from kappaskin.scenes import Indenter, Scene
from kappaskin_app.features.presenter.feedback import Feedback, RadiusEstimate
from kappaskin_app.features.presenter.indicators import (
    Banner,
    ForceBar,
    Indicator,
    NumberIndicator,
    RadiusView,
    StatusStrip,
)
from kappaskin_app.guard import guarded
from kappaskin_app.theme import current, follow_look
from kappaskin_app.widgets.lettering import CAPTION, Words, letters, shrunk
from kappaskin_app.widgets.text import NONE, Coverage

_HEIGHT, _WIDTH = 1080.0, 1920.0  # px of the screen for which a unit is one px
_SKIN, _FIGURES = 51, 49  # shares of the width
_EDGE = 26.0  # units around the numbers
_RADIUS = "Radius of the object"
_FLAT = 1e3  # mm: a bound beyond says nothing of an object
_OBJECTS = {"sphere": "ball", "cylinder": "pipe", "plane": "flat face", "skin": "skin at contact"}


@dataclass(frozen=True)
class DemoObject:
    """An object of the demonstration: title and tooltip of its button, and its scene settings."""

    title: str
    tip: str
    settings: Mapping[str, Any]

    def is_in(self, scene: Scene) -> bool:
        """Whether it is the object in `scene`."""
        what = scene.stimuli[0].what
        rigid = what.rigid if isinstance(what, Indenter) else what
        named = type(rigid).__name__.removesuffix("Load").lower()
        sizes = {name: value for name, value in self.settings.items() if name != "what"}
        return named == self.settings["what"] and all(
            getattr(rigid, name, None) == value for name, value in sizes.items()
        )


DEMO_OBJECTS = (
    DemoObject("Ball, radius 40 mm", "A ball of 40 mm radius.", {"what": "sphere", "radius": 0.04}),
    DemoObject("Ball, radius 60 mm", "A ball of 60 mm radius.", {"what": "sphere", "radius": 0.06}),
    DemoObject("Ball, radius 80 mm", "A ball of 80 mm radius.", {"what": "sphere", "radius": 0.08}),
    DemoObject(
        "Pipe, radius 150 mm",
        "A pipe of 150 mm radius and 50 mm length that lies along x.",
        {"what": "cylinder", "radius": 0.15, "length": 0.05},
    ),
    DemoObject(
        "Edge",
        "The edge of a box, 40 mm long, along x.",
        {"what": "wedge", "angle": math.pi / 2, "length": 0.04, "width": 0.02},
    ),
    DemoObject("Point", "A point, without a radius.", {"what": "point"}),
)


class Hand(NamedTuple):
    """Position in m and force in N of the simulated object."""

    x: float
    y: float
    force: float


_CONTROLS = 210.0  # units, height
_HINT = (
    "Press on the skin with the left button and drag; the wheel, or Shift and drag, changes the "
    "force. The right button turns the view."
)
_UNDO_HINT = "Ctrl+Z undoes."
_COLUMNS = 3
_BUTTON = 15.0  # units, height of a capital on a button
_TOP = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop


class _HandText(Indicator):
    """Force and position of the simulated object, and how to move it."""

    def __init__(self) -> None:
        super().__init__()
        self.hand: Hand | None = None
        self.refusal = ""

    def show_hand(self, hand: Hand | None, refusal: str) -> None:
        if (hand, refusal) != (self.hand, self.refusal):
            self.hand, self.refusal = hand, refusal
            self.update()

    def words(self) -> list[Words]:
        if self.hand is None:
            return []
        place, third = self.rect().toRectF(), self.height() / 3
        x, y, force = 1e3 * self.hand.x, 1e3 * self.hand.y, self.hand.force
        hand_text = f"Simulated load: {force:.2f} N at x {x:.0f} mm, y {y:.0f} mm"
        above = place.adjusted(0, 0, 0, -2 * third)
        below = place.adjusted(0, third, 0, 0)
        hint = f"{self.refusal}. {_UNDO_HINT}" if self.refusal else _HINT
        large, small = self.letters(CAPTION, bold=True), self.letters(0.8 * CAPTION)
        return [
            shrunk(Words(hand_text, large, above, align=_TOP)),
            shrunk(Words(hint, small, below, faint=True, align=_TOP, lines=True)),
        ]


class OperatorControls(QWidget):
    """The hand, and buttons of the objects; `chosen` emits a number in `DEMO_OBJECTS`."""

    chosen = Signal(int)

    def __init__(self) -> None:
        super().__init__()
        self.hand_text = _HandText()
        self.objects, self._selection = QButtonGroup(self), QWidget()
        self._selection.setAccessibleName("Object")
        grid = QGridLayout(self._selection)
        grid.setContentsMargins(0, 0, 0, 0)
        for number, demo_object in enumerate(DEMO_OBJECTS):
            button = QPushButton(demo_object.title)
            button.setCheckable(True)
            button.setToolTip(demo_object.tip)
            button.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
            self.objects.addButton(button, number)
            grid.addWidget(button, *divmod(number, _COLUMNS))
        self.objects.idClicked.connect(guarded(self.chosen.emit))
        self._column = QVBoxLayout(self)
        self._column.addWidget(self.hand_text, 1)
        self._column.addWidget(self._selection)
        follow_look(self, self._apply_theme)

    def show_unit(self, unit: float) -> None:
        self.setFixedHeight(round(_CONTROLS * unit))
        edge = round(12 * unit)
        self._column.setContentsMargins(edge, edge, edge, edge)
        self.hand_text.show_unit(unit)
        for button in self.objects.buttons():
            button.setFont(letters(self.font(), _BUTTON * unit))

    def show_hand(self, hand: Hand | None, refusal: str = "") -> None:
        """Show the simulated object, and why the last requested scene was refused."""
        self.hand_text.show_hand(hand, refusal)

    def show_objects(self, selectable: bool, number: int) -> None:
        """Check the present one of `DEMO_OBJECTS`, -1 for none; hidden if not `selectable`."""
        self._selection.setVisible(selectable)
        checked = self.objects.checkedId()
        if number != checked:
            self.objects.setExclusive(False)
            for button in self.objects.buttons():
                button.setChecked(self.objects.id(button) == number)
            self.objects.setExclusive(True)

    def _apply_theme(self) -> None:
        theme = current()
        self._selection.setStyleSheet(
            f"QPushButton:checked {{ background: {theme.accent}; color: {theme.on_accent};"
            f" border: 1px solid {theme.accent}; border-radius: 3px; padding: 4px; }}"
        )


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
        if feedback is None:
            for figure in (self.force, self.displacement, self.place):
                figure.show_figure(NONE, why_none if figure is self.force else "")
            self.radius.show_figure(NONE, name=_RADIUS)
            return
        force, off = _figure("N", feedback.force_off, feedback.force)
        if math.isfinite(feedback.force):
            self.force.show_figure(feedback.bound + force, off)
        else:
            self.force.show_figure(NONE, feedback.no_force or "unknown")
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
    low, high = (1e3 * radius for radius in estimate.bar)
    if low == math.inf:
        return "flat", ""
    if low > 0 and high < math.inf:
        half = (high - low) / 2
        value, low, high = (rounded(r, half)[0] for r in (1e3 * estimate.value, low, high))
        return (
            f"{value} mm",
            "exact" if low == high else f"{Coverage.now.label}: {low} to {high} mm",
        )
    if low > 0:
        return NONE, f"unknown, over {low:.3g} mm"
    hint = "pressed too lightly" if recorded else "press harder"
    return NONE, f"unknown, under {high:.3g} mm: {hint}" if high < _FLAT else "unknown"


def _figure(unit: str, half: float, *values: float) -> tuple[str, str]:
    """The values with their unit, and their error bar `half`, with which one that is."""
    digits = 3 if unit == "N" else 1 + (max(map(abs, values)) < 1)
    found = [rounded(value, half, digits) for value in values]
    bar = found[0][1]
    text = f"{', '.join(text for text, _ in found)} {unit}"
    off = f"\N{PLUS-MINUS SIGN} {bar} {unit} ({Coverage.now.label})"
    return text, off if bar not in ("", "exact") else bar
