"""The status bar: messages and warnings, what touches the skin, and background tasks."""

import numpy as np
from PySide6.QtCore import Signal
from PySide6.QtGui import QPalette
from PySide6.QtWidgets import QHBoxLayout, QLabel, QStatusBar, QToolButton, QWidget

from kappaskin.estimation import FAULTS
from kappaskin.frames import Estimate
from kappaskin_app.theme import ALERT
from kappaskin_app.widgets.layout import row
from kappaskin_app.widgets.line import Line

_ACTIVITY_TIP = "What takes longer than a moment. The window goes on meanwhile."


class Activity(QWidget):
    """Shows what is done, or hides; `cancel_wanted` asks that it be ended."""

    cancel_wanted = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.words, self.cancel = QLabel(), QToolButton()
        self.words.setToolTip(_ACTIVITY_TIP)
        self.cancel.setText("Cancel")
        self.cancel.setToolTip("End it, and keep what was there before.")
        self.cancel.clicked.connect(self.cancel_wanted)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(4, 0, 4, 0)
        layout.addWidget(self.words)
        layout.addWidget(self.cancel)
        self.hide()

    def show_work(self, words: str, may_cancel: bool) -> None:
        """Show what is done, and whether it can be ended; nothing when there are no `words`."""
        self.words.setText(words)
        self.cancel.setVisible(may_cancel)
        self.cancel.setAccessibleName(f"Cancel: {words}")
        self.setVisible(bool(words))


_TIP = (
    "Near the rim: no force moves the skin where it is held, so that a light touch further inside "
    "and a hard one at the rim read alike; an edge that gives may be assumed instead (Basis). "
    "Strain: beyond 1 % a metal gage is not elastic any more; these elements are crossed out in "
    "the heatmaps. Left out: elements, counted from 0, that the others contradict, or of which "
    "channels were found wanting: Health (F3) lists these, and letters in the heatmaps say why."
)


_NAMED = 4  # elements that are named one by one


def _left_out(estimate: Estimate) -> str:
    """Which elements are left out and why."""
    out = np.flatnonzero(estimate.suspect)
    if not len(out):
        return ""
    if len(out) > _NAMED:
        kinds = [FAULTS[kind] for kind in np.unique(estimate.suspect[out])]
        return f"{len(out)} elements left out ({', '.join(kinds)})"
    named = ", ".join(f"{element} ({FAULTS[estimate.suspect[element]]})" for element in out)
    return f"element{'s' if len(out) > 1 else ''} {named} left out"


def warnings(estimate: Estimate, strained: int) -> str:
    """What is doubtful of an estimate in words; so many elements are `strained` too far."""
    told = [_left_out(estimate)] if estimate.suspect.any() else []
    if not estimate.converged:
        told.append("the iteration gave up, least squares shown")
    if strained:
        told.append(f"{strained} element{'s' if strained > 1 else ''} over 1 % strain")
    if estimate.contact.near_rim:
        told.append("contact too near the rim to trust")
    words = "; ".join(told)
    return words[:1].upper() + words[1:]


class Notice(QLabel):
    """Shows a hint, or in the colour of alarms what there is to warn of."""

    def __init__(self, hint: str, parent: QWidget | None = None) -> None:
        super().__init__(hint, parent)
        self._hint, self.warning = hint, ""
        self.setContentsMargins(4, 0, 12, 0)
        self.setMinimumWidth(self.sizeHint().width())  # or what stands beside it would jump

    def show_hint(self, hint: str) -> None:
        """Hint at this while there is nothing to warn of."""
        if hint != self._hint:
            self._hint = hint
            self.setText(self.warning or hint)

    def show_warning(self, text: str) -> None:
        """Warn of `text`, or of nothing."""
        if text != self.warning:
            self.warning = text
            self.setText(text or self._hint)
            self.setToolTip(_TIP if text else "")
            self.setForegroundRole(ALERT if text else QPalette.ColorRole.WindowText)


class StatusBar(QStatusBar):
    """Shows a `notice`, the `object` that touches, and background tasks (`activity`)."""

    def __init__(self, notice: Notice) -> None:
        super().__init__()
        # There from the start, or its first message would push the rest up.
        self.addWidget(notice)
        self.object, self.activity = Line(), Activity()
        self.addPermanentWidget(self.object, 1)
        self._corner = row(self.activity)
        self._grow(self._corner)
        self.addPermanentWidget(self._corner)
        # What it takes of the bar, all that the rest leaves, a passing message needs.
        self.messageChanged.connect(lambda text: self.object.setHidden(bool(text)))

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
