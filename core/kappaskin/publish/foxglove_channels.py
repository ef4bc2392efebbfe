"""Channels of the Foxglove transport: their schemas, and the skin as a cloud of points."""

import base64
import json
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from kappaskin._text import printable
from kappaskin.bases import CurvatureMap
from kappaskin.frames import COMPONENTS, Array, Event
from kappaskin.pipeline import Pipeline
from kappaskin.publish.message import CONTACT as CONTACT_NUMBERS
from kappaskin.publish.message import SECOND, STATUS_NUMBERS, SWITCHES, EstimateMessage

FRAME = "skin"
"""The frame of reference: that of `Patch`, x along the skin, z outward at its middle."""

_WARNING, _INFORMATION = 3, 2
_GRAVE = ("gap", "gone", "refused", "engine", "other", "restarted", "noise")

Schema = dict[str, Any]


@dataclass(frozen=True, eq=False)
class Channel:
    """A stream of JSON: its `number`, the `topic` it is called by and what it holds."""

    number: int
    topic: str
    name: str
    schema: str

    @property
    def advertised(self) -> dict[str, object]:
        return {
            "id": self.number,
            "topic": self.topic,
            "encoding": "json",
            "schemaName": self.name,
            "schema": self.schema,
            "schemaEncoding": "jsonschema",
        }


def _object(**properties: Schema) -> Schema:
    return {"type": "object", "properties": properties}


def _numbers(*names: str) -> Schema:
    return _object(**{name: {"type": "number"} for name in names})


_TEXT: Schema = {"type": "string"}
_INTEGER: Schema = {"type": "integer"}
_MANY: Schema = {"type": "array", "items": {"type": "number"}}
_TIME = _object(sec=_INTEGER, nsec=_INTEGER) | {"title": "time"}
_POSE = _object(position=_numbers("x", "y", "z"), orientation=_numbers("x", "y", "z", "w"))
_FIELD = _object(name=_TEXT, offset=_INTEGER, type=_INTEGER)
_IN_FRAME: Schema = {"timestamp": _TIME, "frame_id": _TEXT, "pose": _POSE}
_KIND: Schema = {"kind": _TEXT, "version": _INTEGER}


_CONTACT = _object(
    **_KIND,
    source=_TEXT,
    **{key: {"type": "boolean", "description": words} for key, words in SWITCHES.items()},
    **{f.key: {"type": "number", "description": f.text} for f in CONTACT_NUMBERS},
    second=_object(**{f.key: {"type": "number", "description": f.text} for f in SECOND}),
)
_SHAPE = _object(
    **_KIND,
    **_numbers("timestamp", "number", "sequence", "generation")["properties"],
    edge=_TEXT,
    functions_x=_INTEGER,
    functions_y=_INTEGER,
    coefficients_m=_MANY,
    coefficients_sd_m=_MANY,
)
_SKIN = _object(
    **_IN_FRAME,
    point_stride=_INTEGER,
    fields={"type": "array", "items": _FIELD},
    data={"type": "string", "contentEncoding": "base64"},
)
_STATUS = _object(
    **_KIND,
    **dict.fromkeys(("state", "source", "message", "sensor"), _TEXT),
    **_numbers("timestamp", *STATUS_NUMBERS)["properties"],
)
_LOG = _object(
    timestamp=_TIME, level=_INTEGER, message=_TEXT, name=_TEXT, file=_TEXT, line=_INTEGER
)


def _channel(number: int, topic: str, name: str, schema: Schema) -> Channel:
    return Channel(number, topic, name, json.dumps(schema | {"title": name}))


CONTACT = _channel(1, "/contact", "kappaskin.Contact", _CONTACT)
POSE = _channel(2, "/contact/pose", "foxglove.PoseInFrame", _object(**_IN_FRAME))
SHAPE = _channel(3, "/shape", "kappaskin.Shape", _SHAPE)
SKIN = _channel(4, "/skin", "foxglove.PointCloud", _SKIN)
STATUS = _channel(5, "/status", "kappaskin.Status", _STATUS)
LOG = _channel(6, "/log", "foxglove.Log", _LOG)

