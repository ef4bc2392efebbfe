"""Prediction of a sensor design's standard deviation, and its check by simulation."""

import math
from collections.abc import Generator
from dataclasses import replace
from pathlib import Path
from typing import cast

from PySide6.QtCore import QObject, Signal

from kappaskin._files import write_whole
from kappaskin.bases import edges_of
from kappaskin.errors import Refusal
from kappaskin.live import Status
from kappaskin.mechanics import DiscLoad, Plate, PointLoad
from kappaskin.scenes import Scene, Stimulus, write_scene
from kappaskin.scenes.effects import GaussianNoise
from kappaskin.sensing import DigitalReadings, SensorLayout, Transduction, kind_of_reading
from kappaskin.skin import Cap, Disk, Patch
from kappaskin.studies import Check, Design, Prospect, check, prospect
from kappaskin_app.shell import simulation
from kappaskin_app.shell.background import BackgroundTask, Tasks
from kappaskin_app.shell.history import History
from kappaskin_app.shell.loads import load_case_stimuli, reference_on
from kappaskin_app.shell.settings import SceneSettings, Settings, part
from kappaskin_app.shell.settings.designed import OPEN, DesignSettings
from kappaskin_app.shell.settings.scene import SHAPES


def patch_of(settings: Settings) -> Patch:
    """The patch of the design."""
    shape = SHAPES[settings.design_shape]
    return shape.make(*(getattr(settings, f"design_{name}") for name in shape.lengths))


_NOISE = {"height": "design_height_noise", "slope": "design_slope_noise"}
ROUND = (Disk, Cap)
"""Skins on which elements may be on rings or a spiral."""
_DISC = 0.075  # of the shorter side: the radius of what presses a curved skin
_ON_CAP = (15, 31)  # functions of the true shape along and around
_RESOLUTION = 1e-9  # of readings that come as numbers: no noise is as small


def noise_settings(settings: Settings) -> dict[str, str]:
    """The setting of the noise of each quantity that the design reads, by name."""
    quantities = dict.fromkeys(kind_of_reading(name)[0] for name in settings.design_reads)
    return {name: _NOISE.get(name, "design_noise") for name in quantities}


def pattern_of(settings: Settings) -> str:
    """The pattern of the elements: a grid, or on a round skin the one that is selected."""
    shape = SHAPES.get(settings.design_shape)
    return settings.design_pattern if shape and shape.make in ROUND else "grid"


def _layout(settings: Settings, patch: Patch) -> SensorLayout:
    s, pattern = settings, pattern_of(settings)
    if pattern == "spiral":
        return SensorLayout.in_spiral(patch, s.design_count)
    if pattern == "grid":
        return SensorLayout.regular(patch, s.design_x, s.design_y)
    try:
        counts = [int(count) for count in s.design_rings.split(",")]
    except ValueError as error:
        raise Refusal(
            "expected the number of elements on each ring, such as 1, 6, 13, got "
            f"{s.design_rings!r:.60}"
        ) from error
    return SensorLayout.on_rings(patch, counts)


def _load(plate: Plate, edge: str) -> tuple[tuple[Stimulus, ...], tuple[int, int]]:
    """A point load in the middle and the true functions; where the skin is curved, a disc.

    It has the same force: such a skin bends close around a load only. A strip has a point load.
    """
    point, reference = load_case_stimuli("centre", plate, edge), reference_on(plate, edge, "centre")
    patch, force = plate.patch, cast("PointLoad", point[0].what).force
    if patch.strip or not any(patch.curvatures):
        return point, reference
    disc = DiscLoad(patch.a / 2, patch.b / 2, _DISC * min(patch.a, patch.b), force)
    return (Stimulus(disc),), _ON_CAP if isinstance(patch, Cap) else reference


def scene_of(settings: Settings) -> Scene:
    """The design with its elements in their pattern, and a load in the middle; or what is open."""
    if settings.design_shape == OPEN:
        return simulation.scene_of(settings)
    s, patch = settings, patch_of(settings)
    layout = _layout(s, patch)
    edge = SHAPES[s.design_shape].defaults.get("edge", edges_of(patch)[0])
    layout, plate, electronics = layout.reading_each(s.design_reads), Plate(patch), Transduction()
    converter = replace(electronics.converter, conversion_time=s.design_conversion)
    electronics, effects = (
        replace(electronics, converter=converter),
        (GaussianNoise(s.design_noise),),
    )
    if not layout.senses_curvature_only:
        noise = {name: getattr(s, own) for name, own in noise_settings(s).items()}
        electronics, effects = DigitalReadings(_RESOLUTION, tuple(noise.items())), ()
    scan_time = electronics.scan_time(layout.channels)
    stimuli, reference = _load(plate, edge)
    rate = min(SHAPES[s.design_shape].rate, 1 / scan_time if scan_time else math.inf)
    return Scene(
        "design",
        plate,
        layout,
        stimuli,
        effects,
        electronics,
        rate=rate if rate < 1 else math.floor(rate),
        reference=reference,
        edge=edge,
        title="A design",
        text="A design made in the panel Design, with a load in the middle.",
    )


