"""A sensor that is not built yet: what is predicted of it at once, and simulated to check that."""

import math
from collections.abc import Generator
from dataclasses import replace
from pathlib import Path

from PySide6.QtCore import QObject, Signal

from kappaskin.bases import edges_of
from kappaskin.errors import Refusal
from kappaskin.live import Status
from kappaskin.mechanics import Plate
from kappaskin.scenes import Scene, write_scene
from kappaskin.scenes.effects import GaussianNoise
from kappaskin.sensing import SensorLayout, Transduction
from kappaskin.skin import Patch
from kappaskin.studies import Check, Design, Prospect, check, prospect
from kappaskin_app.shell.background import BackgroundTask, Tasks
from kappaskin_app.shell.history import History
from kappaskin_app.shell.loads import load_case_stimuli, reference_on
from kappaskin_app.shell.settings import Settings, part
from kappaskin_app.shell.settings.designed import DesignSettings
from kappaskin_app.shell.settings.scene import SHAPES


def patch_of(settings: Settings) -> Patch:
    """The skin that is designed."""
    shape = SHAPES[settings.design_shape]
    return shape.make(*(getattr(settings, f"design_{name}") for name in shape.lengths))


def scene_of(settings: Settings) -> Scene:
    """The design with its elements on a regular grid, pressed in the middle by a point."""
    s, patch = settings, patch_of(settings)
    layout, edge = SensorLayout.regular(patch, s.design_x, s.design_y), edges_of(patch)[0]
    plate, electronics = Plate(patch), Transduction()
    converter = replace(electronics.converter, conversion_time=s.design_conversion)
    electronics = replace(electronics, converter=converter)
    fastest = 1 / electronics.scan_time(3 * len(layout))
    return Scene(
        "design",
        plate,
        layout,
        load_case_stimuli("centre", plate, edge),
        (GaussianNoise(s.design_noise),),
        electronics,
        rate=min(SHAPES[s.design_shape].rate, fastest if fastest < 1 else math.floor(fastest)),
        reference=reference_on(patch),
        edge=edge,
        title="A design",
        text="A design made in the panel Design, with a point load in the middle.",
    )


def design_of(settings: Settings) -> Design:
    """What is designed, its elements not placed yet."""
    s = settings
    return Design(scene_of(s), (s.design_functions_x, s.design_functions_y), s.design_place)


def _prospect(settings: Settings) -> Prospect:
    return prospect(design_of(settings))


def _placed(settings: Settings, found: Prospect) -> Scene:
    """The design with its elements where they were found to be placed."""
    scene = scene_of(settings)
    if settings.design_place == "scene":
        return scene
    return replace(scene, layout=SensorLayout.scattered(scene.plate.patch, found.positions))


def _checks(settings: Settings, found: Prospect) -> Generator[Check]:
    return check(replace(design_of(settings), scene=_placed(settings, found), by="scene"))


class Designing(QObject):
    """Predicts what is designed while somebody looks; `changed` tells when there is news.

    `prospect` is the last that was predicted, of the design there is now unless it is `predicting`;
    `check` what was simulated of it, and `refusal` why there is none.
    """

    changed = Signal()

    def __init__(self, history: History, tasks: Tasks, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._history = history
        self.prospect: Prospect | None = None
        self.check: Check | None = None
        self.refusal = ""
        self.predicts = BackgroundTask(
            tasks,
            "Placing the design's elements",
            self._take,
            self._refuse,
            ended=self.changed.emit,
            cancelled="Cancelled; another design is computed again.",
        )
        self.checks = BackgroundTask(
            tasks,
            "Simulating the design",
            self._take_check,
            ended=self.changed.emit,
            cancelled="Cancelled; Check by simulation begins anew.",
        )
        self._asked: Settings | None = None
        self._watched = self._quick = False

    def watch(self, watched: bool) -> None:
        """Predict while somebody looks, and only then."""
        self._watched = watched
        if not watched:
            self._stop()
            self._asked = None
            self.changed.emit()

    @property
    def predicting(self) -> bool:
        return self.predicts.running

    @property
    def checking(self) -> bool:
        return self.checks.running

    def follow(self, _: Status) -> None:
        """Begin anew when something else is designed."""
        settings, asked = self._history.settings, self._asked
        another = asked is None or part(settings, DesignSettings) != part(asked, DesignSettings)
        if self._watched and another:
            self._begin(settings)

    def _begin(self, settings: Settings) -> None:
        if self.predicting and self._quick:
            return  # it is as good as done
        self._stop()
        self._asked, self.check, self.refusal = settings, None, ""
        # Where elements are placed, and where modes are computed, it takes seconds.
        plain = "rim_radius" not in SHAPES[settings.design_shape].lengths
        self._quick = plain and settings.design_place in ("scene", "clustered")
        if self._quick:
            self.predicts.run(_prospect, settings)
        else:
            self.predicts.compute(_prospect, settings)
        self.changed.emit()

    def _take(self, found: Prospect) -> None:
        self.prospect = found

    def _take_check(self, found: Check) -> None:
        self.check = found
        self.changed.emit()

    def _refuse(self, error: Exception) -> None:
        self.prospect, self.refusal = None, str(error)

    def simulate(self) -> None:
        """Begin to check the prediction by a simulation, or end that."""
        if self.checking:
            self.checks.stop()
        elif self._asked is not None and self.prospect is not None and not self.predicting:
            self.check = None
            self.checks.compute(_checks, self._asked, self.prospect)
        self.changed.emit()

    def write(self, file: Path) -> None:
        """Write the design into a scene's file; an `OSError` or a `Refusal` may come."""
        if self._asked is None or self.prospect is None or self.predicting:
            raise Refusal("expected a design that can be computed; change it until a map is shown")
        file.write_text(write_scene(_placed(self._asked, self.prospect)), encoding="utf-8")

    def _stop(self) -> None:
        self.predicts.stop()
        self.checks.stop()
