"""The reported quantities of an estimate: one table for files, messages and the screen.

The table is in this room, with the pipeline, since some error bars need the fit that it comes
from, and since all that shows, sends or writes an estimate lies above. Another quantity is one
entry of `REPORTED` and the function that computes it.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import groupby, product
from operator import attrgetter
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np

from kappaskin.errors import Refusal
from kappaskin.estimation import Fit, propagated_covariance
from kappaskin.frames import COMPONENTS, Array, Estimate
from kappaskin.sensing import Sensor, SensorLayout

if TYPE_CHECKING:
    from kappaskin.pipeline.quantities import Quantities

UNKNOWN = math.pi / math.sqrt(12)
"""In rad, the standard deviation of an unknown direction, the largest error bar of a direction."""

ELEMENT, ALONG, ACROSS, ROW, COLUMN = "element", "along", "across", "row", "column"
"""Axes of a quantity whose length depends on the skin, the functions and the surface's points."""
_OF_READINGS = COMPONENTS, ELEMENT
_READING = "reading"
Axes = dict[str, int | tuple[str, ...]]


def axes_of(layout: SensorLayout, functions: tuple[int, int], points: tuple[int, int]) -> Axes:
    """The lengths of all axes, for Ni x Nj `functions` and nx x ny `points`.

    Where elements read other than xx, yy and xy, the names of all readings, which have one axis.
    """
    lengths = (len(layout), *functions, *points[::-1])
    axes: Axes = dict(zip((ELEMENT, ALONG, ACROSS, ROW, COLUMN), lengths, strict=True))
    if layout.reads:
        kinds, elements = layout.kind.tolist(), layout.element.tolist()
        names = layout.kind_names
        axes[_READING] = tuple(f"{names[k]}_{p}" for k, p in zip(kinds, elements, strict=True))
    return axes


# The least range of colours of readings in a unit over that in 1/m, on the screen's scales.
_LEAST = {"m": 20.0, "m/m": 2.0, "1/m": 1.0}
_SD, _INTERVAL = "standard deviation", "Student's t, half width of the 95 % interval"


class Reported:
    """An `estimate` with what several quantities are computed of; each is computed once.

    Error bars in space, those of `spread` and `tilt`, need the `fit` that made it, quantities on
    the surface the `skin`.
    """

    __slots__ = (
        "_in_space",
        "_principal",
        "contact",
        "estimate",
        "fit",
        "geometry",
        "second",
        "skin",
    )

    def __init__(
        self, estimate: Estimate, fit: Fit | None = None, skin: "Quantities | None" = None
    ) -> None:
        self.estimate, self.fit, self.skin = estimate, fit, skin
        self.contact, self.second = estimate.contact, estimate.second
        self.geometry = estimate.geometry
        self._in_space: tuple[list[float], list[float]] | None = None
        self._principal: tuple[list[float], list[float]] | None = None

    def in_space(self) -> tuple[list[float], list[float]]:
        """Standard deviations (3,) in m of the contact's place; normal (3,), and its tilt's in rad.

        To first order, from what the readings' noise makes of the displacement f and its slopes
        there, and of the place x, y itself, as if these were independent:
            dr = r_x dx + r_y dy - n0 df,    |dn| = |d(f_x, f_y) + K [metric] (dx, dy)|,
        where [r_x r_y] = [t e] [metric] and n0 is the normal of the skin at rest. On a cap the
        slopes are those along the axes of its elements.
        """
        if self._in_space is not None:
            return self._in_space
        if self.fit is None:
            return [math.nan] * 3, [*self.geometry.normal.tolist(), math.nan]
        geometry, patch = self.geometry, self.fit.estimator.basis.patch
        x, y = self.contact.position.tolist()
        x_sd, y_sd = self.contact.position_sd.tolist()
        # Cached: the geometry there was computed of it.
        base, covariance = patch.base(x, y), self.fit.jet(x, y)[1]
        if base.slopes:
            covariance = propagated_covariance(base.covariant, covariance)
        variances = covariance.diagonal()[:3].tolist()
        f_sd, *slopes_sd = (math.sqrt(v) if v >= 0 else math.nan for v in variances)
        t, e, normal = geometry.frame.tolist()
        (L, m), (o, k) = geometry.metric.tolist()
        (xx, xy), (_, yy) = geometry.curvature_form.tolist()
        spread = [
            math.hypot(
                (L * t[i] + o * e[i]) * x_sd, (m * t[i] + k * e[i]) * y_sd, base.normal[i] * f_sd
            )
            for i in range(3)
        ]
        tilt_x = (L * xx + o * xy) * x_sd, (L * xy + o * yy) * x_sd
        tilt = *tilt_x, (m * xx + k * xy) * y_sd, (m * xy + k * yy) * y_sd
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
                min(UNKNOWN, turn / (4 * h * h)) if h * h else UNKNOWN,
            ],
        )
        return self._principal


