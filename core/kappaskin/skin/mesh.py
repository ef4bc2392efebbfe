"""Meshes: skins of any shape, as triangles in space, with coordinates and smooth geometry."""

import base64
import hashlib
import io
import math
import zipfile
from dataclasses import dataclass, field, fields
from functools import cached_property, lru_cache
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kappaskin._files import ARCHIVE_DAMAGES
from kappaskin.errors import Refusal
from kappaskin.frames import Array, Indices, Mask
from kappaskin.skin.mesh_file import MeshSurface, faults, placed
from kappaskin.skin.patch import SIDES, Base, Number, Polygon, doubled_area

_MOST_STEPS = 64  # of the splines, along the longer side
_PER_STEP = 1.4  # nodes at least along a step
_SMOOTHED = 0.08  # of a step: shorter waves of what is fitted are smoothed
_AT_RIM = 10.0  # times the weight of a node that lies on the rim
_MOST_TRIANGLES = 2**15  # which take some minutes
_MOST_BYTES = 2**23  # of the arrays in a text, many times what so many triangles need
# Faults that a skin may have: numbers become less exact, or nothing is wrong but the unit.
_LESSER = ("size", "too many", "too few", "sliver")
_STEEPEST = 80.0  # degrees between a triangle and the plane that it is projected on
_ALONG = 0.9  # of a normal: with so much of x it has no x in its plane, and y is used
_ROUNDS = 40  # of flattening
_LINE = 0.1  # of its length: a held edge that is no wider has no plane

# The cubic spline between the second and third of four even nodes, by powers of the place, and
# what its derivatives are by the same.
_CUBIC = np.array([[1, 4, 1, 0], [-3, 0, 3, 0], [3, -6, 3, 0], [-1, 3, -3, 1]]) / 6
_DERIVED = [np.linalg.matrix_power(np.diag([1.0, 2.0, 3.0], 1), order) for order in range(4)]
_ORDERS = (0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)
_ALONG_X = np.array([of_x for of_x, _ in _ORDERS])
_ALONG_Y = np.array([3 + of_y for _, of_y in _ORDERS])


def _cubic(at: Array, order: int = 0) -> Array:
    """Weights (..., 4) of a spline's coefficients at `at` (...) within a step, derived by it."""
    return at[..., None] ** np.arange(4.0) @ (_DERIVED[order] @ _CUBIC)


