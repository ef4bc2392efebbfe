"""Shapes of skin that a person may choose; another one is another line here."""

import math
from collections.abc import Callable
from dataclasses import dataclass

from kappaskin import Patch

_FINGERTIP = 0.0129  # m, the paper's


@dataclass(frozen=True)
class Shape:
    """A shape made from some of the settings, with what they begin as when it is chosen."""

    label: str
    make: Callable[..., Patch]
    begins: dict[str, float]


SHAPES = {
    "flat": Shape("Flat patch", Patch, {"side_x": 0.1, "side_y": 0.1}),
    "cylinder": Shape(
        "Cylinder (fingertip)",
        Patch,
        {"side_x": math.pi * _FINGERTIP, "side_y": 0.04, "base_radius": _FINGERTIP},
    ),
}
"""By name; `make` is called with the settings named in `begins`, in their order."""