def design_of(settings: Settings) -> Design:
    """The design, before its elements are placed."""
    s = settings
    return Design(scene_of(s), (s.design_functions_x, s.design_functions_y), s.design_place)


def _prospect(settings: Settings) -> tuple[Design, Prospect]:
    """The design with its elements placed, and what is predicted of it."""
    placed = design_of(settings).placed()
    return placed, prospect(placed, settings.design_map)


def _checks(placed: Design, of: str) -> Generator[Check]:
    return check(placed, of=of)


def _designed(settings: Settings) -> tuple[object, ...]:
    """The settings that the design depends on."""
    scene = part(settings, SceneSettings) if settings.design_shape == OPEN else ()
    return (*part(settings, DesignSettings), *scene)


class DesignPrediction(QObject):
    """Predicts the design while its panel is visible; `changed` reports a new result.

    `prospect` is the last prediction, of the present design unless it is `predicting`, and `placed`
    its design with the elements where they are; `check` is its simulation, and `refusal` the reason
    where there is none.
    """

    changed = Signal()

    def __init__(self, history: History, tasks: Tasks, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._history = history
        self.prospect: Prospect | None = None
        self.placed: Design | None = None
        self.check: Check | None = None
        self.refusal = ""
        self.predicts = BackgroundTask(
            tasks,
            "Placing the design's elements",
            self._take,
            self._refuse,
            ended=self.changed.emit,
            cancelled="Cancelled; computed again when the design changes.",
        )
        self.checks = BackgroundTask(
            tasks,
            "Simulating the design",
            self._take_check,
            ended=self.changed.emit,
            cancelled="Cancelled; Check by simulation starts again.",
        )
        self._requested: Settings | None = None
        self._active = self._quick = False

    def set_active(self, active: bool) -> None:
        """Predict while the panel is visible, and only then."""
        self._active = active
        if not active:
            self._stop()
            self._requested = None
            self.changed.emit()

    @property
    def predicting(self) -> bool:
        return self.predicts.running

    @property
    def checking(self) -> bool:
        return self.checks.running

    def follow(self, _: Status) -> None:
        """Predict again when the design has changed."""
        settings, requested = self._history.settings, self._requested
        if not self._active or settings is requested:
            return
        if requested is None or _designed(settings) != _designed(requested):
            self._begin(settings)

    def _begin(self, settings: Settings) -> None:
        if self.predicting and self._quick:
            return  # the result comes soon
        self._stop()
        self._requested, self.check, self.refusal = settings, None, ""
        # Optimised positions and computed modes take seconds, contacts a fifth of one.
        shape = SHAPES.get(settings.design_shape)
        plain = shape is not None and "side_x" in shape.lengths
        self._quick = plain and settings.design_place in ("scene", "clustered")
        if self._quick:
            self.predicts.run(_prospect, settings)
        else:
            self.predicts.compute(_prospect, settings)
        self.changed.emit()

    @property
    def open_map(self) -> tuple[Design, Prospect] | None:
        """What is predicted of the scene that is open, while the panel is visible."""
        requested = self._requested
        if requested is None or requested.design_shape != OPEN or self.predicting:
            return None
        return (
            None if self.placed is None or self.prospect is None else (self.placed, self.prospect)
        )

    def _take(self, found: tuple[Design, Prospect]) -> None:
        self.placed, self.prospect = found

    def _take_check(self, found: Check) -> None:
        self.check = found
        self.changed.emit()

    def _refuse(self, error: Exception) -> None:
        self.prospect, self.refusal = None, str(error)

    def simulate(self) -> None:
        """Start the check by simulation, or stop it."""
        if self.checking:
            self.checks.stop()
        elif self.placed is not None and self.prospect is not None and not self.predicting:
            self.check = None
            self.checks.compute(_checks, self.placed, self.prospect.of)
        self.changed.emit()

    def write(self, file: Path) -> None:
        """Write the design into a scene file; a `Refusal` where that fails."""
        if self.placed is None or self.prospect is None or self.predicting:
            raise Refusal(
                "expected a design with a prediction, got none; change it until a map is shown"
            )
        write_whole(file, write_scene(self.placed.scene))

    def _stop(self) -> None:
        self.predicts.stop()
        self.checks.stop()
