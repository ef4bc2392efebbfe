"""What accuracy costs on the skin that is shown: measured beside the window, point by point."""

import time
from collections import deque
from dataclasses import dataclass, replace

import numpy as np
from PySide6.QtCore import QObject, Signal

from kappaskin.errors import Refusal
from kappaskin.estimation import METHODS
from kappaskin.frames import Estimate
from kappaskin.live import Status
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
"""Functions along each side that are tried."""
ELEMENTS = (6, 16)
"""Elements along each side that are tried on a simulated skin, besides its own."""
_MOST_FUNCTIONS = 400  # of a setting that is measured because it is the present one
_SHOWN = 0.2  # s between two looks: faster cannot be read
_SMOOTHED = 0.5  # s that the measured error and time of the present frame are taken over
_WHOLE = "Predicted is what scans of all elements give, without the region."
_SPOILT = "What spoils the readings of a sensor is in them already: nothing can be left out."
_NOISIER = 1.5  # times more or less noise is other noise


def in_words(setting: Setting, elements: int = 0) -> str:
    """A setting in words; `elements` is how many there are, if known, where they are no grid."""
    name = METHOD_SHORT.get(setting.method, setting.method)
    m_n = " x ".join(map(str, setting.elements)) if setting.elements else str(elements or "")
    words = f"{name}, {' x '.join(map(str, setting.functions))} functions"
    return f"{words}, {m_n} elements" if m_n else words


def gives(cost: Cost) -> str:
    """What a cost gives for what."""
    return f"{length(cost.rms)} in {duration(cost.time_per_frame)}"


@dataclass(frozen=True)
class Frontier:
    """What was measured and is worth to be shown: all of it, and what nothing beats."""

    costs: tuple[Cost, ...] = ()
    best: tuple[Cost, ...] = ()

    def cheapest(self, within: float) -> Cost | None:
        """The one with the least arithmetic whose RMS error is `within` m or less."""
        return next((cost for cost in self.best if cost.rms <= within), None)


