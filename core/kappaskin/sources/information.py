"""Device information: a sensor's description as JSON."""

import json
import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields, replace
from operator import attrgetter, index
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from kappaskin.bases import check_edge
from kappaskin.errors import Refusal, SourceError
from kappaskin.mechanics import Plate
from kappaskin.scenes import PARTS, check_sides
from kappaskin.scenes.effects import Within
from kappaskin.sensing import (
    Amplifier,
    Converter,
    HalfBridge,
    Multiplexer,
    Sensor,
    SensorLayout,
    Transduction,
)
from kappaskin.skin import Disk, Patch, Polygon


@dataclass(frozen=True)
class _Key:
    """One key of the information: the `kind` of its value, and the `value` that a sensor has.

    A value of None is not written. A key that a device leaves out has the `default`; one without
    is required, or optional where None is a value.
    """

    kind: str
    value: Callable[[Sensor], Any]
    default: Any = None


def _outline(sensor: Sensor) -> Any:
    """The corners of a polygon, or "disk"; None for a rectangle."""
    patch = sensor.layout.patch
    if isinstance(patch, Disk):
        return "disk"
    return patch.vertices if isinstance(patch, Polygon) else None


def _positions(sensor: Sensor) -> list[Any] | None:
    return None if sensor.layout.shape else sensor.layout.positions.tolist()


def _wiring(sensor: Sensor) -> list[int] | None:
    return None if sensor.channel_map is None else sensor.channel_map.tolist()


_TEXT, _NUMBER, _LIST, _OBJECT = "a text", "a number", "a list", "an object"
_SWITCH, _CHECKED_LATER = "true or false", ""
_PYTHON: dict[str, Any] = {
    _TEXT: str,
    _NUMBER: (int, float),
    _LIST: list,
    _OBJECT: dict,
    _SWITCH: bool,
    _CHECKED_LATER: object,
}
# All keys, in the order in which they are written; SI units. The defaults are those of a flat
# plate hinged along its edges.
_KEYS = {
    "name": _Key(_TEXT, attrgetter("name")),
    "serial_number": _Key(_TEXT, attrgetter("serial_number")),
    "firmware": _Key(_TEXT, attrgetter("firmware")),
    "simulated": _Key(_SWITCH, attrgetter("simulated")),
    "rate": _Key(_NUMBER, attrgetter("rate")),
    "rigidity": _Key(_NUMBER, attrgetter("plate.rigidity")),
    "size": _Key(_LIST, attrgetter("layout.patch.a", "layout.patch.b")),
    "base_curvature": _Key(_NUMBER, attrgetter("layout.patch.base_curvature"), 0.0),
    "strip": _Key(_SWITCH, attrgetter("layout.patch.strip"), False),
    "outline": _Key(_CHECKED_LATER, _outline),
    "edge": _Key(_TEXT, attrgetter("edge"), "hinged"),
    "fluid": _Key(_SWITCH, attrgetter("plate.fluid"), False),
    "tension": _Key(_NUMBER, attrgetter("plate.tension"), 0.0),
    "foundation": _Key(_NUMBER, attrgetter("plate.foundation"), 0.0),
    "poisson": _Key(_NUMBER, attrgetter("plate.poisson"), 0.3),
    "rim_stiffness": _Key(_NUMBER, attrgetter("plate.rim_stiffness"), 2e3),
    "axial_stiffness": _Key(_NUMBER, attrgetter("plate.axial_stiffness")),
    "grid": _Key(_LIST, attrgetter("layout.shape")),
    "positions": _Key(_LIST, _positions),
    "gage_length": _Key(_NUMBER, attrgetter("layout.gage_length"), 0.0),
    "dead_channels": _Key(_LIST, lambda s: np.flatnonzero(~s.layout.live.ravel()).tolist()),
    "channel_map": _Key(_LIST, _wiring),
    "bridge": _Key(_OBJECT, lambda s: asdict(s.transduction.bridge)),
    "multiplexer": _Key(_OBJECT, lambda s: asdict(s.transduction.multiplexer)),
    "amplifier": _Key(_OBJECT, lambda s: asdict(s.transduction.amplifier)),
    "converter": _Key(_OBJECT, lambda s: asdict(s.transduction.converter)),
}
DEFAULTS = {name: key.default for name, key in _KEYS.items() if key.default is not None}
_OF_THE_PLATE = ("tension", "foundation", "poisson", "rim_stiffness")
_READS = Within(1e-3, 1e9, "1/m")

_Part = TypeVar("_Part", HalfBridge, Multiplexer, Amplifier, Converter)


def sensor_to_json(sensor: Sensor) -> str:
    """The information text of `sensor`: SI units, channels counted component by component."""
    values = {name: key.value(sensor) for name, key in _KEYS.items()}
    written = {name: value for name, value in values.items() if value is not None}
    return json.dumps(written, separators=(",", ":"))


def _number(text: str) -> float:
    """The number in `text`; JSON has no infinity and no NaN, nor has a device."""
    if not math.isfinite(value := float(text)):
        raise ValueError(f"expected a number, got {text}")
    return value


