"""ROS 2 messages to bytes and back (CDR, little endian), from their definitions as text.

A message type is its `ros2msg` text: fields of a primitive type, a text or another message, alone,
as `type[N]`, or as `type[]` of any length.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import numpy as np

from kappaskin.errors import Refusal

_PRIMITIVES = {
    "bool": np.dtype("?"),
    "byte": np.dtype("u1"),
    "uint8": np.dtype("u1"),
    "int32": np.dtype("<i4"),
    "uint32": np.dtype("<u4"),
    "int64": np.dtype("<i8"),
    "uint64": np.dtype("<u8"),
    "float32": np.dtype("<f4"),
    "float64": np.dtype("<f8"),
}
_LITTLE_ENDIAN = b"\0\1\0\0"
_FIELD = re.compile(r"([\w/]+)(\[(\d*)\])? (\w+)\s*(#.*)?")
_RULE = "=" * 80
_LENGTH = np.dtype("<u4")
_MOST = 4096  # messages in a list


@dataclass(frozen=True)
class MessageField:
    """A field of `kind`; `count` of them, None for one alone and 0 for a list of any length."""

    name: str
    kind: str
    count: int | None


class MessageType:
    """The message called `name` (such as `std_msgs/msg/Header`), of the fields in `text`.

    `parts` are the types of the messages in it.
    """

    def __init__(self, name: str, text: str, *parts: "MessageType") -> None:
        self.name, self.text, self.parts = name, text.strip() + "\n", parts
        self.fields = tuple(self._parsed())

    def _parsed(self) -> Iterator[MessageField]:
        for line in self.text.splitlines():
            if line and not line.startswith("#"):
                found = _FIELD.fullmatch(line)
                if found is None:
                    raise ValueError(f"{self.name}: expected a field, got {line!r}")
                kind, several, count, name, _ = found.groups()
                yield MessageField(name, kind, int(count or 0) if several else None)

    @property
    def short(self) -> str:
        """The name as other definitions refer to it, such as `std_msgs/Header`."""
        return self.name.replace("/msg/", "/")

    @cached_property
    def inside(self) -> "dict[str, MessageType]":
        """Every type in it, at any depth, by its short name."""
        found: dict[str, MessageType] = {}
        for part in self.parts:
            found |= {part.short: part} | part.inside
        return found

    @property
    def definition(self) -> bytes:
        """The text as MCAP files hold it: with that of every message in it."""
        texts = [self.text]
        texts += [f"{_RULE}\nMSG: {name}\n{part.text}" for name, part in self.inside.items()]
        return "".join(texts).encode()


class MessageLayout:
    """The bytes of messages of one type whose texts and lengths of lists are always the same.

    `fixed` has by the path of a field (such as `header.frame_id`) its text, or the length of its
    list. A call gives the bytes of a message, its other fields by path; a list of messages of
    numbers of one kind, such as points, is one array of a row for each.
    """

    def __init__(self, kind: MessageType, fixed: Mapping[str, str | int]) -> None:
        self._fixed, self._end = fixed, len(_LITTLE_ENDIAN)
        self._names: list[str] = []
        self._formats: list[Any] = []
        self._offsets: list[int] = []
        self._constant: dict[str, Any] = {}
        self._place(kind, "")
        self._type = np.dtype(
            {
                "names": self._names,
                "formats": self._formats,
                "offsets": self._offsets,
                "itemsize": self._end,
            }
        )
        # Bytes, not a record: copying a record leaves out what lies between its fields.
        self._start = np.zeros(self._end, np.uint8)
        self._start[: len(_LITTLE_ENDIAN)] = np.frombuffer(_LITTLE_ENDIAN, np.uint8)
        record = self._start.view(self._type)[0]
        for path, value in self._constant.items():
            record[path] = value

    def _place(self, kind: MessageType, before: str) -> None:
        for field in kind.fields:
            path = before + field.name
            if field.count is None:
                self._place_one(kind, field.kind, path)
                continue
            count = field.count
            if not count:
                count = int(self._fixed[path])
                self._add(f"{path}.length", _LENGTH, None, count)
            if primitive := _PRIMITIVES.get(field.kind):
                if count:
                    self._add(path, primitive, count)
                continue
            if even := _even(kind.inside[field.kind]):
                if count:
                    self._add(path, np.dtype(even), count)
                continue
            for n in range(count):
                self._place_one(kind, field.kind, f"{path}.{n}")

    def _place_one(self, kind: MessageType, name: str, path: str) -> None:
        if primitive := _PRIMITIVES.get(name):
            self._add(path, primitive, None, self._fixed.get(path))
        elif name == "string":
            text = str(self._fixed[path]).encode(errors="backslashreplace") + b"\0"
            self._add(f"{path}.length", _LENGTH, None, len(text))
            self._add(path, np.dtype(f"S{len(text)}"), None, text, aligned=1)
        else:
            self._place(kind.inside[name], f"{path}.")

    def _add(
        self,
        path: str,
        kind: "np.dtype[Any]",
        count: int | None,
        constant: Any = None,
        aligned: int = 0,
    ) -> None:
        head = len(_LITTLE_ENDIAN)
        step = aligned or kind.base.itemsize
        at = head + -(-(self._end - head) // step) * step
        self._names.append(path)
        self._formats.append(kind if count is None else (kind, (count,)))
        self._offsets.append(at)
        self._end = at + kind.itemsize * (1 if count is None else count)
        if constant is not None:
            self._constant[path] = constant

    def __call__(self, values: Mapping[str, Any]) -> bytes:
        data = self._start.copy()
        record = data.view(self._type)[0]
        for path, value in values.items():
            record[path] = value
        return data.tobytes()


def _even(kind: MessageType) -> "tuple[np.dtype[Any], tuple[int]] | None":
    """The kind and shape of the numbers in a message that has no other fields."""
    (first, *others) = ((_PRIMITIVES.get(field.kind), field.count) for field in kind.fields)
    if first[0] is None or first[1] is not None or any(other != first for other in others):
        return None
    return first[0], (len(kind.fields),)


def encode(kind: MessageType, values: Mapping[str, Any]) -> bytes:
    """The bytes of one message, its fields by path: numbers, texts and lists of numbers."""
    fixed: dict[str, str | int] = {}
    for path, value in values.items():
        if isinstance(value, str):
            fixed[path] = value
        elif isinstance(value, Sequence | np.ndarray):
            fixed[path] = len(cast("Sequence[object]", value))
    others = {
        path: value
        for path, value in values.items()
        if not isinstance(value, str) and fixed.get(path) != 0
    }
    return MessageLayout(kind, fixed)(others)


def decode(kind: MessageType, data: bytes) -> dict[str, Any]:
    """The fields of a message, by path; a `Refusal` when `data` is none of this `kind`."""
    if data[:2] != _LITTLE_ENDIAN[:2]:
        raise Refusal(f"expected a message {kind.name} in little endian CDR, got {data[:4]!r}")
    reader = _Reader(kind.name, data)
    return dict(reader.fields(kind, ""))


class _Reader:
    """Goes through the bytes of one message."""

    def __init__(self, name: str, data: bytes) -> None:
        self._name, self._data, self._at = name, data, len(_LITTLE_ENDIAN)

    def fields(self, kind: MessageType, before: str) -> Iterator[tuple[str, Any]]:
        for field in kind.fields:
            path = before + field.name
            if field.count is None:
                yield from self._one(kind, field.kind, path)
                continue
            count = field.count or int(self._take(_LENGTH, 1)[0])
            if primitive := _PRIMITIVES.get(field.kind):
                yield path, self._take(primitive, count)
                continue
            if count > _MOST:
                raise Refusal(f"{self._name}: expected at most {_MOST} of {path}, got {count}")
            for n in range(count):
                yield from self._one(kind, field.kind, f"{path}.{n}")

    def _one(self, kind: MessageType, name: str, path: str) -> Iterator[tuple[str, Any]]:
        if primitive := _PRIMITIVES.get(name):
            yield path, self._take(primitive, 1)[0].item()
        elif name == "string":
            length = int(self._take(_LENGTH, 1)[0])
            text = self._take(np.dtype("u1"), length).tobytes().removesuffix(b"\0")
            yield path, text.decode(errors="replace")
        else:
            yield from self.fields(kind.inside[name], f"{path}.")

    def _take(self, kind: "np.dtype[Any]", count: int) -> "np.ndarray[Any, Any]":
        if not count:
            return np.empty(0, kind)
        head, step = len(_LITTLE_ENDIAN), kind.itemsize
        at = head + -(-(self._at - head) // step) * step
        self._at = at + step * count
        if self._at > len(self._data):
            raise Refusal(f"{self._name}: expected {self._at} bytes or more, got {len(self._data)}")
        return np.frombuffer(self._data, kind, count, at)
