"""Lessons: steps, questions and answers."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from kappaskin.scenes import scene_file
from kappaskin_app.features.lessons.expression import Expression
from kappaskin_app.shell.settings import SceneSettings
from kappaskin_app.shell.settings.scene import SHAPES, Scanning
from kappaskin_app.shell.settings.shown import EstimatorSettings, View
from kappaskin_app.shell.simulation import written

UNITS = {
    "": 1.0,
    "m": 1.0,
    "mm": 1e-3,
    "\N{MICRO SIGN}m": 1e-6,
    "N": 1.0,
    "mN": 1e-3,
    "1/m": 1.0,
    "V": 1.0,
    "mV": 1e-3,
    "s": 1.0,
    "ms": 1e-3,
    "%": 1e-2,
    "times": 1.0,
    "frames/s": 1.0,
}
"""What one of each unit that an answer may have is in SI units."""

_PLAIN = {
    field.name: getattr(kind(), field.name)
    for kind in (SceneSettings, EstimatorSettings, Scanning, View)
    for field in fields(kind)
} | {"calibration": None, "tare": None}


@dataclass(frozen=True)
class ChoiceAnswer:
    """One of several `options` is `right`, counted from 0."""

    options: tuple[str, ...]
    right: int


@dataclass(frozen=True)
class NumberAnswer:
    """A number within `tolerance` of what is `expected`, both in SI units, asked in `unit`."""

    expected: Expression
    tolerance: float
    unit: str


@dataclass(frozen=True)
class LessonTask:
    """A task, done when `check` holds for what the window shows; `solution` does it."""

    check: Expression
    solution: Mapping[str, Any]


@dataclass(frozen=True)
class Question:
    """A question, with a `hint` after the first wrong answer and an explanation at the end."""

    text: str
    how: ChoiceAnswer | NumberAnswer | LessonTask
    hint: str
    explain: str


@dataclass(frozen=True)
class Button:
    """A button that changes settings: `sets` on top of the step's settings."""

    label: str
    sets: Mapping[str, Any]


@dataclass(frozen=True)
class Step:
    """A `title`, a `text` in Markdown, and what it does to the window.

    `sets` are the settings it begins with, None where it changes none; `point` names the controls
    that are pointed at.
    """

    title: str
    text: str
    sets: Mapping[str, Any] | None = None
    point: tuple[str, ...] = ()
    buttons: tuple[Button, ...] = ()
    question: Question | None = None


@dataclass(frozen=True)
class Lesson:
    """A lesson of about so many `minutes`, in steps; on a ready `hand` where one is named.

    `version` is a checksum of its text: answers belong to one text.
    """

    name: str
    title: str
    minutes: int
    learn: str
    steps: tuple[Step, ...]
    hand: str = ""
    version: int = 0

    def begins(self, step: int) -> Mapping[str, Any] | None:
        """The settings that `step` begins with, from it or the last step that has any."""
        earlier = (one.sets for one in reversed(self.steps[: step + 1]))
        return next((sets for sets in earlier if sets is not None), None)

    @property
    def questions(self) -> int:
        return sum(step.question is not None for step in self.steps)


def whole(sets: Mapping[str, Any]) -> dict[str, Any]:
    """All settings of a step with `sets`: the others are defaults, and a shape has its size.

    A "scene" among them is the ready scene that is played.
    """
    values = dict(sets)
    shape = SHAPES[values.get("shape", "flat")]
    scene = values.pop("scene", "")
    played = {"written": written(scene_file(scene))} if scene else {}
    return _PLAIN | {**shape.lengths, **shape.defaults} | played | values
