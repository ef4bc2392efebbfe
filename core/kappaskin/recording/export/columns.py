"""What a table has of every frame: names, units, and where the numbers are."""

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kappaskin.frames import COMPONENTS, Array, Estimate
from kappaskin.recording.export.about import About
from kappaskin.recording.export.moment import Moment


class Column(NamedTuple):
    """A number, or an array of some `shape`, of each frame; `labels` name those in it, flattened.

    Of a `unit`, which is empty for a plain number, and of the NumPy type `kind`.
    """

    name: str
    unit: str
    kind: str
    shape: tuple[int, ...]
    labels: tuple[str, ...]
    said: str
    of: Callable[[Moment], Any]

    def heads(self) -> list[str]:
        """What its numbers are called one by one, with their unit."""
        unit = f" [{self.unit}]" if self.unit else ""
        return [f"{self.name}{label}{unit}" for label in self.labels or ("",)]

    def row(self, moment: Moment) -> "NDArray[Any]":
        return np.asarray(self.of(moment), self.kind).reshape(self.shape)


def _number(
    name: str, unit: str, said: str, of: Callable[[Moment], Any], kind: str = "<f8"
) -> Column:
    return Column(name, unit, kind, (), (), said, of)


def _flag(name: str, said: str, of: Callable[[Estimate], bool]) -> Column:
    return _number(name, "", said, lambda moment: of(moment.estimate), "?")


def _several(
    name: str, unit: str, said: str, labels: Iterable[str], of: Callable[[Estimate], Array]
) -> Column:
    told = tuple(f"_{label}" for label in labels)

    def value(moment: Moment) -> Array:
        return of(moment.estimate)

    return Column(name, unit, "<f8", (len(told),), told, said, value)


def _matrix(
    name: str, unit: str, said: str, labels: tuple[str, str], of: Callable[[Estimate], Array]
) -> Column:
    """Of rows and columns that are labelled by characters."""
    value = _several(name, unit, said, (), of).of
    return Column(name, unit, "<f8", (len(labels[0]), len(labels[1])), _pairs(*labels), said, value)


def _pairs(rows: Iterable[str], across: Iterable[str]) -> tuple[str, ...]:
    columns = tuple(across)
    return tuple(f"_{row}_{column}" for row in rows for column in columns)


def _covariance(moment: Moment) -> Array:
    return moment.estimate.geometry.covariance


_ONE, _OF_SKIN = "Student's t, half width of the 95 % interval", "of the skin at the contact"

