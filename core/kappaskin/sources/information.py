"""Device information: a sensor's description as JSON on the wire, and back."""

import json
import math
from dataclasses import asdict, fields, replace
from operator import index
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from kappaskin.bases import check_edge
from kappaskin.errors import Refusal, SourceError
from kappaskin.mechanics import Plate
from kappaskin.scenes import SKIN, Within, check_sides
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


def sensor_to_json(sensor: Sensor) -> str:
    """The information text of `sensor`: SI units, channels counted component by component."""
    layout, stiffness, wired = sensor.layout, sensor.plate.axial_stiffness, sensor.channel_map
    where = {"grid": layout.shape} if layout.shape else {"positions": layout.positions.tolist()}
    return json.dumps(
        {
            "name": sensor.name,
            "serial_number": sensor.serial_number,
            "firmware": sensor.firmware,
            "simulated": sensor.simulated,
            "rate": sensor.rate,
            "rigidity": sensor.plate.rigidity,
            "size": [layout.patch.a, layout.patch.b],
            "base_curvature": layout.patch.base_curvature,
            "strip": layout.patch.strip,
            **_outline(layout.patch),
            "edge": sensor.edge,
            "fluid": sensor.plate.fluid,
            **{name: getattr(sensor.plate, name) for name in _OF_THE_PLATE},
            **({} if stiffness is None else {"axial_stiffness": stiffness}),
            **where,
            "gage_length": layout.gage_length,
            "dead_channels": np.flatnonzero(~layout.live.ravel()).tolist(),
            **({} if wired is None else {"channel_map": wired.tolist()}),
            **asdict(sensor.transduction),
        },
        separators=(",", ":"),
    )


def _outline(patch: Patch) -> dict[str, Any]:
    """The outline as JSON has it: none for a rectangle, "disk", or the corners of a polygon."""
    if isinstance(patch, Disk):
        return {"outline": "disk"}
    return {"outline": patch.vertices} if isinstance(patch, Polygon) else {}


_READS = Within(1e-3, 1e9, "1/m")

_Part = TypeVar("_Part", HalfBridge, Multiplexer, Amplifier, Converter)

_OF_THE_PLATE = ("tension", "foundation", "poisson", "rim_stiffness")
# What a flat plate hinged along its edges may leave out.
DEFAULTS: dict[str, Any] = {
    "base_curvature": 0.0,
    "strip": False,
    "edge": "hinged",
    "tension": 0.0,
    "foundation": 0.0,
    "fluid": False,
    "poisson": 0.3,
    "rim_stiffness": 2e3,
    "gage_length": 0.0,
}
_KINDS: dict[str, tuple[Any, tuple[str, ...]]] = {
    "a text": (str, ("name", "serial_number", "firmware", "edge")),
    "a number": (
        (int, float),
        ("rate", "rigidity", "base_curvature", "axial_stiffness", "gage_length", *_OF_THE_PLATE),
    ),
    "a list": (list, ("size", "grid", "positions", "dead_channels", "channel_map")),
    "an object": (dict, ("bridge", "multiplexer", "amplifier", "converter")),
    "true or false": (bool, ("simulated", "strip", "fluid")),
}


def _number(text: str) -> float:
    """The number in `text`; JSON has no infinity and no NaN, nor has a device."""
    if not math.isfinite(value := float(text)):
        raise ValueError(f"expected a number, got {text}")
    return value


def _parsed(text: str) -> dict[str, Any]:
    said = json.loads(text, parse_float=_number, parse_constant=_number)
    if not isinstance(said, dict):
        raise TypeError(f"expected an object with keys, got {said!r:.80}")
    found = DEFAULTS | cast("dict[str, Any]", said)
    for what, (kind, names) in _KINDS.items():
        for name in names:
            # Of Python's kinds, true and false are numbers too; of JSON's they are not.
            wrong = isinstance(found.get(name), bool) and kind is not bool
            if name in found and (wrong or not isinstance(found[name], kind)):
                raise TypeError(f"expected {name} to be {what}, got {found[name]!r:.80}")
    return found


