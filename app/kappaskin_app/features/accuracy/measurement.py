"""Measurement of cost and accuracy of the settings, as a background task."""

import time
from collections import deque
from dataclasses import dataclass, replace

import numpy as np
from PySide6.QtCore import QObject, Signal

from kappaskin.errors import Refusal
from kappaskin.estimation import METHODS
from kappaskin.frames import Estimate
from kappaskin.live import ComputedFrames, Status
from kappaskin.scenes import Scene
from kappaskin.scenes.effects import GaussianNoise, UniformNoise
from kappaskin.studies import (
    Cost,
    EffectCosts,
    Refused,
    Setting,
    cost_steps,
    frontier,
    settings_to_try,
)
from kappaskin_app.shell.background import BackgroundTask, Tasks
from kappaskin_app.shell.history import History
from kappaskin_app.shell.session import Session
from kappaskin_app.shell.settings.shown import METHOD_SHORT
from kappaskin_app.shell.simulation import NO_ELEMENTS, elements_of, scene_of_sensor
from kappaskin_app.widgets.text import duration, length

FUNCTIONS = (4, 6, 8, 12)
"""Basis functions along each side that are measured."""
ELEMENTS = (6, 16)
"""Elements along each side that are measured on a simulated skin, besides its own."""
_MOST_FUNCTIONS = 400  # of the present setting, beyond which it is not measured
_UPDATE = 0.2  # s between two updates of the panel
_AVERAGED = 0.5  # s over which error and time of the present frames are averaged
_WHOLE = "Predicted values are for scans of all elements, without the region of interest."
_REAL = "The readings of a real sensor include all effects: none can be omitted."
_NOISE_RATIO = 1.5  # beyond this ratio the noise has changed


def setting_text(setting: Setting, elements: int = 0) -> str:
    """The name of a setting; `elements` is their number, if known, where they are no grid."""
    name = METHOD_SHORT.get(setting.method, setting.method)
    m_n = " x ".join(map(str, setting.elements)) if setting.elements else str(elements or "")
    words = f"{name}, {' x '.join(map(str, setting.functions))} functions"
    return f"{words}, {m_n} elements" if m_n else words


def performance(cost: Cost) -> str:
    """The RMS error of a cost, and its time."""
    return f"{length(cost.rms)} in {duration(cost.time_per_frame)}"


@dataclass(frozen=True)
class Frontier:
    """The measured costs, and the Pareto-optimal ones among them."""

    costs: tuple[Cost, ...] = ()
    best: tuple[Cost, ...] = ()

    def cheapest(self, within: float) -> Cost | None:
        """The cost of least computing time whose RMS error is `within` m or less."""
        return next((cost for cost in self.best if cost.rms <= within), None)


