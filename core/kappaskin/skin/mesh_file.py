"""Triangle meshes of skins from files: reading, faults and repairs, and places on them."""

import io
import os
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, cast

import numpy as np
import scipy
from numpy.typing import ArrayLike

from kappaskin._files import check_memory, open_file, why_unread
from kappaskin.errors import Refusal
from kappaskin.frames import Array, Indices, Mask

UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "inch": 25.4e-3}
"""Units of length of mesh files, in m."""

_MOST_TRIANGLES = 2_000_000
_MEMORY = 20  # times the size of a file of triangles, that it takes in memory
_AT_ONCE = 2**19  # triangles tried against points at a time


@dataclass(frozen=True, eq=False)
class MeshSurface:
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
    def centres(self) -> Array:
        """The centres (F, 3) of the triangles in m."""
        return self.corners.mean(axis=1)

    @cached_property
    def normals(self) -> Array:
        """Outward normals (F, 3) of the triangles, of length their area in m²."""
        a, b, c = np.moveaxis(self.corners, 1, 0)
        return np.cross(b - a, c - a) / 2

    @cached_property
    def angles(self) -> Array:
        """The angles (F, 3) in rad at the corners of the triangles; zero at a side of no length."""
        onward = np.roll(self.corners, -1, axis=1) - self.corners
        across = np.linalg.norm(2 * self.normals, axis=1, keepdims=True)
        return np.arctan2(across, -np.sum(onward * np.roll(onward, 1, axis=1), axis=-1))

    @cached_property
    def smallest(self) -> Array:
        """The smallest angle (F,) in rad of each triangle."""
        return self.angles.min(axis=1)

    @cached_property
    def sides(self) -> Indices:
        """The sides (3F, 2) of the triangles as pairs of nodes, those of triangle t from 3t."""
        return self.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)

    @cached_property
    def _edges(self) -> tuple[Indices, Indices]:
        ordered = np.sort(self.sides, axis=1)
        key, edge = np.unique(ordered @ (len(self.nodes), 1), return_inverse=True)
        return np.column_stack(np.divmod(key, len(self.nodes))), edge

    @property
    def edges(self) -> Indices:
        """The edges (E, 2) as pairs of nodes, the lower number first."""
        return self._edges[0]

    @property
    def edge_of(self) -> Indices:
        """The number (3F,) of the edge that each side is on."""
        return self._edges[1]

    @cached_property
    def counts(self) -> Indices:
        """How many triangles (E,) each edge has: one at the rim, else two."""
        return np.bincount(self.edge_of)

    @cached_property
    def rim(self) -> Indices:
        """The sides (R, 2) that are no other triangle's; the skin is on their left."""
        return self.sides[self.counts[self.edge_of] == 1]

    @cached_property
    def meeting(self) -> Indices:
        """Pairs (K, 2) of sides that are on the same edge."""
        order = np.argsort(self.edge_of, kind="stable")
        same = np.diff(self.edge_of[order]) == 0
        return np.column_stack([order[:-1], order[1:]])[same]

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

    def part(self, of: Mask) -> "MeshSurface":
        """The surface of the triangles in `of` (F,) alone, with all nodes; itself if of all."""
        return self if of.all() else MeshSurface(self.nodes, self.triangles[of])

    def _length(self, loop: Indices) -> float:
        points = self.nodes[loop]
        return float(np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1).sum())

    @cached_property
    def tree(self) -> "tuple[scipy.spatial.cKDTree, float]":
        """A tree of the triangles' centres, and how far at most their corners are from them."""
        away = np.linalg.norm(self.corners - self.centres[:, None], axis=-1)
        return scipy.spatial.cKDTree(self.centres), float(away.max())


def read_surface(path: str | Path, unit: str) -> MeshSurface:
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
            f"cannot read a mesh from {path}{why_unread(error)}; expected an STL, OBJ or PLY file "
            "as its name says; export the mesh again"
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
    surface = _used(MeshSurface(nodes, triangles))
    if unit not in UNITS:
        sizes = " or ".join(f"{_size(surface.nodes)} {name}" for name in UNITS)
        raise Refusal(
            f"{path}: expected its unit, one of {', '.join(UNITS)}, got {unit or 'none'}; give the "
            f"one in which the skin has its size: {sizes}"
        )
    return MeshSurface(UNITS[unit] * surface.nodes, surface.triangles)


