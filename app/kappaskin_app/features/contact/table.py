"""What the skin's picture shows, as tables of text: contact, what touches, every element."""

import csv
import io
import math
from collections.abc import Sequence

from kappaskin.estimation import FAULTS
from kappaskin.frames import COMPONENTS, Estimate
from kappaskin.pipeline import readouts
from kappaskin.sensing import Sensor

FACTS = ("What", "Value", "95 % within", "Unit")
ELEMENTS = ("Element", "x [mm]", "y [mm]", *(f"{name} [1/m]" for name in COMPONENTS), "Left out")

Rows = list[tuple[str, ...]]


def facts_of(estimate: Estimate, touches: str) -> Rows:
    """The contact, what `touches` there in words, and how well the shape is known."""
    rows = [
        (each.label, _told(each.value, each.digits), _told(each.half_width, each.digits), each.unit)
        for each in readouts(estimate)
    ]
    return [*rows, ("Touches", touches or "nothing known", "", "")]


def elements_of(estimate: Estimate, sensor: Sensor) -> Rows:
    """Where every element is, what it reads, and why it is left out."""
    places = 1e3 * sensor.layout.positions
    if estimate.curvature.shape[1] != len(places):
        return []  # of the skin before
    return [
        (
            str(number),
            *(_told(value, 1) for value in place),
            *(_told(value, 2) for value in estimate.curvature[:, number]),
            FAULTS[estimate.suspect[number]],
        )
        for number, place in enumerate(places)
    ]


def csv_of(*tables: tuple[Sequence[str], Rows]) -> str:
    """Tables of a head and rows each as CSV, an empty line between them."""
    text = io.StringIO()
    for number, (head, rows) in enumerate(tables):
        text.write("\n" if number else "")
        csv.writer(text, lineterminator="\n").writerows([head, *rows])
    return text.getvalue()


def _told(value: float, digits: int) -> str:
    """A number, or nothing where there is none; a program reads its minus."""
    return f"{value + 0.0:.{digits}f}" if math.isfinite(value) else ""