class Costing(QObject):
    """Measures settings while somebody looks; `changed` tells when there is something to show.

    `scene` is what is measured on and `costs` what came of it, by setting, as `effects` is of what
    spoils its readings; `refusal` says why nothing can be measured, and `about` on what a real
    sensor's costs rest.
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
            "Measuring what accuracy costs",
            self._take_up,
            self._refuse,
            cancelled="Cancelled; Measure begins anew.",
        )
        self._watched = False
        self._next = 0.0
        self._recent: deque[tuple[float, float, float]] = deque()
        self._generation = -1

    # What happens.

    def watch(self, watched: bool) -> None:
        """Measure what is still to be measured while somebody looks, and only then."""
        self._watched, self._next = watched, 0.0
        if not watched:
            self.task.stop()

    def measure(self) -> None:
        """Measure everything, on the skin as it is now."""
        self.task.stop()
        self.scene, self.costs, self._tried, self.refusal = None, {}, (), ""
        self.effects = {}
        self._next = 0.0
        self._go_on()
        self.changed.emit()

    def follow(self, _: Status) -> None:
        """Measure what is still to be measured."""
        if not self._watched:
            return
        if not self.running and not self.refusal:
            self._go_on()
        now = time.monotonic()
        if now >= self._next:
            self._next = now + _SHOWN
            self.changed.emit()

    def receive(self, estimate: Estimate) -> None:
        """Remember what this frame took and how wrong it is."""
        if not self._watched:
            return
        now = time.monotonic()
        if estimate.generation != self._generation:
            self._generation = estimate.generation
            self._recent.clear()
        self._recent.append((now, estimate.fit_time, estimate.error_rms))
        while self._recent[0][0] < now - _SMOOTHED:
            self._recent.popleft()

    def choose(self, cost: Cost) -> None:
        """Switch to the setting of `cost`."""
        self._take(cost.setting)
        self._next = 0.0

    def _take(self, setting: Setting) -> None:
        """Fit as `setting` says, on as many elements."""
        along_x, along_y = setting.functions
        changed = {"method": setting.method, "functions_x": along_x, "functions_y": along_y}
        elements = setting.elements
        another = elements != elements_of(self._history.settings)
        if elements is not None and another and self._session.simulating:
            changed |= {"elements_x": elements[0], "elements_y": elements[1], **NO_ELEMENTS}
        self._history.change("Choice by its cost", -1, **changed)

    # What is so.

    @property
    def running(self) -> bool:
        return self.task.running

    @property
    def progress(self) -> tuple[int, int]:
        """How many settings are measured, of how many."""
        asked = self._asked()
        return sum(setting in self.costs for setting in asked), len(asked)

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
        """What was measured of the setting in use."""
        present = self.present
        return None if present is None else self.costs.get(present)

    def spoiling(self) -> EffectCosts | None:
        """What the effects of the scene cost with the setting in use, None while not known."""
        setting = self._with()
        return None if setting is None else self.effects.get(setting)

    def why_none(self) -> str:
        """Why no effect is told of, or nothing."""
        if self.scene is not None and not self._of[0]:
            return _SPOILT
        found = self.spoiling()
        return found.reason if isinstance(found, Refused) else ""

    def measured(self) -> tuple[float, float]:
        """Error in m and time in s of the present frames; NaN where they are not known."""
        lately = time.monotonic() - 2 * _SMOOTHED
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
        """What to bear in mind while comparing."""
        whole = "" if self._history.settings.region == "off" else _WHOLE
        return " ".join(filter(None, [self.about, whole]))

    def unlike(self) -> str:
        """What is not as it was when the costs were measured, or nothing."""
        if self.scene is None:
            return ""
        simulated, connections, noise = self._of
        if simulated != self._session.inside:
            return "on another skin"
        if simulated:
            return _unlike(self.scene, self._session.scene)
        if connections != self._session.status.connections:
            return "on another skin"
        now = self._noise()
        return "with other noise" if not 1 / _NOISIER < now / noise < _NOISIER else ""

    # How it is measured.

    def _asked(self) -> tuple[Setting, ...]:
        """The settings to be measured; the present one too, wherever that makes sense."""
        present = self.present
        if present is None or present in self._tried or self.unlike() or not self._tried:
            return self._tried
        return (*self._tried, present) if _measurable(present) else self._tried

    def _go_on(self) -> None:
        try:
            if self.scene is None:
                self._look()
            missing = [setting for setting in self._asked() if setting not in self.costs]
            missing.sort(key=lambda setting: setting != self.present)
            effects_with = self._with()
            if effects_with in self.effects or self.unlike():
                effects_with = None
            if self.scene is not None and (missing or effects_with):
                self.task.compute(cost_steps, self.scene, missing, effects_with)
        except Refusal as refusal:
            self.refusal = str(refusal)

    def _with(self) -> Setting | None:
        """The setting to judge effects with; None where there are none to be judged."""
        present = self.present
        if present is None or not self._tried or not self._of[0] or not _measurable(present):
            return None
        # As they are, with all that a tiling of as many knows nothing of.
        own = present.elements == self._tried[0].elements
        return replace(present, elements=None) if own else present

    def _look(self) -> None:
        """Take the skin as it is now to measure on, if there is one and its noise is known."""
        session, status, noise = self._session, self._session.status, self._noise()
        if status.sensor is None or status.state != "streaming":
            return
        if session.inside:
            self.scene, self.about = session.scene, ""
        elif np.isfinite(noise):
            self.scene = scene_of_sensor(status.sensor, noise)
            self.about = f"With a point load in the middle and the noise of now, {noise:.2g} 1/m."
        if self.scene is not None:
            self._of = session.inside, status.connections, noise
            self._tried = self._to_try(self.scene)

    def _to_try(self, scene: Scene) -> tuple[Setting, ...]:
        """Every method and basis; on a simulated skin with other elements too."""
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
        """The noise of a reading as it is now, in 1/m."""
        estimate = self._session.estimate
        return float("nan") if estimate is None else max(estimate.noise, 1e-9)

    def _take_up(self, found: Cost | Refused | tuple[Setting, EffectCosts]) -> None:
        if isinstance(found, tuple):
            self.effects |= [found]
        else:
            self.costs[found.setting] = found

    def _refuse(self, error: Exception) -> None:
        self.refusal = str(error)
        self.changed.emit()


def _measurable(setting: Setting) -> bool:
    """Whether measuring a setting, because it is in use, takes no ages."""
    return setting.functions[0] * setting.functions[1] <= _MOST_FUNCTIONS


def _besides_noise(scene: Scene) -> list[object]:
    return [one for one in scene.effects if not isinstance(one, UniformNoise | GaussianNoise)]


def _unlike(was: Scene, now: Scene) -> str:
    """What of a simulated scene is not as it was, besides how many elements it has."""
    dead, dead_now = (np.flatnonzero(~scene.layout.live[0]).tolist() for scene in (was, now))
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
