"""The numbers in words: how live it is, where the contact is and how wrong the shape is."""

import math
from dataclasses import dataclass

import numpy as np
from PySide6.QtGui import QFont
from PySide6.QtWidgets import QGridLayout, QLabel, QWidget

from kappaskin import Estimate
from kappaskin_app.theme import Theme
from kappaskin_app.views.line import Line

NONE = "\N{EN DASH}"


@dataclass(frozen=True)
class Health:
    """How live the view is: `rate` in frames/s, `drawn` in pictures/s, `age` in s."""

    rate: float
    drawn: float
    age: float
    lost: int
    discarded: int


FIELDS = {
    "rate": ("Frames", "Frames computed per second, and pictures drawn of them."),
    "age": ("Latency", "Age of the frame when it was drawn, since its bytes were read."),
    "lost": (
        "Lost",
        "Frames that never came, and bytes that made no sense.",
    ),
    "contact": ("Contact", "Where one point load explains the readings best, with its error bar."),
    "force": ("Force", "How hard that load presses, with its error bar."),
    "depth": ("Depth", "Displacement of the skin at the contact, with its error bar."),
    "error": (
        "Error at load",
        "Reconstructed minus true displacement there (simulated only).",
    ),
    "rms": ("RMS error", "Root mean square error over the whole skin (simulated only)."),
}

_WIDTHS = {"contact": 6, "rate": 5, "force": 5, "depth": 5, "age": 3, "error": 4, "rms": 4}


def _with_error(value: float, sd: float, digits: int, unit: str) -> str:
    if not math.isfinite(value):
        return NONE
    bar = f" \N{PLUS-MINUS SIGN} {sd:.{digits}f}" if math.isfinite(sd) else ""
    return f"{value:.{digits}f}{bar} {unit}".replace("-", "\N{MINUS SIGN}")


class Readouts(QWidget):
    """Names above numbers, each of a fixed width so that nothing jitters."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        grid = QGridLayout(self)
        grid.setContentsMargins(8, 2, 8, 2)
        grid.setHorizontalSpacing(16)
        grid.setVerticalSpacing(0)
        self._names: list[QLabel] = []
        self._numbers: dict[str, Line] = {}
        for column, (key, (name, tip)) in enumerate(FIELDS.items()):
            above, below = QLabel(name), Line(NONE)
            bold = below.font()
            bold.setWeight(QFont.Weight.DemiBold)
            below.setFont(bold)
            for widget in (above, below):
                widget.setToolTip(tip)
            self._names.append(above)
            self._numbers[key] = below
            grid.addWidget(above, 0, column)
            grid.addWidget(below, 1, column)
            grid.setColumnStretch(column, _WIDTHS.get(key, 4))

    def text(self, key: str) -> str:
        return self._numbers[key].text()

    def show_health(self, health: Health) -> None:
        age = f"{health.age * 1e3:.0f} ms" if math.isfinite(health.age) else NONE
        self._write("rate", f"{health.rate:.0f}/s, {health.drawn:.0f} drawn")
        self._write("age", age)
        self._write("lost", f"{health.lost} frames, {health.discarded} B")

    def show_estimate(self, estimate: Estimate | None) -> None:
        if estimate is None:
            for key in ("contact", "force", "depth", "error", "rms"):
                self._write(key, NONE)
            return
        touch = estimate.touch
        x, y = touch.position * 1e3
        sd = float(np.max(touch.position_sd)) * 1e3
        where = f"({x:.1f}, {y:.1f}) \N{PLUS-MINUS SIGN} {sd:.1f} mm" if touch.present else "none"
        self._write("contact", where)
        self._write("force", _with_error(touch.force, touch.force_sd, 3, "N"))
        depth = touch.displacement * 1e3, touch.displacement_sd * 1e3
        self._write("depth", _with_error(*depth, 2, "mm"))
        self._write("error", _with_error(estimate.error_at_load * 1e3, math.nan, 3, "mm"))
        self._write("rms", _with_error(estimate.error_rms * 1e3, math.nan, 3, "mm"))

    def _write(self, key: str, text: str) -> None:
        self._numbers[key].show_text(text)

    def show_theme(self, theme: Theme) -> None:
        for label in self._names:
            label.setStyleSheet(f"color: {theme.faint}; font-size: 11px;")
