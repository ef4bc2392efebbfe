"""Display of estimates: age, colours, marks and warnings."""

import math
import time
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QWidget

from kappaskin.contact import ContactObject
from kappaskin.estimation import FAULTS
from kappaskin.frames import COMPONENTS, Array, Estimate, Mask
from kappaskin.live import Status
from kappaskin.sensing import SensorLayout
from kappaskin_app.guard import guarded
from kappaskin_app.shell.background import Tasks
from kappaskin_app.shell.badge import GAP, LOST, OFF, STALE, WAITING, Badge, Header
from kappaskin_app.shell.centre import ActionBanner, Centre
from kappaskin_app.shell.colouring import Colouring, Ranges
from kappaskin_app.shell.session import Session
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.status_bar import Notice, StatusBar, SteadyWarning, warnings
from kappaskin_app.widgets.parts import capital
from kappaskin_app.widgets.tint import Tint

_OLD = (LOST, OFF, STALE, WAITING, GAP)  # the values shown are not the present ones
_HINT = "Left button on the skin: press, wheel: force; right button: turn; F1: shortcuts"
_NO_LOAD_HINT = "F1: shortcuts"
_NUMBERS = 0.2  # s between two updates of numbers
_SLOW = 0.95  # times real time: a slower simulation is marked

Kinds = NDArray[np.uint8]


class Shown:
    """An estimate for views, with its excluded and its saturated channels."""

    def __init__(self, estimate: Estimate, display: "Display", now: float) -> None:
        self.estimate, self.now, self._display = estimate, now, display

    @cached_property
    def kinds(self) -> Kinds:
        """Why each channel (k, P) is excluded, as an index of `FAULTS`; 0 where it is not."""
        return self._display.kinds(self.estimate)

    @cached_property
    def railed(self) -> Mask:
        """Which readings (k, P) are saturated, as far as that is known."""
        return self._display.railed(self.estimate, self.kinds)