def _root(C: list[list[float]], xx: float, yy: float, xy: float) -> float:
    """Standard deviation of what changes with xx, yy and xy so much, by their covariance."""
    (a, b, c), (_, d, e), (_, _, f) = C
    diagonal = a * xx * xx + d * yy * yy + f * xy * xy
    return math.sqrt(max(0.0, diagonal + 2 * (b * xx * yy + c * xx * xy + e * yy * xy)))


def _suffix(unit: str) -> str:
    """What ends the key of a number in a unit: "_N", "_m2", "_per_m", "_N_per_m2"."""
    words = unit.replace("1/", "per_").replace("/", "_per_").replace("^", "").replace(" ", "_")
    return f"_{words}" if unit else ""


Getter = Callable[[Reported], Any]
Step = tuple[bool, str | Getter]
"""A function that returns numbers: whether several, as a list, and which."""


def _got(*of: str | Getter) -> Getter:
    """What gets a quantity: itself, or what is at its path; of several paths, one after another."""
    paths = [path for path in of if isinstance(path, str)]
    # The contact and the geometry are at hand, which is the shorter way.
    whole = [path if path.count(".") else f"estimate.{path}" for path in paths]
    return attrgetter(*whole) if paths else cast("Getter", of[0])


@dataclass(frozen=True, repr=False, eq=False)
class Number:
    """A published number: its `key`, which ends in its unit, how it is written, its meaning."""

    key: str
    form: str
    text: str


@dataclass(frozen=True, repr=False, eq=False)
class SkinColour:
    """What the skin and a heatmap may be coloured by: `name` in settings, `label` in menus.

    The `symbol` is HTML, the `tip` has the equation, and `unknown` says why there may be no value.
    `on_surface` gets the values (ny, nx) on the surface's points; without it there are values at
    the elements only. `of_elements` gets these (P,); without it they are those of the surface.
    `at_rest` gets the value of a skin at rest from its xx, yy, xy, zero if left out, from which
    colours of what is `signed` go both ways. They reach as far as `least` at least, on the screen's
    scale, or for a length as that share of the skin's longer side; those of one `group` may share
    a range.

    The `unit` and the `row` among the components (-1 for none) are those of its quantity.
    """

    name: str
    label: str
    symbol: str
    tip: str
    on_surface: Getter | None = None
    of_elements: Getter | None = None
    at_rest: Callable[[Array], float] | None = None
    unknown: str = ""
    signed: bool = True
    least: float = 0.5
    group: str = ""
    unit: str = ""
    row: int = -1


class HeaderNumber(NamedTuple):
    """How a number stands in the window's header: its `key` in lessons, its width in characters."""

    key: str
    width: int
    tip: str
    signed: bool = False


