"""A recording to what every file made of it says of itself."""

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass, fields
from datetime import UTC, datetime
from importlib import metadata
from typing import Any, NamedTuple

from kappaskin.calibration import Calibration, Tare
from kappaskin.errors import Refusal
from kappaskin.pipeline import Setup
from kappaskin.recording import messages as m
from kappaskin.recording.cdr import decode
from kappaskin.recording.export.wanted import Wanted
from kappaskin.recording.messages import Topic
from kappaskin.recording.reading import Recording
from kappaskin.recording.setup_text import setup_from
from kappaskin.sensing import Sensor
from kappaskin.sources import sensor_from_json


@dataclass(frozen=True)
class About:
    """What the frames are of: a `sensor`, and at most so many `functions` along x and y.

    `said` tells it all in words and numbers that JSON has.
    """

    said: dict[str, Any]
    sensor: Sensor
    functions: tuple[int, int]

    @property
    def program(self) -> str:
        return self.said["program"]

    def json(self, **more: object) -> str:
        """All of it, and `more`, as JSON."""
        return json.dumps(self.said | more)


class _Told(NamedTuple):
    """The `number`th text on its topic, `at` s after the beginning."""

    number: int
    at: float
    text: str


def about(recording: Recording, wanted: Wanted) -> About:
    """What files of the span that is `wanted` say; a `Refusal` where there were two devices."""
    path = recording.path
    devices = list(_in_force(recording, m.DEVICE, wanted))
    if not devices:
        raise Refusal(f"{path}: expected a device from {wanted.first:g} s on, got none")
    for device in devices[1:]:
        if device.text != devices[0].text:
            raise Refusal(f"{path}: {another(device.at)}")
    sensor = sensor_from_json(devices[0].text)
    setups = [_setup_said(wanted.setup, sensor)] if wanted.setup else []
    if wanted.setup is None:
        for told in _in_force(recording, m.SETUP, wanted):
            setup = setup_from(told.text, recording.attachment)
            number = {"number": told.number, "since": max(told.at, 0.0)}
            setups.append(number | _setup_said(setup, sensor))
    if not setups:
        raise Refusal(
            f"{path}: was recorded without settings until {wanted.end:g} s, so that no frame was "
            "worked out; export a later span"
        )
    functions = (max(setup[name] for setup in setups) for name in ("Ni", "Nj"))
    return About(_said(recording, devices[0].text, sensor, setups), sensor, (*functions,))


def another(at: float) -> str:
    """What is said of a device that came `at` s after the beginning, as another one."""
    before, after = math.ceil(1e3 * at - 1) / 1e3, math.floor(1e3 * at + 1) / 1e3
    return (
        f"another device, or another skin, came at {at:.6g} s, and a file is of one: export the "
        f"time until {before:.3f} s (--until), or from {after:.3f} s on (--from)"
    )


def _in_force(recording: Recording, topic: Topic, wanted: Wanted) -> Iterator[_Told]:
    """What was told on a topic, as far as it held at some time of the span."""
    told = [
        _Told(
            number, (message.stamp - recording.first) * 1e-9, decode(m.STRING, message.data)["data"]
        )
        for number, message in enumerate(recording.messages_on(topic))
    ]
    last = None
    for one in told:
        if one.at > wanted.end:
            break
        if last is not None and one.at > wanted.first:
            yield last
        last = one
    if last is not None:
        yield last


def _setup_said(setup: Setup, sensor: Sensor) -> dict[str, Any]:
    said = {field.name: getattr(setup, field.name) for field in fields(setup)}
    said["Nj"] = 1 if sensor.layout.patch.strip else setup.Nj
    said["edge"] = setup.edge or sensor.edge
    return said | {"calibration": _dated(setup.calibration), "tare": _dated(setup.tare)}


def _dated(kept: Calibration | Tare | None) -> dict[str, str] | None:
    if kept is None:
        return None
    return {
        "name": kept.name,
        "serial_number": kept.serial_number,
        "date": kept.date.isoformat(),
        "digest": kept.digest,
    }


def _said(
    recording: Recording, device: str, sensor: Sensor, setups: list[dict[str, Any]]
) -> dict[str, Any]:
    began = datetime.fromtimestamp(recording.first * 1e-9, UTC)
    return {
        "program": f"kappaskin {metadata.version('kappaskin')}",
        "recording": recording.path.name,
        "recorded_by": recording.library,
        "began": began.isoformat(timespec="milliseconds"),
        "ended_properly": recording.whole,
        "device": json.loads(device),
        "skin": sensor.layout.patch.name,
        "positions": sensor.layout.positions.tolist(),
        "settings": setups,
        "units": "SI: m, s, N, 1/m; curvature components xx, yy, xy",
    }