class Splines:
    """Bicubic splines over the box of a skin, by least squares through values at `places` (n, 2).

    With `weights` (n,) in m^2. Where there are no places, as beyond the rim, they go on as smoothly
    as can be. So many `steps` along x and y, on a box with the `sides` in m.
    """

    def __init__(
        self, places: Array, weights: Array, sides: tuple[float, float], steps: tuple[int, int]
    ) -> None:
        # Slow to import, and seldom needed, as below.
        from scipy.sparse import csc_array, kron
        from scipy.sparse.linalg import splu

        self._steps, self.step = np.array(steps), np.array(sides) / steps
        x, y = (
            [_overlap(count, order, step) for order in range(4)]
            for count, step in zip(steps, self.step.tolist(), strict=True)
        )
        rough: Any = sum(math.comb(3, d) * cast("Any", kron)(y[d], x[3 - d]) for d in range(4))
        B, smooth = self.design(places), (_SMOOTHED * float(self.step.max())) ** 6
        self._transposed = csc_array(B.T * weights)
        self._normal = splu(csc_array(self._transposed @ B + smooth * rough))
        self._count, self._sizes = (self._steps + 3).tolist(), self.step.tolist()
        self.at = lru_cache(4)(self._weights_at)
        """The first coefficients each way around a place, and weights (6, 16) as of a jet."""

    def _cells(self, positions: Array) -> tuple[Indices, Array]:
        """The cell (P, 2) that each place lies in, and the place (P, 2) within it, in steps."""
        at = positions / self.step
        cell = np.minimum(np.maximum(at.astype(int), 0), self._steps - 1)
        return cell, at - cell

    def design(self, positions: Array, dx: int = 0, dy: int = 0) -> Any:
        """The sparse map (P, G) from coefficients to derivatives at `positions` (P, 2) in m."""
        from scipy.sparse import csr_array

        (cell, at), (hx, hy), row = self._cells(positions), self.step, int(self._steps[0]) + 3
        X, Y = _cubic(at[:, 0], dx) / hx**dx, _cubic(at[:, 1], dy) / hy**dy
        block = (row * np.arange(4)[:, None] + np.arange(4)).ravel()
        columns = (cell[:, 1] * row + cell[:, 0])[:, None] + block
        values, ends = Y[:, :, None] * X[:, None], 16 * np.arange(len(positions) + 1)
        shape = len(positions), int((self._steps + 3).prod())
        return csr_array((values.ravel(), columns.ravel(), ends), shape=shape)

    def fit(self, values: Array) -> Array:
        """The coefficients (G, k) of `values` (n, k) at the places."""
        return self._normal.solve(np.ascontiguousarray(self._transposed @ values))

    def at_places(self, rows: Any) -> Array:
        """The map (P, n) from values at the places to what a design `rows` (P, G) gives of them."""
        return cast("Any", self._transposed.T @ self._normal.solve(rows.toarray().T)).T

    def jet(self, coefficients: Array, x: float, y: float, orders: int = 6) -> Array:
        """Derivatives (6, k) at one place in m: the value, along x, y, xx, xy and yy.

        Or the first of these `orders` alone.
        """
        first, rows = self.at(x, y)
        return rows[:orders].dot(self.block(coefficients, *first))

    def block(self, coefficients: NDArray[Any], i: int, j: int) -> Array:
        """Those (16, k) of coefficients (G, k) of which `at` gives the weights."""
        found = coefficients.reshape(self._count[1], self._count[0], -1)[j : j + 4, i : i + 4]
        return found.reshape(16, -1).astype(float, copy=False)

    def _weights_at(self, x: float, y: float) -> tuple[tuple[int, int], Array]:
        """The first coefficients each way around a place, and weights (6, 16) of those."""
        (hx, hy), (nx, ny) = self._sizes, self._count
        i, j = min(max(int(x / hx), 0), nx - 4), min(max(int(y / hy), 0), ny - 4)
        u, v = x / hx - i, y / hy - j
        p, q, pp, qq = 1 / hx, 1 / hy, 1 / hx**2, 1 / hy**2
        powers = (
            (1.0, u, u * u, u * u * u),
            (0.0, p, 2 * p * u, 3 * p * u * u),
            (0.0, 0.0, 2 * pp, 6 * pp * u),
            (1.0, v, v * v, v * v * v),
            (0.0, q, 2 * q * v, 3 * q * v * v),
            (0.0, 0.0, 2 * qq, 6 * qq * v),
        )
        each = np.dot(powers, _CUBIC)
        return (i, j), (each[_ALONG_Y, :, None] * each[_ALONG_X, None]).reshape(6, 16)


def _overlap(count: int, order: int, step: float) -> Any:
    """Integrals (count + 3, count + 3) of products of one derivative of the cubic splines."""
    from scipy.sparse import csr_array

    t, w = np.polynomial.legendre.leggauss(4)
    f = _cubic((t + 1) / 2, order) / step**order
    rows = (np.arange(count)[:, None, None] + np.arange(4)[:, None]).repeat(4, axis=2)
    values = np.broadcast_to(step / 2 * (f.T * w) @ f, rows.shape)
    places = rows.ravel(), rows.swapaxes(1, 2).ravel()
    return csr_array((values.ravel(), places), shape=(count + 3, count + 3))


