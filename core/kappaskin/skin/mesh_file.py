"""Triangle meshes of skins from files: reading, faults and repairs, and places on them."""

import io
import os
import re
import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, cast

import numpy as np
import scipy

from kappaskin._files import check_memory, open_file, why_unread
from kappaskin.errors import Refusal
from kappaskin.frames import Array, Indices

UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "inch": 25.4e-3}
"""Units of length of mesh files, in m."""

_MOST_TRIANGLES = 2_000_000
_MEMORY = 20  # times the size of a file of triangles, that it takes in memory
_AT_ONCE = 2**19  # triangles tried against points at a time


@dataclass(frozen=True, eq=False)
class Surface:
    """A skin of `triangles` (F, 3) between `nodes` (n, 3) in m.

    The numbers of a triangle's nodes turn left as seen from outside.
    """

    nodes: Array = field(repr=False)
    triangles: Indices = field(repr=False)

    @cached_property
    def corners(self) -> Array:
        """The corners (F, 3, 3) of the triangles in m."""
        return self.nodes[self.triangles]

    @cached_property
    def normals(self) -> Array:
        """Outward normals (F, 3) of the triangles, of length their area in m²."""
        a, b, c = np.moveaxis(self.corners, 1, 0)
        return np.cross(b - a, c - a) / 2

    @cached_property
    def sides(self) -> Indices:
        """The sides (3F, 2) of the triangles as pairs of nodes, those of triangle t from 3t."""
        return self.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)

    @cached_property
    def edges(self) -> Indices:
        """The number (3F,) of the edge that each side is on."""
        ordered = np.sort(self.sides, axis=1)
        return np.unique(ordered @ (len(self.nodes), 1), return_inverse=True)[1]

    @cached_property
    def rim(self) -> Indices:
        """The sides (R, 2) that are no other triangle's; the skin is on their left."""
        return self.sides[np.bincount(self.edges)[self.edges] == 1]

    @cached_property
    def loops(self) -> list[Indices]:
        """The nodes of each closed loop of the rim in order, the skin on their left.

        The longest first. Raises a `Refusal` where the rim touches itself, or has no direction.
        """
        start, end = self.rim.T
        if not np.array_equal(np.unique(start), np.sort(end)):
            raise Refusal(
                "expected a rim of closed lines that do not touch, got one with branches; mend "
                "the faults of the mesh first"
            )
        after = dict(zip(start.tolist(), end.tolist(), strict=True))
        loops: list[Indices] = []
        while after:
            loop = [next(iter(after))]
            while (node := after.pop(loop[-1])) != loop[0]:
                loop.append(node)
            loops.append(np.array(loop))
        return sorted(loops, key=self._length, reverse=True)

    def _length(self, loop: Indices) -> float:
        points = self.nodes[loop]
        return float(np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1).sum())

    @cached_property
    def centres(self) -> tuple[scipy.spatial.cKDTree, float]:
        """A tree of the triangles' centres, and how far at most their corners are from them."""
        centres = self.corners.mean(axis=1)
        away = np.linalg.norm(self.corners - centres[:, None], axis=-1)
        return scipy.spatial.cKDTree(centres), float(away.max())


def read_surface(path: str | Path, unit: str) -> Surface:
    """The surface in an STL, OBJ or PLY file, whose `unit` of length is "m", "cm", "mm" or "inch".

    An STL file has no common nodes, each triangle has its own three: exactly equal ones are merged.
    Nothing else is mended, see `faults`. Polygons are cut into triangles; nodes of none are left
    out. Raises a `Refusal` for a file that holds no triangles, and for another unit: it has the
    size that the skin would have in each.
    """
    path = Path(path)
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise Refusal(f"expected a file named {', '.join(_READERS)}, got {path}")
    try:
        with open_file(path) as file:
            check_memory(_MEMORY * os.fstat(file.fileno()).st_size, f"the mesh {path}")
            nodes, triangles = reader(file.read())
    except Refusal as error:
        raise Refusal(f"{path}: {error}; export the mesh again") from error
    except _UNREADABLE as error:
        raise Refusal(
            f"{path}: expected a mesh as its name says{why_unread(error)}; export the mesh again"
        ) from error
    if not 0 < len(triangles) <= _MOST_TRIANGLES:
        raise Refusal(
            f"{path}: expected 1 to {_MOST_TRIANGLES:,} triangles, got {len(triangles):,}; export "
            "the mesh again"
        )
    if not 0 <= triangles.min() <= triangles.max() < len(nodes):
        raise Refusal(
            f"{path}: expected triangles of its {len(nodes)} nodes, got other numbers; export the "
            "mesh again"
        )
    surface = _used(Surface(nodes, triangles))
    if unit not in UNITS:
        sizes = " or ".join(f"{_size(surface.nodes)} {name}" for name in UNITS)
        raise Refusal(
            f"{path}: expected its unit, one of {', '.join(UNITS)}, got {unit or 'none'}; give the "
            f"one in which the skin has its size: {sizes}"
        )
    return Surface(UNITS[unit] * surface.nodes, surface.triangles)