def _size(nodes: Array) -> str:
    return " x ".join(f"{side:.3g}" for side in np.ptp(nodes, axis=0))


def _used(surface: MeshSurface) -> MeshSurface:
    """The surface without nodes of no triangle; itself if there are none."""
    used, triangles = np.unique(surface.triangles, return_inverse=True)
    if len(used) == len(surface.nodes):
        return surface
    return MeshSurface(surface.nodes[used], triangles)


def _equal(nodes: Array | Indices) -> Indices:
    """A number (n,) for each of `nodes` (n, 3), the same for exactly equal ones."""
    order = np.lexsort(nodes.T)
    new = (np.diff(nodes[order], axis=0) != 0).any(axis=1)
    number = np.zeros(len(nodes), np.intp)
    number[order[1:]] = np.cumsum(new)
    return number


def _joined(surface: MeshSurface, number: Indices) -> MeshSurface:
    """The surface with the nodes of the same `number` (n,), from zero, joined to the first."""
    _, first = np.unique(number, return_index=True)
    if len(first) == len(number):
        return surface
    return MeshSurface(surface.nodes[first], number[surface.triangles])


# What NumPy and trimesh raise on files of other contents.
_UNREADABLE = (
    OSError,
    ValueError,
    LookupError,
    TypeError,
    AttributeError,
    ArithmeticError,
    NameError,
)
_Mesh = tuple[Array, Indices]


def _numbers(lines: list[bytes]) -> Array:
    """The first three numbers (n, 3) of each of the `lines`."""
    if not lines:
        raise Refusal("expected a mesh of nodes and triangles, found none")
    # A line of less, or of a comment alone, is an error, none is passed over.
    text = io.BytesIO(b"\n".join(lines))
    return np.loadtxt(text, comments=None, usecols=(0, 1, 2), ndmin=2)


_STL = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("colour", "<u2")])


def _read_stl(content: bytes) -> _Mesh:
    count = int.from_bytes(content[80:84], "little")
    if len(content) >= 84 and len(content) == 84 + count * _STL.itemsize:
        corners = np.frombuffer(content, _STL, offset=84)["corners"].reshape(-1, 3).astype(float)
    elif content.lstrip()[:5].lower() == b"solid":
        corners = _numbers(re.findall(rb"\bvertex\s+(\S[^\r\n]*)", content, re.IGNORECASE))
        if len(corners) % 3 or not re.search(rb"\bendsolid\b", content[-1000:], re.IGNORECASE):
            raise Refusal("expected `endsolid` after whole triangles, got an STL text that is cut")
    else:
        announced = f" where {count} triangles are announced" if len(content) >= 84 else ""
        is_text = len(content) > 0 and content.isascii()
        found = "another text" if is_text else f"{len(content)} bytes{announced}"
        raise Refusal(
            "expected an STL text that begins with `solid`, or 84 bytes and 50 for each triangle, "
            f"got {found}"
        )
    soup = MeshSurface(corners, np.arange(len(corners)).reshape(-1, 3))
    merged = _joined(soup, _equal(corners))
    return merged.nodes, merged.triangles


def _read_obj(content: bytes) -> _Mesh:
    content = content.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ")  # lines that go on
    nodes = _numbers(re.findall(rb"^[ \t]*v[ \t]+(\S[^\r\n]*)", content, re.MULTILINE))
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


@dataclass(frozen=True, eq=False)
class MeshFault:
    """What a mesh has that a skin cannot have: its `kind`, and where, at `places` (k, 3) in m.

    The `message` has what was expected, what came and what to do. The `repair` is the one of
    `REPAIRS` that mends it, None where a person must.
    """

    kind: str
    message: str
    places: Array = field(repr=False)
    repair: str | None = None


_SIZES = (0.5e-3, 1.0)  # m
_COUNTS = (200, 20_000)  # triangles
# Stiffnesses grow as the cotangent of the smallest angle and second derivatives as its square: 800
# at 2 degrees, so that of the 6 to 8 digits which a factorisation of bending leaves 3 are lost.
_SHARPEST = np.radians(2.0)
_FLAT = 1e-6  # rad: a triangle with a smaller angle has no area
_JOINT = 1e-5  # of the size: nodes of the rim that are nearer are one

