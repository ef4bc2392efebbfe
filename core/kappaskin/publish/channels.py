"""What a client of Foxglove's protocol may subscribe to, and the schema of each."""

import json
from dataclasses import dataclass
from typing import Any

from kappaskin.frames import Event
from kappaskin.publish.message import CONTACT as CONTACT_NUMBERS
from kappaskin.publish.message import STATUS_NUMBERS, SWITCHES

FRAME = "skin"
"""The frame of reference: that of `Patch`, x along the skin, z outward at its middle."""

_WARNING, _INFORMATION = 3, 2
_GRAVE = ("gap", "gone", "refused", "engine", "other", "restarted")

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
    **{f.key: {"type": "number", "description": f.words} for f in CONTACT_NUMBERS},
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
    text = f"{event.kind}: {event.text}"
    return (
        f'{{"timestamp":{moment(when)},"level":{level},"message":{json.dumps(text)},'
        '"name":"kappaskin","file":"","line":0}'
    ).encode()