@dataclass(frozen=True, repr=False, eq=False)
class ReportedQuantity:
    """A quantity of an estimate: a number, or an array whose axes have `parts`, the labels there.

    `value` gets it, `sd` its standard deviation and `half_width` that of its 95 % interval, each a
    function, or the path of a field of the estimate, as "contact.force". Each is a column of
    tables if its suffix is among `columns`, of the NumPy type `kind`, described by `text` and
    `sd_text`. A quantity of the `group` contact is NaN without one, as one of the group second is
    without a second one; those of the groups skin and truth are in no table.

    Published it is one number for each of `keys`, key and meaning, written in a `form`; its error
    bars follow it, or each its number if they are `interleaved`. Without `keys` these are made of
    name, parts and unit, but for what has more numbers with a larger skin, which is not published.
    `quick` gets all that is published of it as a list, in less time than `value` and `sd`.

    On the screen its numbers are called as in `labels_shown`, and each is `shown` in a unit, as so
    many times the value, with so many digits where its error is unknown; without labels it is no
    readout. `at_rim` is shown where a contact is too near a held edge to determine it. `header`
    says how it stands in the window's header too. `colours` are what the skin may be coloured by.

    What has `COMPONENTS` at every element may be a column `element_head` of the element panel.
    `traced` is the title of what is drawn of it over time: then it is a field of the estimate with
    one of `colours` for each component, by whose names it is in the table of all elements.

    What has `COMPONENTS` at every element has one axis, of all readings, and their units where a
    layout reads other than those; a number that is in the unit of the readings is `as_readings`.
    """

    name: str
    unit: str
    text: str
    value: str | Getter
    symbol: str = ""
    parts: tuple[str | tuple[str, ...], ...] = ()
    kind: str = "<f8"
    group: str = "contact"
    sd: str | Getter | None = None
    sd_text: str = _SD
    half_width: str | Getter | None = None
    columns: tuple[str, ...] = ("", "_sd", "_95")
    keys: tuple[tuple[str, str], ...] | None = None
    sd_keys: tuple[tuple[str, str], ...] | None = None
    form: str = "%.6g"
    quick: Getter | None = None
    interleaved: bool = False
    labels_shown: tuple[str, ...] = ()
    at_rim: str = ""
    shown: tuple[str, float, int] = ("", 1.0, 3)
    header: HeaderNumber | None = None
    element_head: str = ""
    traced: str = ""
    colours: tuple[SkinColour, ...] = ()
    as_readings: bool = False

    @property
    def forms(self) -> tuple[tuple[str, str, Getter], ...]:
        """Suffix, meaning and getter of the value, its standard deviation and its interval."""
        of = (
            ("", self.text, self.value),
            ("_sd", self.sd_text, self.sd),
            ("_95", _INTERVAL, self.half_width),
        )
        return tuple((suffix, text, _got(get)) for suffix, text, get in of if get is not None)

    def named_axes(self, lengths: Axes) -> list[tuple[str, tuple[str, ...]]]:
        """What is along each axis, and the labels there."""
        names = [part if isinstance(part, str) else "component" for part in self.parts]
        labels = self._axes(lengths)
        return list(zip(names if len(names) == len(labels) else [_READING], labels, strict=True))

    def _axes(self, lengths: Axes) -> list[tuple[str, ...]]:
        """The labels along each axis."""
        if self.of_readings and isinstance(names := lengths.get(_READING), tuple):
            return [names]
        axes = [lengths[axis] if isinstance(axis, str) else axis for axis in self.parts]
        return [tuple(map(str, range(axis))) if isinstance(axis, int) else axis for axis in axes]

    @property
    def of_readings(self) -> bool:
        """Whether it is a number for each reading."""
        return self.parts == _OF_READINGS

    def unit_of(self, sensor: Sensor) -> str:
        """Its unit: of what is in the unit of the readings, that of a `sensor`.

        A number in units of their noise has none.
        """
        layout = sensor.layout
        if self.as_readings and sensor.sigma is not None:
            return ""
        return layout.units if self.unit and (self.of_readings or self.as_readings) else self.unit

    def units_of(self, layout: SensorLayout) -> tuple[str, ...]:
        """The unit of each reading of a `layout`, of what is in those; else none."""
        if not (layout.reads and self.unit and self.of_readings):
            return ()
        kinds: list[int] = layout.kind.tolist()
        return tuple(layout.kind_units[k] for k in kinds)

    def labels(self, lengths: Axes) -> tuple[str, ...]:
        """What is appended to the name for each number, flattened, by the `lengths` of axes.

        Empty for a number.
        """
        axes = self._axes(lengths)
        return tuple("".join(f"_{each}" for each in parts) for parts in product(*axes))

    def shape(self, lengths: Axes) -> tuple[int, ...]:
        """Its shape as an array; `lengths` are those of some axes."""
        return tuple(map(len, self._axes(lengths)))

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
        if any(isinstance(axis, str) for axis in self.parts):
            return ()
        suffix = _suffix(self.unit)
        return tuple((f"{self.name}{label}{suffix}", self.text) for label in self.labels({}))

    @property
    def _sd_keys(self) -> tuple[tuple[str, str], ...]:
        if self.sd_keys is not None:
            return self.sd_keys
        if self.sd is None:
            return ()
        suffix = _suffix(self.unit)
        return tuple(
            (f"{key.removesuffix(suffix)}_sd{suffix}", f"standard deviation of {key}")
            for key, _ in self._keys
        )

    def steps(self) -> Iterator[Step]:
        """What gets the `published` numbers in order."""
        if self.quick is not None:
            yield True, self.quick
            return
        for of, count in (self.value, len(self._keys)), (self.sd, len(self._sd_keys)):
            if of is not None and count:
                yield count > 1, (_listed(_got(of)) if count > 1 else of)

    def shaded(self) -> Iterator[SkinColour]:
        """Its `colours` with what they have from it."""
        get, elements = _got(self.value), self.parts[-1:] == (ELEMENT,)
        for row, colour in enumerate(self.colours):
            yield replace(
                colour,
                on_surface=colour.on_surface or (None if elements else get),
                of_elements=colour.of_elements or (partial(_row, get, row) if elements else None),
                unit=self.unit,
                row=row if self.parts[0] == COMPONENTS else -1,
            )

    def read_by(self, layout: SensorLayout) -> Iterator[SkinColour]:
        """Its colours of each quantity and direction that a `layout` reads."""
        first, get, is_read = self.colours[0], _got(self.value), self.name == "curvature"
        kinds = zip(layout.kinds, layout.kind_names, layout.kind_units, strict=True)
        for row, (kind, name, unit) in enumerate(kinds):
            quantity, at, degrees = name.partition("@")
            angle = degrees.replace("-", "\N{MINUS SIGN}") + "\N{DEGREE SIGN}" * bool(at)
            words = f"{quantity} {angle}".rstrip()
            label = words.capitalize() if is_read else f"{self.name.capitalize()} {words}"
            symbol = first.symbol.replace(COMPONENTS[0], angle if is_read else words)
            yield replace(
                first,
                name=name if is_read else f"{self.name}_{name}",
                label=label,
                symbol=label if is_read and quantity != "curvature" else symbol,
                tip=f"{label} of the skin, as elements read it." if is_read else first.tip,
                on_surface=partial(_of_fit, *kind) if is_read else None,
                of_elements=partial(_of_kind, get, row),
                least=_LEAST[unit] * first.least,
                group=first.group if unit == self.unit else f"{first.group} in {unit}",
                unit=unit,
                row=row,
            )


