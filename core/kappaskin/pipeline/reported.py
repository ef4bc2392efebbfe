"""The table of what an estimate reports, from which files, messages and readouts are made.

It stands here, beside what makes an estimate, since some error bars need the fit that it comes
from, and since all that shows, sends or writes an estimate lies above. Another quantity is one
entry of `REPORTED` and the function that computes it.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from kappaskin.estimation import Fit
from kappaskin.frames import COMPONENTS, Estimate

UNKNOWN = math.pi / math.sqrt(12)
"""In rad, the spread of a line that may point anywhere: an error bar of a direction at most."""

ELEMENT, ALONG, ACROSS = "element", "along", "across"
"""Axes of a quantity whose length depends on the skin and the functions."""

_SUFFIX = {
    "": "",
    "m": "_m",
    "N": "_N",
    "s": "_s",
    "rad": "_rad",
    "1/m": "_per_m",
    "1/m^2": "_per_m2",
}
_SD, _INTERVAL = "standard deviation", "Student's t, half width of the 95 % interval"


class Reported:
    """An `estimate` with what several quantities are computed of; each is computed once.

    Error bars in space, those of `spread` and `tilt`, need the `fit` that made it.
    """

    __slots__ = ("_in_space", "_principal", "contact", "estimate", "fit", "geometry")

    def __init__(self, estimate: Estimate, fit: Fit | None = None) -> None:
        self.estimate, self.fit = estimate, fit
        self.contact, self.geometry = estimate.contact, estimate.geometry
        self._in_space: tuple[list[float], list[float]] | None = None
        self._principal: tuple[list[float], list[float]] | None = None

    def in_space(self) -> tuple[list[float], list[float]]:
        """Standard deviations (3,) in m of the contact's place; normal (3,), and its tilt's in rad.

        To first order, from what the readings' noise makes of the displacement f and its slopes
        there, and of the place x, y itself, as if these were independent:
            dr = r_x dx + r_y dy - n0 df,    |dn| = |d(f_x, f_y) + K [metric] (dx, dy)|,
        where [r_x r_y] = [t e] [metric] and n0 is the normal of the skin at rest.
        """
        if self._in_space is not None:
            return self._in_space
        if self.fit is None:
            return [math.nan] * 3, [*self.geometry.normal.tolist(), math.nan]
        geometry, estimator = self.geometry, self.fit.estimator
        patch = estimator.basis.patch
        x, y = self.contact.position.tolist()
        x_sd, y_sd = self.contact.position_sd.tolist()
        f_sd, *slopes_sd = self.fit.sd_of(estimator.basis.jet(x, y)[:3]).tolist()
        t, e, normal = geometry.frame.tolist()
        (L, m), (_, k) = geometry.metric.tolist()
        (xx, xy), (_, yy) = geometry.curvature_form.tolist()
        angle = (x - patch.a / 2) * patch.base_curvature
        n0 = math.sin(angle), 0.0, math.cos(angle)
        spread = [
            math.hypot(L * t[i] * x_sd, (m * t[i] + k * e[i]) * y_sd, n0[i] * f_sd)
            for i in range(3)
        ]
        tilt = L * xx * x_sd, L * xy * x_sd, (m * xx + k * xy) * y_sd, (m * xy + k * yy) * y_sd
        self._in_space = spread, [*normal, math.hypot(*slopes_sd, *tilt)]
        return self._in_space

    def principal(self) -> tuple[list[float], list[float]]:
        """Each principal curvature with its standard deviation; both directions (6,), and theirs.

        As `LocalGeometry` has them, written out in numbers: this is done for every frame.
        """
        if self._principal is not None:
            return self._principal
        geometry = self.geometry
        (xx, xy), (_, yy) = geometry.curvature_form.tolist()
        C = geometry.covariance.tolist()
        (ax, ay, az), (bx, by, bz), _ = geometry.frame.tolist()
        d, mean = (xx - yy) / 2, (xx + yy) / 2
        h, angle = math.hypot(d, xy), math.atan2(xy, d) / 2
        c, s = math.cos(angle), math.sin(angle)
        turn = _root(C, -xy, xy, 2 * d)
        self._principal = (
            [
                *(mean + h, _root(C, c * c, s * s, 2 * c * s)),
                *(mean - h, _root(C, s * s, c * c, -2 * c * s)),
            ],
            [
                *(c * ax + s * bx, c * ay + s * by, c * az + s * bz),
                *(c * bx - s * ax, c * by - s * ay, c * bz - s * az),
                min(UNKNOWN, turn / (4 * h * h)) if h else UNKNOWN,
            ],
        )
        return self._principal


def _root(C: list[list[float]], xx: float, yy: float, xy: float) -> float:
    """Standard deviation of what changes with xx, yy and xy so much, by their covariance."""
    (a, b, c), (_, d, e), (_, _, f) = C
    diagonal = a * xx * xx + d * yy * yy + f * xy * xy
    return math.sqrt(max(0.0, diagonal + 2 * (b * xx * yy + c * xx * xy + e * yy * xy)))


Getter = Callable[[Reported], Any]


@dataclass(frozen=True)
class Number:
    """A published number: its `key`, which ends in its unit, how it is written, its meaning."""

    key: str
    form: str
    text: str


@dataclass(frozen=True)
class ReportedQuantity:
    """A quantity of an estimate: a number, or an array whose axes have `parts`, the labels there.

    `value` gets it, `sd` its standard deviation and `half_width` that of its 95 % interval; each
    is a column of tables if its suffix is among `columns`, of the NumPy type `kind`, described by
    `text` and `sd_text`. A quantity of the `group` contact is NaN without one.

    Published it is one number for each of `keys`, key and meaning, written in a `form`; its error
    bars follow it, or each its number if they are `interleaved`. Without `keys` these are made of
    name, parts and unit; with none in it, as for an array of every element, it is not published.
    `quick` gets all that is published of it as a list, in less time than `value` and `sd`.

    On the screen its numbers are called as in `labels_shown`, and each is `shown` in a unit, as so
    many times the value, with so many digits; without labels it is no readout.
    """

    name: str
    unit: str
    text: str
    value: Getter
    symbol: str = ""
    parts: tuple[str | tuple[str, ...], ...] = ()
    kind: str = "<f8"
    group: str = "contact"
    sd: Getter | None = None
    sd_text: str = _SD
    half_width: Getter | None = None
    columns: tuple[str, ...] = ("", "_sd", "_95")
    keys: tuple[tuple[str, str], ...] | None = None
    sd_keys: tuple[tuple[str, str], ...] | None = None
    form: str = "%.6g"
    quick: Getter | None = None
    interleaved: bool = False
    labels_shown: tuple[str, ...] = ()
    shown: tuple[str, float, int] = ("", 1.0, 3)

    @property
    def forms(self) -> tuple[tuple[str, str, Getter], ...]:
        """Suffix, meaning and getter of the value, its standard deviation and its interval."""
        found = [("", self.text, self.value)]
        if self.sd is not None:
            found.append(("_sd", self.sd_text, self.sd))
        if self.half_width is not None:
            found.append(("_95", _INTERVAL, self.half_width))
        return tuple(found)

    def labels(self, axes: dict[str, tuple[str, ...]]) -> tuple[str, ...]:
        """What is appended to the name for each number, flattened; `axes` have the labels of some.

        Empty for a number.
        """
        names = [axes[axis] if isinstance(axis, str) else axis for axis in self.parts]
        return tuple("".join(f"_{each}" for each in parts) for parts in product(*names))

    @property
    def published(self) -> tuple[Number, ...]:
        """The numbers of it in a message, in order."""
        values = tuple(Number(key, self.form, text) for key, text in self._keys)
        sds = tuple(Number(key, "%.3g", text) for key, text in self._sd_keys)
        if self.interleaved:
            return tuple(each for pair in zip(values, sds, strict=True) for each in pair)
        return values + sds

    @property
    def _keys(self) -> tuple[tuple[str, str], ...]:
        if self.keys is not None:
            return self.keys
        suffix = _SUFFIX[self.unit]
        return tuple((f"{self.name}{label}{suffix}", self.text) for label in self.labels({}))

    @property
    def _sd_keys(self) -> tuple[tuple[str, str], ...]:
        if self.sd_keys is not None:
            return self.sd_keys
        if self.sd is None:
            return ()
        suffix = _SUFFIX[self.unit]
        return tuple(
            (f"{key.removesuffix(suffix)}_sd{suffix}", f"standard deviation of {key}")
            for key, _ in self._keys
        )

    def steps(self) -> "tuple[tuple[bool, Getter], ...]":
        """What gets the `published` numbers in order: whether several, as a list, and how."""
        if self.quick is not None:
            return ((True, self.quick),)
        if self.interleaved and self.sd is not None:
            return ((True, _interleaved(_listed(self.value), _listed(self.sd))),)
        found = [(self.value, len(self._keys)), (self.sd, len(self._sd_keys))]
        return tuple(
            (True, _listed(getter)) if count > 1 else (False, getter)
            for getter, count in found
            if getter is not None and count
        )


def _listed(getter: Getter) -> Getter:
    """What gets an array as a flat list."""
    return lambda reported: np.ravel(getter(reported)).tolist()


def _interleaved(value: Getter, sd: Getter) -> Getter:
    return lambda reported: [
        each for pair in zip(value(reported), sd(reported), strict=True) for each in pair
    ]


def numbers_of(quantities: Iterable[ReportedQuantity]) -> Callable[[Reported], list[float]]:
    """What gets all that is published of some quantities, in order."""
    steps = tuple(step for quantity in quantities for step in quantity.steps())

    def numbers(reported: Reported) -> list[float]:
        found: list[float] = []
        for several, get in steps:
            if several:
                found += get(reported)
            else:
                found.append(get(reported))
        return found

    return numbers


_OF_SKIN = "of the skin at the contact"
_MISSING = "NaN where missing"

_FRAME = (
    ReportedQuantity(
        "sequence",
        "",
        "number of the frame",
        lambda r: r.estimate.sequence,
        kind="<i8",
        group="frame",
        keys=(),
    ),
    ReportedQuantity(
        "setup",
        "",
        "number of the settings",
        lambda r: r.estimate.generation,
        kind="<i8",
        group="frame",
        keys=(),
    ),
    ReportedQuantity(
        "device_time",
        "s",
        "on the device's clock",
        lambda r: r.estimate.device_time,
        symbol="t",
        group="frame",
        keys=(("device_time_s", "when the scan began on the device's clock"),),
        form="%.6f",
    ),
    ReportedQuantity(
        "host_time",
        "s",
        "when it came, monotonic clock",
        lambda r: r.estimate.host_time,
        group="frame",
        keys=(),
    ),
    ReportedQuantity(
        "taken",
        "s",
        "when it was taken, monotonic clock",
        lambda r: r.estimate.taken,
        group="frame",
        sd=lambda r: r.estimate.taken_sd,
        sd_text="standard deviation of taken",
        keys=(),
        sd_keys=(("taken_sd_s", "standard deviation of timestamp; null where nothing tells"),),
    ),
)
_FIT = (
    ReportedQuantity(
        "nominal",
        "1/m",
        f"Eq. 8; {_MISSING}",
        lambda r: r.estimate.nominal,
        parts=(COMPONENTS, ELEMENT),
        group="fit",
        keys=(),
    ),
    ReportedQuantity(
        "curvature",
        "1/m",
        _MISSING,
        lambda r: r.estimate.curvature,
        symbol="\N{GREEK SMALL LETTER KAPPA}",
        parts=(COMPONENTS, ELEMENT),
        group="fit",
        keys=(),
    ),
    ReportedQuantity(
        "fresh",
        "",
        "whether the frame brought it",
        lambda r: r.estimate.fresh,
        parts=(COMPONENTS, ELEMENT),
        kind="?",
        group="fit",
        keys=(),
    ),
    ReportedQuantity(
        "residual",
        "1/m",
        "reading less fit",
        lambda r: r.estimate.residual,
        parts=(COMPONENTS, ELEMENT),
        group="fit",
        keys=(),
    ),
    ReportedQuantity(
        "suspect",
        "",
        "why an element is left out, 0 if it is not",
        lambda r: r.estimate.suspect,
        parts=(ELEMENT,),
        kind="|u1",
        group="fit",
        keys=(),
    ),
    ReportedQuantity(
        "coefficients",
        "m",
        "of the functions; NaN where the settings have fewer",
        lambda r: r.estimate.coefficients,
        symbol="c",
        parts=(ALONG, ACROSS),
        group="fit",
        keys=(),
    ),
    ReportedQuantity(
        "noise",
        "1/m",
        "standard deviation of a reading",
        lambda r: r.estimate.noise,
        symbol="\N{GREEK SMALL LETTER SIGMA}",
        group="fit",
        keys=(("noise_per_m", "standard deviation of one reading"),),
        form="%.3g",
        labels_shown=("Noise of a reading",),
        shown=("1/m", 1.0, 3),
    ),
    ReportedQuantity(
        "converged",
        "",
        "whether the fit did",
        lambda r: r.estimate.converged,
        kind="?",
        group="fit",
        keys=(),
    ),
)
_CONTACT = (
    ReportedQuantity(
        "present",
        "",
        "whether there is a contact",
        lambda r: r.contact.present,
        kind="?",
        keys=(
            ("present", "whether the readings hold a contact; without one its numbers are null"),
        ),
    ),
    ReportedQuantity(
        "single",
        "",
        "whether one point load explains the readings",
        lambda r: r.contact.single,
        kind="?",
        keys=(
            ("single", "whether one point load explains the readings as well as the shape does"),
        ),
    ),
    ReportedQuantity(
        "near_rim",
        "",
        "whether it is too near a held edge",
        lambda r: r.contact.near_rim,
        kind="?",
        keys=(
            (
                "near_rim",
                "whether it is too near a held edge for its place and force to be trusted",
            ),
        ),
    ),
    ReportedQuantity(
        "spare", "", "readings more than needed", lambda r: r.contact.spare, kind="<i8", keys=()
    ),
    ReportedQuantity(
        "position",
        "m",
        "of the contact",
        lambda r: r.contact.position,
        symbol="x",
        parts=(("x", "y"),),
        sd=lambda r: r.contact.position_sd,
        half_width=lambda r: r.contact.position_95,
        quick=lambda r: [*r.contact.position.tolist(), *r.contact.position_sd.tolist()],
        labels_shown=("Contact x", "Contact y"),
        shown=("mm", 1e3, 2),
        keys=(
            ("x_m", "where the contact is, along the skin"),
            ("y_m", "where the contact is, across the skin"),
        ),
        form="%.7g",
    ),
    ReportedQuantity(
        "force",
        "N",
        "of the contact",
        lambda r: r.contact.force,
        symbol="F",
        sd=lambda r: r.contact.force_sd,
        half_width=lambda r: r.contact.force_95,
        keys=(("force_N", "of the contact, above zero where it presses"),),
        labels_shown=("Force",),
        shown=("mN", 1e3, 1),
    ),
    ReportedQuantity(
        "displacement",
        "m",
        _OF_SKIN,
        lambda r: r.contact.displacement,
        symbol="w",
        sd=lambda r: r.contact.displacement_sd,
        half_width=lambda r: r.contact.displacement_95,
        columns=("", "_sd"),
        keys=(("displacement_m", f"{_OF_SKIN}, above zero inward"),),
        labels_shown=("Depth",),
        shown=("mm", 1e3, 3),
    ),
)
_GEOMETRY = (
    ReportedQuantity(
        "point",
        "m",
        "the contact in space",
        lambda r: r.geometry.position,
        symbol="r",
        parts=(("x", "y", "z"),),
        sd=lambda r: r.in_space()[0],
        quick=lambda r: [*r.geometry.position.tolist(), *r.in_space()[0]],
        columns=("",),
        keys=(
            ("position_x_m", "the contact's place in space, on the deflected skin"),
            ("position_y_m", "see position_x_m"),
            ("position_z_m", "see position_x_m; z is 0 at the top of the skin at rest"),
        ),
        form="%.7g",
    ),
    ReportedQuantity(
        "normal",
        "",
        "outward unit normal",
        lambda r: r.geometry.normal,
        symbol="n",
        parts=(("x", "y", "z"),),
        sd=lambda r: r.in_space()[1][3],
        quick=lambda r: r.in_space()[1],
        columns=(),
        keys=(
            ("normal_x", "outward unit normal of the deflected skin at the contact"),
            ("normal_y", "see normal_x"),
            ("normal_z", "see normal_x"),
        ),
        sd_keys=(("normal_sd_rad", "standard deviation of the normal's tilt"),),
        form="%.6f",
    ),
    ReportedQuantity(
        "frame",
        "",
        "unit vectors, row by row: along x (t), across it (s), outward normal (n)",
        lambda r: r.geometry.frame,
        parts=(("t", "s", "n"), ("x", "y", "z")),
        keys=(),
    ),
    ReportedQuantity(
        "metric",
        "",
        "what a step along x, y is along the frame",
        lambda r: r.geometry.metric,
        parts=(("t", "s"), ("x", "y")),
        keys=(),
    ),
    ReportedQuantity(
        "curvature_form",
        "1/m",
        f"{_OF_SKIN}, along the frame",
        lambda r: r.geometry.curvature_form,
        symbol="K",
        parts=(("t", "s"), ("t", "s")),
        keys=(),
    ),
    ReportedQuantity(
        "torsion_form",
        "1/m",
        _OF_SKIN,
        lambda r: r.geometry.torsion_form,
        symbol="T",
        parts=(("t", "s"),),
        keys=(),
    ),
    ReportedQuantity(
        "covariance",
        "1/m^2",
        "of xx, yy, xy of the curvature form",
        lambda r: r.geometry.covariance,
        parts=(COMPONENTS, COMPONENTS),
        keys=(),
    ),
    ReportedQuantity(
        "principal",
        "1/m",
        "principal curvatures",
        lambda r: r.geometry.principal,
        symbol="\N{GREEK SMALL LETTER KAPPA}",
        parts=(("1", "2"),),
        sd=lambda r: r.geometry.principal_sd,
        keys=(
            ("curvature_1_per_m", "larger principal curvature of the skin at the contact"),
            ("curvature_2_per_m", "smaller principal curvature"),
        ),
        quick=lambda r: r.principal()[0],
        interleaved=True,
        labels_shown=(
            "Larger \N{GREEK SMALL LETTER KAPPA}",
            "Smaller \N{GREEK SMALL LETTER KAPPA}",
        ),
        shown=("1/m", 1.0, 2),
    ),
    ReportedQuantity(
        "direction",
        "",
        "unit vectors along the principal curvatures",
        lambda r: r.geometry.directions,
        parts=(("1", "2"), ("x", "y", "z")),
        sd=lambda r: r.principal()[1][6],
        columns=(),
        keys=(
            ("direction_1_x", "unit vector along the larger principal curvature"),
            ("direction_1_y", "see direction_1_x"),
            ("direction_1_z", "see direction_1_x"),
            ("direction_2_x", "unit vector along the smaller principal curvature"),
            ("direction_2_y", "see direction_2_x"),
            ("direction_2_z", "see direction_2_x"),
        ),
        sd_keys=(
            (
                "direction_sd_rad",
                "standard deviation of both about the normal; at most 0.907",
            ),
        ),
        form="%.6f",
        quick=lambda r: r.principal()[1],
    ),
    ReportedQuantity(
        "angle",
        "rad",
        "from x to the first principal curvature",
        lambda r: r.geometry.angle,
        keys=(),
    ),
)

REPORTED = (*_FRAME, *_FIT, *_CONTACT, *_GEOMETRY)
"""Every quantity of an estimate, in the order in which tables have them."""


def getters() -> dict[str, Getter]:
    """What gets each quantity and error bar, by name: `force`, `force_sd`, `force_95`."""
    return {
        f"{quantity.name}{suffix}": getter
        for quantity in REPORTED
        for suffix, _, getter in quantity.forms
    }


class Readout(NamedTuple):
    """A number on the screen: in a `unit`, with so many `digits`; NaN where one is not known."""

    label: str
    value: float
    sd: float
    half_width: float
    unit: str
    digits: int


def readouts(estimate: Estimate) -> list[Readout]:
    """What the screen shows of an estimate: first of the contact, then of the fit."""
    reported = Reported(estimate)
    found: list[Readout] = []
    for quantity in sorted(REPORTED, key=lambda each: each.group != "contact"):
        unit, scale, digits = quantity.shown
        numbers = [
            np.ravel(math.nan if get is None else get(reported))
            for get in (quantity.value, quantity.sd, quantity.half_width)
        ]
        for part, label in enumerate(quantity.labels_shown):
            value, sd, half_width = (scale * float(each[part % len(each)]) for each in numbers)
            found.append(Readout(label, value, sd, half_width, unit, digits))
    return found