@dataclass(frozen=True, init=False)
class MeshSkin(Polygon):
    """A skin of any shape: triangles in space, held along its rim or a part of it.

    `nodes` (n, 3) in m and `triangles` (F, 3) of their numbers, counter-clockwise seen from
    outside: one piece with one rim. `held` are the nodes of the rim that are held; None for all.
    `thickness` in m.

    Positions are the projection on the plane of the held edge, with x along the nodes' x, as far as
    it lies in that. Where the skin leans by more than 80 degrees from that plane, they are those of
    the skin flattened, with lengths along it as nearly kept as can be (`is_flattened`). In space z
    points outward from that plane, the highest point has z = 0, and x and y are the positions, or
    on the whole as near to them as can be. Two points p (3,) in the coordinates of the nodes and q
    in these are alike where p = `origin` + q `frame`.
    """

    content: str
    thickness: float = field(compare=False)
    nodes: Array = field(compare=False, repr=False)
    points: Array = field(compare=False, repr=False)
    """The nodes (n, 3) in m, in the coordinates of the skin in space."""
    places: Array = field(compare=False, repr=False)
    """The positions (n, 2) in m of the nodes."""
    triangles: Indices = field(compare=False, repr=False)
    rim: Indices = field(compare=False, repr=False)
    """The nodes (V,) of the rim in order, counter-clockwise seen from outside."""
    held: Indices = field(compare=False, repr=False)
    frame: Array = field(compare=False, repr=False)
    origin: Array = field(compare=False, repr=False)

    def __init__(
        self,
        nodes: ArrayLike,
        triangles: ArrayLike,
        thickness: float,
        held: ArrayLike | None = None,
    ) -> None:
        # As exact as most files have them, which halves what a recording needs.
        with np.errstate(invalid="ignore", over="ignore"):  # what is not finite is refused below
            given = np.array(nodes, np.float32).astype(float)
        faces = np.array(triangles, np.intp)
        _check_mesh(given, faces, thickness)
        (rim,) = MeshSurface(given, faces).loops
        fixed = np.intersect1d(rim if held is None else np.array(held, np.intp), rim)
        if len(fixed) < 2:
            raise Refusal(f"expected at least two nodes of the rim that are held, got {len(fixed)}")
        frame = _frame(given, faces, given[fixed], given[rim])
        points = given @ frame.T
        places = points[:, :2]
        if _leans(points, faces):
            places = _flattened(points, faces, rim)
        low = places[rim].min(axis=0)
        beside = np.mean(points[:, :2] - places, axis=0)
        corner = np.array([*(low + beside), points[:, 2].max()])
        points, places = points - corner, places - low
        content = hashlib.sha256()
        for part in (given, faces, fixed, np.array(float(thickness))):
            content.update(np.ascontiguousarray(part).tobytes())
        a, b = np.ptp(places[rim], axis=0).tolist()
        of_mesh: dict[str, Any] = {"a": a, "b": b, "radius": math.inf, "strip": False}
        of_mesh |= {
            "nodes": given,
            "points": points,
            "places": places,
            "triangles": faces,
            "rim": rim,
            "held": fixed,
            "frame": frame,
        }
        of_mesh |= {"origin": corner @ frame, "thickness": thickness}
        of_mesh |= {"content": content.hexdigest()}
        of_mesh |= {"vertices": tuple((x, y) for x, y in places[rim].tolist())}
        for name, value in of_mesh.items():
            object.__setattr__(self, name, value)

    @cached_property
    def text(self) -> str:
        """The mesh as a text, from which `of_text` makes it."""
        file, nodes = io.BytesIO(), self.nodes.astype(np.float32)
        steps = np.diff(self.triangles.ravel(), prepend=0).astype(np.int32)
        held, thickness = self.held, np.array(self.thickness)
        np.savez_compressed(file, nodes=nodes, steps=steps, held=held, thickness=thickness)
        return base64.b85encode(file.getvalue()).decode()

    @classmethod
    def of_text(cls, text: str) -> "MeshSkin":
        """The mesh of a `text`; raises a `Refusal` for another text."""
        try:
            content = base64.b85decode(text)
            with zipfile.ZipFile(io.BytesIO(content)) as archive:
                if sum(member.file_size for member in archive.infolist()) > _MOST_BYTES:
                    raise ValueError
            with np.load(io.BytesIO(content)) as file:
                nodes = file["nodes"].astype(np.float32, casting="same_kind")
                held = file["held"].astype(np.intp, casting="same_kind")
                triangles = np.cumsum(file["steps"], dtype=np.intp).reshape(-1, 3)
                thickness = float(file["thickness"])
        except (*ARCHIVE_DAMAGES, LookupError, TypeError) as error:
            raise Refusal(
                f"expected the text of a mesh as kappaskin writes it, got {text!r:.40}; give the "
                "file of the mesh and its unit instead"
            ) from error
        return cls(nodes, triangles, thickness, held)

    def __getstate__(self) -> dict[str, Any]:
        return {one.name: getattr(self, one.name) for one in fields(self)}

    @property
    def name(self) -> str:
        return f"mesh of {len(self.triangles)} triangles, {self.a:.3g} x {self.b:.3g} m"

    @property
    def is_shallow(self) -> bool:
        return False

    @property
    def is_flattened(self) -> bool:
        """Whether positions are those of the skin flattened, and no projection."""
        return not np.array_equal(self.places, self.points[:, :2])

    @property
    def is_held_in_part(self) -> bool:
        """Whether a part of the rim is free."""
        return len(self.held) < len(self.rim)

    @property
    def arc_curvature(self) -> float:
        return 0.0

    @property
    def most_functions(self) -> int:
        """How many functions it has nodes for."""
        return len(self.points) // 4  # two loads for each, of two nodes each

    @cached_property
    def areas(self) -> Array:
        """The area (n,) in m^2 of each node: a third of its triangles'."""
        u, v = (
            self.points[self.triangles[:, k]] - self.points[self.triangles[:, 0]] for k in (1, 2)
        )
        third = np.linalg.norm(np.cross(u, v), axis=1) / 6
        return _sums(self.triangles.ravel(), np.repeat(third, 3), len(self.points))

    def spread(self, count: int, apart: float = 0.0) -> Indices:
        """So many nodes at most, spread evenly: each the farthest from those before.

        From the rim they are half as far as from one another; at least `apart` in m through the
        air.
        """
        from scipy.spatial import KDTree

        away: Array = 2 * np.asarray(KDTree(self.points[self.rim]).query(self.points)[0])
        found = np.empty(count, np.intp)
        for k in range(count):
            found[k] = away.argmax()
            if away[found[k]] < apart:
                return found[:k]
            far = np.linalg.norm(self.points - self.points[found[k]], axis=1)
            away = np.minimum(away, far)
        return found

    def projected(self, points: Array) -> tuple[Array, Array]:
        """Positions (P, 2) in m nearest to `points` (P, 3) in m in the coordinates of `nodes`.

        And how far (P,) in m these are from there.
        """
        triangle, shares, away = placed(MeshSurface(self.nodes, self.triangles), points)
        return np.einsum("pk,pki->pi", shares, self.places[self.triangles[triangle]]), away

    @cached_property
    def splines(self) -> Splines:
        """Splines through values at the nodes (n, k), over the coordinates of the skin."""
        weights = self.areas.copy()
        weights[self.rim] *= _AT_RIM
        spacing = math.sqrt(self.outline.area / len(self.points))
        step = max(max(self.a, self.b) / _MOST_STEPS, _PER_STEP * spacing)
        steps = math.ceil(self.a / step), math.ceil(self.b / step)
        return Splines(self.places, weights, (self.a, self.b), steps)

    @cached_property
    def _surface(self) -> Array:
        """Coefficients (G, 3) of the points in space."""
        return self.splines.fit(self.points)

    @property
    def radii(self) -> tuple[float, float]:
        """Radius of curvature along x and y in m at the node nearest to the middle of the box."""
        return self._radii

    @cached_property
    def _radii(self) -> tuple[float, float]:
        middle = (self.a / 2, self.b / 2)
        away = np.linalg.norm(self.places - middle, axis=1)
        xx, yy, _ = self.base(*self.points[int(away.argmin()), :2].tolist()).curvature
        return 1 / xx if xx else math.inf, 1 / yy if yy else math.inf

    @property
    def rise(self) -> float:
        return float(np.ptp(self.points[:, 2]))

    def _derivatives(self, positions: Array) -> Array:
        """Derivatives (6, P, 3) of the points in space, in the order of a jet."""
        each = [self.splines.design(positions, *order) @ self._surface for order in _ORDERS]
        return np.stack(each)

    def jet(self, x: float, y: float) -> Array:
        """Derivatives (6, 3) of the point in space at one place in m, as of splines."""
        return self.splines.jet(self._surface, x, y)

    def base(self, x: Number, y: Number) -> Base:
        if isinstance(x, float):
            return _base(self.jet(x, y).tolist())
        x, y = np.broadcast_arrays(x, y)
        jet = self._derivatives(np.column_stack([x.ravel(), y.ravel()]))
        return _base(np.swapaxes(jet, 1, 2).reshape(6, 3, *x.shape))

    def read_at_rest(self, positions: Array) -> Array:
        return self.base(*positions.T).form

    def area(self, positions: Array) -> Array:
        _, r_x, r_y, *_ = self._derivatives(positions)
        return np.linalg.norm(np.cross(r_x, r_y), axis=1)

    def around(self, x: float, y: float, offsets: Array) -> Array:
        far = np.hypot(*offsets.T)[:, None]
        ways = np.where(far > 0, offsets, (1.0, 0.0)) / np.where(far > 0, far, 1.0)
        return self.along(np.broadcast_to((x, y), offsets.shape), ways, far[:, 0])[0]

    def along(self, positions: Array, ways: Array, far: Number) -> tuple[Array, Array]:
        # In steps of a geodesic, to the second order: as long along the skin, and as straight.
        places, ways = positions, np.broadcast_to(ways, positions.shape)
        for _ in range(_GEODESIC):
            base = self.base(*places.T)
            slopes = np.moveaxis(np.array(base.slopes), 2, 0)
            bent = np.moveaxis(np.array(base.second), 2, 0)
            step = np.broadcast_to(np.asarray(far) / _GEODESIC, len(places))[:, None]
            c, s = ways.T
            # The second derivative along the way, less that of a straight line in x and y.
            turn = (c * c)[:, None] * bent[:, 0, :2] + (2 * c * s)[:, None] * bent[:, 1, :2]
            turn += (s * s)[:, None] * bent[:, 2, :2]
            moved = np.einsum("pa,pai->pi", ways, slopes)
            onward = moved + step * turn
            places = places + step * moved + step**2 / 2 * turn
            # The way goes on along the same line in x and y; in the frame there it has length 1.
            there = np.moveaxis(np.array(self.base(*places.T).slopes), 2, 0)
            ways = np.einsum("pi,pia->pa", onward, np.linalg.inv(there))
            ways = ways / np.linalg.norm(ways, axis=1)[:, None]
        return places, ways

    def near_rim(self, x: float, y: float, within: float) -> list[tuple[float, float, float]]:
        return [at for at in super().near_rim(x, y, within) if self._is_held(*at[:2])]

    @cached_property
    def _held_edges(self) -> Mask:
        """Which edges (V,) of the outline are held: both their ends are."""
        on = np.isin(self.rim, self.held)
        return on & np.roll(on, -1)

    def _is_held(self, x: float, y: float) -> bool:
        """Whether the edge of the outline that is nearest to a place is held."""
        feet = self.outline.feet(np.array([[x, y]]))[0]
        return bool(self._held_edges[np.linalg.norm(feet - (x, y), axis=1).argmin()])