def _listed(get: Getter) -> Getter:
    return lambda reported: np.asarray(get(reported)).ravel().tolist()


def _row(get: Getter, row: int, reported: Reported) -> Array:
    return np.atleast_2d(get(reported))[row].astype(float, copy=False)


def _of_kind(get: Getter, row: int, reported: Reported) -> Array:
    return _skin(reported).layout.by_kind(get(reported))[row]


def _of_fit(quantity: str, direction: float, reported: Reported) -> Array:
    return _skin(reported).reading(quantity, direction, reported.estimate)


def numbers_of(quantities: Iterable[ReportedQuantity]) -> Callable[[Reported], list[float]]:
    """What gets all that is published of some quantities, in order."""
    found = (step for quantity in quantities for step in quantity.steps())
    steps: list[tuple[bool, Getter]] = []
    for is_one, some in groupby(found, lambda step: not step[0] and isinstance(step[1], str)):
        run = list(some)
        if is_one:  # paths one after the other are got at once
            steps.append((len(run) > 1, _got(*(of for _, of in run))))
        else:
            steps += [(several, _got(of)) for several, of in run]

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
_OF_LOAD = "of the disc that the load is spread over"
_MISSING = "NaN where missing"

_FRAME = (
    ReportedQuantity(
        "sequence",
        "",
        "number of the frame",
        "sequence",
        kind="<i8",
        group="frame",
        keys=(),
    ),
    ReportedQuantity(
        "setup",
        "",
        "number of the settings",
        "generation",
        kind="<i8",
        group="frame",
        keys=(),
    ),
    ReportedQuantity(
        "device_time",
        "s",
        "start of the scan, device's clock",
        "device_time",
        symbol="t",
        group="frame",
        keys=(("device_time_s", "when the scan began on the device's clock"),),
        form="%.6f",
    ),
    ReportedQuantity(
        "host_time",
        "s",
        "arrival time, monotonic clock",
        "host_time",
        group="frame",
        keys=(),
    ),
    ReportedQuantity(
        "taken",
        "s",
        "start of the scan, monotonic clock",
        "taken",
        group="frame",
        sd="taken_sd",
        sd_text="standard deviation of taken",
        keys=(),
        sd_keys=(("taken_sd_s", "standard deviation of timestamp; null if unknown"),),
    ),
    ReportedQuantity(
        "ready_time",
        "s",
        "completion of the estimate, monotonic clock",
        "ready_time",
        group="frame",
        columns=(),
        keys=(),
    ),
)
_KAPPA, _SIGMA, _DELTA = "\N{GREEK SMALL LETTER KAPPA}", "\u03c3", "\u0394"
_OWN = "of the skin, its curvature at rest included"
_WHITE = "White is a skin at rest."
_ROOT = "\u221a(((xx \u2212 yy) / 2)\u00b2 + xy\u00b2)"


def _changes(*tips: tuple[str, str]) -> tuple[SkinColour, ...]:
    """Colours of the changes of curvature xx, yy and xy: each its label and its tip."""
    return tuple(
        SkinColour(
            name,
            label,
            f"{_KAPPA}<sub>{name}</sub>",
            tip,
            on_surface=lambda r, name=name: _skin(r).change(name, r.estimate),
            group="curvature",
        )
        for name, (label, tip) in zip(COMPONENTS, tips, strict=True)
    )


def _skin(reported: Reported) -> "Quantities":
    if reported.skin is None:
        raise Refusal("expected a skin to compute a quantity on its surface, got none")
    return reported.skin


def curvature_invariant(name: str, form: Array) -> Array:
    """A principal, the mean or the Gaussian curvature (...) of `form` (3, ...): xx, yy, xy."""
    xx, yy, xy = form
    if name == "gaussian":
        return xx * yy - xy**2
    mean = (xx + yy) / 2
    if name == "mean":
        return mean
    half = np.hypot((xx - yy) / 2, xy)
    return mean + half if name == "first" else mean - half


def _invariant(
    name: str, unit: str, label: str, symbol: str, tip: str, least: float = 0.5, group: str = ""
) -> ReportedQuantity:
    """A `curvature_invariant` on the skin."""
    of = partial(curvature_invariant, name)
    return ReportedQuantity(
        f"surface_{name}",
        unit,
        f"{label} of the skin, on the surface's points",
        lambda r: of(_skin(r).form(r.estimate.coefficients)),
        symbol=symbol,
        parts=(ROW, COLUMN),
        group="skin",
        colours=(
            SkinColour(
                name,
                label,
                symbol,
                tip,
                of_elements=lambda r: of(_skin(r).form_at_elements(r.estimate.curvature)),
                at_rest=lambda form: float(of(form)),
                least=least,
                group=group,
            ),
        ),
    )