class CostMeasurement(QObject):
    """Measures settings while its panel is visible; `changed` reports new results.

    `costs` and `effects` are the results by setting, measured on `scene`; `refusal` is the reason
    where nothing can be measured, and `about` the conditions on a real sensor.
    """

    changed = Signal()

    def __init__(
        self, history: History, session: Session, tasks: Tasks, parent: QObject | None = None
    ) -> None:
        super().__init__(parent)
        self._history, self._session = history, session
        self.scene: Scene | None = None
        self.costs: dict[Setting, Cost | Refused] = {}
        self.effects: dict[Setting, EffectCosts] = {}
        self.refusal = self.about = ""
        self._of: tuple[bool, int, float] = (False, 0, 0.0)
        self._tried: tuple[Setting, ...] = ()
        self.task = BackgroundTask(
            tasks,
            "Measuring the cost of accuracy",
            self._take_result,
            self._refuse,
            cancelled="Cancelled; Measure starts again.",
        )
        self._active = False
        self._began = 0.0, 0  # when the task did, and how many were measured before
        self._next = 0.0
        self._recent: deque[tuple[float, float, float]] = deque()
        self._generation = -1

    # Actions

    def set_active(self, active: bool) -> None:
        """Measure while the panel is visible, and only then."""
        self._active, self._next = active, 0.0
        if not active:
            self.task.stop()

    def measure(self) -> None:
        """Measure all settings again, on the present skin."""
        self.task.stop()
        self.scene, self.costs, self._tried, self.refusal = None, {}, (), ""
        self.effects = {}
        self._next = 0.0
        self._continue()
        self.changed.emit()

    def follow(self, _: Status) -> None:
        """Continue the measurement."""
        if not self._active:
            return
        if not self.running and not self.refusal:
            self._continue()
        now = time.monotonic()
        if now >= self._next:
            self._next = now + _UPDATE
            self.changed.emit()

    def receive(self, estimate: Estimate) -> None:
        """Record the time and the error of a frame."""
        if not self._active:
            return
        now = time.monotonic()
        if estimate.generation != self._generation:
            self._generation = estimate.generation
            self._recent.clear()
        self._recent.append((now, estimate.fit_time, estimate.error_rms))
        while self._recent[0][0] < now - _AVERAGED:
            self._recent.popleft()

    def choose(self, cost: Cost) -> None:
        """Switch to the setting of `cost`."""
        self._take(cost.setting)
        self._next = 0.0

    def _take(self, setting: Setting) -> None:
        """Select the estimator, the basis and the elements of `setting`."""
        along_x, along_y = setting.functions
        changed = {"method": setting.method, "functions_x": along_x, "functions_y": along_y}
        elements = setting.elements
        another = elements != elements_of(self._history.settings)
        if elements is not None and another and self._session.simulating:
            changed |= {"elements_x": elements[0], "elements_y": elements[1], **NO_ELEMENTS}
        self._history.change("Setting from Cost of accuracy", -1, **changed)

    # State

    @property
    def running(self) -> bool:
        return self.task.running

    @property
    def progress(self) -> tuple[int, int]:
        """The number of measured settings, and of all."""
        requested = self._requested()
        return sum(setting in self.costs for setting in requested), len(requested)

    @property
    def left(self) -> float:
        """How many s the rest of the settings take, by those measured since the task began."""
        since, before = self._began
        done, requested = self.progress
        if not self.running or done <= before:
            return float("nan")
        return (time.monotonic() - since) * (requested - done) / (done - before)

    @property
    def present(self) -> Setting | None:
        """The setting in use, None before there is a skin."""
        status, s = self._session.status, self._history.settings
        if status.sensor is None:
            return None
        layout, setup = status.sensor.layout, status.setup
        across = 1 if layout.patch.strip else setup.Nj
        own = layout.shape
        if self._session.simulating and not s.dead_elements:
            own = elements_of(s)
        return Setting(setup.method, (setup.Ni, across), own)

    def predicted(self) -> Cost | Refused | None:
        """The cost of the setting in use."""
        present = self.present
        return None if present is None else self.costs.get(present)

    def effect_costs(self) -> EffectCosts | None:
        """The costs of the effects with the setting in use; None while unknown."""
        setting = self._effects_setting()
        return None if setting is None else self.effects.get(setting)

    def why_none(self) -> str:
        """Why there are no costs of effects; empty if there are."""
        if self.scene is not None and not self._of[0]:
            return _REAL
        found = self.effect_costs()
        return found.reason if isinstance(found, Refused) else ""

    @property
    def computed(self) -> ComputedFrames:
        """What the frames that the engine computes take."""
        return self._session.status.computed

    def measured(self) -> tuple[float, float]:
        """Error in m and time in s of the present frames; NaN where unknown."""
        lately = time.monotonic() - 2 * _AVERAGED
        recent = [(taken, error) for when, taken, error in self._recent if when > lately]
        if not recent:
            return float("nan"), float("nan")
        taken, error = np.array(recent).T
        return float(error.mean()), float(np.median(taken))

    def frontier(self) -> Frontier:
        known = tuple(
            cost
            for cost in self.costs.values()
            if isinstance(cost, Cost) and cost.rms < cost.shape_rms
        )
        return Frontier(known, frontier(known))

    def note(self) -> str:
        """Conditions of the measurement."""
        whole = "" if self._history.settings.region == "off" else _WHOLE
        return " ".join(filter(None, [self.about, whole]))

    def difference(self) -> str:
        """What has changed since the costs were measured; empty if nothing."""
        if self.scene is None:
            return ""
        simulated, connections, noise = self._of
        if simulated != self._session.inside:
            return "on another skin"
        if simulated:
            return _scene_difference(self.scene, self._session.scene)
        if connections != self._session.status.connections:
            return "on another skin"
        now = self._noise()
        return "with other noise" if not 1 / _NOISE_RATIO < now / noise < _NOISE_RATIO else ""

    # Measurement

    def _requested(self) -> tuple[Setting, ...]:
        """The settings to measure, with the present one if it is small enough."""
        present = self.present
        if present is None or present in self._tried or self.difference() or not self._tried:
            return self._tried
        return (*self._tried, present) if _measurable(present) else self._tried

    def _continue(self) -> None:
        try:
            if self.scene is None:
                self._prepare()
            missing = [setting for setting in self._requested() if setting not in self.costs]
            missing.sort(key=lambda setting: setting != self.present)
            effects_with = self._effects_setting()
            if effects_with in self.effects or self.difference():
                effects_with = None
            if self.scene is not None and (missing or effects_with):
                self._began = time.monotonic(), self.progress[0]
                self.task.compute(cost_steps, self.scene, missing, effects_with)
        except Refusal as refusal:
            self.refusal = str(refusal)

    def _effects_setting(self) -> Setting | None:
        """The setting with which effects are measured; None where there are none."""
        present = self.present
        if present is None or not self._tried or not self._of[0] or not _measurable(present):
            return None
        # The scene's own elements: a regular grid of as many may differ.
        own = present.elements == self._tried[0].elements
        return replace(present, elements=None) if own else present

    def _prepare(self) -> None:
        """Select the present skin for the measurement, if its noise is known."""
        session, status, noise = self._session, self._session.status, self._noise()
        if status.sensor is None or status.state != "streaming":
            return
        if session.inside:
            self.scene, self.about = session.scene, ""
        elif np.isfinite(noise):
            self.scene = scene_of_sensor(status.sensor, noise)
            times, unit = status.sensor.noise_unit
            text = f"{times * noise:.2g}\N{NO-BREAK SPACE}{unit}"
            self.about = f"With a point load in the middle and the present noise, {text}."
        if self.scene is not None:
            self._of = session.inside, status.connections, noise
            self._tried = self._to_try(self.scene)

    def _to_try(self, scene: Scene) -> tuple[Setting, ...]:
        """All estimators and bases; on a simulated skin also with other elements."""
        own, others = scene.layout.shape, ()
        if self._session.simulating:
            s = self._history.settings
            own = own if s.dead_elements else elements_of(s)
            others = tuple(m for m in ELEMENTS if (m, 1 if scene.layout.patch.strip else m) != own)
        tried = settings_to_try(
            scene, tuple(METHODS), FUNCTIONS, others, precisions=("float64",), scanned=("all",)
        )
        first = tried[0].elements
        return tuple(replace(t, elements=own) if t.elements == first else t for t in tried)

    def _noise(self) -> float:
        """The present noise of a reading, in its unit."""
        estimate = self._session.estimate
        return float("nan") if estimate is None else max(estimate.noise, 1e-9)

    def _take_result(self, found: Cost | Refused | tuple[Setting, EffectCosts]) -> None:
        if isinstance(found, tuple):
            self.effects |= [found]
        else:
            self.costs[found.setting] = found

    def _refuse(self, error: Exception) -> None:
        self.refusal = str(error)
        self.changed.emit()


def _measurable(setting: Setting) -> bool:
    """Whether the present setting is small enough to be measured."""
    return setting.functions[0] * setting.functions[1] <= _MOST_FUNCTIONS


def _besides_noise(scene: Scene) -> list[object]:
    return [one for one in scene.effects if not isinstance(one, UniformNoise | GaussianNoise)]


def _scene_difference(was: Scene, now: Scene) -> str:
    """The change of a simulated scene, except in the number of its elements."""
    dead, dead_now = (scene.layout.dead for scene in (was, now))
    if (was.plate, was.edge) != (now.plate, now.edge):
        return "on another skin"
    if was.transduction != now.transduction:
        return "with other electronics"
    if (was.choice, *_besides_noise(was)) != (now.choice, *_besides_noise(now)):
        return "with other effects"
    if was.effects != now.effects:
        return "with other noise"
    if dead != dead_now:
        return "with other elements dead"
    if was.stimuli != now.stimuli:
        return "under another load"
    return ""