_GEODESIC = 2


def _base(jet: Any) -> Base:
    """`Base` of derivatives (6, 3, ...) of the points in space."""
    r, r_x, r_y, *seconds = jet
    (ux, uy, uz), (vx, vy, vz) = r_x, r_y
    E = ux * ux + uy * uy + uz * uz
    t = (ux * vx + uy * vy + uz * vz) / E
    vx, vy, vz = vx - t * ux, vy - t * uy, vz - t * uz
    a, d = 1 / E**0.5, 1 / (vx * vx + vy * vy + vz * vz) ** 0.5
    e_x, e_y = (a * ux, a * uy, a * uz), (d * vx, d * vy, d * vz)
    n = (
        e_x[1] * e_y[2] - e_x[2] * e_y[1],
        e_x[2] * e_y[0] - e_x[0] * e_y[2],
        e_x[0] * e_y[1] - e_x[1] * e_y[0],
    )
    # Along e_x the derivative is a f_x, along e_y it is b f_x + d f_y; the second ones are sums of
    # f_xx, f_xy and f_yy. Of these, r_ij has the parts K along the normal and G along r_x and r_y.
    b, no = -t * d, 0 * a
    sums = (a * a, no, no), (a * b, a * d, no), (b * b, 2 * b * d, d * d)
    on_x, on_y = [_dot(one, e_x) for one in seconds], [_dot(one, e_y) for one in seconds]
    G_x = [a * u + b * v for u, v in zip(on_x, on_y, strict=True)]
    G_y = [d * v for v in on_y]
    K = [-_dot(one, n) for one in seconds]
    second = tuple((-_dot(each, G_x), -_dot(each, G_y), *each) for each in sums)
    xx, xy, yy = (_dot(each, K) for each in sums)
    turning = a * a * on_y[0], a * (b * on_y[0] + d * on_y[1])
    return Base(tuple(r), e_x, e_y, n, (xx, yy, xy), ((a, no), (b, d)), second, turning)


