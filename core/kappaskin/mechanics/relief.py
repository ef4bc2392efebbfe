"""Objects with any underside: a map of heights, given or read from a picture."""

import io
import struct
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from tokenize import TokenError
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.mechanics.objects import check_sizes

_MOST = 2**24  # pixels
_LARGEST = 2**26  # bytes of a picture
_HIGHEST = 1.0  # m
_BLOCKS = 8  # along each side, each with its lowest pixel on the keel
# What numpy raises on files of other contents, or of shapes that are none.
_NO_ARRAY = (OSError, ValueError, TypeError, OverflowError, EOFError, SyntaxError, TokenError)


@dataclass(frozen=True, eq=False)
class HeightMap:
    """An object `length` along x by `width` along y in m with `heights` (ny, nx) in m below.

    They are those of its underside at the centres of equal pixels, counted from any level,
    infinite where there is none; row 0 has the least y, column 0 the least x. In between they are
    bilinear. Details finer than the pitch of a skin's nodes are felt only where a node meets them,
    and at the lowest pixel of each of 8 x 8 blocks.
    """

    heights: Array = field(repr=False)
    length: float
    width: float

    def __post_init__(self) -> None:
        check_sizes(f"a map of {self.length} x {self.width} m", self.length, self.width)
        if self.heights.ndim != 2 or not 0 < self.heights.size <= _MOST:
            raise Refusal(
                f"expected heights of shape (ny, nx), {_MOST} at most, got {self.heights.shape}"
            )
        if np.isnan(self.heights).any() or (self.heights == -np.inf).any():
            raise Refusal("expected heights in m, infinite where there is nothing, got NaN or -inf")
        if not np.isfinite(low := self.heights.min()):
            raise Refusal("expected an object, got a map with nothing in it")
        object.__setattr__(self, "heights", self.heights - low)

    @classmethod
    def read(cls, path: str | Path, length: float, width: float, relief: float) -> "HeightMap":
        """The stamp in an NPY file (ny, nx) or a grey PNG picture, `relief` in m high in all.

        The brightest pixels stand out furthest towards the skin. An array's row 0 has the least y,
        as `heights`; a picture's first row is the one on top, with the largest y.
        """
        reader = _READERS.get(Path(path).suffix.lower())
        if reader is None:
            raise Refusal(f"expected a file named .npy or .png, got {path}")
        pixels = reader(Path(path))
        if not np.isfinite(pixels).all():
            raise Refusal(f"expected finite pixels, got NaN or infinity in {path}; fill them in")
        if not 0 <= relief <= _HIGHEST:
            raise Refusal(
                f"expected a relief of at least zero in m, {_HIGHEST:g} at most, got {relief}"
            )
        low, high = float(pixels.min()), float(pixels.max())
        if not np.isfinite(high - low):
            raise Refusal(f"expected pixels of one size, got {low:g} to {high:g} in {path}")
        if low == high and relief:
            raise Refusal(f"{path} has no relief: all its pixels are {low:g}; give 0 m for a flat")
        # Not times relief / (high - low): of the smallest differences that is infinite.
        return cls((high - pixels) / ((high - low) or 1.0) * relief, length, width)

    @property
    def extent(self) -> tuple[float, float]:
        return self.length / 2, self.width / 2

    def height(self, points: Array) -> Array:
        ny, nx = self.heights.shape
        on = (np.abs(points) <= self.extent).all(axis=1)
        i, s = _between(points[:, 0], self.length, nx)
        j, t = _between(points[:, 1], self.width, ny)
        height = np.where(on, 0.0, np.inf)
        for row, across in ((j, 1 - t), (np.minimum(j + 1, ny - 1), t)):
            for column, along in ((i, 1 - s), (np.minimum(i + 1, nx - 1), s)):
                share = across * along
                # Zero times infinity is not a number, but a corner without share has no say.
                height += share * np.where(share > 0, self.heights[row, column], 0.0)
        return height

    def keel(self) -> Array:
        return self._lowest

    @cached_property
    def _lowest(self) -> Array:
        """The lowest pixel (k, 2) in m of each block."""
        places: list[tuple[float, float]] = []
        ny, nx = self.heights.shape
        for top, below in _blocks(ny):
            for left, right in _blocks(nx):
                block = self.heights[top:below, left:right]
                row, column = divmod(int(np.argmin(block)), right - left)
                places.append((left + column, top + row))
        return ((np.array(places) + 0.5) / (nx, ny) - 0.5) * (self.length, self.width)


def _blocks(count: int) -> Iterator[tuple[int, int]]:
    """Where each of the blocks begins and ends that divide `count` pixels."""
    blocks = min(count, _BLOCKS)
    return pairwise(count * block // blocks for block in range(blocks + 1))


def _between(x: Array, length: float, count: int) -> tuple[NDArray[np.intp], Array]:
    """The pixel (P,) before each x (P,), and how far x (P,) is from it to the next."""
    place = np.clip((x / length + 0.5) * count - 0.5, 0, count - 1)
    pixel = place.astype(np.intp)
    return pixel, place - pixel


def _check_pixels(path: Path, shape: tuple[int, ...]) -> None:
    if len(shape) != 2 or not 0 < shape[0] * shape[1] <= _MOST:
        raise Refusal(f"expected a map of (ny, nx) pixels, {_MOST} at most; {path} has {shape}")


def _read_array(path: Path) -> Array:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a header as Python 2 wrote it
            stored = cast("NDArray[Any]", np.lib.format.open_memmap(path, mode="r"))
    except _NO_ARRAY as error:
        raise Refusal(f"expected an array in {path}, as numpy.save writes it: {error}") from error
    _check_pixels(path, stored.shape)
    if stored.dtype.kind not in "buif":
        raise Refusal(f"expected real numbers in {path}, got {stored.dtype}")
    return np.array(stored, float)


def _read_picture(path: Path) -> Array:
    from PIL import Image  # slow to import, and seldom needed

    try:
        if path.stat().st_size > _LARGEST or not path.is_file():
            raise Refusal(f"expected a file of at most {_LARGEST} bytes, got {path}")
        # From memory: from a file Pillow takes as much of that as a length in it says.
        with Image.open(io.BytesIO(path.read_bytes()), formats=("PNG",)) as picture:
            _check_pixels(path, picture.size[::-1])
            if picture.mode not in ("1", "L", "I", "I;16"):
                raise Refusal(
                    f"expected a grey picture of 8 or 16 bits, got mode {picture.mode} in {path}; "
                    "save it as grey, without transparency"
                )
            return np.asarray(picture, float)[::-1]
    except Refusal:
        raise
    except (OSError, ValueError, SyntaxError, struct.error, Image.DecompressionBombError) as error:
        raise Refusal(f"expected a PNG picture in {path}: {error}") from error


_READERS: dict[str, Callable[[Path], Array]] = {".npy": _read_array, ".png": _read_picture}
