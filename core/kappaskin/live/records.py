"""Estimates as few bytes: numbers are exact, arrays as exact as a screen shows them.

A surface is a whole number of steps, of which the largest displacement has 32,767, and stored as
its second differences; other arrays have the seven digits of single precision.
"""

import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kappaskin.live.codec import BadMessageError

_FEW = 16  # numbers, which are stored as they are
_STEPS = 2**15 - 1
_STEP = np.dtype("<f8")


def packed(record: Any) -> bytes:
    """The bytes of a record of an estimate, as `Ring.newest` has it."""
    parts = [_packed(record[name]) for name in record.dtype.names]
    return zlib.compress(b"".join(parts), 1)


def unpacked(data: bytes, slot: np.dtype[np.void]) -> Any:
    """The record of this type; a `BadMessageError` where the bytes are of another one."""
    names = slot.names or ()
    sizes = [_size(slot[name]) for name in names]
    reader, record = zlib.decompressobj(), np.zeros((), slot)
    try:
        whole = reader.decompress(data, sum(sizes) + 1)
    except zlib.error as error:
        raise BadMessageError(f"expected an estimate, got {error}") from error
    if len(whole) != sum(sizes):
        raise BadMessageError(f"expected {sum(sizes)} bytes of an estimate, got {len(whole)}")
    begin = 0
    for name, size in zip(names, sizes, strict=True):
        record[name] = _unpacked(whole[begin : begin + size], slot[name])
        begin += size
    return record


def _is_surface(kind: np.dtype[Any]) -> bool:
    return kind.base.kind == "f" and len(kind.shape) == 2 and min(kind.shape) >= _FEW


def _single(kind: np.dtype[Any]) -> bool:
    return kind.base.kind == "f" and int(np.prod(kind.shape)) > _FEW


def _size(kind: np.dtype[Any]) -> int:
    count = int(np.prod(kind.shape))
    if _is_surface(kind):
        return _STEP.itemsize + (count + 7) // 8 + 2 * count
    return 4 * count if _single(kind) else kind.itemsize


def _packed(values: Any) -> bytes:
    kind = np.dtype((values.dtype, values.shape))
    if _is_surface(kind):
        return _surface(values)
    return values.astype("<f4").tobytes() if _single(kind) else values.tobytes()


def _unpacked(data: bytes, kind: np.dtype[Any]) -> Any:
    if _is_surface(kind):
        return _surface_of(data, kind.shape)
    base = np.dtype("<f4") if _single(kind) else kind.base
    return np.frombuffer(data, base).reshape(kind.shape)


def _surface(w: NDArray[Any]) -> bytes:
    known = np.isfinite(w)
    largest = float(np.abs(w[known]).max(initial=0.0))
    # Differences that overflow are right again when they are summed.
    steps = np.zeros(w.shape, "<i2")
    if largest:
        steps[known] = np.round(w[known] / largest * _STEPS)
    for axis in (0, 1, 0, 1):
        steps = np.diff(
            steps, axis=axis, prepend=np.zeros_like(steps[:1] if axis == 0 else steps[:, :1])
        )
    halves = steps.view(np.uint8).reshape(-1, 2).T  # the upper ones are alike
    scale = np.array(largest / _STEPS, _STEP)
    return b"".join([scale.tobytes(), np.packbits(known).tobytes(), halves.tobytes()])


def _surface_of(data: bytes, shape: tuple[int, ...]) -> NDArray[Any]:
    count, begin = int(np.prod(shape)), _STEP.itemsize
    rest = begin + (count + 7) // 8
    scale = float(np.frombuffer(data, _STEP, 1)[0])
    known = np.unpackbits(np.frombuffer(data[begin:rest], np.uint8), count=count)
    halves = np.frombuffer(data[rest:], np.uint8).reshape(2, -1).T
    steps = np.ascontiguousarray(halves).view("<i2").reshape(shape)
    for axis in (0, 0, 1, 1):
        steps = np.cumsum(steps, axis=axis, dtype="<i2")
    return np.where(known.reshape(shape), scale * steps, np.nan)
