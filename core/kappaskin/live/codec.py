"""Values as bytes and back, between machines: JSON with the bytes of arrays behind it.

What is read is checked against the type that is expected, and only values and data classes of this
library are made of it, with their own checks: reading runs no code of the sender.
"""

import inspect
import json
import struct
import sys
import types
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from datetime import datetime
from functools import cache
from pathlib import Path, PurePath
from typing import Any, Protocol, Union, cast, get_args, get_origin, get_type_hints

import lz4.block  # pyright: ignore[reportMissingTypeStubs]
import numpy as np

from kappaskin.errors import Refusal

LARGEST = 64 * 2**20
"""Bytes of a message."""

_DEEPEST = 64  # levels of a value
_KINDS = frozenset("biufUS")  # of arrays
_HEAD = struct.Struct("<II")  # bytes in all, and those of the JSON
_lz4, _format = cast("Any", lz4.block), cast("Any", np.lib.format)


class BadMessageError(Refusal):
    """Bytes from outside that are no message of this library."""


def encoded(value: Any) -> bytes:
    """The bytes of a value: of numbers, texts, times, paths, arrays, data classes and such."""
    parts: list[bytes] = []
    data = json.dumps(_plain(value, parts)).encode()
    whole = b"".join([data, *parts])
    return _HEAD.pack(len(whole), len(data)) + _lz4.compress(whole)


def decoded(data: bytes, expected: Any, most: int = LARGEST) -> Any:
    """The value of the type `expected` in these bytes; a `BadMessageError` where there is none."""
    try:
        size, length = _HEAD.unpack_from(data)
        if not (int.from_bytes(data[_HEAD.size : _HEAD.size + 4], "little") == size <= most):
            raise BadMessageError(f"expected a message of at most {most} bytes, got {size}")
        whole = _lz4.decompress(data[_HEAD.size :])
        plain = json.loads(whole[:length])
        return _value(plain, expected, memoryview(whole)[length:])
    except BadMessageError:
        raise
    except (Refusal, *_INVALID) as error:
        raise BadMessageError(f"expected a message of this version, got {error!s:.200}") from error


_INVALID: tuple[type[Exception], ...] = (
    *(ValueError, TypeError, KeyError, AttributeError, IndexError, OverflowError),
    *(RecursionError, MemoryError, struct.error, _lz4.LZ4BlockError),
)


def _plain(value: Any, parts: list[bytes]) -> Any:
    """The value as JSON has it; the bytes of arrays are put behind `parts`."""
    match value:
        case None | bool() | int() | float() | str():
            return value
        case np.ndarray():
            array = cast("np.ndarray[Any, Any]", value)
            fortran = array.flags.f_contiguous and not array.flags.c_contiguous
            order = "F" if fortran else "C"  # in which products are summed
            parts.append(array.tobytes(order))
            return [array.dtype.str, array.shape, order, len(parts[-1]), _begin(parts)]
        case bytes():
            parts.append(value)
            return [len(value), _begin(parts)]
        case np.generic():
            return cast("Any", value).item()
        case np.dtype():
            return _format.dtype_to_descr(value)
        case PurePath():
            return str(value)
        case datetime():
            return value.isoformat()
        case Mapping():
            items = cast("Mapping[Any, Any]", value).items()
            return [[_plain(key, parts), _plain(each, parts)] for key, each in items]
        case frozenset():
            return sorted(cast("frozenset[Any]", value))
        case tuple() | list():
            return [_plain(each, parts) for each in cast("Sequence[Any]", value)]
        case _ if is_dataclass(value):
            named = {each.name: _plain(getattr(value, each.name), parts) for each in fields(value)}
            return {"class": type(value).__name__, "fields": named}
        case _:
            raise Refusal(f"expected a value that can be sent, got {type(value).__name__}")


def _begin(parts: list[bytes]) -> int:
    return sum(map(len, parts[:-1]))


def _value(plain: Any, expected: Any, rest: memoryview, depth: int = 0) -> Any:
    """The value of the type `expected` that JSON has as `plain`, with the bytes in `rest`."""
    if depth > _DEEPEST:
        raise BadMessageError(f"expected a value of at most {_DEEPEST} levels")
    origin, inner = get_origin(expected) or expected, get_args(expected)

    def within(each: Any, of: Any) -> Any:
        return _value(each, of, rest, depth + 1)

    if origin in (Union, types.UnionType):
        return _one_of(plain, inner, within)
    if origin is np.ndarray:
        return _array(plain, inner[1], rest)
    if origin is np.dtype:
        return _record(plain)
    if origin in (tuple, list, frozenset) or origin is Sequence:
        several = _list(plain)
        if origin is tuple and Ellipsis not in inner:
            return tuple(within(*both) for both in zip(several, inner, strict=True))
        made = [within(each, inner[0]) for each in several]
        return made if origin is list else frozenset(made) if origin is frozenset else tuple(made)
    if origin in (dict, Mapping):
        return {within(key, inner[0]): within(each, inner[1]) for key, each in _list(plain)}
    if origin is bytes:
        length, begin = map(int, _list(plain))
        return bytes(_cut(rest, begin, length))
    if origin is datetime:
        return datetime.fromisoformat(plain)
    if origin is Path:
        return Path(_checked(plain, str))
    if origin is float:
        return _checked(plain, float, int)
    if origin in (bool, int, str, types.NoneType):
        return _checked(plain, origin)
    return _object(plain, origin, within)


