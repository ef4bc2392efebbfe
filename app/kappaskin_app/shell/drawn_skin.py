"""The drawn skin: its points at rest, displaced along its normals, in mm."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from kappaskin.frames import Array, Indices, Mask
from kappaskin.skin import Cap, MeshSkin, Patch, interpolated, snapped_to_rim

MM = 1e3
_DEEPEST = 0.45  # of the shorter side that a skin is drawn deep at most, to stay in the picture
_NEAREST = 0.7  # of the base radius, so that no skin is drawn through its own axis


_AROUND = 129  # points around the rim of a cap
_SEAM = 1e-9  # of a side: or a line passes between two triangles
_ITERATIONS = 12  # until a place on a bent skin is found to rounding
_STEP = 1e-5  # of the shorter side, of differences along the skin at rest


@dataclass(frozen=True)
class Direction:
    """A way to look at the skin: from where, as shares of its longer side, and what is up."""

    words: str
    towards: tuple[float, float, float]
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def sees(self, axis: int) -> bool:
        """Whether what runs along `axis` is not seen end-on."""
        return any(share for other, share in enumerate(self.towards) if other != axis)


FROM_THE_LEFT = Direction("from the front, a little from the left", (-0.45, -1.1, 1.1))


class DrawnSkin:
    """`patch` by nx x ny points; where it ends inside its rectangle, those off it are not drawn.

    Positions (k, 2) are the skin's own, in m; points (k, 3) are in space, in mm.
    """

    def __init__(self, patch: Patch, nx: int, ny: int) -> None:
        self.patch = patch
        x, y = patch.grid(nx, ny)
        self.cell = np.array([x[1] - x[0], y[1] - y[0]])
        """How far apart the points are along x and y, in m."""
        grid = np.stack(np.meshgrid(x, y), axis=-1)
        self.on = patch.contains(grid.reshape(-1, 2)).reshape(ny, nx)
        """Which points (ny, nx) are on the skin."""
        self._shown: Indices | None = None
        if not self.on.all():
            grid, self._shown = snapped_to_rim(patch, grid, self.on)
        positions = grid.reshape(-1, 2)
        self._inside = np.flatnonzero(self.on)
        off = np.setdiff1d(np.arange(self.on.size), self._inside)
        self._free = off[_is_free(patch, positions[off])]
        self._free_points = _extrapolated(positions[self._inside], positions[self._free])
        self._rest, self._out = self.at_rest(positions)
        self._areas, self._leans = self._normal_terms(positions)
        self.shares: Array = positions / (patch.a, patch.b)
        """Where each point (points, 2) is, as shares of the sides."""
        self.height: Array = np.zeros((ny, nx))
        """How far out each point is drawn, in mm."""

    def show_displacement(self, surface: Array, times: float = 1.0) -> None:
        """Draw a displacement inward (ny, nx) in m, NaN off the skin, `times` as large."""
        self.height = self.height_of(np.nan_to_num(surface), times)

    def height_of(self, surface: Array, times: float = 1.0) -> Array:
        """How far out in mm points are drawn for a displacement inward (ny, nx) in m.

        The heights of points on a free rim are weighted means of those of the points inside it.
        """
        height = -MM * times * surface
        near, weights = self._free_points
        found = np.sum(weights * height.ravel()[self._inside[near]], axis=1)
        height.ravel()[self._free] = found
        return height

    @cached_property
    def rim(self) -> Array:
        """Positions (k, 2) in m around the rim of a cap or a mesh; none of other skins."""
        patch = self.patch
        if isinstance(patch, MeshSkin):
            return patch.places[np.append(patch.rim, patch.rim[0])]
        if isinstance(patch, Cap):
            turn = np.linspace(0, 2 * np.pi, _AROUND)
            return patch.rim_radius * (1 + np.stack([np.cos(turn), np.sin(turn)], axis=-1))
        return np.empty((0, 2))

    def rim_height(self) -> Array:
        """Height (k,) in mm of the `rim`: 0 where held, else a mean of heights near it."""
        near, weights = self._rim_points
        return np.sum(weights * self.height.ravel()[self._inside[near]], axis=1)

    @cached_property
    def _rim_points(self) -> tuple[Indices, Array]:
        positions = self.patch.grid(*self.on.shape[::-1])
        inside = np.stack(np.meshgrid(*positions), axis=-1).reshape(-1, 2)[self._inside]
        near, weights = _extrapolated(inside, self.rim)
        return near, weights * _is_free(self.patch, self.rim)[:, None]

    def at_rest(self, positions: Array) -> tuple[Array, Array]:
        """Points of the skin at rest at `positions`, and its outward normals there."""
        points, out = self.patch.at_rest(positions)
        return MM * points, out

    def _slopes_at_rest(self, positions: Array) -> tuple[Array, Array]:
        """How points, and in 1/mm normals, at rest change along x and y, each (2, k, 3)."""
        step = _STEP * min(self.patch.a, self.patch.b) * np.eye(2)[:, None]
        ahead, behind = self.at_rest(positions + step), self.at_rest(positions - step)
        along, turning = (
            (one - other) / (2 * MM * step.max()) for one, other in zip(ahead, behind, strict=True)
        )
        return along, turning

    def _normal_terms(self, positions: Array) -> tuple[Array, Array]:
        """The normal of the drawn surface by powers of the height h, and of its slopes.

        With the tangents T at rest, a surface at h has T_x + h N_x + h_x N and likewise along y.
        Their product is N (a + b h + c h^2) - h_x (P + h Q) - h_y (R + h S): a, b, c (3, k),
        and P, Q and R, S (2, 2, k, 3).
        """
        (x, y), (turn_x, turn_y) = self._slopes_at_rest(positions)
        out = self._out
        both = np.cross(turn_x, y) + np.cross(x, turn_y)
        areas = np.stack([np.cross(x, y), both, np.cross(turn_x, turn_y)])
        leans = np.stack([np.cross([y, turn_y], out), np.cross(out, [x, turn_x])])
        return np.vecdot(areas, out), leans

    @property
    def side(self) -> float:
        """The longer side in mm."""
        return MM * max(self.patch.a, self.patch.b)

    @property
    def size(self) -> float:
        """What arrows and marks are scaled to, in mm: the side of a square as large as the skin."""
        return MM * math.sqrt(self.patch.a * self.patch.b)

    @property
    def deepest(self) -> float:
        """How far in mm the skin may be drawn from where it rests."""
        patch = self.patch
        side = patch.a if patch.strip else min(patch.a, patch.b)
        return MM * min(_DEEPEST * side, _NEAREST * min(map(abs, patch.radii)))

    @property
    def bounds(self) -> tuple[Array, Array]:
        """From where to where (3,) in mm it may be drawn, along x, y and upwards in space."""
        upwards, drawn = np.array([0.0, 0.0, self.deepest]), self._rest[np.unique(self._triangles)]
        return drawn.min(axis=0) - upwards, drawn.max(axis=0) + upwards

    # Its faces and lines, over the points of the grid.

    def faces(self) -> Indices:
        """Squares (k, 5) with a corner on the skin, VTK's way; the others are on its rim."""
        index = np.arange(self.on.size).reshape(self.on.shape)
        around = (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1])
        corners = np.stack(around, axis=-1).reshape(-1, 4)
        corners = corners[self.on.ravel()[corners].any(axis=1)]
        return np.insert(corners, 0, 4, axis=1)

    def lines(self, stride: int, first: int = 0) -> list[Indices]:
        """Every so many lines of the grid along x and y from the `first` on, as their points."""
        index = np.arange(self.on.size).reshape(self.on.shape)
        found: list[Indices] = []
        for line in (*index[first::stride], *index[:, first::stride].T):
            on = self.on.ravel()[line]
            drawn = on.copy()  # and as far as the rim
            drawn[1:] |= on[:-1]
            drawn[:-1] |= on[1:]
            ends = np.flatnonzero(np.diff(drawn, prepend=False, append=False)).reshape(-1, 2)
            found += [line[begin:end] for begin, end in ends]
        return found

    def values(self, values: Array) -> Array:
        """What to colour every point by, of `values` (ny, nx) that are known on the skin."""
        return values.ravel() if self._shown is None else values.ravel()[self._shown]

    # Its shape.

    def points(self, which: Indices | slice = slice(None), height: Array | None = None) -> Array:
        """The points of the grid `which`, drawn `height` (k,) mm out, else as the skin is."""
        h = self.height.ravel()[which] if height is None else height
        return self._rest[which] + self._out[which] * h[:, None]

    def shading(self) -> Array:
        """Unit normals (points, 3) of the drawn surface, in one pass of differences."""
        slopes = np.gradient(self.height, self.cell[1] * MM, self.cell[0] * MM)[::-1]
        h, (a, b, c) = self.height.ravel(), self._areas
        normals: Array = self._out * (a + h * (b + h * c))[:, None]
        for slope, (level, raised) in zip(slopes, self._leans, strict=True):
            normals -= slope.ravel()[:, None] * (level + h[:, None] * raised)
        normals /= np.sqrt(np.einsum("pi,pi->p", normals, normals))[:, None]
        return normals

    def nearest(self, positions: Array) -> Indices:
        """The points of the grid nearest to `positions`."""
        p, q = np.rint(positions / self.cell).astype(int).T
        ny, nx = self.on.shape
        return np.clip(q, 0, ny - 1) * nx + np.clip(p, 0, nx - 1)

    def height_at(self, positions: Array) -> Array:
        """How far out (k,) in mm the skin is drawn at `positions`, evenly between its points."""
        return interpolated(self.patch, self.height, positions)

    def place(self, positions: Array, above: float = 0.0) -> tuple[Array, Array]:
        """Points `above` mm over the drawn skin at `positions`, and the normals at rest there."""
        points, out = self.at_rest(positions)
        return points + out * (self.height_at(positions) + above)[:, None], out

    def tangents(self, position: Array) -> tuple[Array, Array]:
        """How the drawn surface runs on along x and along y at `position` (2,), each (3,)."""
        nearest = int(self.nearest(position[None])[0])
        q, p = divmod(nearest, self.on.shape[1])
        (out,) = self.at_rest(position[None])[1]
        along, turning = (slopes[:, 0] for slopes in self._slopes_at_rest(position[None]))
        rows, columns = (slice(max(at - 1, 0), at + 2) for at in (q, p))
        lines = self.height[q, columns], self.height[rows, p]
        rises = [(h[-1] - h[0]) / ((len(h) - 1) * MM) for h in lines] / self.cell
        x, y = along + self.height[q, p] * turning + rises[:, None] * out
        return x, y

    @cached_property
    def _triangles(self) -> Indices:
        corners = self.faces()[:, 1:]
        return np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])

    def hit(self, near: Array, far: Array) -> Array | None:
        """Where the line of sight from `near` to `far` first meets the drawn skin, (2,) in m.

        None where it passes it by.
        """
        places, shares = self._met(near, far, self.points())
        return places[np.argmin(shares)] if len(places) else None

    def seen_at(self, near: Array, far: Array, height: float, beside: Array) -> Array:
        """Where the line of sight from `near` to `far` meets the skin `height` mm out, (2,) in m.

        Of several crossings the one next to `beside`; of none, where the line passes closest.
        """
        places, _ = self._met(near, far, self.points(height=np.full(self.on.size, height)))
        position = min(
            places, key=lambda place: float(np.linalg.norm(place - beside)), default=beside
        )
        towards = (far - near) / np.linalg.norm(far - near)
        across = np.eye(3) - np.multiply.outer(towards, towards)
        for _ in range(_ITERATIONS):
            points, out = self.at_rest(position[None])
            along, turning = (slopes[:, 0] for slopes in self._slopes_at_rest(position[None]))
            tangents = (along + height * turning) @ across
            off = (points[0] + height * out[0] - near) @ across
            # Newton's way: to where the line meets the skin, or is nearest to what bends away.
            bent = 0.0 if len(places) else np.linalg.norm(off) * np.abs(turning).max()
            steepness = tangents @ tangents.T + bent * np.eye(2)
            position = position - np.linalg.lstsq(steepness, tangents @ off)[0] / MM
        return position

    def _met(self, near: Array, far: Array, points: Array) -> tuple[Array, Array]:
        """Where a line meets the surface of `points`: positions (k, 2) in m, shares (k,) of it.

        Moeller and Trumbore's way, for all triangles at once.
        """
        a, b, c = np.moveaxis(points[self._triangles], 1, 0)
        along, ab, ac, start = far - near, b - a, c - a, near - a
        p, q = np.cross(along, ac), np.cross(start, ab)
        area = np.vecdot(ab, p)
        area[area == 0] = np.nan  # seen edge-on
        u, v = np.vecdot(start, p) / area, np.vecdot(along[None], q) / area
        met = np.flatnonzero((u >= -_SEAM) & (v >= -_SEAM) & (u + v <= 1 + _SEAM))
        weights = np.stack([1 - u[met] - v[met], u[met], v[met]], axis=1)
        corners = self.shares[self._triangles[met]] * (self.patch.a, self.patch.b)
        return np.einsum("kv,kvi->ki", weights, corners), np.vecdot(ac, q)[met] / area[met]


_BESIDE = 8  # points that a plane through the skin beside its rim is fitted to


def _extrapolated(inside: Array, positions: Array) -> tuple[Indices, Array]:
    """Which of the points `inside` (k, 2), and their weights, that a plane has at `positions`.

    Both (P, 8): those nearest to each position, and the plane of least squares through them.
    """
    count = min(_BESIDE, len(inside))
    if not len(positions):
        return np.empty((0, count), np.intp), np.empty((0, count))
    far, near = scipy.spatial.KDTree(inside).query(positions, count)
    away = (inside[near] - positions[:, None]) / np.max(far)
    return np.asarray(near), np.linalg.pinv(np.insert(away, 0, 1.0, axis=2))[:, 0]


def _is_free(patch: Patch, positions: Array) -> Mask:
    """Whether the rim next to each of `positions` (k, 2) is not held."""
    if not isinstance(patch, MeshSkin) or len(patch.held) == len(patch.rim):
        return np.zeros(len(positions), bool)
    near = scipy.spatial.KDTree(patch.places[patch.rim]).query(positions)[1]
    return ~np.isin(patch.rim[near], patch.held)


NO_SKIN = DrawnSkin(Patch(0.1, 0.1), 2, 2)
"""The skin drawn before a sensor has sent its description."""
