"""What a device says it is, as JSON on the wire and as a `Sensor` in the program."""

import json
import math
from dataclasses import asdict, fields
from operator import index
from typing import Any, TypeVar, cast

import numpy as np

from kappaskin.errors import Refusal, SourceError
from kappaskin.layout import SensorLayout
from kappaskin.patch import Patch
from kappaskin.sensor import Sensor
from kappaskin.transduction import Converter, HalfBridge, Transduction


def to_json(sensor: Sensor) -> str:
    """The information text of `sensor`: SI units, channels counted component by component."""
    layout = sensor.layout
    where = {"grid": layout.shape} if layout.shape else {"positions": layout.positions.tolist()}
    return json.dumps(
        {
            "name": sensor.name,
            "serial_number": sensor.serial_number,
            "firmware": sensor.firmware,
            "simulated": sensor.simulated,
            "rate": sensor.rate,
            "rigidity": sensor.rigidity,
            "size": [layout.patch.a, layout.patch.b],
            **where,
            "dead_channels": np.flatnonzero(~layout.live.ravel()).tolist(),
            "bridge": asdict(sensor.transduction.bridge),
            "converter": asdict(sensor.transduction.converter),
        },
        separators=(",", ":"),
    )


_Part = TypeVar("_Part", HalfBridge, Converter)

_KINDS: dict[str, tuple[Any, tuple[str, ...]]] = {
    "a text": (str, ("name", "serial_number", "firmware")),
    "a number": ((int, float), ("rate", "rigidity")),
    "a list": (list, ("size", "grid", "positions", "dead_channels")),
    "an object": (dict, ("bridge", "converter")),
    "true or false": (bool, ("simulated",)),
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
    found = cast("dict[str, Any]", said)
    for what, (kind, names) in _KINDS.items():
        for name in names:
            if name in found and not isinstance(found[name], kind):
                raise TypeError(f"expected {name} to be {what}, got {found[name]!r:.80}")
    return found


def _made(kind: type[_Part], said: dict[str, Any]) -> _Part:
    return kind(**{field.name: said[field.name] for field in fields(kind)})


def _layout(said: dict[str, Any]) -> SensorLayout:
    patch = Patch(*(float(side) for side in said["size"]))
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
    return SensorLayout(patch, layout.positions, live, layout.shape)


def from_json(text: str) -> Sensor:
    """The sensor that `text` tells of; raises `SourceError` when it cannot be understood."""
    try:
        said = _parsed(text)
        return Sensor(
            _layout(said),
            Transduction(_made(HalfBridge, said["bridge"]), _made(Converter, said["converter"])),
            float(said["rigidity"]),
            float(said["rate"]),
            said["name"],
            said["serial_number"],
            said["firmware"],
            said["simulated"],
        )
    except KeyError as error:
        raise SourceError(
            f"the device's information lacks {error}; its firmware must send every key of wire "
            "version 1"
        ) from error
    except (ValueError, TypeError, ArithmeticError, RecursionError) as error:
        raise SourceError(f"the device's information cannot be used: {error}") from error
