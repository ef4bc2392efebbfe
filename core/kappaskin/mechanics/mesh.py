"""Objects of triangles, from STL, PLY or OBJ files: their underside as a map of heights."""

import struct
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.mechanics.relief import HeightMap
from kappaskin.skin import turn

_FILES = (".stl", ".ply", ".obj")
_MOST = 2_000_000  # triangles
_PIXELS = 256  # along the longer side of the map
_AT_ONCE = 2**18  # pixels tried against triangles at a time
_TRIED = 2**25  # pixels tried in all: many large triangles above each other take minutes
_SIZES = (1e-4, 1.0)  # m
_EDGE_ON = 1e-9  # pixels: a face seen with less area is seen from the side
_ON_EDGE = 1e-9  # of a face: a pixel as far beside it is on it
# What trimesh raises on files of other contents, a local variable that was never set among it.
_UNREADABLE = (
    OSError,
    ValueError,
    LookupError,
    TypeError,
    AttributeError,
    ArithmeticError,
    NameError,
    struct.error,
)


@dataclass(frozen=True, eq=False)
class Mesh:
    """A closed surface of `vertices` (V, 3) in m and `faces` (F, 3), pressed along -z.

    Its centre is that of its box. Only its underside matters, seen from below; 256 pixels
    along its longer side map it.
    """

    vertices: Array = field(repr=False)
    faces: NDArray[np.intp] = field(repr=False)

    def __post_init__(self) -> None:
        if self.vertices.shape[1:] != (3,) or self.faces.shape[1:] != (3,):
            raise Refusal(
                f"expected vertices (V, 3) and faces (F, 3), got {self.vertices.shape} and "
                f"{self.faces.shape}"
            )
        if not 4 <= len(self.faces) <= _MOST:
            raise Refusal(f"expected 4 to {_MOST} triangles, got {len(self.faces)}; simplify it")
        if not 0 <= self.faces.min() <= self.faces.max() < len(self.vertices):
            raise Refusal(f"expected faces of {len(self.vertices)} vertices, got others' numbers")
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
                "on one side only; fill its holes, as a program for meshes can"
            )

    @classmethod
    def read(cls, path: str | Path, unit: float = 1.0) -> "Mesh":
        """The object in an STL, PLY or OBJ file whose lengths are in `unit`, in m: 1e-3 for mm."""
        import trimesh  # slow to import, and seldom needed

        if Path(path).suffix.lower() not in _FILES:
            raise Refusal(f"expected a file named {', '.join(_FILES)}, got {path}")
        if not 0 < unit < np.inf:
            raise Refusal(f"expected a unit above zero in m, got {unit}")
        try:
            with np.errstate(all="ignore"):  # what is no number is refused below
                mesh = cast("Any", trimesh).load_mesh(str(path))  # not typed throughout
        except _UNREADABLE as error:
            raise Refusal(f"cannot read a mesh from {path}: {error}") from error
        if not len(mesh.faces):
            raise Refusal(f"expected triangles in {path}, found none; export the object again")
        return cls(unit * np.array(mesh.vertices, float), np.array(mesh.faces, np.intp))

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
    seen = np.abs(turn(*np.moveaxis(triangles[..., :2], 1, 0))) > _EDGE_ON
    triangles = triangles[seen]
    first = np.maximum(np.ceil(triangles[..., :2].min(axis=1)), 0).astype(int)
    last = np.minimum(np.floor(triangles[..., :2].max(axis=1)), (nx - 1, ny - 1)).astype(int)
    across, up = np.maximum(last - first + 1, 0).T
    pixels = across * up
    if pixels.sum() > _TRIED:
        raise Refusal(
            f"the mesh lies in too many layers: its triangles cover {pixels.sum() / (nx * ny):.0f} "
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
    whole = turn(a, b, c)
    s, t = turn(a, place, c) / whole, turn(a, b, place) / whole
    shares = np.column_stack([1 - s - t, s, t])
    z = np.sum(shares * triangles[..., 2], axis=1)
    return np.where((shares >= -_ON_EDGE).all(axis=1), z, np.inf)