def _per_metre(value: float, reported: Reported) -> float:
    """A `value` in the unit of the readings where that is 1/m for sure, of xx, yy and xy."""
    return value if reported.estimate.curvature.ndim == 2 else math.nan


_FIT = (
    ReportedQuantity(
        "surface",
        "m",
        "displacement on the surface's points, above zero inward; NaN off the skin",
        "surface",
        symbol="w",
        parts=(ROW, COLUMN),
        group="skin",
        colours=(
            SkinColour(
                "displacement",
                "Displacement",
                "w",
                "Inward displacement of the skin along its normal: w (Eq. 1).",
                signed=False,
                least=1e-3,
            ),
        ),
    ),
    ReportedQuantity(
        "nominal",
        "1/m",
        f"nominal curvature (Eq. 8); {_MISSING}",
        "nominal",
        parts=(COMPONENTS, ELEMENT),
        group="fit",
    ),
    ReportedQuantity(
        "curvature",
        "1/m",
        f"corrected by calibration and tare; {_MISSING}",
        "curvature",
        symbol=_KAPPA,
        parts=(COMPONENTS, ELEMENT),
        group="fit",
        sd="noise",
        columns=("",),
        shown=("1/m", 1.0, 2),
        element_head="reading",
        traced="Curvature",
        colours=_changes(
            ("Curvature xx", "Curvature along x, beyond that at rest: w_xx (Eq. 3)."),
            ("Curvature yy", "Curvature along y, beyond that at rest: w_yy (Eq. 4)."),
            ("Twist xy", "Twist, beyond that at rest: w_xy (Eq. 5)."),
        ),
    ),
    _invariant(
        "first",
        "1/m",
        "Principal curvature 1",
        f"{_KAPPA}<sub>1</sub>",
        f"The larger principal curvature {_OWN}: (xx + yy) / 2 + {_ROOT}. {_WHITE}",
        group="curvature",
    ),
    _invariant(
        "second",
        "1/m",
        "Principal curvature 2",
        f"{_KAPPA}<sub>2</sub>",
        f"The smaller principal curvature {_OWN}: (xx + yy) / 2 \u2212 {_ROOT}. {_WHITE}",
        group="curvature",
    ),
    _invariant(
        "mean",
        "1/m",
        "Mean curvature",
        f"{_KAPPA}<sub>m</sub>",
        f"The mean curvature {_OWN}: (xx + yy) / 2. {_WHITE}",
        group="curvature",
    ),
    _invariant(
        "gaussian",
        "1/m^2",
        "Gaussian curvature",
        "K",
        f"The Gaussian curvature {_OWN}: xx yy \u2212 xy\u00b2. Positive on a ball or a "
        "bowl, negative on a saddle, zero where the skin bends in one direction only.",
        least=1.0,
    ),
    ReportedQuantity(
        "fresh",
        "",
        "whether the reading is new in this frame",
        "fresh",
        parts=(COMPONENTS, ELEMENT),
        kind="?",
        group="fit",
    ),
    ReportedQuantity(
        "residual",
        "1/m",
        "reading minus fitted value",
        "residual",
        parts=(COMPONENTS, ELEMENT),
        group="fit",
        shown=("1/m", 1.0, 2),
        element_head="residual",
        colours=tuple(
            SkinColour(
                f"residual_{name}",
                f"Residual {name}",
                f"r<sub>{name}</sub>",
                "Residual of each reading: reading minus fitted value. Noise alone has no "
                "pattern; a lasting pattern indicates too few functions or a wrong boundary "
                "condition.",
                least=0.1,
                group="residual",
            )
            for name in COMPONENTS
        ),
    ),
    ReportedQuantity(
        "surface_sd",
        "m",
        "standard deviation of the displacement on the surface's points",
        lambda r: _skin(r).surface_sd(r.estimate),
        symbol=f"{_SIGMA}<sub>w</sub>",
        parts=(ROW, COLUMN),
        group="skin",
        colours=(
            SkinColour(
                "error_bar",
                "Error bar",
                f"{_SIGMA}<sub>w</sub>",
                "The standard deviation (always 1 \u03c3) of the displacement due to the noise of "
                "the readings: \u221a(b' C b), with the functions b there and the covariance C of "
                "their coefficients. For Tracking, that of a single frame.",
                unknown="Computing the standard deviation\N{HORIZONTAL ELLIPSIS}",
                signed=False,
                least=1e-5,
            ),
        ),
    ),
    ReportedQuantity(
        "surface_error",
        "m",
        "displacement minus the true one; NaN without a simulation",
        lambda r: r.estimate.surface - r.estimate.true_surface,
        symbol=f"{_DELTA}w",
        parts=(ROW, COLUMN),
        group="skin",
        colours=(
            SkinColour(
                "difference",
                "Difference to the truth",
                f"{_DELTA}w",
                "Estimated minus true displacement, known in simulations only.",
                unknown="No simulation: the true surface is not known",
                least=1e-5,
            ),
        ),
    ),
    ReportedQuantity(
        "suspect",
        "",
        "fault for which an element is excluded, 0 if it is not",
        "suspect",
        parts=(ELEMENT,),
        kind="|u1",
        group="fit",
        colours=(
            SkinColour(
                "health",
                "Health",
                "Health",
                "Fault of each element (F3): the reason why any of its readings is excluded.",
                signed=False,
            ),
        ),
    ),
    ReportedQuantity(
        "coefficients",
        "m",
        "of the basis functions; NaN where the settings have fewer",
        "coefficients",
        symbol="c",
        parts=(ALONG, ACROSS),
        group="fit",
    ),
    ReportedQuantity(
        "noise",
        "1/m",
        "standard deviation of a reading",
        "noise",
        symbol=_SIGMA,
        group="fit",
        keys=(("noise_per_m", "standard deviation of one reading"),),
        form="%.3g",
        as_readings=True,
        quick=lambda r: [_per_metre(r.estimate.noise, r)],
        labels_shown=("Noise of a reading",),
        shown=("1/m", 1.0, 3),
    ),
    ReportedQuantity(
        "converged",
        "",
        "whether the fit converged",
        "converged",
        kind="?",
        group="fit",
        keys=(),
    ),
    ReportedQuantity(
        "fit_time", "s", "computing time of the fit", "fit_time", group="fit", columns=(), keys=()
    ),
    ReportedQuantity(
        "drift",
        "1/m",
        "smooth shift of all readings by RMS, 0 where none is detected",
        "drift",
        group="fit",
        keys=(("drift_per_m", "smooth shift of all readings by RMS, 0 where none is detected"),),
        form="%.3g",
        as_readings=True,
        quick=lambda r: [_per_metre(r.estimate.drift, r)],
        labels_shown=("Drift of all readings",),
        shown=("1/m", 1.0, 3),
    ),
)
_CONTACT = (
    ReportedQuantity(
        "present",
        "",
        "whether there is a contact",
        "contact.present",
        kind="?",
        keys=(("present", "whether there is a contact; without one its numbers are null"),),
    ),
    ReportedQuantity(
        "single",
        "",
        "whether one load on a small area explains the readings",
        "contact.single",
        kind="?",
        keys=(
            (
                "single",
                "whether one load on a small area explains the readings; else the load is "
                "distributed, or there are two: see second",
            ),
        ),
    ),
    ReportedQuantity(
        "near_rim",
        "",
        "whether the contact is too near a held edge",
        "contact.near_rim",
        kind="?",
        keys=(
            (
                "near_rim",
                "whether it is too near a held edge for position and force to be reliable",
            ),
        ),
    ),
    ReportedQuantity(
        "force_is_lower_bound",
        "",
        "whether the skin may stretch and need more force",
        "contact.force_is_lower_bound",
        kind="?",
        keys=(
            (
                "force_is_lower_bound",
                "whether the force leaves out a stretch that may change it by more than its error "
                "bar: of a flat skin whose thickness is not given, for which 0.25 mm is assumed, "
                "or a curved one that stiffens",
            ),
        ),
    ),
    ReportedQuantity(
        "force_is_upper_bound",
        "",
        "whether the skin softens and needs less force",
        "contact.force_is_upper_bound",
        kind="?",
        keys=(
            (
                "force_is_upper_bound",
                "whether a curved skin is pressed so deep that it softens, by which the force "
                "changes by more than its error bar; the error bar contains the change",
            ),
        ),
    ),
    ReportedQuantity(
        "snaps_through",
        "",
        "whether the skin snaps through, where there is no force",
        "contact.snaps_through",
        kind="?",
        keys=(
            (
                "snaps_through",
                "whether a curved skin is pressed so deep that it snaps through; the force is "
                "null then",
            ),
        ),
    ),
    ReportedQuantity(
        "spare", "", "readings in excess of the unknowns", "contact.spare", kind="<i8", keys=()
    ),
    ReportedQuantity(
        "position",
        "m",
        "of the contact",
        "contact.position",
        symbol="x",
        parts=(("x", "y"),),
        sd="contact.position_sd",
        half_width="contact.position_95",
        labels_shown=("Contact x", "Contact y"),
        at_rim="edge: unreliable",
        shown=("mm", 1e3, 2),
        keys=(
            ("x_m", "position of the contact along the skin"),
            ("y_m", "position of the contact across the skin"),
        ),
        form="%.7g",
    ),
    ReportedQuantity(
        "force",
        "N",
        "of the contact",
        "contact.force",
        symbol="F",
        sd="contact.force_sd",
        half_width="contact.force_95",
        keys=(("force_N", "of the contact, above zero where it presses"),),
        labels_shown=("Force",),
        shown=("N", 1.0, 4),
        header=HeaderNumber(
            "force",
            20,
            "Force of the point load that fits best, with its error bar; \u2265: a lower bound, as "
            "the skin may stretch: its thickness is not given, and 0.25 mm would change the force "
            "by more than the error bar; \u2264: an upper bound, as a curved skin softens where it "
            "is pressed in deep.",
        ),
    ),
    ReportedQuantity(
        "size",
        "m^2",
        "squared radius of the disc that the load is spread over",
        "contact.size",
        sd="contact.size_sd",
        columns=(),
        keys=(),
        sd_keys=(),
    ),
    ReportedQuantity(
        "displacement",
        "m",
        _OF_SKIN,
        "contact.displacement",
        symbol="w",
        sd="contact.displacement_sd",
        half_width="contact.displacement_95",
        columns=("", "_sd"),
        keys=(("displacement_m", f"{_OF_SKIN}, above zero inward"),),
        labels_shown=("Depth",),
        at_rim="edge: no depth",
        shown=("mm", 1e3, 3),
        header=HeaderNumber(
            "depth", 17, "Displacement at the contact, with its error bar; positive is inward."
        ),
    ),
    ReportedQuantity(
        "load_size",
        "m^2",
        "squared radius of the disc that the load is spread over",
        "contact.size",
        sd="contact.size_sd",
        columns=(),
        keys=(),
    ),
    ReportedQuantity(
        "load_radius",
        "m",
        _OF_LOAD,
        "contact.load_radius",
        symbol="r",
        keys=(("load_radius_m", f"{_OF_LOAD}; null where the readings do not determine it"),),
        labels_shown=("Load radius",),
        at_rim="edge: no radius",
        shown=("mm", 1e3, 2),
    ),
    ReportedQuantity(
        "load_radius_95",
        "m",
        "95 % interval of the load's radius, from zero where only an upper bound is known",
        "contact.load_radius_95",
        parts=(("low", "high"),),
        keys=(
            ("load_radius_low_m", "lower end of the 95 % interval of load_radius_m, often 0"),
            ("load_radius_high_m", "upper end of the 95 % interval of load_radius_m"),
        ),
    ),
)
_GEOMETRY = (
    ReportedQuantity(
        "point",
        "m",
        "the contact in space",
        "geometry.position",
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
        "geometry.normal",
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
        "geometry.frame",
        parts=(("t", "s", "n"), ("x", "y", "z")),
        keys=(),
    ),
    ReportedQuantity(
        "metric",
        "",
        "steps along the frame for unit steps in x and y",
        "geometry.metric",
        parts=(("t", "s"), ("x", "y")),
        keys=(),
    ),
    ReportedQuantity(
        "curvature_form",
        "1/m",
        f"{_OF_SKIN}, along the frame",
        "geometry.curvature_form",
        symbol="K",
        parts=(("t", "s"), ("t", "s")),
        keys=(),
    ),
    ReportedQuantity(
        "torsion_form",
        "1/m",
        _OF_SKIN,
        "geometry.torsion_form",
        symbol="T",
        parts=(("t", "s"),),
        keys=(),
    ),
    ReportedQuantity(
        "covariance",
        "1/m^2",
        "of xx, yy, xy of the curvature form",
        "geometry.covariance",
        parts=(COMPONENTS, COMPONENTS),
        keys=(),
    ),
    ReportedQuantity(
        "principal",
        "1/m",
        "principal curvatures",
        "geometry.principal",
        symbol=_KAPPA,
        parts=(("1", "2"),),
        sd="geometry.principal_sd",
        keys=(
            ("curvature_1_per_m", "larger principal curvature of the skin at the contact"),
            ("curvature_2_per_m", "smaller principal curvature"),
        ),
        quick=lambda r: r.principal()[0],
        interleaved=True,
        labels_shown=(f"Larger {_KAPPA}", f"Smaller {_KAPPA}"),
        shown=("1/m", 1.0, 2),
    ),
    ReportedQuantity(
        "direction",
        "",
        "unit vectors along the principal curvatures",
        "geometry.directions",
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
                "standard deviation of both directions about the normal; at most 0.907",
            ),
        ),
        form="%.6f",
        quick=lambda r: r.principal()[1],
    ),
    ReportedQuantity(
        "angle",
        "rad",
        "from x to the direction of principal curvature 1",
        "geometry.angle",
        keys=(),
    ),
)