_WHEN = (
    _number("time", "s", "when it came, since the recording began", lambda m: m.at),
    _number("sequence", "", "number of the frame", lambda m: m.frame.sequence, "<i8"),
    _number("setup", "", "number of the settings", lambda m: m.estimate.generation, "<i8"),
    _number("device_time", "s", "on the device's clock", lambda m: m.frame.device_time),
    _number("host_time", "s", "when it came, monotonic clock", lambda m: m.frame.host_time),
    _number("taken", "s", "when it was taken, monotonic clock", lambda m: m.frame.taken),
    _number("taken_sd", "s", "standard deviation of taken", lambda m: m.frame.taken_sd),
)
_CONTACT = (
    _number("noise", "1/m", "standard deviation of a reading", lambda m: m.estimate.noise),
    _flag("converged", "whether the fit did", lambda e: e.converged),
    _flag("present", "whether there is a contact", lambda e: e.touch.present),
    _flag("single", "whether one point load explains the readings", lambda e: e.touch.single),
    _flag("near_rim", "whether it is too near a held edge", lambda e: e.touch.near_rim),
    _number("spare", "", "readings more than needed", lambda m: m.estimate.touch.spare, kind="<i8"),
    _several("position", "m", "of the contact", "xy", lambda e: e.touch.position),
    _several("position_sd", "m", "standard deviation", "xy", lambda e: e.touch.position_sd),
    _several("position_95", "m", _ONE, "xy", lambda e: e.touch.position_95),
    _number("force", "N", "of the contact", lambda m: m.estimate.touch.force),
    _number("force_sd", "N", "standard deviation", lambda m: m.estimate.touch.force_sd),
    _number("force_95", "N", _ONE, lambda m: m.estimate.touch.force_95),
    _number("displacement", "m", _OF_SKIN, lambda m: m.estimate.touch.displacement),
    _number(
        "displacement_sd", "m", "standard deviation", lambda m: m.estimate.touch.displacement_sd
    ),
)
_GEOMETRY = (
    _several("point", "m", "the contact in space", "xyz", lambda e: e.geometry.position),
    _matrix(
        "frame",
        "",
        "unit vectors, row by row: along x (t), across it (s), outward normal (n)",
        ("tsn", "xyz"),
        lambda e: e.geometry.frame,
    ),
    _matrix(
        "metric",
        "",
        "what a step along x, y is along the frame",
        ("ts", "xy"),
        lambda e: e.geometry.metric,
    ),
    _matrix(
        "curvature_form",
        "1/m",
        f"{_OF_SKIN}, along the frame",
        ("ts", "ts"),
        lambda e: e.geometry.curvature_form,
    ),
    _several("torsion_form", "1/m", _OF_SKIN, "ts", lambda e: e.geometry.torsion_form),
    Column(
        "covariance",
        "1/m^2",
        "<f8",
        (3, 3),
        _pairs(COMPONENTS, COMPONENTS),
        "of xx, yy, xy of the curvature form",
        _covariance,
    ),
    _several("principal", "1/m", "principal curvatures", "12", lambda e: e.geometry.principal),
    _several("principal_sd", "1/m", "standard deviation", "12", lambda e: e.geometry.principal_sd),
    _number(
        "angle",
        "rad",
        "from x to the first principal curvature",
        lambda m: m.estimate.geometry.angle,
    ),
)


def columns(about: About) -> tuple[Column, ...]:
    """All of them, for P elements and Ni x Nj functions."""
    P, N = len(about.sensor.layout), about.functions
    elements = _pairs(COMPONENTS, map(str, range(P)))
    functions = _pairs(map(str, range(N[0])), map(str, range(N[1])))

    def readings(name: str, unit: str, said: str, of: Callable[[Moment], Any], kind: str) -> Column:
        return Column(name, unit, kind, (3, P), elements, said, of)

    def coefficients(moment: Moment) -> Array:
        found = np.full(N, np.nan)
        Ni, Nj = moment.estimate.coefficients.shape
        found[:Ni, :Nj] = moment.estimate.coefficients
        return found

    def suspect(moment: Moment) -> "NDArray[np.uint8]":
        return moment.estimate.suspect

    def counts(moment: Moment) -> Array:
        found = np.full(3 * P, np.nan)
        found[moment.frame.channels] = moment.frame.counts
        return found

    reading, shape = "NaN where missing", "of the functions; NaN where the settings have fewer"
    return (
        *_WHEN,
        readings("counts", "", "NaN where not scanned", counts, "<f8"),
        readings("nominal", "1/m", f"Eq. 8; {reading}", lambda m: m.estimate.nominal, "<f8"),
        readings("curvature", "1/m", reading, lambda m: m.estimate.curvature, "<f8"),
        readings("fresh", "", "whether the frame brought it", lambda m: m.estimate.fresh, "?"),
        readings("residual", "1/m", "reading less fit", lambda m: m.estimate.residual, "<f8"),
        Column(
            "suspect",
            "",
            "|u1",
            (P,),
            tuple(f"_{n}" for n in range(P)),
            "why an element is left out, 0 if it is not",
            suspect,
        ),
        Column("coefficients", "m", "<f8", N, functions, shape, coefficients),
        *_CONTACT,
        *_GEOMETRY,
    )