def _size(nodes: Array) -> str:
    return " x ".join(f"{side:.3g}" for side in np.ptp(nodes, axis=0))


def _used(surface: Surface) -> Surface:
    """The surface without nodes of no triangle."""
    used, triangles = np.unique(surface.triangles, return_inverse=True)
    return Surface(surface.nodes[used], triangles)


def _equal(nodes: Array) -> Indices:
    """A number (n,) for each of `nodes` (n, 3), the same for exactly equal ones."""
    order = np.lexsort(nodes.T)
    new = (np.diff(nodes[order], axis=0) != 0).any(axis=1)
    number = np.zeros(len(nodes), np.intp)
    number[order[1:]] = np.cumsum(new)
    return number


def _joined(surface: Surface, number: Indices) -> Surface:
    """The surface with the nodes of the same `number` (n,), from zero, joined to the first."""
    _, first = np.unique(number, return_index=True)
    return Surface(surface.nodes[first], number[surface.triangles])


# What NumPy and trimesh raise on files of other contents.
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
_Mesh = tuple[Array, Indices]


def _numbers(lines: list[bytes]) -> Array:
    """The first three numbers (n, 3) of each of the `lines`."""
    if not lines:
        raise Refusal("expected a mesh of nodes and triangles, found none")
    return np.loadtxt(io.BytesIO(b"\n".join(lines)), usecols=(0, 1, 2), ndmin=2)


_STL = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("colour", "<u2")])


def _read_stl(content: bytes) -> _Mesh:
    count = int.from_bytes(content[80:84], "little")
    if len(content) >= 84 and len(content) == 84 + count * _STL.itemsize:
        corners = np.frombuffer(content, _STL, offset=84)["corners"].reshape(-1, 3).astype(float)
    elif content.lstrip()[:5].lower() == b"solid":
        corners = _numbers(re.findall(rb"\bvertex\s([^\r\n]*)", content, re.IGNORECASE))
        if len(corners) % 3 or not re.search(rb"\bendsolid\b", content[-1000:], re.IGNORECASE):
            raise Refusal("expected `endsolid` after whole triangles, got an STL text that is cut")
    else:
        raise Refusal(
            "expected an STL text that begins with `solid`, or 84 bytes and 50 for each triangle, "
            f"got {len(content)} bytes"
            + (f" where {count} triangles are announced" if len(content) >= 84 else "")
        )
    soup = Surface(corners, np.arange(len(corners)).reshape(-1, 3))
    merged = _joined(soup, _equal(corners))
    return merged.nodes, merged.triangles


def _read_obj(content: bytes) -> _Mesh:
    content = content.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ")  # lines that go on
    nodes = _numbers(re.findall(rb"^[ \t]*v[ \t]([^\r\n]*)", content, re.MULTILINE))
    faces = list(re.finditer(rb"^[ \t]*f[ \t]([^\r\n#]*)", content, re.MULTILINE))
    # Of a corner such as 7/3/2 only the first number is its node.
    rows = [re.sub(rb"/\S*", b"", face[1]).split() for face in faces]
    sizes = np.array([len(row) for row in rows], np.intp)
    numbers = np.array([corner for row in rows for corner in row]).astype(np.intp)
    if (numbers < 0).any():  # counted back from the nodes before the line
        before = [node.start() for node in re.finditer(rb"^[ \t]*v[ \t]", content, re.MULTILINE)]
        passed = np.searchsorted(before, [face.start() for face in faces])
        numbers += np.where(numbers < 0, np.repeat(passed, sizes) + 1, 0)
    return nodes, _fans(numbers - 1, sizes)


def _fans(numbers: Indices, sizes: Indices) -> Indices:
    """The triangles (F, 3) of polygons of `sizes` nodes, whose `numbers` follow one another."""
    first = np.cumsum(sizes) - sizes
    count = np.maximum(sizes - 2, 0)
    polygon = np.repeat(np.arange(len(sizes)), count)
    step = np.arange(len(polygon)) - (np.cumsum(count) - count)[polygon]
    corner = first[polygon] + step
    return np.column_stack([numbers[first[polygon]], numbers[corner + 1], numbers[corner + 2]])


