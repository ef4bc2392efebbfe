"""Adds two quantities before anything is made from the table: a number, and one of every element.

The second is a field of the estimate, as CONTRIBUTING says how to add one. Run as the beginning of
a process that looks for both.
"""

from dataclasses import dataclass

import kappaskin.frames as frames


@dataclass(frozen=True, slots=True, eq=False)
class Estimate(frames.Estimate):
    twice_read: object = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "twice_read", 2 * self.curvature)


frames.Estimate = Estimate

import kappaskin.pipeline as pipeline  # noqa: E402
import kappaskin.pipeline.reported as table  # noqa: E402
from kappaskin.pipeline import ReportedQuantity, SkinColour  # noqa: E402
from kappaskin.pipeline.reported import HeaderNumber  # noqa: E402

pipeline.REPORTED = table.REPORTED = (
    *table.REPORTED,
    ReportedQuantity(
        "twice",
        "N",
        "twice the force",
        lambda r: 2 * r.contact.force,
        sd=lambda r: 2 * r.contact.force_sd,
        labels_shown=("Twice",),
        shown=("N", 1.0, 4),
        header=HeaderNumber("twice", 14, "Twice the force."),
    ),
    ReportedQuantity(
        "twice_read",
        "1/m",
        "twice the readings",
        "twice_read",
        parts=(frames.COMPONENTS, table.ELEMENT),
        group="fit",
        element_head="reads twice",
        traced="Twice",
        colours=tuple(
            SkinColour(f"twice_{name}", f"Twice {name}", f"2{name}", "Twice the readings.")
            for name in frames.COMPONENTS
        ),
    ),
)
