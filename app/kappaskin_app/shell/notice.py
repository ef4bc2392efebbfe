"""A hint at the foot of the window, until there is something to warn of."""

import numpy as np
from PySide6.QtWidgets import QLabel, QWidget

from kappaskin.estimation import FAULTS
from kappaskin.frames import Estimate
from kappaskin_app.theme import LIGHT, Theme

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
        self._hint, self._theme, self.warning = hint, LIGHT, ""
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
            self._paint()

    def show_theme(self, theme: Theme) -> None:
        self._theme = theme
        self._paint()

    def _paint(self) -> None:
        colour = self._theme.alert if self.warning else self._theme.text
        self.setStyleSheet(f"color: {colour};")