_KINDS: dict[str, tuple[str, str | None]] = {
    "not finite": (
        "expected finite coordinates, got NaN or infinity at {count:,} nodes; export the mesh "
        "again",
        None,
    ),
    "size": (
        "expected a skin of 0.5 mm to 1 m, got {size} m; give the unit of the file",
        None,
    ),
    "too many": (
        "expected at most 20,000 triangles, got {count:,}; decimate them, or export the mesh "
        "coarser",
        "decimate",
    ),
    "too few": ("expected at least 200 triangles, got {count}; export the mesh finer", None),
    "not merged": (
        "expected triangles that share their nodes, got {count:,} nodes of rims at the places of "
        "others; merge them",
        "merge",
    ),
    "duplicate": ("expected each triangle once, got {count:,} again; remove them", "remove"),
    "no area": ("expected triangles with an area, got {count:,} without; remove them", "remove"),
    "sliver": (
        "expected triangles with angles of 2 degrees or more, got {count:,} with less; mesh the "
        "shape anew with even triangles",
        None,
    ),
    "wall": (
        "expected one or two triangles at an edge, got more at {count:,} edges; remove the inner "
        "walls in a mesh program",
        None,
    ),
    "one-sided": (
        "expected a skin with two sides, got a part whose outside leads to its inside; cut it in "
        "a mesh program",
        None,
    ),
    "flipped": (
        "expected triangles that all face outward, got {count:,} of {all:,} that face the other "
        "way; orient them",
        "orient",
    ),
    "inside out": (
        "expected an outside that mostly faces along {outward}, got the inside; orient the "
        "surface, or give the opposite direction",
        "orient",
    ),
    "parts": (
        "expected one part, got {parts:,}, with {count:,} of {all:,} triangles outside the "
        "largest; keep that, or join them in a mesh program",
        "keep largest part",
    ),
    "pinched": (
        "expected triangles that are one fan around each node, got several fans at {count:,} "
        "nodes; widen or cut the skin there in a mesh program",
        None,
    ),
    "closed": (
        "expected a skin with a rim to hold it by, got a closed surface; cut it in a mesh program "
        "where the skin ends",
        None,
    ),
    "hole": (
        "expected one rim, got {holes:,} more, the longest {longest:.3g} mm around; fill the holes "
        "in a mesh program",
        None,
    ),
}


def _fault(kind: str, places: Array, **came: Any) -> MeshFault:
    text, repair = _KINDS[kind]
    return MeshFault(kind, text.format(**{"count": len(places), **came}), places, repair)


def faults(surface: MeshSurface, outward: Array | None = None) -> list[MeshFault]:
    """What keeps the surface from being a skin: one part, with one rim, of regular triangles.

    `outward` (3,) is a direction that the outside mostly faces. One cause is found once: each kind
    is looked for in what the repairs of those before it make of the surface, which itself stays as
    it is.
    """
    finite = np.isfinite(np.abs(surface.nodes).max(axis=1))
    if not finite.all():
        beside = surface.triangles[~np.all(finite[surface.triangles], axis=1)]
        known = surface.nodes[np.intersect1d(beside, np.flatnonzero(finite))]
        return [_fault("not finite", known, count=np.count_nonzero(~finite))]
    with np.errstate(over="ignore"):
        longest = np.ptp(surface.nodes, axis=0).max()
    if not _SIZES[0] <= longest <= _SIZES[1]:
        return [_fault("size", surface.nodes.mean(axis=0)[None], size=_size(surface.nodes))]
    return [fault for fault in _faults(surface, outward) if len(fault.places)]


