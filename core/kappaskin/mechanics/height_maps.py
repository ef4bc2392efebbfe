"""Rigid objects from files: height maps, grey pictures and triangle meshes."""

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

from kappaskin._files import open_file, read_file, why_unread
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.mechanics.rigid_objects import check_sizes
from kappaskin.skin import doubled_area, read_surface, repaired

_MOST_PIXELS = 2**24  # pixels
_LARGEST = 2**26  # bytes of a picture
_HIGHEST = 1.0  # m
_BLOCKS = 8  # along each side, each with its lowest pixel on the keel
# What numpy raises on files of other contents, or of shapes that are none.
_NO_ARRAY = (OSError, ValueError, TypeError, OverflowError, EOFError, SyntaxError, TokenError)


@dataclass(frozen=True, eq=False)
class HeightMap:
    """An object of `length` along x by `width` along y in m, whose underside has `heights` in m.

    `heights` (ny, nx) are those at the centres of equal pixels, above any level, infinite where
    there is no object; row 0 has the least y, column 0 the least x. Between them it is bilinear.
    Details finer than the pitch of a skin's nodes touch it only where a node meets them, and at
    the lowest pixel of each of 8 x 8 blocks.
    """

    heights: Array = field(repr=False)
    length: float
    width: float

    def __post_init__(self) -> None:
        check_sizes(f"a map of {self.length} x {self.width} m", self.length, self.width)
        if self.heights.ndim != 2 or not 0 < self.heights.size <= _MOST_PIXELS:
            raise Refusal(
                f"expected heights of shape (ny, nx), {_MOST_PIXELS} at most, got "
                f"{self.heights.shape}"
            )
        if np.isnan(self.heights).any() or (self.heights == -np.inf).any():
            raise Refusal("expected heights in m, infinite where there is nothing, got NaN or -inf")
        if not np.isfinite(low := self.heights.min()):
            raise Refusal("expected an object, got a map with nothing in it")
        object.__setattr__(self, "heights", self.heights - low)

    @classmethod
    def read(cls, path: str | Path, length: float, width: float, relief: float) -> "HeightMap":
        """A stamp from an NPY file (ny, nx) or a grey PNG picture, with `relief` in m in all.

        The brightest pixels stand out furthest towards the skin. Row 0 of an array has the least y,
        as in `heights`; the top row of a picture has the largest y. Raises a `Refusal` for a file
        that holds neither.
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
            raise Refusal(f"{path} has no relief: all its pixels are {low:g}; give 0 m if flat")
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
    """First and last pixel of each of the blocks that divide `count` pixels."""
    blocks = min(count, _BLOCKS)
    return pairwise(count * block // blocks for block in range(blocks + 1))


def _between(x: Array, length: float, count: int) -> tuple[NDArray[np.intp], Array]:
    """The pixel (P,) before each x (P,), and how far x (P,) is from it to the next."""
    place = np.clip((x / length + 0.5) * count - 0.5, 0, count - 1)
    pixel = place.astype(np.intp)
    return pixel, place - pixel


def _check_pixels(path: Path, shape: tuple[int, ...]) -> None:
    if len(shape) != 2 or not 0 < shape[0] * shape[1] <= _MOST_PIXELS:
        raise Refusal(
            f"expected a map of (ny, nx) pixels, {_MOST_PIXELS} at most; {path} has {shape}"
        )


def _read_array(path: Path) -> Array:
    try:
        open_file(path).close()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a header as Python 2 wrote it
            stored = cast("NDArray[Any]", np.lib.format.open_memmap(path, mode="r"))
    except _NO_ARRAY as error:
        raise Refusal(
            f"expected an array in {path}, as numpy.save writes it{why_unread(error)}"
        ) from error
    _check_pixels(path, stored.shape)
    if stored.dtype.kind not in "buif":
        raise Refusal(f"expected real numbers in {path}, got {stored.dtype}")
    return np.array(stored, float)


def _read_picture(path: Path) -> Array:
    from PIL import Image  # slow to import, and seldom needed

    try:
        # From memory: from a file Pillow takes as much of that as a length in it says.
        with Image.open(io.BytesIO(read_file(path, _LARGEST)), formats=("PNG",)) as picture:
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
        raise Refusal(f"expected a PNG picture in {path}{why_unread(error)}") from error


_READERS: dict[str, Callable[[Path], Array]] = {".npy": _read_array, ".png": _read_picture}


_MOST_TRIANGLES = 2_000_000  # triangles
_PIXELS = 256  # along the longer side of the map
_AT_ONCE = 2**18  # pixels tried against triangles at a time
_TRIED = 2**25  # pixels tried in all: many large triangles above each other take minutes
_SIZES = (1e-4, 1.0)  # m
_EDGE_ON = 1e-9  # pixels: a face seen with less area is seen from the side
_ON_EDGE = 1e-9  # of a face: a pixel as far beside it is on it


@dataclass(frozen=True, eq=False)
class Mesh:
    """A closed triangle mesh of `vertices` (V, 3) in m and `faces` (F, 3), pressed along -z.

    Its centre is that of its box. Its underside is mapped with 256 pixels along its longer side.
    """

    vertices: Array = field(repr=False)
    faces: NDArray[np.intp] = field(repr=False)

    def __post_init__(self) -> None:
        if self.vertices.shape[1:] != (3,) or self.faces.shape[1:] != (3,):
            raise Refusal(
                f"expected vertices (V, 3) and faces (F, 3), got {self.vertices.shape} and "
                f"{self.faces.shape}"
            )
        if not 4 <= len(self.faces) <= _MOST_TRIANGLES:
            raise Refusal(
                f"expected 4 to {_MOST_TRIANGLES} triangles, got {len(self.faces)}; simplify it"
            )
        if not 0 <= self.faces.min() <= self.faces.max() < len(self.vertices):
            raise Refusal(f"expected faces of {len(self.vertices)} vertices, got other numbers")
        if not np.isfinite(self.vertices).all():
            raise Refusal("expected finite vertices in m, got NaN or infinity")
        self._check_closed()
        size = np.ptp(self.vertices, axis=0)
        if not (size.max() <= _SIZES[1] and size.min() >= _SIZES[0]):
            raise Refusal(
                f"the mesh is {' x '.join(f'{side:.3g}' for side in size)} m: expected sides of "
                f"{_SIZES[0]:g} to {_SIZES[1]:g} m; a file in millimetres needs a unit of 1e-3"
            )

    def _check_closed(self) -> None:
        edges = np.sort(self.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        _, count = np.unique(edges @ (len(self.vertices), 1), return_counts=True)
        if (count % 2).any():
            raise Refusal(
                f"the mesh is not closed: {np.count_nonzero(count % 2)} of its edges have a face "
                "on one side only; fill its holes in a mesh program"
            )

    @classmethod
    def read(cls, path: str | Path, unit: float = 1.0) -> "Mesh":
        """The mesh in an STL, PLY or OBJ file whose unit of length is `unit` in m: 1e-3 for mm."""
        if not 0 < unit < np.inf:
            raise Refusal(f"expected a unit above zero in m, got {unit}")
        surface = read_surface(path, "m")
        if np.isfinite(surface.nodes).all():
            surface = repaired(surface, "merge")  # as most files have nodes of their own per face
        return cls(unit * surface.nodes, surface.triangles)

    @property
    def extent(self) -> tuple[float, float]:
        return self._underside.extent

    def height(self, points: Array) -> Array:
        return self._underside.height(points)

    def keel(self) -> Array:
        return self._underside.keel()

    @cached_property
    def _underside(self) -> HeightMap:
        low, high = self.vertices.min(axis=0), self.vertices.max(axis=0)
        length, width, _ = high - low
        nx, ny = np.maximum(_PIXELS * (high - low)[:2] / max(length, width), 1).round().astype(int)
        pixels = (self.vertices - low) / (length / nx, width / ny, 1.0) - (0.5, 0.5, 0.0)
        return HeightMap(_lowest(pixels[self.faces], int(nx), int(ny)), length, width)


def _lowest(triangles: Array, nx: int, ny: int) -> Array:
    """The least z (ny, nx) of `triangles` (F, 3, 3) over whole x < nx and y < ny; else infinite."""
    heights = np.full((ny, nx), np.inf)
    visible = np.abs(doubled_area(*np.moveaxis(triangles[..., :2], 1, 0))) > _EDGE_ON
    triangles = triangles[visible]
    first = np.maximum(np.ceil(triangles[..., :2].min(axis=1)), 0).astype(int)
    last = np.minimum(np.floor(triangles[..., :2].max(axis=1)), (nx - 1, ny - 1)).astype(int)
    across, up = np.maximum(last - first + 1, 0).T
    pixels = across * up
    if pixels.sum() > _TRIED:
        raise Refusal(
            f"the mesh has too many layers: its triangles cover {pixels.sum() / (nx * ny):.0f} "
            f"times the map, expected {_TRIED / (nx * ny):.0f} at most; simplify it"
        )
    batch = np.cumsum(pixels) // _AT_ONCE
    for number in range(int(batch.max(initial=0)) + 1):
        part = np.flatnonzero(batch == number)
        count = pixels[part]
        which = np.repeat(part, count)
        step = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
        x = first[which, 0] + step % across[which]
        y = first[which, 1] + step // across[which]
        np.minimum.at(heights, (y, x), _plane(triangles[which], np.column_stack([x, y])))
    return heights


def _plane(triangles: Array, place: Array) -> Array:
    """The z (P,) of each of `triangles` (P, 3, 3) at its `place` (P, 2); infinite beside it."""
    a, b, c = np.moveaxis(triangles[..., :2], 1, 0)
    whole = doubled_area(a, b, c)
    s, t = doubled_area(a, place, c) / whole, doubled_area(a, b, place) / whole
    shares = np.column_stack([1 - s - t, s, t])
    z = np.sum(shares * triangles[..., 2], axis=1)
    return np.where((shares >= -_ON_EDGE).all(axis=1), z, np.inf)
