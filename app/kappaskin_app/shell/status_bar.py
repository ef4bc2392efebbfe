"""The status bar: messages, warnings, the object in contact, background tasks."""

import numpy as np
from PySide6.QtCore import QEvent, QSize, Signal
from PySide6.QtGui import QPalette
from PySide6.QtWidgets import QHBoxLayout, QSizePolicy, QStatusBar, QToolButton, QWidget

from kappaskin.estimation import FAULTS, METHODS, slope_warning
from kappaskin.frames import Estimate
from kappaskin_app.theme import ALERT
from kappaskin_app.widgets.layout import row
from kappaskin_app.widgets.line import Line
from kappaskin_app.widgets.parts import Label

_ACTIVITY_TIP = "Background tasks."


class Activity(QWidget):
    """Shows the background task, or hides; `cancel_wanted` requests its end."""

    cancel_wanted = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.words, self.cancel = Label(), QToolButton()
        self.words.setToolTip(_ACTIVITY_TIP)
        self.cancel.setText("Cancel")
        self.cancel.setToolTip("Cancel this task.")
        self.cancel.clicked.connect(self.cancel_wanted)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(4, 0, 4, 0)
        layout.addWidget(self.words)
        layout.addWidget(self.cancel)
        self.hide()

    def show_work(self, words: str, may_cancel: bool) -> None:
        """Show a task, and whether it can be cancelled; hide when there are no `words`."""
        self.words.setText(words)
        self.cancel.setVisible(may_cancel)
        self.cancel.setAccessibleName(f"Cancel: {words}")
        self.setVisible(bool(words))


_TIP = (
    "Near the rim: a held edge does not move, so a small force inside and a large one at the rim "
    "give the same readings; select an elastic edge if the edge is elastic (Basis). "
    "Strain: beyond 1 % a metal gage is not elastic; these elements are crossed out in the "
    "heatmaps. Drift: all readings have shifted smoothly over the skin, which no load does; "
    "the contact and the surface are those without it (Tracking keeps it in the surface). "
    "Slopes: most estimators assume a nearly flat skin; select Finite slope (Basis). "
    "Excluded: elements, counted from 0, that are inconsistent with the others, or have "
    "faulty channels: Health (F3) lists these, and letters in the heatmaps give the reason."
)


_NAMED = 4  # elements that are named one by one


def _left_out(estimate: Estimate) -> str:
    """Which elements are excluded and why."""
    out = np.flatnonzero(estimate.suspect)
    if not len(out):
        return ""
    if len(out) > _NAMED:
        kinds = [FAULTS[kind] for kind in np.unique(estimate.suspect[out])]
        return f"{len(out)} elements excluded ({', '.join(kinds)})"
    named = ", ".join(f"{element} ({FAULTS[estimate.suspect[element]]})" for element in out)
    return f"element{'s' if len(out) > 1 else ''} {named} excluded"


_STEEP = 0.14  # slope of shapes that are up to 1 % too flat


def warnings(estimate: Estimate, strained: int, method: str, slope: float = 0.0) -> str:
    """Warnings of an estimate by a `method`.

    `strained` is the number of elements over their strain limit, `slope` what the method neglects:
    it is no warning below 1 % of the shape.
    """
    parts = [_left_out(estimate)] if estimate.suspect.any() else []
    if not estimate.converged:
        parts.append(METHODS[method].failure.format(""))
    if strained:
        parts.append(f"{strained} element{'s' if strained > 1 else ''} over 1 % strain")
    if estimate.drift:
        by = f"{estimate.drift:.2g}{' 1/m' * (estimate.curvature.ndim == 2)}"
        parts.append(f"readings drifted by {by}, by temperature or a bent mount: tare at rest")
    if estimate.contact.near_rim:
        parts.append("contact near the rim: unreliable")
    if slope >= _STEEP:
        parts.append(slope_warning(slope, "select Finite slope"))
    words = "; ".join(parts)
    return words[:1].upper() + words[1:]


class SteadyWarning:
    """The number of a warning as it is shown: it changes if by much, and goes after a while.

    A change below `share` of it is not shown, nor that it is 0 for less than `kept` in s.
    """

    def __init__(self, share: float, kept: float) -> None:
        self._share, self._kept = share, kept
        self._shown, self._until = 0.0, 0.0

    def __call__(self, number: float, now: float) -> float:
        """What is shown of a `number` at the time `now` in s; 0 without a warning."""
        if number:
            self._until = now + self._kept
            steady = abs(number - self._shown) < self._share * self._shown
            self._shown = self._shown if steady else number
        elif now > self._until:
            self._shown = 0.0
        return self._shown


class Notice(Line):
    """Shows a hint, or a warning in the colour of alarms."""

    def __init__(self, hint: str) -> None:
        super().__init__(hint)
        self._hint, self.warning = hint, ""
        self.setContentsMargins(4, 0, 12, 0)
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)
        self.setMinimumWidth(self.sizeHint().width())  # else the widgets to its right would move

    def sizeHint(self) -> QSize:
        # The margins, and 2 px, as the advance is rounded.
        return QSize(
            self.fontMetrics().horizontalAdvance(self.text()) + 18, super().sizeHint().height()
        )

    def show_hint(self, hint: str) -> None:
        """Show this hint while there is no warning."""
        if hint != self._hint:
            self._hint = hint
            self.show_text(self.warning or hint)
            self.updateGeometry()

    def show_warning(self, text: str) -> None:
        """Show a warning; none when `text` is empty."""
        if text != self.warning:
            self.warning = text
            self.show_text(text or self._hint)
            self.updateGeometry()
            self.setToolTip(_TIP if text else "")
            self.setForegroundRole(ALERT if text else QPalette.ColorRole.WindowText)


class StatusBar(QStatusBar):
    """Shows a `notice`, the `object` in contact, and background tasks (`activity`)."""

    def __init__(self, notice: Notice) -> None:
        super().__init__()
        # There from the start, or its first message would push the rest up.
        self.addWidget(notice)
        self.object, self.activity = Line(), Activity()
        self.addPermanentWidget(self.object, 1)
        self._corner = row(self.activity)
        self._grow(self._corner)
        self.addPermanentWidget(self._corner)
        self._beneath = (notice, self.object)  # the bar hides the first alone, until it grows
        self.messageChanged.connect(self._make_room)

    def event(self, event: QEvent) -> bool:
        done = super().event(event)
        if event.type() == QEvent.Type.LayoutRequest:
            self._make_room(self.currentMessage())
        return done

    def _make_room(self, message: str) -> None:
        """Hide what a passing `message` takes the room of, while there is one."""
        for widget in self._beneath:
            widget.setHidden(bool(message))

    def add(self, widget: QWidget) -> None:
        """Show a widget at the end."""
        layout = self._corner.layout()
        if layout is not None:
            layout.addWidget(widget)
        self._grow(widget)

    def _grow(self, widget: QWidget) -> None:
        # As high from the start: a bar that grows shows all again that a message hides.
        least = max(self._corner.minimumHeight(), widget.sizeHint().height())
        self._corner.setMinimumHeight(least)
