"""The objects that an operator has at hand, as a scene's text says them."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from kappaskin.scenes import Indenter, Scene


@dataclass(frozen=True)
class DemoObject:
    """An object that a simulated finger may press: what its button and its tooltip say."""

    title: str
    tip: str
    said: Mapping[str, Any]

    def is_in(self, scene: Scene) -> bool:
        """Whether it is what touches in `scene`."""
        what = scene.stimuli[0].what
        rigid = what.rigid if isinstance(what, Indenter) else what
        named = type(rigid).__name__.removesuffix("Load").lower()
        sizes = {name: value for name, value in self.said.items() if name != "what"}
        return named == self.said["what"] and all(
            getattr(rigid, name, None) == value for name, value in sizes.items()
        )


THINGS = (
    DemoObject("Ball 40 mm", "A ball of 40 mm radius.", {"what": "sphere", "radius": 0.04}),
    DemoObject("Ball 60 mm", "A ball of 60 mm radius.", {"what": "sphere", "radius": 0.06}),
    DemoObject("Ball 80 mm", "A ball of 80 mm radius.", {"what": "sphere", "radius": 0.08}),
    DemoObject(
        "Pipe 150 mm",
        "A pipe of 150 mm radius and 50 mm length that lies along x.",
        {"what": "cylinder", "radius": 0.15, "length": 0.05},
    ),
    DemoObject(
        "Edge",
        "The edge of a box, 40 mm long, along x.",
        {"what": "wedge", "angle": math.pi / 2, "length": 0.04, "width": 0.02},
    ),
    DemoObject("Point", "A point: it has no radius.", {"what": "point"}),
)
