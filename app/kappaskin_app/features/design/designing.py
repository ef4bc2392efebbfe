"""A sensor that is not built yet: what is predicted of it at once, and simulated to check that."""

import math
from collections.abc import Generator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
from PySide6.QtCore import QObject, Signal

from kappaskin._processes import BackgroundProcess
from kappaskin.bases import edges_of
from kappaskin.errors import Refusal
from kappaskin.live import Status
from kappaskin.mechanics import Plate
from kappaskin.scenes import Scene, write_scene
from kappaskin.scenes.effects import GaussianNoise
from kappaskin.sensing import SensorLayout, Transduction
from kappaskin.skin import Patch
from kappaskin.studies import Check, Design, Prospect, check, prospect
from kappaskin_app.shell.history import History
from kappaskin_app.shell.loads import ready, reference_on
from kappaskin_app.shell.settings import Settings, part
from kappaskin_app.shell.settings.designed import Designed
from kappaskin_app.shell.settings.scene import SHAPES

_CANCELLED = "Cancelled; another design is computed again."


def patch_of(settings: Settings) -> Patch:
    """The skin that is designed."""
    shape = SHAPES[settings.design_shape]
    return shape.make(*(getattr(settings, f"design_{name}") for name in shape.asks))


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
        ready("centre", plate, edge),
        (GaussianNoise(s.design_noise),),
        electronics,
        rate=min(SHAPES[s.design_shape].rate, fastest if fastest < 1 else math.floor(fastest)),
        reference=reference_on(patch),
        edge=edge,
        title="A design",
        text="Designed in the panel Design; a point presses in the middle.",
    )


def design_of(settings: Settings) -> Design:
    """What is designed, its elements not placed yet."""
    s = settings
    return Design(scene_of(s), (s.design_functions_x, s.design_functions_y), s.design_place)


def _prospects(settings: Settings) -> Generator[Prospect]:
    yield prospect(design_of(settings))


def _placed(settings: Settings, found: Prospect) -> Scene:
    """The design with its elements where they were found to be placed."""
    scene = scene_of(settings)
    if settings.design_place == "scene":
        return scene
    return replace(scene, layout=SensorLayout.scattered(scene.plate.patch, found.positions))


def _checks(settings: Settings, found: Prospect) -> Generator[Check]:
    yield from check(replace(design_of(settings), scene=_placed(settings, found), by="scene"))


class Designing(QObject):
    """Predicts what is designed while somebody looks; `changed` tells when there is news.

    `prospect` is the last that was predicted, of the design there is now unless it is `predicting`;
    `check` what was simulated of it, and `refusal` why there is none.
    """

    changed = Signal()

    def __init__(self, history: History, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._history = history
        self.prospect: Prospect | None = None
        self.check: Check | None = None
        self.refusal = ""
        self._thread = ThreadPoolExecutor(1, "design")
        self._quick: Future[Prospect] | None = None
        self._slow: BackgroundProcess[Prospect] | None = None
        self._checking: BackgroundProcess[Check] | None = None
        self._asked: Settings | None = None
        self._watched = False

    def watch(self, watched: bool) -> None:
        """Predict while somebody looks, and only then."""
        self._watched = watched
        if not watched:
            self._stop()
            self._asked = None

    @property
    def predicting(self) -> bool:
        return self._quick is not None or self._slow is not None

    @property
    def checking(self) -> bool:
        return self._checking is not None

    def follow(self, _: Status) -> None:
        """Take up what was computed meanwhile, and begin anew when something else is designed."""
        if not self._watched:
            return
        self._take_up()
        settings = self._history.settings
        asked = self._asked
        if asked is None or part(settings, Designed) != part(asked, Designed):
            self._begin(settings)

    def _begin(self, settings: Settings) -> None:
        if self._quick is not None:
            return  # it is as good as done
        self._stop()
        self._asked, self.check, self.refusal = settings, None, ""
        # Where elements are placed, and where modes are computed, it takes seconds.
        quick = "rim_radius" not in SHAPES[settings.design_shape].asks
        if quick and settings.design_place in ("scene", "clustered"):
            self._quick = self._thread.submit(lambda: prospect(design_of(settings)))
        else:
            self._slow = BackgroundProcess("kappaskin-design", _prospects, settings)
        self.changed.emit()

    def _take_up(self) -> None:
        try:
            if self._quick is not None and self._quick.done():
                done, self._quick = self._quick, None
                self._show(done.result())
            if self._slow is not None:
                for found in self._slow.poll():
                    self._show(found)
            if self._checking is not None and (found := self._checking.poll()):
                self.check = found[-1]
                self.changed.emit()
        except (Refusal, MemoryError, np.linalg.LinAlgError) as reason:
            self.prospect, self.refusal = None, str(reason)
            self.changed.emit()
        for work in (self._slow, self._checking):
            if work is not None and work.done:
                self._end(work)

    def _show(self, found: Prospect) -> None:
        self.prospect = found
        self.changed.emit()

    def simulate(self) -> None:
        """Begin to check the prediction by a simulation, or end that."""
        if self._checking is not None:
            self._end(self._checking)
        elif self._asked is not None and self.prospect is not None and not self.predicting:
            self.check = None
            self._checking = BackgroundProcess(
                "kappaskin-check", _checks, self._asked, self.prospect
            )
            self.changed.emit()

    def cancel(self) -> None:
        """Wait no more for what is computed."""
        if self._slow is not None:
            self.prospect, self.refusal = None, _CANCELLED
        self._stop()
        self.changed.emit()

    def write(self, file: Path) -> None:
        """Write the design into a scene's file; an `OSError` or a `Refusal` may come."""
        if self._asked is None or self.prospect is None or self.predicting:
            raise Refusal("expected a design that can be computed; change it until a map is shown")
        file.write_text(write_scene(_placed(self._asked, self.prospect)), encoding="utf-8")

    def _stop(self) -> None:
        for work in (self._slow, self._checking):
            if work is not None:
                self._end(work)

    def _end(self, work: "BackgroundProcess[Prospect] | BackgroundProcess[Check]") -> None:
        work.close()
        if work is self._slow:
            self._slow = None
        else:
            self._checking = None
        self.changed.emit()

    def close(self) -> None:
        self.watch(False)
        self._thread.shutdown(wait=True, cancel_futures=True)
