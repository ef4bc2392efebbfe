"""Skins at rest: rectangles, cylinders, disks, polygons and caps in their own coordinates."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, cast

import numpy as np
import scipy
from numpy.typing import ArrayLike

from kappaskin.errors import Refusal
from kappaskin.frames import Array, Mask

_MOST_CORNERS = 256
_CLOSEST = 2e-3  # of the longer side: between a corner and an edge that it is no end of
_SHARPEST = math.radians(10)


class Outline:
    """A closed line through `corners` (V, 2), counter-clockwise; edge v runs to the next corner."""

    def __init__(self, corners: Array) -> None:
        self.corners, self.ends = corners, np.roll(corners, -1, axis=0)
        self.along: Array = self.ends - corners
        """The edges (V, 2) in m as vectors; their `lengths` (V,) in m."""
        self.lengths: Array = np.sqrt(np.sum(self.along**2, axis=1))
        level = np.where(self.along[:, 1] == 0, 1.0, self.along[:, 1])
        self._leaning = self.along[:, 0] / level

    @property
    def normals(self) -> Array:
        """Unit normals (V, 2) of the edges, inward."""
        return self.along[:, ::-1] * (-1, 1) / self.lengths[:, None]

    @property
    def turns(self) -> Array:
        """Turning angle (V,) in rad at each corner, positive where the outline is convex."""
        before = np.roll(self.along, 1, axis=0)
        onward = np.sum(before * self.along, axis=1)
        return np.angle(onward + 1j * doubled_area(self.corners - before, self.corners, self.ends))

    @property
    def area(self) -> float:
        return float(np.sum(doubled_area(np.zeros(2), self.corners, self.ends))) / 2

    def feet(self, positions: Array, short: float = 0.0) -> Array:
        """The nearest point (P, V, 2) of each edge to each of `positions` (P, 2), all in m.

        The share `short` of an edge at either end is left out.
        """
        offset = positions[:, None] - self.corners
        share = (offset * self.along).sum(axis=-1) / self.lengths**2
        share = np.minimum(np.maximum(share, short), 1 - short)
        return self.corners + share[..., None] * self.along

    def inside(self, positions: Array) -> Mask:
        """Which of `positions` (P, 2) a ray towards +x leaves through an odd number of edges."""
        x, y = positions[:, :1], positions[:, 1:]
        (x0, y0), y1 = self.corners.T, self.ends[:, 1]
        passed = ((y0 > y) != (y1 > y)) & (x < x0 + (y - y0) * self._leaning)
        return np.count_nonzero(passed, axis=1) % 2 == 1

    def depth(self, positions: Array) -> Array:
        """Distance (P,) in m of `positions` (P, 2) from the outline, negative outside."""
        away = positions[:, None] - self.feet(positions)
        distance: Array = np.sqrt((away**2).sum(axis=-1).min(axis=1))
        return np.where(self.inside(positions), distance, -distance)


def doubled_area(a: Array, b: Array, c: Array) -> Array:
    """Twice the signed area of the triangles a, b, c (..., 2): positive when counter-clockwise."""
    u, v = b - a, c - a
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


def checked_corners(vertices: ArrayLike) -> Array:
    """The corners (V, 2) in m, counter-clockwise; raises a `Refusal` for no valid outline."""
    try:
        corners = np.array(vertices, float)
    except (ValueError, TypeError, OverflowError) as error:
        raise Refusal(f"expected vertices of shape (V, 2) in m, got {error}") from error
    if corners.ndim != 2 or corners.shape[1] != 2 or not 3 <= len(corners) <= _MOST_CORNERS:
        raise Refusal(
            f"expected vertices of shape (V, 2) in m, V from 3 to {_MOST_CORNERS}, got "
            f"{corners.shape}"
        )
    if not np.isfinite(corners).all():
        raise Refusal("expected finite vertices in m, got NaN or infinity")
    if (low := corners.min(axis=0)).any():
        raise Refusal(
            f"expected an outline whose lowest x and y are 0, got {low[0]:g} and {low[1]:g} m; "
            "subtract them from the vertices and from the positions on the skin"
        )
    if not corners.max(axis=0).all():
        raise Refusal("expected an outline that encloses an area, got vertices on one line")
    shape = Outline(corners / corners.max())
    with np.errstate(invalid="ignore"):  # edges of no length, refused next
        _check_crossings(shape)
    _check_distances(shape)
    _check_corners(shape)
    return corners if shape.area > 0 else np.roll(corners[::-1], 1, axis=0)


def _check_crossings(line: Outline) -> None:
    a, b, c, d = line.corners[:, None], line.ends[:, None], line.corners[None], line.ends[None]
    crossed = (doubled_area(a, b, c) * doubled_area(a, b, d) < 0) & (
        doubled_area(c, d, a) * doubled_area(c, d, b) < 0
    )
    if crossed.any():
        i, j = np.argwhere(crossed)[0]
        raise Refusal(f"edges {i} and {j} of the outline cross; give its corners in order")


def _check_distances(line: Outline) -> None:
    V, limit = len(line.corners), f"a {1 / _CLOSEST:.0f}th of the longer side"
    if (short := line.lengths < _CLOSEST).any():
        i = int(np.argmax(short))
        raise Refusal(
            f"vertices {i} and {(i + 1) % V} of the outline are the same or nearer than {limit}; "
            "leave one out (the last need not repeat the first)"
        )
    gap = np.linalg.norm(line.corners[:, None] - line.feet(line.corners), axis=-1)
    own = np.arange(V)
    gap[own, own] = gap[own, own - 1] = np.inf
    if (near := gap < _CLOSEST).any():
        i, j = np.argwhere(near)[0]
        raise Refusal(
            f"vertex {i} of the outline is on its edge {j} or nearer than {limit}; expected an "
            "outline that does not touch itself"
        )


def _check_corners(line: Outline) -> None:
    sharp = np.abs(line.turns) > math.pi - _SHARPEST
    if sharp.any():
        raise Refusal(
            f"the corner at vertex {int(np.argmax(sharp))} of the outline is sharper than "
            f"{math.degrees(_SHARPEST):.0f} degrees; round it with one more vertex"
        )


SIDES = (1e-9, 1e9)
"""Shortest and longest sides of a skin in m: their squares and products stay numbers."""

_MARGIN = 1e-3  # of a side: how near its rim a point may be and still move with the skin
_CORNER = 0.02  # of an edge: how near to its ends no place is looked for along it
_CELLS = 64  # along each side of a raster that shows quickly whether a point is far inside
_ROUNDING = 1e-12  # of a side: a point on the rim as computed may stand this far outside
_STEEPEST = 0.01  # 1 / (R k)^2 of the lowest wave: what shallow shell theory may neglect


Number = Any  # a float, or an array
Numbers = tuple[Number, ...]
Vector = tuple[Number, Number, Number]


class Base(NamedTuple):
    """A skin at rest at one place, each number, or at many, each an array.

    Its point in m and outward normal in space, orthonormal tangents e_x and e_y, and its curvature
    xx, yy and xy in 1/m along these. On caps, domes and saddles, where x and y are no lengths
    at a right angle, also, on other skins empty: the rows of the matrix `slopes` (2, 2) from
    derivatives along x and y to those along e_x and e_y, those of the matrix (3, 5) from f_x, f_y,
    f_xx, f_xy, f_yy to the second ones, and by how much e_x turns to e_y along each of them, in
    1/m.
    """

    point: Vector
    along: Vector
    across: Vector
    normal: Vector
    curvature: Vector
    slopes: tuple[Numbers, ...] = ()
    second: tuple[Numbers, ...] = ()
    turning: Numbers = ()

    @property
    def frame(self) -> Array:
        """The tangents e_x and e_y in space, (..., 2, 3)."""
        e_x, e_y = (np.broadcast_arrays(*each, self.point[0])[:3] for each in self[1:3])
        return np.stack([np.stack(e_x, axis=-1), np.stack(e_y, axis=-1)], axis=-2)

    @property
    def form(self) -> Array:
        """The curvature (3, ...) in 1/m."""
        return np.stack(np.broadcast_arrays(*self.curvature, self.point[0])[:3])

    @property
    def covariant(self) -> Array:
        """The map (..., 6, 6) from a function's derivatives along x and y, as `ORDERS` has them.

        To its covariant ones along e_x and e_y.
        """
        if isinstance(self.point[0], float) and self.slopes:  # a third of the time
            first = ((0.0, *row, 0.0, 0.0, 0.0) for row in self.slopes)
            value = 1.0, 0.0, 0.0, 0.0, 0.0, 0.0
            return np.array([value, *first, *((0.0, *row) for row in self.second)])
        found = np.zeros((*np.shape(self.point[0]), 6, 6))
        found[...] = np.eye(6)
        for i, row in enumerate(self.slopes + self.second, 1):
            for j, each in enumerate(row, 1):
                found[..., i, j] = each
        return found


_FLAT = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Patch:
    """A rectangular skin of `a` by `b` metres, held along its edges.

    At rest it is flat, or bent along x to `radius` in m: a cylinder skin whose arc has the length
    a. Two radii are those along x and y, of either sign: a shallow dome, saddle or trough, and
    where only the first is finite and above zero, the cylinder again. A `strip` is held at its two
    ends in x only and nothing varies along y: a planar curve.

    In space, x runs along the arc, whose highest point is at (a/2, y, 0); the outward normal there
    is (0, 0, 1). Displacement is positive inward, as a load presses; curvature is positive where
    the skin is convex seen from outside, so that pressing in adds f_xx (Eq. 3) to 1/radius. A
    shallow skin is an arc along x carried along an arc along y, highest at (a/2, b/2, 0) of a dome.
    """

    a: float
    b: float
    radius: float | tuple[float, float] = math.inf
    strip: bool = False

    def __post_init__(self) -> None:
        least, most = SIDES
        if not all(least <= side <= most for side in (self.a, self.b)):  # NaN too
            raise Refusal(
                f"expected a patch with two sides above zero in metres, {least:g} to {most:g}, "
                f"got {self.a} x {self.b}; give lengths such as 0.1 x 0.1"
            )
        if isinstance(self.radius, tuple) and not self.arc_curvature:
            self._check_shallow(self.radius)
        elif not self.radii[0] >= self.a / (2 * math.pi):  # NaN too
            raise Refusal(
                f"an arc of {self.a:g} m is a full circle at radius {self.a / 2 / math.pi:.4g} "
                f"m: expected a larger base radius, or infinity for a flat skin, got {self.radius}"
            )

    def _check_shallow(self, radii: tuple[float, float]) -> None:
        least = SIDES[0]
        if self.strip or not all(abs(R) >= least for R in radii):  # NaN too
            raise Refusal(
                f"expected two radii of at least {least:g} m, either sign, or infinity, of a skin "
                f"that is no strip; got {list(radii)}, strip {self.strip}"
            )
        if self.steepness > _STEEPEST:
            least = min(map(abs, radii)) * math.sqrt(self.steepness / _STEEPEST)
            raise Refusal(
                f"shallow shell theory neglects 1/(R k)^2, {self.steepness:.2%} of the longest "
                f"wave on a skin of {self.a:g} x {self.b:g} m with radii of {radii[0]:g} and "
                f"{radii[1]:g} m: expected at most {_STEEPEST:.0%}, which are radii of at least "
                f"{least:.3g} m; for a steeper skin use a cap"
            )

    @property
    def name(self) -> str:
        """A short description for messages."""
        what = f"{'strip' if self.strip else 'patch'} of {self.a:g} x {self.b:g} m"
        if self.is_shallow:
            return f"{what} bent to {self.radii[0]:g} and {self.radii[1]:g} m"
        return f"{what} bent to {self.radii[0]:g} m" if self.arc_curvature else what

    @property
    def radii(self) -> tuple[float, float]:
        """Radius of curvature along x and y in m; infinite where it is straight."""
        return self.radius if isinstance(self.radius, tuple) else (self.radius, math.inf)

    @cached_property
    def curvatures(self) -> tuple[float, float]:
        """Curvature at rest along x and y in 1/m; zero when flat."""
        return 1 / self.radii[0], 1 / self.radii[1]

    @property
    def arc_curvature(self) -> float:
        """1 / radius in 1/m of a cylinder skin; zero when flat, and of a shallow skin."""
        Rx, Ry = self.radii
        return 1 / Rx if math.isinf(Ry) and Rx > 0 else 0.0

    @property
    def is_shallow(self) -> bool:
        """Whether it is a dome, a saddle or a trough, bent as shallow shell theory has it."""
        return any(self.curvatures) and not self.arc_curvature

    @property
    def steepness(self) -> float:
        """1 / (R k)^2 of the longest wave: by how much shallow shell theory is in error."""
        k = math.pi * math.hypot(1 / self.a, 1 / self.b)
        return (max(map(abs, self.curvatures)) / k) ** 2

    @property
    def rise(self) -> float:
        """Height in m between its highest and lowest points at rest."""
        ends = self.at_rest(np.array([[0, 0], [self.a, 0], [0, self.b], [self.a, self.b]]) / 2)[0]
        return float(np.ptp(ends[:, 2]))

    @property
    def opening(self) -> float:
        """The angle of the arc of a cylinder skin, a / radius in rad; else zero."""
        return self.a * self.arc_curvature

    def grid(self, nx: int, ny: int) -> tuple[Array, Array]:
        """Evenly spaced x (nx,) and y (ny,) in m, edges included."""
        if nx < 2 or ny < 2:
            raise Refusal(f"expected a grid of at least 2 x 2 points, got {nx} x {ny}")
        return np.linspace(0.0, self.a, nx), np.linspace(0.0, self.b, ny)

    def cell_centres(self, m: int, n: int) -> tuple[Array, Array]:
        """Centres x (m,) and y (n,) in m of an m x n tiling."""
        if m < 1 or n < 1:
            raise Refusal(f"expected at least 1 x 1 cells, got {m} x {n}")
        return (np.arange(m) + 0.5) * self.a / m, (np.arange(n) + 0.5) * self.b / n

    def contains(self, positions: Array) -> Mask:
        """Which of `positions` (P, 2) in m lie on the patch, edges included."""
        return np.all((positions >= 0) & (positions <= (self.a, self.b)), axis=-1)

    def depth(self, positions: Array) -> Array:
        """Distance (P,) in m of `positions` (P, 2) from the rim; negative off the skin."""
        far = np.minimum(positions, (self.a, self.b) - positions)
        return far[:, 0] if self.strip else far.min(axis=-1)

    def inward(self, x: float, y: float) -> tuple[float, float]:
        """(x, y) in m, moved to at least a thousandth of a side inside the rim."""
        dx, dy = _MARGIN * self.a, _MARGIN * self.b
        return min(max(x, dx), self.a - dx), min(max(y, dy), self.b - dy)

    def near_rim(self, x: float, y: float, within: float) -> list[tuple[float, float, float]]:
        """Points just inside the held edges near (x, y): x and y in m, distance in sides.

        One for each edge that is at most `within` sides away.
        """
        a, b, (dx, dy) = self.a, self.b, (_MARGIN * self.a, _MARGIN * self.b)
        places = [(dx, y, x / a), (a - dx, y, 1 - x / a)]
        if not self.strip:
            places += [(x, dy, y / b), (x, b - dy, 1 - y / b)]
        return [place for place in places if place[2] <= within]

    def moves(self, positions: Array) -> Mask:
        """Which of `positions` (P, 2) are far enough inside the rim for the skin to move there."""
        return self.depth(positions) >= 0.9 * _MARGIN * min(self.a, self.b)

    def area(self, positions: Array) -> Array:
        """The area (P,) of the skin per area of x and y at `positions` (P, 2); of a cap below 1."""
        return np.ones(len(positions))

    def at_rest(self, positions: Array) -> tuple[Array, Array]:
        """Points (..., 3) in m and outward unit normals (..., 3) of the skin at rest."""
        base = self.base(positions[..., 0], positions[..., 1])
        each = np.broadcast_arrays(*base.point, *base.normal)
        return np.stack(each[:3], axis=-1), np.stack(each[3:], axis=-1)

    def base(self, x: Number, y: Number) -> Base:
        """The skin at rest at x, y in m: numbers, or arrays of one shape."""
        Hx, Hy = self.curvatures
        if not (Hx or Hy):
            return Base((x, y, 0.0), *_FLAT)
        sin, cos = (math.sin, math.cos) if isinstance(x, float) else (np.sin, np.cos)
        u, v = x - self.a / 2, y - self.b / 2
        sx, cx, sy, cy = sin(Hx * u), cos(Hx * u), sin(Hy * v), cos(Hy * v)
        px, py, pz = x, y, 0.0
        if Hx:
            px, pz = self.a / 2 + sx / Hx, -2 * sin(Hx * u / 2) ** 2 / Hx
        if Hy:
            py, pz = self.b / 2 + sy / Hy, pz - 2 * sin(Hy * v / 2) ** 2 / Hy
        # The arcs' tangents r_x = (cx, 0, -sx) and r_y = (0, cy, -sy) meet at a right angle only
        # along the middles: r_x . r_y = m. The frame is e_x = r_x and e_y = t r_x + up r_y.
        m = sx * sy
        up = 1 / (1 - m * m) ** 0.5
        ny, nz, t = cx * sy * up, cx * cy * up, -m * up
        across, normal = (-sx * ny, cy * up, -cx * ny), (sx * cy * up, ny, nz)
        base = Base((px, py, pz), (cx, 0.0, -sx), across, normal, (Hx, Hy, 0.0))
        if not (Hx and Hy):
            return base
        # r_xx . e_y = p, r_yy . r_x = q and r_xy = 0.
        p, q, b = up * Hx * cx * sy, Hy * cy * sx, Hx * cy * up
        along = -t * p, -up * p, 1.0, 0.0, 0.0
        across = -(up**4) * q, m * up**4 * q, 0.0, 2 * t * up, up * up
        return base._replace(
            curvature=(b, t * t * b + up**3 * Hy * cx, t * b),
            slopes=((1.0, 0.0), (t, up)),
            second=(
                along,
                (*(t * each for each in along[:3]), up, 0.0),
                tuple(t * t * one + other for one, other in zip(along, across, strict=True)),
            ),
            turning=(p, t * p),
        )

    def read_at_rest(self, positions: Array) -> Array:
        """Curvature xx, yy, xy (3, P) in 1/m of the skin at rest that elements are taken to have.

        At `positions` (P, 2) in m; by shallow shell theory it is alike all over.
        """
        return np.multiply.outer([*self.curvatures, 0.0], np.ones(len(positions)))

    def around(self, x: float, y: float, offsets: Array) -> Array:
        """Positions (Q, 2) in m that lie from (x, y) as far along the skin as `offsets` (Q, 2)."""
        slopes = self.base(x, y).slopes
        return np.array([x, y]) + (offsets @ np.array(slopes) if slopes else offsets)

    def along(self, positions: Array, ways: Array, far: Number) -> tuple[Array, Array]:
        """Positions (P, 2) in m that lie `far` in m from `positions` (P, 2) along the skin.

        Along unit vectors `ways` (2,) or (P, 2) of the frame there; and the unit vectors of the
        frame at the end along which the way goes on.
        """
        return positions + far * ways, ways


@dataclass(frozen=True, init=False)
class Disk(Patch):
    """A flat round skin of `rim_radius` in m, held along its rim; its box begins at x = y = 0."""

    def __init__(self, rim_radius: float) -> None:
        if not 0 < rim_radius < math.inf:
            raise Refusal(f"expected a disk with a radius above zero in metres, got {rim_radius}")
        super().__init__(2 * rim_radius, 2 * rim_radius)

    @property
    def rim_radius(self) -> float:
        """Radius of the rim in m."""
        return self.a / 2

    @property
    def name(self) -> str:
        return f"disk of radius {self.rim_radius:g} m"

    def contains(self, positions: Array) -> Mask:
        return self.depth(positions) >= -_ROUNDING * self.a

    def depth(self, positions: Array) -> Array:
        r = self.rim_radius
        return r - np.hypot(positions[:, 0] - r, positions[:, 1] - r)

    def inward(self, x: float, y: float) -> tuple[float, float]:
        r = self.rim_radius
        away = math.hypot(x - r, y - r)
        share = min(1.0, (1 - 2 * _MARGIN) * r / away) if away else 1.0
        return r + share * (x - r), r + share * (y - r)

    def near_rim(self, x: float, y: float, within: float) -> list[tuple[float, float, float]]:
        r = self.rim_radius
        away = math.hypot(x - r, y - r)
        if (share := (r - away) / self.a) > within or not away:
            return []
        out = (1 - 2 * _MARGIN) * r / away
        return [(r + out * (x - r), r + out * (y - r), share)]


@dataclass(frozen=True, slots=True, eq=False)
class Meridian:
    """The meridian of a cap at some distances from its pole along it.

    `radius` in m of the parallel there, and its `slope` per distance; `curvatures` (2, ...) in 1/m
    along the meridian and along the parallel, and their `changes` in 1/m^2 per distance. `angle` in
    rad of the spheroid: its parallels have the radius R sin(angle).
    """

    radius: Array
    slope: Array
    curvatures: Array
    changes: Array
    angle: Array


_STRETCHES = (0.2, 5.0)
_LEVEL = 0.2  # of what the pole moves by across itself, along the axis, the rim does
_HALF = 1e-4  # of pi/2: an angle so near makes a hemisphere, as 1.5708 rad does
_NEAR_POLE = 1e-7  # of the arc to the rim: so far from the pole azimuths have a value


@dataclass(frozen=True, init=False)
class Cap(Disk):
    """A domed skin: a cap of a sphere of `radius` in m, held along its rim.

    Of a spheroid with `stretch` other than 1: its equator has the `radius`, and it is `stretch`
    times as long along its axis. At the rim its normal is turned by `angle` in rad from that at the
    pole; pi/2 makes a hemisphere.

    Positions are azimuthal equidistant: the pole is in the middle of the box, and a place lies as
    far from there as along the skin, and in its azimuth. `rim_radius` is that distance of the rim.
    In space the pole is at (a/2, b/2, 0), and the outward normal there is (0, 0, 1).
    """

    angle: float
    stretch: float

    def __init__(self, radius: float, angle: float = math.pi / 2, stretch: float = 1.0) -> None:
        least, most = _STRETCHES
        if not (0 < radius < math.inf and least <= stretch <= most):
            raise Refusal(
                f"expected a cap with a radius above zero in metres and a stretch from {least:g} "
                f"to {most:g}, got {radius} and {stretch}"
            )
        if not 0 < angle <= math.pi / 2 * (1 + _HALF):
            raise Refusal(
                "expected a cap whose rim is turned by an angle above zero, at most pi/2 (a "
                f"hemisphere), got {angle} rad; multiply degrees by pi/180"
            )
        for name, value in (("angle", min(angle, math.pi / 2)), ("stretch", stretch)):
            object.__setattr__(self, name, value)
        rim = math.atan2(math.sin(self.angle), stretch * math.cos(self.angle))
        super().__init__(radius * float(scipy.special.ellipeinc(rim, 1 - stretch**2)))
        object.__setattr__(self, "radius", radius)

    @property
    def name(self) -> str:
        of = f" stretched {self.stretch:g} times" if self.stretch != 1 else ""
        rim = f"its rim at {math.degrees(self.angle):g} degrees"
        return f"cap of radius {self.equator:g} m{of} with {rim}"

    @property
    def equator(self) -> float:
        """Radius in m of its equator."""
        return self.radius if isinstance(self.radius, float | int) else self.radius[0]

    @property
    def radii(self) -> tuple[float, float]:
        """Radius of curvature in m along x and y at the pole."""
        R = self.equator / self.stretch
        return R, R

    @property
    def is_shallow(self) -> bool:
        return False

    @property
    def rise(self) -> float:
        rim = self.at_rest(np.array([[self.a, self.b / 2]]))[0]
        return -float(rim[0, 2])

    @property
    def is_hemisphere(self) -> bool:
        return math.isclose(self.angle, math.pi / 2, rel_tol=_HALF)

    def _angle(self, distance: Number) -> Number:
        """The `angle` of the `meridian` at a `distance` in m from the pole."""
        m, t = 1 - self.stretch**2, distance / self.equator
        for _ in range(8 if m else 0):  # Newton's method
            arc = cast("Number", scipy.special.ellipeinc(t, m))
            t = t - (arc - distance / self.equator) / (1 - m * np.sin(t) ** 2) ** 0.5
        return t

    @property
    def moves_as_a_whole(self) -> bool:
        """Whether its rim moves along itself where it moves along its axis, or nearly so."""
        return self.stretch == 1 and math.cos(self.angle) < _LEVEL

    def meridian(self, distance: Array) -> Meridian:
        """The meridian at each `distance` (...) in m from the pole along the skin."""
        R, k, t = self.equator, self.stretch, self._angle(distance)
        m, sin, cos = 1 - k**2, np.sin(t), np.cos(t)
        L = np.sqrt(1 - m * sin**2)  # the arc, over R, per angle
        curvatures = np.stack([k / L**3, k / L]) / R
        changes = np.stack([3 * k / L**6, k / L**4]) * (m * sin * cos) / R**2
        return Meridian(R * sin, cos / L, curvatures, changes, t)

    def base(self, x: Number, y: Number) -> Base:
        one, R, k, pole = isinstance(x, float), self.equator, self.stretch, self.rim_radius
        of_sin, of_cos = (math.sin, math.cos) if one else (np.sin, np.cos)
        u, v = x - pole, y - pole
        least, s = _NEAR_POLE * pole, (u * u + v * v) ** 0.5
        far = max(s, least) if one else np.maximum(s, least)
        t = self._angle(far)
        sin, cos = of_sin(t), of_cos(t)
        # In space e_s = (r' c, r' n, -k2 r) along the meridian and e_t = (-n, c, 0) around meet
        # e_x = c e_s - n e_t and e_y = n e_s + c e_t; what is left of c^2 + n^2 = 1 at the pole,
        # where the azimuth has no value, vanishes there.
        c, n, L = u / far, v / far, (1 - (1 - k**2) * sin * sin) ** 0.5
        r, slope, k1, k2 = R * sin, cos / L, k / (R * L**3), k / (R * L)
        g, cc, nn, cn = r / far, c * c, n * n, c * n
        out, flat, bend = k2 * r, slope - 1, k1 - k2
        fall = 2 * R * k * of_sin(t * s / far / 2) ** 2
        # With M = 1 + (1/g - 1) e_t e_t' the slopes are M f_i, the second derivatives
        #     M F M + p (e_s e_t' + e_t e_s') f_t + q e_t e_t' f_s
        # where F are those of the coordinates, p = (1 - r'/g) / r and q = (r' - 1/g) / r.
        near, p, q = 1 / g - 1, (1 - slope / g) / r, (slope - 1 / g) / r
        mxx, mxy, myy = 1 + near * nn, -near * cn, 1 + near * cc
        on_s, on_t = (q * c, q * n), (-p * n, p * c)
        second = tuple(
            (*(st * of_t + tt * of_s for of_s, of_t in zip(on_s, on_t, strict=True)), *of_second)
            for st, tt, of_second in (
                (-2 * cn, nn, (mxx * mxx, 2 * mxx * mxy, mxy * mxy)),
                (cc - nn, -cn, (mxx * mxy, mxx * myy + mxy * mxy, mxy * myy)),
                (2 * cn, cc, (mxy * mxy, 2 * mxy * myy, myy * myy)),
            )
        )
        return Base(
            (pole + g * u, pole + g * v, -fall),
            (1 + flat * cc, flat * cn, -out * c),
            (flat * cn, 1 + flat * nn, -out * n),
            (out * c, out * n, slope),
            (1 / R, 1 / R, 0.0) if k == 1 else (k2 + bend * cc, k2 + bend * nn, bend * cn),
            ((mxx, mxy), (mxy, myy)),
            second,
            (-flat / r * n, flat / r * c),
        )

    def area(self, positions: Array) -> Array:
        away = np.maximum(np.hypot(*(positions - self.rim_radius).T), _NEAR_POLE * self.rim_radius)
        return self.meridian(away).radius / away

    def read_at_rest(self, positions: Array) -> Array:
        return self.base(*positions.T).form

    def places(self, points: Array) -> Array:
        """Positions (..., 2) in m of `points` (..., 3) of the skin in space, or just off it."""
        pole, R, k = self.rim_radius, self.equator, self.stretch
        x, y = points[..., 0] - pole, points[..., 1] - pole
        r = np.hypot(x, y)
        t = np.arctan2(r, points[..., 2] / k + R)
        s = R * scipy.special.ellipeinc(t, 1 - k**2)
        out = np.where(r > 0, s / np.where(r > 0, r, 1.0), 1.0)
        return np.stack([pole + out * x, pole + out * y], axis=-1)

    def around(self, x: float, y: float, offsets: Array) -> Array:
        far = np.hypot(*offsets.T)[:, None]
        ways = np.where(far > 0, offsets, (1.0, 0.0)) / np.where(far > 0, far, 1.0)
        return self.along(np.broadcast_to((x, y), offsets.shape), ways, far[:, 0])[0]

    def along(self, positions: Array, ways: Array, far: Number) -> tuple[Array, Array]:
        # Along circles of the skin's curvature where they begin: of a spheroid nearly.
        ways, base = np.broadcast_to(ways, positions.shape), self.base(*positions.T)
        (xx, yy, xy), (c, s) = base.form, ways.T
        H = c * c * xx + s * s * yy + 2 * c * s * xy
        turn, normal = (H * far)[:, None], np.stack(base.normal, axis=-1)
        out: Array = np.einsum("pi,pik->pk", ways, base.frame)
        moved = np.sin(turn) * out - 2 * np.sin(turn / 2) ** 2 * normal
        places = self.places(np.stack(base.point, axis=-1) + moved / H[:, None])
        onward = np.cos(turn) * out - np.sin(turn) * normal
        ends: Array = np.einsum("pk,pik->pi", onward, self.base(*places.T).frame)
        return places, ends / np.hypot(*ends.T)[:, None]


@dataclass(frozen=True, init=False)
class Polygon(Patch):
    """A flat skin with the corners `vertices` (V, 2) in m, in either sense of rotation.

    Its box begins at x = y = 0.
    """

    vertices: tuple[tuple[float, float], ...]

    def __init__(self, vertices: ArrayLike) -> None:
        corners = checked_corners(vertices)
        super().__init__(*corners.max(axis=0).tolist())
        object.__setattr__(self, "vertices", tuple((x, y) for x, y in corners.tolist()))

    @property
    def name(self) -> str:
        return f"polygon of {len(self.vertices)} corners in {self.a:g} x {self.b:g} m"

    @cached_property
    def outline(self) -> Outline:
        return Outline(np.array(self.vertices))

    def contains(self, positions: Array) -> Mask:
        found = self.outline.inside(positions)
        found[~found] = self.depth(positions[~found]) >= -_ROUNDING * max(self.a, self.b)
        return found

    def depth(self, positions: Array) -> Array:
        with np.errstate(all="ignore"):  # of positions that are not finite
            return self.outline.depth(positions)

    @cached_property
    def _raster(self) -> list[list[float]]:
        """Lower bound in m of the depth of every point of a cell of the box, by row and column."""
        centres = np.stack(np.meshgrid(*self.cell_centres(_CELLS, _CELLS)), axis=-1)
        least = self.depth(centres.reshape(-1, 2)) - math.hypot(self.a, self.b) / 2 / _CELLS
        return least.reshape(_CELLS, _CELLS).tolist()

    def _is_deep(self, x: float, y: float, depth: float) -> bool:
        """Whether the raster alone shows that (x, y) lies deeper than `depth` in m."""
        column, row = _CELLS * x / self.a, _CELLS * y / self.b
        on = 0 <= row < _CELLS and 0 <= column < _CELLS  # not where they are NaN
        return on and self._raster[int(row)][int(column)] > depth

    def holds(self, x: float, y: float) -> bool:
        """Whether (x, y) in m lies on the skin."""
        return self._is_deep(x, y, 0.0) or bool(self.contains(np.array([[x, y]]))[0])

    def inward(self, x: float, y: float) -> tuple[float, float]:
        margin = _MARGIN * min(self.a, self.b)
        if self._is_deep(x, y, margin) or self.depth(np.array([[x, y]]))[0] >= margin:
            return x, y
        return min(self.near_rim(x, y, math.inf), key=lambda place: place[2])[:2]

    def near_rim(self, x: float, y: float, within: float) -> list[tuple[float, float, float]]:
        shorter, line = min(self.a, self.b), self.outline
        if self._is_deep(x, y, within * shorter):
            return []
        near = line.feet(np.array([[x, y]]), _CORNER)[0] + _MARGIN * shorter * line.normals
        near = near[self.contains(near)]
        share = np.hypot(near[:, 0] - x, near[:, 1] - y) / shorter
        places = zip(near.tolist(), share.tolist(), strict=True)
        return [(u, v, far) for (u, v), far in places if far <= within]