def _dot(u: Any, v: Any) -> Number:
    (a, b, c), (x, y, z) = u, v
    return a * x + b * y + c * z


def _sums(places: Indices, values: Array, count: int) -> Array:
    """The sum (count,) of the `values` at each of the `places`."""
    return cast("Array", np.bincount(places, values, count))


def _check_mesh(nodes: Array, triangles: Indices, thickness: float) -> None:
    if nodes.ndim != 2 or nodes.shape[1] != 3 or not (len(nodes) and np.isfinite(nodes).all()):
        raise Refusal(f"expected finite nodes of shape (n, 3) in m, got shape {nodes.shape}")
    if not (SIDES[0] <= np.ptp(nodes, axis=0).max() <= SIDES[1]):
        raise Refusal(f"expected nodes of a skin in m, got {np.ptp(nodes, axis=0)} m of them")
    of_three = triangles.ndim == 2 and triangles.shape[1] == 3 and len(triangles)
    if not (of_three and 0 <= triangles.min() <= triangles.max() < len(nodes)):
        raise Refusal(
            f"expected triangles of shape (F, 3), numbers of the {len(nodes)} nodes from 0, got "
            f"shape {triangles.shape}"
        )
    if len(triangles) > _MOST_TRIANGLES:
        raise Refusal(
            f"expected at most {_MOST_TRIANGLES:,} triangles, got {len(triangles):,}; decimate them"
        )
    if not 0 < thickness < math.inf:
        raise Refusal(f"expected a thickness above zero in m of the mesh, got {thickness}")
    for fault in faults(MeshSurface(nodes, triangles)):
        if fault.kind not in _LESSER:
            raise Refusal(fault.message)


