"""Disk cache of arrays that take seconds to compute, in the user's cache folder."""

import hashlib
import io
import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import platformdirs
import scipy

from kappaskin.frames import Array

_MEANING = 1  # to be changed by whatever makes other arrays of the same key
_MOST = 16  # files
_MARK = hashlib.sha256().digest_size  # bytes: what a file begins with
_LARGEST = 64_000_000  # bytes of one: more is read no faster than it is computed


def cached(key: str, compute: Callable[[], dict[str, Array]]) -> dict[str, Array]:
    """The arrays of `compute()`, by name: read from the cache where `key` is there.

    The same bits whether cached or computed. A damaged file and those of other versions of numpy
    or scipy are not used; where none can be written, the arrays are computed every time.
    """
    versioned = f"{_MEANING} {np.__version__} {scipy.__version__} {key}"
    file = _folder() / f"{hashlib.sha256(versioned.encode()).hexdigest()[:24]}.npz"
    with suppress(OSError):
        data = file.read_bytes()
        if data.startswith(_mark(data[_MARK:])):
            file.touch()  # the oldest go first
            return dict(np.load(io.BytesIO(data[_MARK:])))
    arrays = compute()
    if sum(values.nbytes for values in arrays.values()) <= _LARGEST:
        with suppress(OSError):
            _write(file, arrays)
    return arrays


def _mark(data: bytes) -> bytes:
    return hashlib.sha256(data).digest()


def _folder() -> Path:
    return platformdirs.user_cache_path("kappaskin", appauthor=False) / "modes"


def _write(file: Path, arrays: dict[str, Array]) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    part = file.with_suffix(f".{os.getpid()}")  # whole when it has its name
    made = io.BytesIO()
    np.savez(made, **arrays)  # pyright: ignore[reportArgumentType]
    data = made.getvalue()
    try:
        part.write_bytes(_mark(data) + data)
        part.replace(file)
    finally:
        part.unlink(missing_ok=True)
    there = sorted(file.parent.iterdir(), key=lambda one: one.stat().st_mtime, reverse=True)
    for old in there[_MOST:]:
        old.unlink(missing_ok=True)