_TRUTH = (
    ReportedQuantity(
        "true_surface",
        "m",
        "the true displacement on the surface's points",
        "true_surface",
        parts=(ROW, COLUMN),
        group="truth",
    ),
    ReportedQuantity(
        "true_contact",
        "m",
        "the true position of the contact",
        "true_contact",
        parts=(("x", "y"),),
        group="truth",
    ),
    ReportedQuantity(
        "error_at_load",
        "m",
        "displacement minus the true one at the true contact",
        "error_at_load",
        group="truth",
        labels_shown=("Error at load",),
        shown=("mm", 1e3, 3),
        header=HeaderNumber(
            "error",
            10,
            "Estimated minus true displacement at the load (simulations only).",
            signed=True,
        ),
    ),
    ReportedQuantity(
        "error_rms",
        "m",
        "RMS over the skin of displacement minus the true one",
        "error_rms",
        group="truth",
        labels_shown=("RMS error",),
        shown=("mm", 1e3, 3),
        header=HeaderNumber(
            "rms", 9, "Root mean square error over the whole skin (simulations only)."
        ),
    ),
)


def _of_second(quantity: ReportedQuantity) -> ReportedQuantity:
    """A quantity of the contact, of the second one; it has no place on the screen of its own."""
    told = quantity.name in ("present", "position", "force")
    value, sd, half_width = (
        of.replace("contact.", "second.") if isinstance(of, str) else of
        for of in (quantity.value, quantity.sd, quantity.half_width)
    )
    return replace(
        quantity,
        name=f"second_{quantity.name}",
        text=f"{quantity.text}; of a second contact",
        value=value or "",
        sd=sd,
        half_width=half_width,
        group="second",
        columns=quantity.columns if told else (),
        keys=quantity.keys if told and quantity.kind != "?" else (),
        sd_keys=None if told else (),
        labels_shown=(),
        header=None,
    )