def _frame(nodes: Array, triangles: Indices, held: Array, rim: Array) -> Array:
    """Unit vectors x, y and z (3, 3) of the plane of the edge that is held, z outward."""
    for edge in (held, rim):
        _, widths, ways = np.linalg.svd(edge - edge.mean(axis=0), full_matrices=False)
        if widths[1] > _LINE * widths[0]:
            break
    corners = nodes[triangles]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).sum(axis=0)
    z = ways[2] * (1 if area @ ways[2] > 0 else -1)
    x = np.eye(3)[0 if abs(z[0]) < _ALONG else 1]
    x = x - (x @ z) * z
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], dtype=float)


def _leans(points: Array, triangles: Indices) -> bool:
    """Whether a triangle leans by more than `_STEEPEST` from the plane of x and y."""
    corners = points[triangles]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    level = area[:, 2] / np.linalg.norm(area, axis=1)
    return bool((level < math.cos(math.radians(_STEEPEST))).any())


def _flattened(points: Array, triangles: Indices, rim: Indices) -> Array:
    """Positions (n, 2) in m in a plane, of lengths as near to those in space as can be.

    From a map with the rim on a circle (Tutte), triangles are turned and joined again, as rigid as
    possible (Liu et al., 10.1111/j.1467-8659.2008.01290.x).
    """
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import splu

    n, corners = len(points), points[triangles]
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    long: Array = np.linalg.norm(u, axis=1)
    along = np.vecdot(u, v) / long
    flat = np.zeros((len(triangles), 3, 2))
    flat[:, 1, 0], flat[:, 2, 0] = long, along
    flat[:, 2, 1] = np.sqrt(np.maximum(np.vecdot(v, v) - along**2, 0))
    # The side opposite to each corner, and half the cotangent of the angle there.
    sides = np.roll(flat, -2, axis=1) - np.roll(flat, -1, axis=1)
    one, other = np.roll(sides, -1, axis=1), np.roll(sides, -2, axis=1)
    half = -np.vecdot(one, other) / (2 * (long * flat[:, 2, 1])[:, None])
    begin, end = np.roll(triangles, -1, axis=1), np.roll(triangles, -2, axis=1)

    def laplacian(weights: Array) -> Any:
        pairs = np.stack([begin, end, begin, end]), np.stack([end, begin, begin, end])
        values = np.stack([-weights, -weights, weights, weights])
        places = tuple(each.ravel() for each in pairs)
        return cast("Any", csc_array)((values.ravel(), places), shape=(n, n))

    found, inner = np.zeros((n, 2)), np.setdiff1d(np.arange(n), rim)
    steps = np.linalg.norm(points[rim] - np.roll(points[rim], -1, axis=0), axis=1)
    turn = 2 * np.pi * np.concatenate([[0.0], np.cumsum(steps)[:-1]]) / steps.sum()
    found[rim] = steps.sum() / (2 * np.pi) * np.column_stack([np.cos(turn), np.sin(turn)])
    even = laplacian(np.ones_like(half))
    found[inner] = splu(csc_array(even[inner][:, inner])).solve(-(even[inner][:, rim] @ found[rim]))
    rigid = laplacian(half)
    factors = splu(csc_array(rigid[1:][:, 1:]))
    for _ in range(_ROUNDS):
        now = found[triangles]
        moved = np.roll(now, -2, axis=1) - np.roll(now, -1, axis=1)
        U, _, Vt = np.linalg.svd(np.einsum("fk,fki,fkj->fij", half, moved, sides))
        U[:, :, 1] *= np.linalg.det(U @ Vt)[:, None]
        pull = half[:, :, None] * np.einsum("fij,fkj->fki", U @ Vt, sides)
        force = np.zeros((n, 2))
        np.add.at(force, end, pull)
        np.add.at(force, begin, -pull)
        found[1:] = factors.solve(force[1:])
        found[0] = 0.0
    area = doubled_area(*np.moveaxis(found[triangles], 1, 0))
    if (area <= 0).any():
        raise Refusal(
            f"expected a skin that can be flattened without folds, got {(area <= 0).sum()} "
            "triangles that fold; take away deep creases, or a part of the skin"
        )
    # Turned so that it lies as the skin does, seen from outside.
    across = (found - found.mean(axis=0)).T @ (points[:, :2] - points[:, :2].mean(axis=0))
    one, _, other = np.linalg.svd(across)
    return found @ (one * [1.0, np.linalg.det(one @ other)]) @ other