def _made(kind: type[_Part], said: dict[str, Any]) -> _Part:
    values = {field.name: said[field.name] for field in fields(kind)}
    for name, value in values.items():
        unset = value is None and name == "balance_voltage"
        if not unset and (isinstance(value, bool) or not isinstance(value, int | float)):
            raise TypeError(f"expected {kind.__name__}.{name} to be a number, got {value!r:.80}")
    return kind(**values)


def _transduction(said: dict[str, Any]) -> Transduction:
    return Transduction(
        _made(HalfBridge, said["bridge"]),
        _made(Multiplexer, said["multiplexer"]),
        _made(Amplifier, said["amplifier"]),
        _made(Converter, said["converter"]),
    )


def _patch(said: dict[str, Any]) -> Patch:
    size, H = [float(side) for side in said["size"]], float(said["base_curvature"])
    if "outline" not in said:
        return Patch(*size, radius=1 / H if H else math.inf, strip=said["strip"])
    outline, (a, _) = said["outline"], size
    if outline != "disk" and not isinstance(outline, list):
        raise Refusal(f"expected the outline 'disk' or a list of corners, got {outline!r:.80}")
    patch = Disk(a / 2) if outline == "disk" else Polygon(said["outline"])
    if H or said["strip"] or size != [patch.a, patch.b]:
        raise Refusal(
            f"expected a flat {patch.name}, of size {[patch.a, patch.b]}, got size {size}, base "
            f"curvature {H:g} and strip {said['strip']}"
        )
    return patch


def _layout(said: dict[str, Any]) -> SensorLayout:
    patch = _patch(said)
    if "grid" in said:
        m, n = (index(count) for count in said["grid"])
        if m * n > 2**16 // 3:
            raise Refusal(f"expected at most {2**16 // 3} elements, got {m} x {n}")
        layout = SensorLayout.regular(patch, m, n)
    else:
        layout = SensorLayout.scattered(patch, said["positions"])
    dead, channels = said["dead_channels"], range(3 * len(layout))
    if unknown := [channel for channel in dead if channel not in channels]:
        raise Refusal(
            f"expected dead channels from 0 to {channels[-1]}, got {unknown!s:.80}; count "
            "them component by component"
        )
    live = np.isin(channels, np.array(dead, np.intp), invert=True).reshape(3, -1)
    return replace(layout, live=live, gage_length=float(said["gage_length"]))


def _channel_map(said: dict[str, Any]) -> NDArray[np.intp] | None:
    if "channel_map" not in said:
        return None
    return np.array([index(place) for place in said["channel_map"]], np.intp)


def _plate(patch: Patch, said: dict[str, Any]) -> Plate:
    names = [*_OF_THE_PLATE, *({"axial_stiffness"} & said.keys())]
    numbers = {name: float(said[name]) for name in names}
    return Plate(patch, float(said["rigidity"]), fluid=said["fluid"], **numbers)


def _check_sizes(plate: Plate, transduction: Transduction) -> None:
    """Refuse what no sensor is like, and no arithmetic is made for."""
    check_sides(plate.patch)
    for name, within in SKIN.items():
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
        said = _parsed(text)
        layout = _layout(said)
        edge = said["edge"]
        check_edge(layout.patch, edge)
        transduction, plate = _transduction(said), _plate(layout.patch, said)
        _check_sizes(plate, transduction)
        return Sensor(
            layout,
            transduction,
            plate,
            edge,
            float(said["rate"]),
            said["name"],
            said["serial_number"],
            said["firmware"],
            said["simulated"],
            _channel_map(said),
        )
    except KeyError as error:
        raise SourceError(
            f"the device's information lacks {error}; its firmware must send every key of wire "
            "version 1"
        ) from error
    except (ValueError, TypeError, ArithmeticError, RecursionError) as error:
        raise SourceError(f"the device's information cannot be used: {error}") from error