def _one_of(plain: Any, choices: tuple[Any, ...], within: Callable[[Any, Any], Any]) -> Any:
    wrong: list[str] = []
    for each in choices:
        try:
            return within(plain, each)
        except (Refusal, *_INVALID) as error:
            wrong.append(str(error))
    raise BadMessageError("; ".join(wrong))


def _checked(plain: Any, *kinds: type) -> Any:
    if type(plain) not in kinds:
        raise BadMessageError(f"expected {kinds[0].__name__}, got {plain!r:.40}")
    return plain


def _list(plain: Any) -> list[Any]:
    return _checked(plain, list)


def _cut(rest: memoryview, begin: int, length: int) -> memoryview:
    if not 0 <= begin <= begin + length <= len(rest):
        raise BadMessageError("expected the bytes of an array, got fewer")
    return rest[begin : begin + length]


def _array(plain: Any, expected: Any, rest: memoryview) -> Any:
    """An array of the expected type of number, by its shape and its place in `rest`."""
    name, shape, order, length, begin = _list(plain)
    dtype = np.dtype(_checked(name, str))
    wanted = get_args(expected)[0]
    if dtype.kind not in _KINDS or not (wanted is Any or issubclass(dtype.type, wanted)):
        raise BadMessageError(f"expected an array of {wanted}, got one of {dtype}")
    found = np.frombuffer(_cut(rest, begin, length), dtype)
    return found.reshape([int(side) for side in _list(shape)], order=order).copy(order=order)


def _record(plain: Any) -> Any:
    """The type of a record of numbers."""
    dtype = _format.descr_to_dtype(_tuples(plain))
    if dtype.hasobject or dtype.itemsize > LARGEST:
        raise BadMessageError(f"expected a record of numbers, got {dtype!s:.200}")
    return dtype


def _tuples(plain: Any) -> Any:
    """As `descr_to_dtype` has it: fields, and their shapes, are tuples."""
    if not isinstance(plain, list):
        return plain
    several = [_tuples(each) for each in cast("list[Any]", plain)]
    return tuple(several) if several and not isinstance(several[0], tuple) else several


@cache
def _hints(kind: type) -> dict[str, Any]:
    return get_type_hints(kind, vars(sys.modules[kind.__module__]))


@cache
def _allowed(expected: type) -> dict[str, type]:
    """The data classes that a value of an expected class may be of, by their names."""
    if not expected.__module__.startswith("kappaskin."):
        raise BadMessageError(f"expected no {expected.__name__}")
    if Protocol not in expected.__bases__:
        return {each.__name__: each for each in _below(expected) if is_dataclass(each)}
    room = ".".join(expected.__module__.split(".")[:2])
    has = [name for name in vars(expected) if not name.startswith("_")]
    return {
        kind.__name__: kind
        for name, module in tuple(sys.modules.items())
        if name.startswith(f"{room}.")
        for _, kind in inspect.getmembers(module, inspect.isclass)
        if is_dataclass(kind) and kind.__module__.startswith(f"{room}.")
        if all(hasattr(kind, each) for each in has)
    }


def _below(kind: type) -> Iterator[type]:
    """A class and all that inherit from it, as far as they are in this library."""
    # With slots a class is made twice, and the first one is nobody's.
    if getattr(sys.modules[kind.__module__], kind.__name__, None) is kind:
        yield kind
    for each in kind.__subclasses__():
        if each.__module__.startswith("kappaskin."):
            yield from _below(each)


def _object(plain: Any, expected: Any, within: Callable[[Any, Any], Any]) -> Any:
    """A data class, made with the checks that it has."""
    _checked(plain, dict)
    kind = _allowed(expected).get(plain["class"])
    if kind is None:
        raise BadMessageError(f"expected {expected.__name__}, got {plain['class']!r:.40}")
    hints, given = _hints(kind), plain["fields"]
    if given.keys() != {each.name for each in fields(kind)}:
        raise BadMessageError(f"expected the fields of {kind.__name__}, got {sorted(given)}")
    made = cast("Any", object.__new__(kind))  # some are made of other things than their fields
    for name, each in given.items():
        object.__setattr__(made, name, within(each, hints[name]))
    if check := getattr(made, "__post_init__", None):
        check()
    return made