CHANNELS = (CONTACT, POSE, SHAPE, SKIN, STATUS, LOG)


def moment(seconds: float) -> str:
    """Seconds since 1970 as the JSON of a time."""
    nanoseconds = round(seconds * 1e9)
    return f'{{"sec":{nanoseconds // 10**9},"nsec":{nanoseconds % 10**9}}}'


def logged(event: Event, when: float) -> bytes:
    """An event as a line of a log; it happened `when`, in s since 1970."""
    level = _WARNING if event.kind in _GRAVE else _INFORMATION
    text = printable(f"{event.kind}: {event.text}")
    return (
        f'{{"timestamp":{moment(when)},"level":{level},"message":{json.dumps(text)},'
        '"name":"kappaskin","file":"","line":0}'
    ).encode()


POINTS = 33
"""Points of the cloud along each side of the skin, edges included."""

NAMES = ("x", "y", "z", "displacement", *(f"curvature_{name}" for name in COMPONENTS))
"""What each point has: place and displacement in m, change of curvature in 1/m."""

_FLOAT32 = 7  # as Foxglove numbers types
_AT_ORIGIN = '{"position":{"x":0,"y":0,"z":0},"orientation":{"x":0,"y":0,"z":0,"w":1}}'
_FIELDS = json.dumps(
    [{"name": name, "offset": 4 * k, "type": _FLOAT32} for k, name in enumerate(NAMES)]
)


class _Grid:
    """Points of a skin, and the maps from coefficients to what they have; made once a setup."""

    def __init__(self, pipeline: Pipeline) -> None:
        basis = pipeline.basis
        x, y = basis.patch.grid(POINTS, POINTS)
        places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        self._on_skin = basis.patch.contains(places)
        self._at_rest, self._outward = basis.patch.at_rest(places[self._on_skin])
        self._maps = [
            basis.on_grid(x, y),
            *(CurvatureMap(basis, component, x, y) for component in COMPONENTS),
        ]

    def __call__(self, coefficients: Array) -> Array:
        """What the points have, (points, 7)."""
        values = [of(coefficients).ravel()[self._on_skin] for of in self._maps]
        points = self._at_rest - values[0][:, None] * self._outward
        return np.column_stack([points, *values])


class Cloud:
    """Messages to clouds of points."""

    def __init__(self) -> None:
        self._pipeline: Pipeline | None = None
        self._grid: _Grid | None = None

    def __call__(self, message: EstimateMessage) -> bytes | None:
        """The skin as a foxglove.PointCloud in JSON; None when its shape is not known."""
        coefficients = message.estimate.coefficients
        if not np.isfinite(coefficients).all():
            return None
        if self._grid is None or self._pipeline is not message.pipeline:
            self._pipeline, self._grid = message.pipeline, _Grid(message.pipeline)
        data = base64.b64encode(self._grid(coefficients).astype("<f4").tobytes()).decode()
        return (
            f'{{"timestamp":{moment(message.timestamp)},"frame_id":"{FRAME}","pose":{_AT_ORIGIN},'
            f'"point_stride":{4 * len(NAMES)},"fields":{_FIELDS},"data":"{data}"}}'
        ).encode()


def pose(message: EstimateMessage) -> bytes:
    """The contact as a foxglove.PoseInFrame in JSON: z is the skin's normal, x along the skin."""
    geometry = message.estimate.geometry
    x, y, z = geometry.position.tolist()
    turn = dict(
        zip(
            "xyzw",
            scipy.spatial.transform.Rotation.from_matrix(geometry.frame.T).as_quat().tolist(),
            strict=True,
        )
    )
    return (
        f'{{"timestamp":{moment(message.timestamp)},"frame_id":"{FRAME}","pose":{{"position":'
        f'{{"x":{x},"y":{y},"z":{z}}},"orientation":{json.dumps(turn)}}}}}'
    ).encode()
