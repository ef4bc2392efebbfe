"""Channels of the Foxglove transport: their schemas, and the skin as a mesh and as points."""

import base64
import json
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from kappaskin._text import printable
from kappaskin.bases import curvature_at
from kappaskin.frames import COMPONENTS, Array, Estimate, Event
from kappaskin.pipeline import SEQUENTIAL, Pipeline
from kappaskin.publish.message import CONTACT as CONTACT_NUMBERS
from kappaskin.publish.message import SECOND, STATUS_NUMBERS, SWITCHES, EstimateMessage
from kappaskin.recording import SCENE_UPDATE, MessageLayout
from kappaskin.skin import RestMesh

FRAME = "skin"
"""The frame of reference: that of `Patch`, x along the skin, z outward at its middle."""

CONTACT_FRAME = "contact"
"""The frame of the contact: z is the skin's normal, x along the skin."""

_WARNING, _INFORMATION = 3, 2
_GRAVE = ("gap", "gone", "refused", "engine", "other", "restarted", "noise")

Schema = dict[str, Any]


@dataclass(frozen=True, eq=False)
class Channel:
    """A stream of messages: its `number`, the `topic` it is called by and what it holds."""

    number: int
    topic: str
    name: str
    schema: str
    encoding: str = "json"
    language: str = "jsonschema"

    def advertised(self, finger: str) -> dict[str, object]:
        """The channel as it is advertised; the topic of a `finger` begins with its name."""
        return {
            "id": self.number,
            "topic": f"/{finger}{self.topic}" if finger else self.topic,
            "encoding": self.encoding,
            "schemaName": self.name,
            "schema": self.schema,
            "schemaEncoding": self.language,
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
_TRANSFORM = _object(
    **{"timestamp": _TIME, "parent_frame_id": _TEXT, "child_frame_id": _TEXT},
    translation=_numbers("x", "y", "z"),
    rotation=_numbers("x", "y", "z", "w"),
)
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
MESH = Channel(
    *(7, "/skin/mesh", SCENE_UPDATE.name, SCENE_UPDATE.definition.decode()), "cdr", "ros2msg"
)
FRAMES = _channel(
    *(8, "/tf", "foxglove.FrameTransforms"),
    _object(transforms={"type": "array", "items": _TRANSFORM}),
)

CHANNELS = (CONTACT, POSE, SHAPE, SKIN, STATUS, LOG, MESH, FRAMES)


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
"""Points of the skin along each of its sides, edges included."""

NAMES = ("x", "y", "z", "displacement", *(f"curvature_{name}" for name in COMPONENTS))
"""What each point has: place and displacement in m, change of curvature in 1/m."""

_FLOAT32 = 7  # as Foxglove numbers types
_AT_ORIGIN = '{"position":{"x":0,"y":0,"z":0},"orientation":{"x":0,"y":0,"z":0,"w":1}}'
_FIELDS = json.dumps(
    [{"name": name, "offset": 4 * k, "type": _FLOAT32} for k, name in enumerate(NAMES)]
)

_ANCHORS: Array = np.array([[*bytes.fromhex(anchor[1:]), 255] for anchor in SEQUENTIAL]) / 255
_PLACES = np.linspace(0, len(_ANCHORS) - 1, 256)
_COLOURS: Array = np.column_stack(
    [np.interp(_PLACES, np.arange(len(_ANCHORS)), _ANCHORS[:, k]) for k in range(4)]
)
_LEAST = 1e-4  # of the longer side: the largest displacement that the colours show at least
_PATIENCE = 2.0  # s that displacement must stay small before the colours show less
_LIFT = 2e-3  # of the longer side: how high above the skin the line lies
_AROUND = 2 * np.pi * np.arange(48) / 48
_SIDES = np.stack([np.cos(_AROUND), np.sin(_AROUND)], axis=-1)
_ENTITY, _LINE, _TRIANGLES = "entities.0.", "entities.0.lines.0.", "entities.0.triangles.0."
_NO_LISTS = dict.fromkeys(
    (
        "deletions",
        *(f"{_ENTITY}{kind}s" for kind in ("arrow", "cube", "sphere", "cylinder", "text", "model")),
        f"{_LINE}colors",
        f"{_LINE}indices",
    ),
    0,
)
_LINE_LOOK = {
    f"{_LINE}{name}": value
    for name, value in {
        "type": 1,  # it ends where it begins
        "pose.orientation.w": 1,
        "thickness": 3,  # pixels
        "scale_invariant": True,
        **{f"color.{c}": v / 255 for c, v in zip("rgba", (31, 209, 122, 255), strict=True)},
    }.items()
}


class _SkinPoints:
    """The points of a skin's mesh and the maps from coefficients to what they have.

    They are made once per setup.
    """

    def __init__(self, pipeline: Pipeline) -> None:
        self.pipeline, self._basis = pipeline, pipeline.basis
        self._patch = patch = pipeline.basis.patch
        self._rest = rest = RestMesh(patch, POINTS, POINTS)
        self._values = self._basis.at(rest.positions)
        self._curvature = curvature_at(self._basis, rest.positions)
        self._side = max(patch.a, patch.b)
        self._limit, self._until = 0.0, 0.0
        self._layouts: dict[tuple[float, bool], MessageLayout] = {}

    def cloud(self, message: EstimateMessage) -> bytes:
        """The skin as a foxglove.PointCloud in JSON."""
        flat = message.estimate.coefficients.ravel()
        displacement = self._values @ flat
        columns = *self._rest.displaced(displacement).T, displacement, *(self._curvature @ flat)
        data = base64.b64encode(np.column_stack(columns).astype("<f4").tobytes()).decode()
        return (
            f'{{"timestamp":{moment(message.timestamp)},"frame_id":"{FRAME}","pose":{_AT_ORIGIN},'
            f'"point_stride":{4 * len(NAMES)},"fields":{_FIELDS},"data":"{data}"}}'
        ).encode()

    def mesh(self, message: EstimateMessage) -> bytes:
        """The skin as triangles, and the error bars of the contact's place as a line on it.

        A SceneUpdate in CDR, coloured by displacement.
        """
        displacement = self._values @ message.estimate.coefficients.ravel()
        deep = np.abs(displacement)
        limit = self._limit_of(float(deep.max()), message.timestamp)
        line = self._line(message.estimate)
        sec, nanosec = divmod(round(message.timestamp * 1e9), 10**9)
        values: dict[str, Any] = {
            f"{_ENTITY}timestamp.sec": sec,
            f"{_ENTITY}timestamp.nanosec": nanosec,
            f"{_TRIANGLES}pose.orientation.w": 1,
            f"{_TRIANGLES}points": self._rest.displaced(displacement),
            f"{_TRIANGLES}colors": _COLOURS[(255 * np.minimum(deep / limit, 1)).astype(int)],
            f"{_TRIANGLES}indices": self._rest.triangles.ravel(),
        }
        if line is not None:
            values |= {**_LINE_LOOK, f"{_LINE}points": line}
        return self._layout(limit, line is not None)(values)

    def _limit_of(self, largest: float, now: float) -> float:
        """The displacement of the last colour, which follows the `largest`: down after a delay."""
        largest = max(largest, _LEAST * self._side)
        power = 10.0 ** math.floor(math.log10(largest))
        wanted = next(times * power for times in (1, 2, 5, 10) if times * power >= largest)
        if wanted >= self._limit or now > self._until:
            self._limit, self._until = wanted, now + _PATIENCE
        return self._limit

    def _line(self, estimate: Estimate) -> Array | None:
        """Points (48, 3) in m just above the skin, a standard deviation from the contact."""
        contact, patch = estimate.contact, self._patch
        if not (contact.present and np.isfinite(contact.position_sd).all()):
            return None
        x0, y0 = contact.position.tolist()
        places = patch.around(x0, y0, contact.position_sd * _SIDES)
        for n in np.flatnonzero(~patch.contains(places)):
            places[n] = patch.inward(*places[n].tolist())
        rest, out = patch.at_rest(places)
        height = _LIFT * self._side - self._basis.at(places) @ estimate.coefficients.ravel()
        return rest + height[:, None] * out

    def _layout(self, limit: float, with_line: bool) -> MessageLayout:
        found = self._layouts.get((limit, with_line))
        if found is None:
            count = len(self._rest.points)
            fixed: dict[str, str | int] = {
                "entities": 1,
                f"{_ENTITY}frame_id": FRAME,
                f"{_ENTITY}id": "skin",
                f"{_ENTITY}metadata": 1,
                f"{_ENTITY}metadata.0.key": "displacement of the brightest colour",
                f"{_ENTITY}metadata.0.value": f"{limit:g} m",
                f"{_ENTITY}lines": int(with_line),
                f"{_LINE}points": len(_SIDES),
                f"{_ENTITY}triangles": 1,
                f"{_TRIANGLES}points": count,
                f"{_TRIANGLES}colors": count,
                f"{_TRIANGLES}indices": self._rest.triangles.size,
            }
            found = MessageLayout(SCENE_UPDATE, fixed | _NO_LISTS)
            self._layouts[limit, with_line] = found
        return found


class SkinMessages:
    """Messages of estimates to messages of the channels `SKIN` and `MESH`."""

    def __init__(self) -> None:
        self._points: _SkinPoints | None = None

    def __call__(self, channel: Channel, message: EstimateMessage) -> bytes | None:
        """The skin for one of its channels; None when its shape is not known."""
        if not np.isfinite(message.estimate.coefficients).all():
            return None
        if self._points is None or self._points.pipeline is not message.pipeline:
            self._points = _SkinPoints(message.pipeline)
        return self._points.mesh(message) if channel is MESH else self._points.cloud(message)


def pose(message: EstimateMessage) -> bytes:
    """The contact as a foxglove.PoseInFrame in JSON: z is the skin's normal, x along the skin."""
    place, turn = _placed(message)
    return (
        f'{{"timestamp":{moment(message.timestamp)},"frame_id":"{FRAME}",'
        f'"pose":{{"position":{place},"orientation":{turn}}}}}'
    ).encode()


def frames(message: EstimateMessage) -> bytes:
    """The frame `CONTACT_FRAME` in that of the skin as foxglove.FrameTransforms in JSON."""
    place, turn = _placed(message)
    return (
        f'{{"transforms":[{{"timestamp":{moment(message.timestamp)},"parent_frame_id":"{FRAME}",'
        f'"child_frame_id":"{CONTACT_FRAME}","translation":{place},"rotation":{turn}}}]}}'
    ).encode()


def _placed(message: EstimateMessage) -> tuple[str, str]:
    """Position and orientation of the contact in JSON."""
    geometry = message.estimate.geometry
    turn = scipy.spatial.transform.Rotation.from_matrix(geometry.frame.T).as_quat().tolist()
    place = dict(zip("xyz", geometry.position.tolist(), strict=True))
    return json.dumps(place), json.dumps(dict(zip("xyzw", turn, strict=True)))