def _parsed(text: str) -> dict[str, Any]:
    parsed = json.loads(text, parse_float=_number, parse_constant=_number)
    if not isinstance(parsed, dict):
        raise TypeError(f"expected an object with keys, got {parsed!r:.80}")
    found = DEFAULTS | cast("dict[str, Any]", parsed)
    for name, kind in ((name, key.kind) for name, key in _KEYS.items() if name in found):
        value = found[name]
        # Of Python's kinds, true and false are numbers too; of JSON's they are not.
        switched = isinstance(value, bool) and kind not in (_SWITCH, _CHECKED_LATER)
        if switched or not isinstance(value, _PYTHON[kind]):
            raise TypeError(f"expected {name} to be {kind}, got {value!r:.80}")
    return found


def _made(kind: type[_Part], part: dict[str, Any]) -> _Part:
    values = {field.name: part[field.name] for field in fields(kind)}
    for name, value in values.items():
        unset = value is None and name == "balance_voltage"
        if not unset and (isinstance(value, bool) or not isinstance(value, int | float)):
            raise TypeError(f"expected {kind.__name__}.{name} to be a number, got {value!r:.80}")
    return kind(**values)


def _transduction(values: dict[str, Any]) -> Transduction:
    return Transduction(
        _made(HalfBridge, values["bridge"]),
        _made(Multiplexer, values["multiplexer"]),
        _made(Amplifier, values["amplifier"]),
        _made(Converter, values["converter"]),
    )


def _patch(values: dict[str, Any]) -> Patch:
    size, H = [float(side) for side in values["size"]], float(values["base_curvature"])
    if "outline" not in values:
        return Patch(*size, radius=1 / H if H else math.inf, strip=values["strip"])
    outline, (a, _) = values["outline"], size
    if outline != "disk" and not isinstance(outline, list):
        raise Refusal(f"expected the outline 'disk' or a list of corners, got {outline!r:.80}")
    patch = Disk(a / 2) if outline == "disk" else Polygon(values["outline"])
    if H or values["strip"] or size != [patch.a, patch.b]:
        raise Refusal(
            f"expected a flat {patch.name}, of size {[patch.a, patch.b]}, got size {size}, base "
            f"curvature {H:g} and strip {values['strip']}"
        )
    return patch


def _layout(values: dict[str, Any]) -> SensorLayout:
    patch = _patch(values)
    if "grid" in values:
        m, n = (index(count) for count in values["grid"])
        if m * n > 2**16 // 3:
            raise Refusal(f"expected at most {2**16 // 3} elements, got {m} x {n}")
        layout = SensorLayout.regular(patch, m, n)
    else:
        layout = SensorLayout.scattered(patch, values["positions"])
    dead, channels = values["dead_channels"], range(3 * len(layout))
    if unknown := [channel for channel in dead if channel not in channels]:
        raise Refusal(
            f"expected dead channels from 0 to {channels[-1]}, got {unknown!s:.80}; count "
            "them component by component"
        )
    live = np.isin(channels, np.array(dead, np.intp), invert=True).reshape(3, -1)
    return replace(layout, live=live, gage_length=float(values["gage_length"]))


def _channel_map(values: dict[str, Any]) -> NDArray[np.intp] | None:
    if "channel_map" not in values:
        return None
    return np.array([index(place) for place in values["channel_map"]], np.intp)


def _plate(patch: Patch, values: dict[str, Any]) -> Plate:
    names = [*_OF_THE_PLATE, *({"axial_stiffness"} & values.keys())]
    numbers = {name: float(values[name]) for name in names}
    return Plate(patch, float(values["rigidity"]), fluid=values["fluid"], **numbers)


def _check_sizes(plate: Plate, transduction: Transduction) -> None:
    """Refuse what no sensor is like, and no arithmetic is made for."""
    check_sides(plate.patch)
    for name, within in PARTS["skin"].limits.items():
        if (value := getattr(plate, name)) and value not in within:
            raise Refusal(f"expected a {name} of {within}, got {value:g}; give it in SI units")
    reads = abs(transduction.resolution) * max(map(abs, transduction.limits))
    if reads not in _READS:
        raise Refusal(
            f"expected electronics that read up to {_READS}, got {reads:g}; give bridge, "
            "amplifier and converter in SI units"
        )


def sensor_from_json(text: str) -> Sensor:
    """The sensor that `text` describes; a `SourceError` where it cannot be understood."""
    try:
        values = _parsed(text)
        layout = _layout(values)
        edge = values["edge"]
        check_edge(layout.patch, edge)
        transduction, plate = _transduction(values), _plate(layout.patch, values)
        _check_sizes(plate, transduction)
        return Sensor(
            layout,
            transduction,
            plate,
            edge,
            float(values["rate"]),
            values["name"],
            values["serial_number"],
            values["firmware"],
            values["simulated"],
            _channel_map(values),
        )
    except KeyError as error:
        raise SourceError(
            f"the device's information lacks {error}; its firmware must send every key of wire "
            "version 1"
        ) from error
    except (ValueError, TypeError, ArithmeticError, RecursionError) as error:
        raise SourceError(f"the device's information cannot be used: {error}") from error