_SECOND = tuple(_of_second(of) for of in _CONTACT if str(of.value).startswith("contact."))

REPORTED = (*_FRAME, *_FIT, *_CONTACT, *_GEOMETRY, *_SECOND, *_TRUTH)
"""Every quantity of an estimate, in the order in which tables have them."""


def getters() -> dict[str, Getter]:
    """What gets each quantity and error bar, by name: `force`, `force_sd`, `force_95`."""
    return {
        f"{quantity.name}{suffix}": getter
        for quantity in REPORTED
        for suffix, _, getter in quantity.forms
    }


def stored() -> dict[str, ReportedQuantity]:
    """The quantity that each field of an estimate has its type and its axes from, by its path."""
    of_sd = {of.sd: replace(of, kind="<f8") for of in REPORTED if isinstance(of.sd, str)}
    return of_sd | {of.value: of for of in REPORTED if isinstance(of.value, str)}


SEQUENTIAL = ("#1a2a5e", "#2c5282", "#3f7f8f", "#63a878", "#a9c95b", "#f5e663")
"""The anchors of the app's colour map of one sign: dark blue to yellow."""


@cache
def skin_colours() -> dict[str, SkinColour]:
    """All that the skin may be coloured by, by name."""
    return {colour.name: colour for quantity in REPORTED for colour in quantity.shaded()}


