"""Figures that the window shows, by name, for the questions of lessons."""

import math
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import fields

import numpy as np

from kappaskin.frames import Estimate
from kappaskin.live import Status
from kappaskin.pipeline import Reported, getters
from kappaskin_app.features.lessons.expression import NUMBER, WORD
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.settings.form_fields import Choice, Several, Text

_RECENT = 24  # estimates of which the median is taken: one alone jumps with the noise
_LEAST = 3  # of them: the first may still be of the settings before


def _peak(row: int) -> Callable[[Estimate], float]:
    def peak(estimate: Estimate) -> float:
        if estimate.curvature.ndim == 1:  # of a sensor that reads others
            return math.nan
        readings = estimate.curvature[row][np.isfinite(estimate.curvature[row])]
        return float(readings[np.argmax(np.abs(readings))]) if len(readings) else math.nan

    return peak


_GETTERS = getters()


def _reported(name: str, part: int = 0) -> Callable[[Estimate], float]:
    """A getter of a number of the table of quantities; yes is 1."""
    return lambda estimate: float(np.ravel(_GETTERS[name](Reported(estimate)))[part])


OF_AN_ESTIMATE: dict[str, Callable[[Estimate], float]] = {
    "error_rms": lambda e: e.error_rms,
    "error_at_load": lambda e: e.error_at_load,
    "noise": _reported("noise"),
    "contact": _reported("present"),
    "contact_x": _reported("position", 0),
    "contact_y": _reported("position", 1),
    "contact_sd": lambda e: float(np.max(e.contact.position_sd)),
    "measured_force": _reported("force"),
    "force_sd": _reported("force_sd"),
    "depth": _reported("displacement"),
    "depth_sd": _reported("displacement_sd"),
    "spread": lambda e: float(e.contact.present and not e.contact.single),
    "near_rim": _reported("near_rim"),
    "peak_xx": _peak(0),
    "peak_yy": _peak(1),
    "peak_xy": _peak(2),
    "suspects": lambda e: float(np.count_nonzero(e.suspect)),
    "unread": lambda e: float(np.isnan(np.atleast_2d(e.curvature)).any(axis=0).sum()),
}
"""Figures of one estimate, in SI units; yes is 1, no is 0."""

OF_THE_STATUS: dict[str, Callable[[Status], float]] = {
    "rate": lambda s: s.rate,
    "refused": lambda s: float(bool(s.refusal)),
    "findings": lambda s: float(len(s.health.findings)),
}
OF_FEATURES = ("silent", "condition")
"""Figures that a feature may show: those of Stability."""


def _kind_of(how: object) -> str:
    return WORD if isinstance(how, Choice | Text) else NUMBER


SETTINGS = {
    field.name: _kind_of(field.metadata["form"])
    for field in fields(Settings)
    if "form" in field.metadata and not isinstance(field.metadata["form"], Several)
}
KINDS = dict.fromkeys((*OF_AN_ESTIMATE, *OF_THE_STATUS, *OF_FEATURES), NUMBER) | SETTINGS
"""Every name that an expression may have, with whether it is a number or a word."""


class RecentEstimates:
    """The last estimates of the present settings, whose medians are steady figures."""

    def __init__(self) -> None:
        self._recent: deque[Estimate] = deque(maxlen=_RECENT)

    def receive(self, estimate: Estimate) -> None:
        self._recent.append(estimate)

    def forget(self) -> None:
        """Drop the estimates of the last settings."""
        self._recent.clear()

    @property
    def settled(self) -> bool:
        """Whether the figures are those of the present settings."""
        return len(self._recent) >= _LEAST

    def figures(
        self, settings: Settings, status: Status, others: Mapping[str, Callable[[], float]]
    ) -> dict[str, float | str]:
        """Every figure as it is now; NaN where there is none."""
        found: dict[str, float | str] = {
            name: value if isinstance(value := getattr(settings, name), str) else float(value)
            for name in SETTINGS
        }
        for name, of in OF_AN_ESTIMATE.items():
            values = [value for e in self._recent if math.isfinite(value := of(e))]
            found[name] = float(np.median(values)) if values and self.settled else math.nan
        found |= {name: of(status) for name, of in OF_THE_STATUS.items()}
        for name in OF_FEATURES:
            found[name] = others[name]() if name in others else math.nan
        return found