def _read_ply(content: bytes) -> _Mesh:
    from trimesh.exchange import ply  # slow to import, and seldom needed

    load = cast("Any", ply).load_ply  # not typed throughout
    with np.errstate(all="ignore"):
        mesh = load(io.BytesIO(content), fix_texture=False, skip_materials=True)
    polygons = np.asarray(mesh.get("faces", np.zeros((0, 3))), np.intp)
    announced = {name: part["length"] for name, part in mesh["metadata"]["_ply_raw"].items()}
    if len(polygons) < announced.get("face", 0) or len(mesh["vertices"]) < announced["vertex"]:
        raise Refusal(
            f"expected {announced['vertex']} nodes and {announced.get('face', 0)} polygons as the "
            f"file announces, got {len(mesh['vertices'])} and {len(polygons)}"
        )
    sizes = np.full(len(polygons), polygons.shape[1])
    return np.array(mesh["vertices"], float), _fans(polygons.ravel(), sizes)


_READERS: dict[str, Callable[[bytes], _Mesh]] = {
    ".stl": _read_stl,
    ".obj": _read_obj,
    ".ply": _read_ply,
}


def placed(surface: Surface, points: Array) -> tuple[Indices, Array, Array]:
    """The places on the surface nearest to `points` (P, 3) in m.

    The triangle (P,), the shares (P, 3) of its corners (barycentric coordinates), and the distance
    (P,) in m.
    """
    tree, most = surface.centres
    triangle = np.zeros(len(points), np.intp)
    shares, distance = np.zeros((len(points), 3)), np.full(len(points), np.inf)
    left, count = np.arange(len(points)), 16
    while len(left):
        count = min(4 * count, len(surface.triangles))
        batches = np.array_split(left, -(-len(left) * count // _AT_ONCE))
        left = left[:0]
        for batch in batches:
            far, near = (
                np.reshape(of, (len(batch), -1)) for of in tree.query(points[batch], count)
            )
            near = near.astype(np.intp)
            found, away = _nearest(surface.corners[near], points[batch, None])
            best = away.argmin(axis=1)
            row = np.arange(len(batch))
            triangle[batch], shares[batch] = near[row, best], found[row, best]
            distance[batch] = away[row, best]
            # All others are further: their centres are further than this by more than `most`.
            if count < len(surface.triangles):
                left = np.append(left, batch[far[:, -1] - most < distance[batch]])
    return triangle, shares, distance


def _nearest(corners: Array, point: Array) -> tuple[Array, Array]:
    """The shares (..., 3) of `corners` (..., 3, 3) of triangles nearest to a point (..., 3).

    Also how far (...) it is.
    """
    a: Array = corners[..., 0, :]
    u, v, w = corners[..., 1, :] - a, corners[..., 2, :] - a, point - a
    uu, uv, vv, uw, vw = (
        np.sum(p * q, axis=-1) for p, q in ((u, u), (u, v), (v, v), (u, w), (v, w))
    )
    area = uu * vv - uv * uv
    with np.errstate(divide="ignore", invalid="ignore"):  # of triangles without area
        s, t = (vv * uw - uv * vw) / area, (uu * vw - uv * uw) / area
    inside = (s >= 0) & (t >= 0) & (s + t <= 1) & (area > 0)
    # On the sides a b, a c and b c: the nearest point of each.
    p, q = _share(uw, uu), _share(vw, vv)
    r = _share(vw - uw + uu - uv, uu - 2 * uv + vv)
    zero = np.zeros_like(p)
    tried_s = np.stack([np.where(inside, s, p), p, zero, 1 - r])
    tried_t = np.stack([np.where(inside, t, zero), zero, q, r])
    away = np.linalg.norm(tried_s[..., None] * u + tried_t[..., None] * v - w, axis=-1)
    best = away.argmin(axis=0)[None]
    s, t = (np.take_along_axis(tried, best, 0)[0] for tried in (tried_s, tried_t))
    return np.stack([np.maximum(1 - s - t, 0), s, t], axis=-1), np.take_along_axis(away, best, 0)[0]


def _share(part: Array, whole: Array) -> Array:
    """The part of a side up to a foot on it, from 0 to 1; of a side without length 0."""
    return np.minimum(np.maximum(part / np.maximum(whole, np.finfo(float).tiny), 0), 1)