class Display(QObject):
    """Brings estimates of the `session` to the views (`shown`), slower to numbers (`numbers`).

    Owns the `header` with the `badge`, the `centre` and the `status_bar`. `restarted` reports
    another sensor, `drawn` that the main view has drawn an estimate, `unit_changed` the pixels of
    a unit of a full-screen picture (0: none), `object_found` the object in contact with its
    estimate. `views` can be saved as pictures, by menu and name; `places` are the widgets that a
    lesson may point at, `figures` the numbers that it may use, by name.
    """

    shown = Signal(object)
    status_shown = Signal(Status)
    numbers = Signal(object)
    restarted = Signal(Status)
    unit_changed = Signal(float)
    object_found = Signal(ContactObject, Estimate)
    drawn = Signal()

    def __init__(self, session: Session, tasks: Tasks, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._session = session
        self.badge, self.notice = Badge(), Notice(_HINT)
        self.banner, self.centre = ActionBanner(), Centre()
        self.header = Header(self.badge, self.banner)
        self.status_bar = StatusBar(self.notice)
        self.colouring, self.ranges = Colouring(tasks), Ranges()
        self.settings = Settings()
        self.old = True
        """Whether the values shown are old."""
        self.ages: Callable[[], list[float]] = list
        """Ages in s of the estimates drawn in the last second, from the main view."""
        self.age_sd = math.nan
        self.limits: list[Callable[[], Mapping[str, float]]] = []
        self.views: dict[str, dict[str, QWidget]] = {}
        self.places: dict[str, list[QWidget]] = {}
        self.figures: dict[str, Callable[[], float]] = {}
        self._connection, self._next_numbers = 0, 0.0
        self._slope, self.delay = SteadyWarning(0.1, 2.0), SteadyWarning(0.5, 10.0)
        session.estimated.connect(guarded(self.show_estimate))
        session.reported.connect(guarded(self._show_status))

    def show_settings(self, settings: Settings) -> None:
        self.settings = settings

    def limits_shown(self) -> dict[str, float]:
        """The colour limits of the visible views, in SI units, by quantity."""
        found = {name: limit for source in self.limits for name, limit in source().items()}
        return {name: limit for name, limit in found.items() if name != "health"}

    def show_numbers_soon(self) -> None:
        """Update the numbers with the next status."""
        self._next_numbers = 0.0

    def _show_status(self, status: Status) -> None:
        self.colouring.follow(status)
        if status.sensor is not None and status.connections != self._connection:
            self._connection = status.connections
            patch = status.sensor.layout.patch
            self.ranges = Ranges(1e3 * max(patch.a, patch.b), self.colouring.shades)
            self.restarted.emit(status)
        state = self._session.badge()
        self.badge.show_state(state, status.recording)
        self.old = state in _OLD
        self.status_shown.emit(status)
        now = time.monotonic()
        if now >= self._next_numbers:
            self._next_numbers = now + _NUMBERS
            estimate = self.estimate_shown()
            self._warn(estimate)
            self.numbers.emit(estimate)

    def show_estimate(self, estimate: Estimate) -> None:
        self.shown.emit(Shown(estimate, self, time.monotonic()))

    def age(self) -> tuple[float, bool]:
        """The median age in s of what is drawn, and whether it is only a lower bound."""
        recent = self.ages()
        known = math.isfinite(self.age_sd)
        return (float(np.median(recent)) if recent else math.nan), not known

    def _warn(self, estimate: Estimate | None) -> None:
        now = time.monotonic()
        there = self._session.inside and estimate is not None and self._session.scene.stimuli
        self.notice.show_hint(_HINT if there else _NO_LOAD_HINT)
        texts = [self._session.other_device()]
        if estimate is not None:
            crossed, _ = self.marks(estimate.curvature)
            slope = self._slope(self._session.status.slope, now)
            method = self._session.engine.requested.setup.method
            texts.append(warnings(estimate, int(crossed.sum()), method, slope))
        pace = self._session.status.pace
        delay = self.delay(1.0 - pace if pace < _SLOW else 0.0, now)
        if delay and self._session.inside:
            texts.append(
                f"simulated at {1.0 - delay:.1f} x real time: this computer is not fast enough"
            )
        self.notice.show_warning(capital("; ".join(filter(None, texts))))

    def estimate_shown(self) -> Estimate | None:
        """The newest estimate, None while it is old."""
        lost = self._session.badge() in _OLD
        return None if lost else self._session.estimate

    def of_elements(self, name: str, estimate: Estimate, kinds: Kinds) -> Array:
        """The values (P,) that colour the elements, on the screen's scale."""
        if name == "health":
            return kinds.max(axis=0).astype(float)
        return self.colouring.of_elements(name, estimate)

    def tint(self, name: str, estimate: Estimate, values: Array, now: float) -> Tint:
        shade, at_rest = self.colouring.shades[name], self.colouring.at_rest(name, estimate)
        if shade.row >= 0:  # one range for the skin and the map
            values = self.colouring.of_elements(name, estimate)
        elif name == "displacement":
            values = 1e3 * estimate.surface
        noise = self.colouring.noise(name, estimate)
        limit = self.ranges.limit(name, values - at_rest, self.settings, now, noise)
        pulled = name == "displacement" and self.ranges.pulled(values)
        return shade.tint(limit, at_rest, pulled, noise)

    def railed(self, estimate: Estimate, kinds: Kinds) -> Mask:
        """Which readings (k, P) are saturated, as far as that is known."""
        status = self._session.status
        on_rail, layout = kinds == FAULTS.index("saturated"), self._layout(estimate)
        if layout is not None and status.region.around == "off":
            # Every channel was scanned: a live one without a reading is saturated.
            missing = (np.isnan(estimate.nominal) & layout.live).astype(float)
            on_rail |= (layout.by_kind(missing) == 1) & (kinds == 0)
        return on_rail

    def _layout(self, estimate: Estimate) -> SensorLayout | None:
        """The layout of the sensor; None where the estimate is of another one."""
        sensor = self._session.status.sensor
        same = sensor is not None and sensor.layout.frame_shape == estimate.curvature.shape
        return sensor.layout if sensor is not None and same else None

    def kinds(self, estimate: Estimate) -> Kinds:
        """Why each channel (k, P) is excluded, as an index of `FAULTS`; 0 where it is not."""
        layout = self._layout(estimate)
        names = layout.kind_names if layout else [*COMPONENTS]
        found = np.zeros((len(names), len(estimate.suspect)), np.uint8)
        for finding in self._session.status.health.findings:
            if finding.element < len(estimate.suspect) and finding.component in names:
                row = names.index(finding.component)  # else it is of another skin
                found[row, finding.element] = FAULTS.index(finding.kind)
        # The fit excludes whole elements.
        whole = np.where(found.any(axis=0), 0, estimate.suspect)
        return np.maximum(found, whole)

    def marks(self, curvature: Array) -> tuple[Mask, Mask]:
        """Which elements exceed their strain limit, and which are selected to scan.

        The limit is known of xx, yy and xy, (3, P); other readings are (R,).
        """
        sensor, settings = self._session.status.sensor, self.settings
        read = curvature.ndim == 2
        count = curvature.shape[1] if read else len(sensor.layout) if sensor else 0
        crossed = none = np.zeros(count, bool)
        if sensor is not None and read:
            crossed = sensor.transduction.overstrained(curvature)
        dotted = none.copy()
        if settings.region == "elements":
            dotted[[p for p in settings.region_elements if p < len(none)]] = True
        return crossed, dotted


def of_row(row: int, of_channels: NDArray[Any]) -> NDArray[Any]:
    """Values of elements (P,) from those of channels (k, P).

    Those of the `row` that a quantity is computed from, or the largest of all where that is -1.
    """
    return of_channels[row] if 0 <= row < len(of_channels) else of_channels.max(axis=0)