def _faults(surface: MeshSurface, outward: Array | None) -> Iterator[MeshFault]:
    """A fault of each kind in finite nodes, without places where there is none."""
    F, middle, nowhere = len(surface.triangles), surface.nodes.mean(axis=0)[None], np.zeros((0, 3))
    yield _fault("too many", middle if _COUNTS[1] < F else nowhere, count=F)
    yield _fault("too few", middle if _COUNTS[0] > F else nowhere, count=F)
    first = np.unique(number := _coincident(surface), return_index=True)[1]
    yield _fault("not merged", np.delete(surface.nodes, first, axis=0))
    surface = _joined(surface, number)
    copy = _copies(surface.triangles)
    yield _fault("duplicate", surface.centres[copy])
    yield _fault("no area", surface.centres[~copy & (surface.smallest < _FLAT)])
    surface = repaired(surface, "remove")
    if not len(surface.triangles):
        return
    yield _fault("sliver", surface.centres[surface.smallest < _SHARPEST])
    walls = surface.edges[surface.counts > 2]
    yield _fault("wall", surface.nodes[walls].mean(axis=1))
    turned, one_sided = _turned(surface)
    yield _fault("one-sided", surface.centres[one_sided])
    yield _fault("flipped", surface.centres[turned & ~one_sided], all=len(turned))
    surface = repaired(surface, "orient")
    inverted = outward is not None and surface.normals.sum(axis=0) @ outward < 0
    yield _fault("inside out", middle if inverted else nowhere, outward=outward)
    part, largest = _parts(surface)
    yield _fault("parts", surface.centres[part != largest], parts=part.max() + 1, all=len(part))
    surface = repaired(surface, "keep largest part")
    yield _fault("pinched", surface.nodes[_pinched(surface)])
    yield _fault("closed", nowhere if len(surface.rim) else middle)
    sides = surface.nodes[surface.rim]
    group = _linked(surface.rim, len(surface.nodes))[surface.rim[:, 0]]
    loop = np.unique(group, return_inverse=True)[1]
    length = 1e3 * np.bincount(loop, np.linalg.norm(sides[:, 1] - sides[:, 0], axis=1), 1)
    holes = np.delete(length, longest := int(length.argmax()))
    inner = sides[loop != longest].mean(axis=1)
    yield _fault("hole", inner, holes=len(holes), longest=holes.max(initial=0))


def _linked(pairs: Indices, count: int) -> Indices:
    """The number (count,) of the group that each of so many is in, of those linked by `pairs`."""
    links = scipy.sparse.coo_array((np.ones(len(pairs), bool), pairs.T), (count, count))
    return scipy.sparse.csgraph.connected_components(links, directed=False)[1].astype(np.intp)


def _coincident(surface: MeshSurface) -> Indices:
    """A number (n,) for each node, from zero, the same for nodes of the rim at one place."""
    rim = np.unique(surface.rim)
    number = _equal(surface.nodes[rim])
    first = rim[np.unique(number, return_index=True)[1]]
    size = np.ptp(surface.nodes, axis=0).max() or 1.0
    near = scipy.spatial.cKDTree(surface.nodes[first] / size).query_pairs(
        _JOINT, output_type="ndarray"
    )
    pairs = np.concatenate([np.column_stack([rim, first[number]]), first[near]])
    return _linked(pairs, len(surface.nodes))


def _copies(triangles: Indices) -> Mask:
    """Which triangles (F,) have the nodes of one before."""
    copy = np.ones(len(triangles), bool)
    copy[np.unique(_equal(np.sort(triangles, axis=1)), return_index=True)[1]] = False
    return copy


def _turned(surface: MeshSurface) -> tuple[Mask, Mask]:
    """Which triangles (F,) face the other way than most of their part, and which have no side."""
    s, t = surface.meeting[surface.counts[surface.edge_of[surface.meeting[:, 0]]] == 2].T
    alike = surface.sides[s, 0] != surface.sides[t, 0]
    F = len(surface.triangles)
    # Each triangle is there twice, facing either way: those that can be reached face alike.
    here, there = s // 3, t // 3 + np.where(alike, 0, F)
    pairs = np.column_stack([np.append(here, here + F), np.append(there, (there + F) % (2 * F))])
    either = _linked(pairs, 2 * F).reshape(2, F)
    turned, part = either[0] > either[1], either.min(axis=0)
    share = np.bincount(part, turned) / np.maximum(np.bincount(part), 1)
    return turned ^ (share > 0.5)[part], either[0] == either[1]


