"""What a device says it is, as JSON on the wire and as a `Sensor` in the program."""

import json
from dataclasses import asdict
from typing import Any

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


def _layout(said: dict[str, Any]) -> SensorLayout:
    patch = Patch(*(float(side) for side in said["size"]))
    if "grid" in said:
        m, n = (int(count) for count in said["grid"])
        if m * n > 2**16 // 3:
            raise Refusal(f"expected at most {2**16 // 3} elements, got {m} x {n}")
        layout = SensorLayout.regular(patch, m, n)
    else:
        layout = SensorLayout.scattered(patch, said["positions"])
    dead = np.array(said["dead_channels"], np.intp)
    live = layout.live.ravel().copy()
    live[dead] = False
    return SensorLayout(patch, layout.positions, live.reshape(3, -1), layout.shape)


def from_json(text: str) -> Sensor:
    """The sensor that `text` tells of; raises `SourceError` when it cannot be understood."""
    try:
        said = json.loads(text)
        return Sensor(
            _layout(said),
            Transduction(HalfBridge(**said["bridge"]), Converter(**said["converter"])),
            float(said["rigidity"]),
            float(said["rate"]),
            str(said["name"]),
            str(said["serial_number"]),
            str(said["firmware"]),
            bool(said["simulated"]),
        )
    except KeyError as error:
        raise SourceError(
            f"the device's information lacks {error}; its firmware must send every key of wire "
            "version 1"
        ) from error
    except (Refusal, ValueError, TypeError, IndexError, OverflowError) as error:
        raise SourceError(f"the device's information cannot be used: {error}") from error