def colours_of(layout: SensorLayout) -> dict[str, SkinColour]:
    """All that the skin of a sensor may be coloured by, by name.

    Where it reads other than xx, yy and xy, these are of the fit, beside what is read. A strip,
    which bends along x only, has neither yy nor xy.
    """
    found: list[SkinColour] = []
    for quantity in REPORTED:
        if not layout.reads:
            found += quantity.shaded()
            continue
        if quantity.colours and quantity.of_readings:
            found += quantity.read_by(layout)
        found += [
            replace(colour, of_elements=None if colour.on_surface else colour.of_elements, row=-1)
            for colour in quantity.shaded()
            if colour.on_surface or colour.row < 0
        ]
    absent = _ACROSS if layout.patch.strip else ()
    return {colour.name: colour for colour in found if colour.name not in absent}


_ACROSS = "yy", "xy", "residual_yy", "residual_xy"


class Readout(NamedTuple):
    """A number on the screen: in a `unit`, NaN if unknown.

    It has so many `digits` where its error is unknown. The `words` stand instead of a number that
    is not determined.
    """

    label: str
    value: float
    sd: float
    half_width: float
    unit: str
    digits: int
    words: str = ""


def readouts(estimate: Estimate) -> list[Readout]:
    """What the screen shows of an estimate: first of the contact, then of the fit.

    Numbers in the unit of the readings only where that is 1/m for sure, of xx, yy and xy.
    """
    reported = Reported(estimate)
    return [
        readout
        for group in ("contact", "fit")
        for quantity in REPORTED
        if quantity.group == group and not (quantity.as_readings and estimate.curvature.ndim == 1)
        for readout in readouts_of(quantity, reported)
    ]


def readouts_of(quantity: ReportedQuantity, reported: Reported) -> list[Readout]:
    """What the screen shows of a quantity: each of its numbers that has a label."""
    unit, scale, digits = quantity.shown
    numbers = [
        np.ravel(math.nan if of is None else _got(of)(reported))
        for of in (quantity.value, quantity.sd, quantity.half_width)
        if quantity.labels_shown
    ]
    found: list[Readout] = []
    for part, label in enumerate(quantity.labels_shown):
        words = quantity.at_rim if reported.contact.near_rim else ""
        if words := reported.contact.no_force if quantity.name == "force" else words:
            found.append(Readout(label, math.nan, math.nan, math.nan, unit, digits, words))
            continue
        value, sd, half_width = (scale * float(each[part % len(each)]) for each in numbers)
        found.append(Readout(label, value, sd, half_width, unit, digits))
    return found