def _parts(surface: MeshSurface) -> tuple[Indices, int]:
    """The number (F,) of the part that each triangle is in, and that of the largest by area."""
    part = _linked(surface.meeting // 3, len(surface.triangles))
    return part, int(np.bincount(part, np.linalg.norm(surface.normals, axis=1)).argmax())


def _pinched(surface: MeshSurface) -> Indices:
    """The nodes whose triangles are several fans that meet there alone."""
    s, t = surface.meeting.T
    # The first and second end of one side are the second and first of the other, or not if flipped.
    ends = np.column_stack([np.arange(len(surface.sides)), _next(np.arange(len(surface.sides)))])
    alike = surface.sides[s, 0] == surface.sides[t, 1]
    other = np.where(alike[:, None], ends[t][:, ::-1], ends[t])
    fan = _linked(np.column_stack([ends[s].ravel(), other.ravel()]), len(surface.sides))
    node_of_fan = np.zeros(fan.max() + 1, np.intp)
    node_of_fan[fan] = surface.triangles.ravel()
    return np.flatnonzero(np.bincount(node_of_fan) > 1)


def _next(side: Indices) -> Indices:
    """The side, or corner, that follows in the same triangle."""
    return side // 3 * 3 + (side + 1) % 3


REPAIRS = ("merge", "remove", "orient", "keep largest part", "decimate")
"""The safe repairs of a surface."""


def repaired(
    surface: MeshSurface, repair: str, outward: Array | None = None, most: int = _COUNTS[1]
) -> MeshSurface:
    """The surface after a `repair`, one of `REPAIRS`.

    `merge` joins nodes of rims that are nearer than 1e-5 of the skin's size; `remove` takes away
    duplicates, and triangles without area by collapsing their shortest side; `orient` makes the
    triangles of each part face as most of it, and the whole `outward` (3,) if that is given; `keep
    largest part` is by area; `decimate` collapses edges, those first that are short and on flat
    places, to `most` triangles or the few more that cannot go, and keeps the shape of the rim.
    """
    match repair:
        case "merge":
            surface = _joined(surface, _coincident(surface))
        case "remove":
            surface = _remove(surface)
        case "orient":
            surface = _orient(surface, outward)
        case "keep largest part":
            part, largest = _parts(surface)
            surface = surface.part(part == largest)
        case "decimate":
            surface = _decimate(surface, most)
        case _:
            raise Refusal(f"expected a repair, one of {', '.join(REPAIRS)}, got {repair}")
    return _used(surface)


def _orient(surface: MeshSurface, outward: Array | None) -> MeshSurface:
    turned, one_sided = _turned(surface)
    turned &= ~one_sided
    normal: Array = np.where(turned, -1.0, 1.0) @ surface.normals
    if outward is not None and normal @ outward < 0:
        turned = ~turned
    triangles = np.where(turned[:, None], surface.triangles[:, ::-1], surface.triangles)
    return MeshSurface(surface.nodes, triangles) if turned.any() else surface


def _remove(surface: MeshSurface) -> MeshSurface:
    copy = _copies(surface.triangles)
    surface = surface.part(~copy & _distinct(surface.triangles))
    while len(flat := np.flatnonzero(surface.smallest < _FLAT)):
        along = np.roll(surface.corners[flat], -1, axis=1) - surface.corners[flat]
        short = surface.edge_of[3 * flat + np.linalg.norm(along, axis=-1).argmin(axis=1)]
        of = np.isin(np.arange(len(surface.edges)), short)
        mended = _collapsed(surface, _errors(surface), of, len(of))[0]
        if len(mended.triangles) == len(surface.triangles):
            break
        surface = mended
    return surface


def _decimate(surface: MeshSurface, most: int) -> MeshSurface:
    errors, before = _errors(surface), 0
    while (excess := len(surface.triangles) - most) > 0 and len(surface.triangles) != before:
        before, every = len(surface.triangles), np.ones(len(surface.edges), bool)
        surface, errors = _collapsed(surface, errors, every, -(-excess // 2))
    return surface


_EVEN = 1e-3  # of an edge's length to the 4th: above an error of shape that is smaller, even edges
_AT_RIM = 100.0  # times the error of a surface, that of the rim
_TURN = 0.2  # least cosine of the angle by which a triangle may turn
_SQUEEZED = np.radians(12)  # an angle that may not become smaller
_CHEAPER = 0.15  # of the edges, that may be collapsed before all costs are found anew
_PASSES = 4  # over the edges that others left


def _errors(surface: MeshSurface) -> Array:
    """Quadrics (n, 4, 4) at the nodes, of a place (x, y, z, 1) in m, in m^4.

    The area of each triangle there times the squared distance from its plane; at the rim also the
    squared length of its sides times that from them. After Garland and Heckbert (1997),
    doi:10.1145/258734.258849.
    """
    area = np.linalg.norm(surface.normals, axis=1)
    at_rim = np.flatnonzero(surface.counts[surface.edge_of] == 1)
    along = np.diff(surface.nodes[surface.rim], axis=1)[:, 0]
    length = np.linalg.norm(along, axis=1)
    across = np.cross(along, surface.normals[at_rim // 3])
    normal = _unit(np.concatenate([surface.normals, across]))
    point = np.concatenate([surface.centres, surface.nodes[surface.rim[:, 0]]])
    plane = np.column_stack([normal, -np.sum(normal * point, axis=1)])
    weighted = plane * np.append(area, _AT_RIM * length**2)[:, None]
    own = (weighted[:, :, None] * plane[:, None, :]).reshape(-1, 16)
    # Of a plane, its nodes; with a rim's side twice, so that all have three.
    nodes = np.concatenate([surface.triangles, surface.rim[:, [0, 1, 1]]])
    return (_at(nodes, len(surface.nodes)) @ own).reshape(-1, 4, 4)


def _at(nodes: Indices, count: int) -> "scipy.sparse.csr_array":
    """The matrix (count, F) that adds up at each node what triangles of `nodes` (F, 3) have."""
    column = np.repeat(np.arange(len(nodes)), nodes.shape[1])
    shape = (count, len(nodes))
    return scipy.sparse.csr_array((np.ones(nodes.size), (nodes.ravel(), column)), shape)


def _collapsed(
    surface: MeshSurface, errors: Array, of: Mask, most: int
) -> tuple[MeshSurface, Array]:
    """The surface with up to `most` of some edges, `of` (E,), collapsed to nodes, with its errors.

    None that would turn a triangle over, or join what is apart.
    """
    (i, j), n = surface.edges.T, len(surface.nodes)
    nodes, into = surface.nodes.copy(), np.arange(n)
    rim = np.isin(into, surface.rim)
    places = np.stack([(nodes[i] + nodes[j]) / 2, nodes[i], nodes[j]])
    error = _error(errors[i] + errors[j], places)
    place = places[error.argmin(axis=0), np.arange(len(i))]
    cost = error.min(axis=0) + _EVEN * np.linalg.norm(nodes[i] - nodes[j], axis=1) ** 4
    of = of & (surface.counts < 3) & ~(rim[i] & rim[j] & (surface.counts == 2))
    # Any of the cheaper ones: neighbours cost alike, so that few are the least of all around.
    cheap = of & (cost <= np.quantile(cost[of], _CHEAPER)) if of.any() else of
    turn = np.random.default_rng(0).permutation(len(i))
    links, free = _links(surface), np.ones(len(i), bool)
    for some in (*[cheap] * _PASSES, of):
        if some is of and (into != np.arange(n)).any():
            break
        best = _apart(i, j, np.where(some & free, turn, len(i)), n)[:most]
        # An edge is collapsed where only its own triangles lie beside both of its ends.
        good = links[i[best]].multiply(links[j[best]]).sum(axis=1) == surface.counts[best]
        good[_spoiling(surface, nodes, i[best], j[best], place[best])] = False
        free[best] = False
        best = best[good]
        most -= len(best)
        into[j[best]], nodes[i[best]] = i[best], place[best]
        done = np.isin(np.arange(n), surface.edges[best])
        beside = np.isin(np.arange(n), surface.edges[done[i] | done[j]])
        free &= ~(beside[i] | beside[j])
    gone = np.flatnonzero(into != np.arange(n))
    errors = errors.copy()
    errors[into[gone]] += errors[gone]
    return MeshSurface(nodes, into[surface.triangles]).part(
        _distinct(into[surface.triangles])
    ), errors


def _distinct(triangles: Indices) -> Mask:
    """Which triangles (F,) have three different nodes."""
    a, b, c = triangles.T
    return (a != b) & (b != c) & (c != a)


def _links(surface: MeshSurface) -> "scipy.sparse.csr_array":
    """The matrix (n, n) that has 1 where two nodes are linked by an edge."""
    i, j = np.concatenate([surface.edges, surface.edges[:, ::-1]]).T
    n = len(surface.nodes)
    return scipy.sparse.csr_array((np.ones(len(i)), (i, j)), (n, n))


def _error(errors: Array, places: Array) -> Array:
    """The quadrics `errors` (E, 4, 4) at `places` (..., E, 3)."""
    linear = errors[:, :3, :3] @ places[..., None] + 2 * errors[:, :3, 3:]
    return np.sum(places * linear[..., 0], axis=-1) + errors[:, 3, 3]


def _apart(i: Indices, j: Indices, turn: Indices, n: int) -> Indices:
    """Edges between nodes `i` and `j` (E,) whose `turn` comes before that of all next to them."""
    near = np.full(n, len(i))
    for end in (i, j):
        np.minimum.at(near, end, turn)
    wide = near.copy()
    for end, other in ((i, j), (j, i)):
        np.minimum.at(wide, end, near[other])
    return np.flatnonzero((wide[i] == turn) & (wide[j] == turn) & (turn < len(i)))


def _spoiling(surface: MeshSurface, nodes: Array, i: Indices, j: Indices, places: Array) -> Indices:
    """Which collapses of `i` and `j` (k,) to `places` (k, 3) would turn or squeeze a triangle."""
    owner = np.full(len(nodes), -1)
    owner[i] = owner[j] = np.arange(len(i))
    moved = nodes.copy()
    moved[i] = moved[j] = places
    owners = owner[surface.triangles]
    one = np.count_nonzero(owners >= 0, axis=1) == 1
    before, after = (MeshSurface(of, surface.triangles[one]) for of in (nodes, moved))
    turned = np.sum(_unit(before.normals) * _unit(after.normals), axis=1) < _TURN
    turned &= before.smallest > _FLAT
    squeezed = after.smallest < np.minimum(before.smallest, _SQUEEZED)
    return owners[one].max(axis=1)[turned | squeezed]


def placed(surface: MeshSurface, points: Array) -> tuple[Indices, Array, Array]:
    """The places on the surface nearest to `points` (P, 3) in m.

    The triangle (P,), the shares (P, 3) of its corners (barycentric coordinates), and the distance
    (P,) in m.
    """
    tree, most = surface.tree
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


_SAMPLES = 64  # for each place, all over the surface
_MOVES = 40  # of each place to the middle of its share


def spread(surface: MeshSurface, count: int) -> Array:
    """So many places (count, 3) in m on the surface, each in the middle of an equal share of it.

    Lloyd's method on points all over the surface, begun with points far from one another; the same
    each time. Which share a point is in goes by the distance in space, not along the surface.
    """
    if not 1 <= count <= len(surface.triangles):
        raise Refusal(f"expected 1 to {len(surface.triangles)} places, got {count}")
    # Each triangle in equal ones, some of them turned by half a turn.
    rows = int(np.ceil(np.sqrt(_SAMPLES * count / len(surface.triangles))))
    s, t = np.indices((rows, rows)).reshape(2, -1)
    s, t = (np.where(s + t < rows, of + 1 / 3, rows - of - 1 / 3) / rows for of in (s, t))
    points = (np.column_stack([1 - s - t, s, t]) @ surface.corners).reshape(-1, 3)
    weights = np.repeat(np.linalg.norm(surface.normals, axis=1), rows**2)
    places = np.zeros((count, 3))
    far = np.linalg.norm(points - np.average(points, axis=0, weights=weights), axis=1)
    places[0] = points[far.argmin()]
    far[:] = np.inf
    for k in range(1, count):
        far = np.minimum(far, np.linalg.norm(points - places[k - 1], axis=1))
        places[k] = points[far.argmax()]
    for _ in range(_MOVES):
        share = scipy.spatial.cKDTree(places).query(points)[1]
        whole = np.bincount(share, weights, count)
        middle = [np.bincount(share, weights * x, count) for x in points.T]
        places = np.where(
            whole[:, None], np.transpose(middle) / np.maximum(whole[:, None], 1e-99), places
        )
    triangle, shares, _ = placed(surface, places)
    return np.einsum("pk,pkx->px", shares, surface.corners[triangle])


def principal_directions(surface: MeshSurface) -> tuple[Array, Array]:
    """Unit tangents (n, 2, 3) at the nodes along the principal curvatures (n, 2) in 1/m.

    Positive where the skin is convex as seen from outside, the larger first; a direction and its
    opposite are the same. Of a paraboloid fitted to the nodes up to two edges away.
    """
    n = len(surface.nodes)
    unit = _unit(_at(surface.triangles, n) @ surface.normals)
    first = _unit(np.cross(unit, np.eye(3)[np.abs(unit).argmin(axis=1)]))
    second = np.cross(unit, first)
    links = _links(surface)
    i, j = (links @ links + links).nonzero()
    i, j = (of[i != j].astype(np.intp) for of in (i, j))
    away = surface.nodes[j] - surface.nodes[i]
    step = np.bincount(i, np.linalg.norm(away, axis=1), n) / np.bincount(i, minlength=n)
    u, v, w = (np.sum(away * of[i], axis=1) / step[i] for of in (first, second, unit))
    # w = -(a u²/2 + b u v + c v²/2 + d u + e v) by least squares, with lengths in mean steps.
    terms = np.column_stack([u * u / 2, u * v, v * v / 2, u, v])
    sums = _at(i[:, None], n)
    square = (sums @ (terms[:, :, None] * terms[:, None, :]).reshape(-1, 25)).reshape(n, 5, 5)
    square += 1e-12 * np.eye(5)  # for a node with less than five others around
    right: Array = sums @ (terms * -w[:, None])
    a, b, c, d, e = np.linalg.solve(square, right[..., None])[..., 0].T
    turn, half = np.arctan2(2 * b, a - c) / 2, np.hypot((a - c) / 2, b)
    along = np.stack([first - d[:, None] * unit, second - e[:, None] * unit], axis=1)
    cos, sin = np.cos(turn), np.sin(turn)
    ways = np.stack([cos, sin, -sin, cos], axis=1).reshape(n, 2, 2)
    curvatures = np.column_stack([(a + c) / 2 + half, (a + c) / 2 - half])
    return _unit(ways @ along), curvatures / step[:, None]


def _unit(vectors: Array) -> Array:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.maximum(length, np.finfo(float).tiny)


_NEAR = 0.1  # of the size: further from the rim no end of an arc is meant


def held_edges(surface: MeshSurface, held: ArrayLike) -> Indices:
    """The sides (H, 2) of the rim that are held, as pairs of nodes with the skin on their left.

    `held` is "all", or arcs (A, 2, 3) of the rim, each from the node nearest to one point in m to
    that nearest to another, counter-clockwise as seen from outside. Raises a `Refusal` where
    nothing is held, and for points away from the rim or on two loops of it.
    """
    if isinstance(held, str) and held == "all":
        return surface.rim
    try:
        arcs = np.array(held, float).reshape(-1, 2, 3)
    except (ValueError, TypeError) as error:
        raise Refusal(f'expected "all" or arcs of the rim (A, 2, 3) in m, got {held}') from error
    if not (len(arcs) and np.isfinite(arcs).all()):
        raise Refusal(
            'expected an edge that is held, got none; give "all", or two points of the rim in m'
        )
    nodes = np.concatenate(surface.loops)
    found, near = scipy.spatial.cKDTree(surface.nodes[nodes]).query(arcs)
    away = np.array(found)
    if away.max() > _NEAR * np.ptp(surface.nodes, axis=0).max():
        far = arcs.reshape(-1, 3)[away.argmax()]
        raise Refusal(
            f"expected ends of the held edge on the rim, got {far} m, which is "
            f"{1e3 * away.max():.3g} mm away; give points of the rim in the unit of the mesh"
        )
    sides: list[Indices] = []
    for begin, end in nodes[near]:
        loop = next(loop for loop in surface.loops if begin in loop)
        loop = np.roll(loop, -int(np.flatnonzero(loop == begin)[0]))
        if end == begin or end not in loop:
            raise Refusal(
                "expected a held edge between two nodes of one rim, got "
                f"{surface.nodes[begin]} and {surface.nodes[end]} m; "
                'give points further apart, or "all"'
            )
        arc = loop[: int(np.flatnonzero(loop == end)[0]) + 1]
        sides.append(np.column_stack([arc[:-1], arc[1:]]))
    return np.unique(np.concatenate(sides), axis=0)
