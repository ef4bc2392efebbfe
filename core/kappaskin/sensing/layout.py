"""Sensor layout: where the elements are, and what they read."""

import math
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from kappaskin.bases import Basis, SineBasis, covariant_at, curvature_at, gauss, hoop_at
from kappaskin.errors import Refusal
from kappaskin.frames import COMPONENTS, Array, Indices, Mask
from kappaskin.mechanics import Plate
from kappaskin.skin import Cap, Disk, MeshSkin, Patch

_POINTS = 12  # exact to rounding for waves as short as the gage
_BESIDES, _PER_STEP = 2, 2  # points, and more for each step of splines: inexact by 0.001

# A gage along the unit vector e reads the mean of the normal curvature e'Ke over its length L. One
# lies along x and one along y. The twist is half of what two along the diagonals differ by, which
# in the limit of short ones is f_xy. Each alone mixes the modes: it sees sin(k x) sin(l y) as
# waves of k + l and of k - l. What they differ by does not: with h = L / sqrt(8) it is the twist
#     k l cos(k x) cos(l y)   times   (cos(k h) sinc(l h) + sinc(k h) cos(l h)) / 2.
# A shallow skin has w Hx^2 more along x, that is xx times 1 - (Hx / k)^2, and along y alike. Along
# the diagonals its mean is w (Hx^2 + Hy^2) / 2, which adds to the twist's factor
#     (Hx^2 + Hy^2) / (4 k l)   times   sinc((k - l) h) - sinc((k + l) h).
_DIAGONAL = 1 / math.sqrt(2)


def gage_multipliers(sines: SineBasis, gage_length: float) -> Array:
    """Factors (3, Ni, Nj) by which gages of `gage_length` in m read sines on no cylinder skin.

    On a flat skin xx: sinc(k_i L / 2) and yy: sinc(k_j L / 2), with sinc(t) = sin(t) / t; xy as
    derived above.
    """
    ki, kj = np.meshgrid(*sines.wavenumbers, indexing="ij")
    L, h = gage_length, gage_length * _DIAGONAL / 2
    twist = np.cos(ki * h) * _sinc(kj * h) + _sinc(ki * h) * np.cos(kj * h)
    xx, yy, xy = _sinc(ki * L / 2), _sinc(kj * L / 2), twist / 2
    if sines.patch.is_shallow:
        squares = np.square(sines.patch.curvatures)
        xx, yy = xx * (1 - squares[0] / ki**2), yy * (1 - squares[1] / kj**2)
        aslant = _sinc((ki - kj) * h) - _sinc((ki + kj) * h)
        xy = xy + squares.sum() / (4 * ki * kj) * aslant
    return np.stack([xx, yy, xy])


def _sinc(t: Array) -> Array:
    return np.sinc(t / np.pi)


ValuesAt = Callable[[Array], Array]
"""From positions (P, 2) in m to a quantity (..., P, N) per m of each function there."""
ValuesAlong = Callable[[Array, Array], Array]
"""The same from positions and unit vectors (2,) or (P, 2) of the frame there."""


_X, _Y = _AXES = np.eye(2)


def _across(t: Array) -> Array:
    """The unit vectors (..., 2) that `t` (..., 2) become by a quarter of a turn from x to y."""
    return np.stack([-t[..., 1], t[..., 0]], axis=-1)


def _along(basis: Basis, positions: Array, L: float, curvature: ValuesAt, t: Array) -> Array:
    """Curvature (P, N) along the unit vectors t (2,) or (P, 2), the mean along gages of length L.

    On a flat skin it follows from the slopes at both ends of a gage, exactly also for functions
    whose curvature jumps between triangles. On a bent skin it is not only a derivative.
    """
    if not L:
        return _normal(curvature(positions), t)
    if isinstance(basis.patch, MeshSkin) or any(basis.patch.curvatures):
        return _over_gage(
            lambda places, ways: _normal(curvature(places), ways), basis.patch, positions, L, t
        )
    half = L / 2 * t
    return (_slope(basis, positions + half, t) - _slope(basis, positions - half, t)) / L


def _twist(along: ValuesAt) -> Array:
    """Twist by gages on both diagonals, from the curvature `along` a unit vector."""
    return (along(_DIAGONAL * (_X + _Y)) - along(_DIAGONAL * (_X - _Y))) / 2


def _normal(K: Array, t: Array) -> Array:
    """The normal curvature (P, N) along t = (c, s) of K (3, P, N): c^2 xx + 2 c s xy + s^2 yy."""
    (xx, yy, xy), c, s = K, t[..., :1], t[..., 1:]
    return c * c * xx + s * s * yy + 2 * c * s * xy


def _unit(direction: ArrayLike) -> Array:
    """Unit vectors (..., 2) along `direction` (...) in rad from x; exact along x and y."""
    t = np.stack([np.cos(direction), np.sin(direction)], axis=-1)
    return np.where(np.abs(t) < np.finfo(float).eps, 0.0, t)


def _slope(basis: Basis, places: Array, t: Array) -> Array:
    """The derivative (P, N) of the functions along t (2,) or (P, 2)."""
    return t[..., :1] * basis.at(places, 1, 0) + t[..., 1:] * basis.at(places, 0, 1)


def _over_gage(values: ValuesAlong, patch: Patch, positions: Array, L: float, t: Array) -> Array:
    """The mean of `values` along gages of length L along t."""
    points = _POINTS
    if isinstance(patch, MeshSkin):  # whose functions are splines
        points = _BESIDES + math.ceil(_PER_STEP * L / float(patch.splines.step.min()))
    along, weights = gauss(L, points)
    steps = zip(along - L / 2, weights / L, strict=True)
    return np.sum([w * values(*patch.along(positions, t, s)) for s, w in steps], axis=0)


def _any_way(values: ValuesAt) -> ValuesAlong:
    return lambda places, _: values(places)


def _over_cell(
    values: ValuesAt, patch: Patch, positions: Array, cell: tuple[float, float], t: Array
) -> Array:
    """The mean of `values` over rectangles of the sides `cell` in m, which may be zero.

    The first of them is along `t` (2,) or (P, 2).
    """
    for axis, side in zip((t, _across(t)), cell, strict=True):
        if side:
            values = partial(_over_gage, _any_way(values), patch, L=side, t=axis)
    return values(positions)


_SHORTEST = 1e-6  # m: the mean over a shorter gage is lost in rounding
_ROUNDING = 1e-9  # of a depth: gages as long as the element distance end on the rim


def _round(patch: Patch) -> Disk:
    if not isinstance(patch, Disk):
        raise Refusal(f"expected a disk or a cap, got a {patch.name}; give a grid or positions")
    return patch


def _channels(patch: Patch, elements: int) -> Mask:
    """The channels (3, P) that the patch has: all; on a strip, which bends along x only, xx."""
    live = np.ones((3, elements), bool)
    live[1:] = not patch.strip
    return live


QUANTITIES = {"height": "m", "slope": "m/m", "curvature": "1/m", "twist": "1/m"}
"""What an element may read, with its unit."""
SHOWN_UNITS = {"m": (1e6, "\N{MICRO SIGN}m"), "m/m": (1e3, "mrad"), "1/m": (1.0, "1/m")}
"""How readings are shown: by how many times a unit, and its name."""
_ALONG = ("slope", "curvature")  # have a direction
_CURVED = ("curvature", "twist")  # depend on the slope
_ALIKE = 9  # decimals of a direction in rad: those equal so far are one
_CURVATURES = (("curvature", 0.0), ("curvature", np.pi / 2), ("twist", 0.0))  # xx, yy and xy
_ROSETTE = ("curvature@0", "curvature@90", "curvature@45")
_DEGREES = 6  # decimals of a direction in degrees in a name


def kind_of_reading(name: str) -> tuple[str, float]:
    """The quantity and its direction in rad of a `name`: height, slope@30, twist, xx ..."""
    if name in COMPONENTS:
        return _CURVATURES[COMPONENTS.index(name)]
    quantity, at, degrees = name.partition("@")
    with suppress(ValueError):
        if quantity in QUANTITIES and bool(at) == (quantity in _ALONG):
            direction = float(degrees) if at else 0.0
            if abs(direction) <= 360:
                return quantity, math.radians(direction)
    raise Refusal(
        f"expected a reading among {', '.join(COMPONENTS)}, height, slope@DEGREES, "
        f"curvature@DEGREES (from x, -360 to 360) and twist, got {name!r:.60}"
    )


def name_of_reading(quantity: str, direction: float) -> str:
    """The name of a quantity along a `direction` in rad, as `kind_of_reading` takes it."""
    degrees = round(math.degrees(direction), _DEGREES)
    degrees -= 360 if degrees > 180 else 0
    return f"{quantity}@{degrees:.10g}" if quantity in _ALONG else quantity


@dataclass(frozen=True, eq=False)
class Readings:
    """What is read, R numbers in each frame: a `quantity` (R,) at an `element` (R,).

    Each of `QUANTITIES` is linear in the displacement w, which is positive inward, as a height is.
    A slope is dw/ds along `direction` (R,) in rad from x, a curvature that along it,
    c^2 xx + 2 c s xy + s^2 yy with (c, s) along it, and the twist is xy. On a bent skin a slope is
    by how much the tangent has turned, w_x + v/R along the arc with the displacement v along it.

    The zero of the quantities in `free` is unknown: one offset in each frame for the heights, and
    one for each direction of slopes or curvatures.

    The axes of the elements may be turned from x, by `turn` (R,) in rad, with which the kinds of
    readings go.
    """

    element: Indices
    quantity: NDArray[np.str_]
    direction: Array
    free: tuple[str, ...] = ()
    turn: Array | None = None

    def __post_init__(self) -> None:
        R = self.element.shape
        if self.element.dtype.kind not in "iu" or len(R) != 1 or not self.element.size:
            raise Refusal(
                f"expected element as whole numbers of shape (R,), R >= 1, one for each reading, "
                f"got {self.element.dtype} of shape {R}"
            )
        if self.quantity.shape != R or self.direction.shape != R:
            raise Refusal(
                f"expected quantity and direction of shape {R} as element has, got "
                f"{self.quantity.shape} and {self.direction.shape}"
            )
        names = ", ".join(QUANTITIES)
        if unknown := set(self.quantity.tolist()) - set(QUANTITIES):
            raise Refusal(f"expected each quantity among {names}, got {sorted(unknown)[0]!r}")
        if unknown := set(self.free) - set(self.quantity.tolist()):
            raise Refusal(
                f"expected a datum only of quantities that are read, got {sorted(unknown)[0]!r}; "
                f"use names among {', '.join(sorted(set(self.quantity.tolist())))}"
            )
        lost = np.isin(self.quantity, _ALONG) & ~np.isfinite(self.direction)
        if lost.any():
            k = int(np.argmax(lost))
            raise Refusal(
                f"expected a direction in rad from x for each {self.quantity[k]}, got "
                f"{self.direction[k]} for reading {k}"
            )

    @cached_property
    def along(self) -> Array:
        """Unit vectors (R, 2) along the directions; exact along x and y."""
        return _unit(self.direction)

    @cached_property
    def kinds(self) -> tuple[list[tuple[str, float]], Indices]:
        """The different quantities with their directions from the axes of their elements.

        And which of them each reading (R,) is.
        """
        own = 0.0 if self.turn is None else self.turn
        return replace(self, direction=self.direction - own, turn=None).directed

    @cached_property
    def directed(self) -> tuple[list[tuple[str, float]], Indices]:
        """The different quantities with their directions from x, and which each reading is."""
        angle = np.where(np.isin(self.quantity, _ALONG), self.direction, 0.0) % (2 * np.pi)
        angle[np.round(angle - 2 * np.pi, _ALIKE) == 0] = 0.0
        each = np.rec.fromarrays([self.quantity, np.round(angle, _ALIKE)])
        _, first, kind = np.unique(each, return_index=True, return_inverse=True)
        return [(str(self.quantity[r]), float(angle[r])) for r in first], kind.reshape(-1)


@dataclass(frozen=True, eq=False)
class SensorLayout:
    """P elements at `positions` (P, 2) in m, and what they read.

    That is the curvature xx, yy and xy of each (a curvature sensor), or the `reads`, along x and y,
    on a cap along the frame of `Patch.local`, gages and sides of cells along the skin. `live` is
    False for dead channels: (3, P) of a curvature sensor, (R,) of other readings. `shape` is
    (m, n) for a regular grid, with element p + m q in column p (along x) and row q (along y), and
    None otherwise. Curvature is the mean over gages of `gage_length` in m, along x, y or the
    direction, the twist that along both diagonals. So are slopes; without gages they, and heights,
    are the mean over a rectangle with the sides `cell` in m. The operator has the readings times
    `scale` (R,), as 1 over their noise.
    """

    patch: Patch
    positions: Array
    live: Mask
    shape: tuple[int, int] | None = None
    gage_length: float = 0.0
    reads: Readings | None = None
    cell: tuple[float, float] = (0.0, 0.0)
    scale: Array | None = None

    def __post_init__(self) -> None:
        P = self.positions
        if P.ndim != 2 or P.shape[1] != 2 or len(P) == 0:
            raise Refusal(f"expected positions of shape (P, 2) with P >= 1, got {P.shape}")
        live = self.reads.element.shape if self.reads else (3, len(P))
        if self.live.shape != live:
            raise Refusal(f"expected live of shape {live}, got {self.live.shape}")
        if self.reads and not (np.min(e := self.reads.element) >= 0 and np.max(e) < len(P)):
            raise Refusal(
                f"expected each element from 0 to {len(P) - 1}, an index into the {len(P)} "
                f"positions, got {int(np.min(e))} to {int(np.max(e))}; count from 0"
            )
        if self.shape and self.shape[0] * self.shape[1] != len(P):
            raise Refusal(f"expected {self.shape[0]} x {self.shape[1]} elements, got {len(P)}")
        outside = np.flatnonzero(~self.patch.contains(P))  # NaN counts as outside
        if outside.size:
            p, (x, y), patch = int(outside[0]), P[outside[0]], self.patch
            raise Refusal(
                f"{outside.size} of {len(P)} elements lie outside the {patch.name}: element {p} is "
                f"at ({x:g}, {y:g}) m; positions are in metres from the corner x = y = 0, the "
                f"middle of the skin is at ({patch.a / 2:g}, {patch.b / 2:g})"
            )
        if isinstance(self.patch, Cap | MeshSkin):
            self._check_on_cap()
        self._check_gages()
        self._check_cells()

    def _check_on_cap(self) -> None:
        if self.reads is not None and "slope" in self.reads.quantity:
            raise Refusal(
                f"expected heights, curvature or twist of each element of a {self.patch.name}, got "
                "slopes, which how far the skin moves along itself changes; read curvature instead"
            )

    def _check_gages(self) -> None:
        L = self.gage_length
        if not L:
            return
        if not _SHORTEST <= L < math.inf:
            raise Refusal(f"expected a gage length of 0 m, or {_SHORTEST:g} m and more, got {L}")
        if isinstance(self.patch, MeshSkin):
            inside = self._has_gages(self.positions, self.turns)
            if not inside.all():
                raise Refusal(
                    f"gages of {L:g} m go over the rim of the {self.patch.name} at element "
                    f"{int(np.argmin(inside))}; use shorter ones"
                )
            return
        depth = self.patch.depth(self.positions)
        least = int(np.argmin(depth))
        if depth[least] * (1 + _ROUNDING) < L / 2:
            longest = 2 * depth[least]
            if float(f"{longest:.4g}") > longest * (1 + _ROUNDING):
                longest *= 1 - 5e-4  # which is rounded down to no more than it was
            raise Refusal(
                f"gages of {L:g} m go over the rim of the {self.patch.name}: element {least} is "
                f"{depth[least]:.4g} m inside; expected a gage length of at most "
                f"{longest:.4g} m"
            )

    def _check_cells(self) -> None:
        if not any(self.cell):
            return
        if not all(0 <= side < math.inf for side in self.cell):
            raise Refusal(f"expected two sides of a cell of at least 0 m, got {self.cell}")
        inside = self._has_cells(self.positions, self.turns)
        if not inside.all():
            raise Refusal(
                f"cells of {self.cell[0]:g} x {self.cell[1]:g} m go over the rim of the "
                f"{self.patch.name} at element {int(np.argmin(inside))}; use smaller ones"
            )

    @classmethod
    def regular(cls, patch: Patch, m: int, n: int) -> "SensorLayout":
        """Elements at the centres of an m x n tiling, without those off a disk or a polygon.

        A layout that lacks some has no `shape`.
        """
        x, y = patch.cell_centres(m, n)
        positions = np.column_stack([np.tile(x, n), np.repeat(y, m)])
        on = patch.contains(positions)
        shape = (m, n) if on.all() else None
        return cls(patch, positions[on], _channels(patch, int(on.sum())), shape)

    @classmethod
    def scattered(cls, patch: Patch, positions: ArrayLike) -> "SensorLayout":
        """Elements at `positions` (P, 2) in m, anywhere on the patch."""
        try:
            points = np.array(positions, float)
        except ValueError as error:
            raise Refusal(f"expected positions of shape (P, 2) in m, got {error}") from error
        if points.ndim != 2:
            raise Refusal(f"expected positions of shape (P, 2) in m, got {points.shape}")
        return cls(patch, points, _channels(patch, len(points)))

    @classmethod
    def on_rings(cls, patch: Patch, counts: Iterable[int]) -> "SensorLayout":
        """Elements on rings about the middle of a disk or a cap, as many on each as `counts` say.

        The rings are evenly far apart, the last one half as far from the rim. A first ring of one
        element is in the middle; every other ring is turned by half of its step.
        """
        rim, each = _round(patch).rim_radius, list(counts)
        if not each or min(each) < 1:
            raise Refusal(f"expected at least one element on each ring, got {each or 'no ring'}")
        begin = 0.0 if each[0] == 1 else 0.5
        far: Array = rim * (np.arange(len(each), dtype=float) + begin) / (len(each) - 0.5 + begin)
        turns = [(np.arange(n) + k % 2 / 2) / n for k, n in enumerate(each)]
        return cls._about_middle(patch, np.repeat(far, each), np.concatenate(turns))

    @classmethod
    def in_spiral(cls, patch: Patch, count: int) -> "SensorLayout":
        """`count` elements on a Fibonacci spiral of a disk or a cap: one to each equal area.

        Each is turned by the golden angle from the one before. The last ones are half the mean
        distance of two elements from the rim.
        """
        rim, N = _round(patch).rim_radius, count
        if N < 1:
            raise Refusal(f"expected at least one element on a spiral, got {N}")
        far: Array = np.linspace(0.0, rim, 4097)
        around: Array = patch.meridian(far).radius if isinstance(patch, Cap) else far
        area: Array = np.concatenate([[0.0], np.cumsum(around[1:] + around[:-1])]) * np.pi * far[1]
        within = float(np.interp(rim - math.sqrt(area[-1] / N) / 2, far, area))
        places: Array = np.interp((np.arange(N, dtype=float) + 0.5) / N * within, area, far)
        return cls._about_middle(patch, places, np.arange(N) * (3 - math.sqrt(5)) / 2)

    @classmethod
    def spread(cls, patch: Patch, count: int) -> "SensorLayout":
        """`count` elements spread evenly over a mesh."""
        if not isinstance(patch, MeshSkin):
            raise Refusal(f"expected a mesh to spread elements over, got a {patch.name}")
        if not 1 <= count <= len(patch.points):
            raise Refusal(f"expected 1 to {len(patch.points)} elements, one at a node, got {count}")
        return cls.scattered(patch, patch.places[patch.spread(count)])

    @classmethod
    def _about_middle(cls, patch: Patch, far: Array, turns: Array) -> "SensorLayout":
        """Elements so `far` (P,) in m from the middle along the skin, after `turns` (P,) from x."""
        around = 2 * np.pi * turns
        x, y = patch.a / 2 + far * np.cos(around), patch.b / 2 + far * np.sin(around)
        return cls.scattered(patch, np.column_stack([x, y]))

    def reading(
        self,
        element: ArrayLike,
        quantity: ArrayLike,
        direction: ArrayLike = 0.0,
        free: Iterable[str] = (),
    ) -> "SensorLayout":
        """The same elements with other readings (`Readings`): a `quantity` of an `element` each.

        One quantity or direction, not (R,) of them, is that of all.
        """
        element = np.asarray(element)
        names, along = np.array(quantity, str), np.array(direction, float)
        names, along = (
            np.broadcast_to(a, element.shape) if a.ndim == 0 else a for a in (names, along)
        )
        reads = Readings(element, names, along, tuple(free))
        return replace(self, reads=reads, live=np.ones(element.shape, bool))

    def reading_each(self, names: Iterable[str]) -> "SensorLayout":
        """The same elements, each with the readings of these `names` (`kind_of_reading`).

        Reading k P + p is number k of element p. xx, yy and xy make a curvature sensor.
        """
        kinds = [kind_of_reading(name) for name in names]
        if not kinds or len(set(kinds)) < len(kinds):
            raise Refusal(
                f"expected at least one reading, each once, got {', '.join(names) or 'none'}"
            )
        if tuple(kinds) == _CURVATURES:
            return self.of_curvature
        P, (quantities, directions) = len(self), zip(*kinds, strict=True)
        element = np.tile(np.arange(P), len(kinds))
        return self.reading(element, np.repeat(quantities, P), np.repeat(directions, P))

    @property
    def of_curvature(self) -> "SensorLayout":
        """The same elements as a curvature sensor, all of them live."""
        return replace(self, reads=None, live=_channels(self.patch, len(self)))

    def turned(self, turns: ArrayLike) -> "SensorLayout":
        """The same on a mesh, with what each element reads along turned by `turns` (P,) in rad.

        A curvature sensor then reads curvatures along 0, 90 and 45 degrees of its own axis.
        """
        if not isinstance(self.patch, MeshSkin):
            raise Refusal(
                f"expected elements that are turned on a mesh, got a {self.patch.name}; let them "
                "read slope@DEGREES or curvature@DEGREES instead"
            )
        if self.reads is None:
            return self.reading_each(_ROSETTE).turned(turns)
        reads, turns = self.reads, np.asarray(turns, float)
        if turns.shape != (len(self),) or not np.isfinite(turns).all():
            raise Refusal(f"expected a turn in rad of each of {len(self)} elements, got {turns}")
        if "twist" in reads.quantity:
            raise Refusal(
                "expected readings along directions of elements that are turned, got a twist; read "
                "curvature@0, curvature@90 and curvature@45 instead"
            )
        turn = turns[reads.element]
        return replace(self, reads=replace(reads, direction=reads.direction + turn, turn=turn))

    @property
    def turns(self) -> Array | None:
        """By how much the axis of each element (P,) is turned from x in rad; None where none is."""
        if self.reads is None or self.reads.turn is None:
            return None
        found = np.zeros(len(self))
        found[self.reads.element] = self.reads.turn
        return found

    def has_room(self, positions: Array) -> Mask:
        """At which `positions` (C, 2) in m the gages and cells of an element are on the skin."""
        if isinstance(self.patch, MeshSkin):
            on = self._has_gages(positions)
        else:
            on = self.patch.depth(positions) * (1 + _ROUNDING) >= self.gage_length / 2
        return on & self._has_cells(positions)

    def _has_gages(self, positions: Array, turns: Array | None = None) -> Mask:
        """At which `positions` (C, 2) in m both ends of all gages along the skin are on it."""
        on, far = np.ones(len(positions), bool), self.gage_length / 2 * (1 - _ROUNDING)
        diagonal = np.pi / 4
        along = {t for name, t in self.kinds if name in _ALONG}
        along |= {diagonal, -diagonal} if "twist" in dict(self.kinds) else set()
        for t in along if far else ():
            ways = _unit(t if turns is None else t + turns)
            for end in (-far, far):
                on &= self.patch.contains(self.patch.along(positions, ways, end)[0])
        return on

    def _has_cells(self, positions: Array, turns: Array | None = None) -> Mask:
        """At which `positions` (C, 2) in m the corners of cells along the skin are on it."""
        half = np.array(self.cell) / 2 * (1 - _ROUNDING)
        on, far = np.ones(len(positions), bool), math.hypot(*half)
        for x, y in half * [[1, 1], [1, -1], [-1, 1], [-1, -1]] if far else ():
            way = math.atan2(y, x)
            ways = _unit(way if turns is None else way + turns)
            on &= self.patch.contains(self.patch.along(positions, ways, far)[0])
        return on

    def reading_at(self, positions: ArrayLike, which: Indices) -> "SensorLayout":
        """Elements at other `positions` (C, 2) in m, each with the readings `which` (k,) of these.

        Reading j C + c is which[j] of element c.
        """
        made = SensorLayout.scattered(self.patch, positions)
        made = replace(made, gage_length=self.gage_length, cell=self.cell)
        numbers: list[int] = self.kind[which].tolist()
        kinds, C = [self.kinds[k] for k in numbers], len(made)
        if not self.reads and kinds == self.kinds:
            return made
        quantity, direction = (np.repeat(of, C) for of in zip(*kinds, strict=True))
        free = self.reads.free if self.reads else ()
        return made.reading(np.tile(np.arange(C), len(which)), quantity, direction, free)

    def read_alike(self, positions: ArrayLike) -> "SensorLayout":
        """Elements at other `positions` (C, 2) in m, each with the k readings of every element.

        Reading k C + c is number k of element c. A `Refusal` where elements differ in what they
        read.
        """
        return self.reading_at(positions, len(self) * np.arange(len(self.each_reads)))

    def in_unit(self, unit: str) -> "SensorLayout":
        """The same elements with their readings in this `unit` only."""
        of_kind = np.array(self.kind_units) == unit
        if not self.reads or of_kind.all():
            return self
        own, reads = of_kind[self.kind], self.reads
        quantity = reads.quantity[own]
        free = tuple(name for name in reads.free if name in quantity)
        turn = None if reads.turn is None else reads.turn[own]
        kept = Readings(reads.element[own], quantity, reads.direction[own], free, turn)
        return replace(self, reads=kept, live=self.live[own])

    def without(self, elements: Iterable[int]) -> "SensorLayout":
        """The same layout with all channels of `elements` dead."""
        live = self.live.copy()
        dead = list(elements)
        if any(not 0 <= p < len(self) for p in dead):
            raise Refusal(f"expected dead elements between 0 and {len(self) - 1}, got {dead}")
        live[np.isin(self.element, dead).reshape(live.shape)] = False
        return replace(self, live=live)

    @property
    def alive(self) -> Mask:
        """Which elements (P,) have a live reading."""
        return np.isin(np.arange(len(self)), self.element[self.live.ravel()])

    @property
    def dead(self) -> list[int]:
        """The elements that have readings, all of them dead."""
        return np.setdiff1d(self.element, np.flatnonzero(self.alive)).tolist()

    @property
    def lacking(self) -> Mask:
        """The dead channels, of those that this patch has, as `live`."""
        if self.reads:
            return ~self.live
        return _channels(self.patch, len(self)) & ~self.live

    def __len__(self) -> int:
        return len(self.positions)

    def __str__(self) -> str:
        return "{} x {} elements".format(*self.shape) if self.shape else f"{len(self)} elements"

    @property
    def frame_shape(self) -> tuple[int, ...]:
        """The shape of the readings of a frame: (3, P) of a curvature sensor, (R,) of others."""
        return self.live.shape

    @property
    def channels(self) -> int:
        """The number R of readings of a frame."""
        return self.live.size

    @property
    def element(self) -> Indices:
        """The element (R,) of each reading."""
        return self.reads.element if self.reads else np.tile(np.arange(len(self)), 3)

    @property
    def kinds(self) -> list[tuple[str, float]]:
        """The different quantities that are read, each with its direction in rad."""
        return self.reads.kinds[0] if self.reads else list(_CURVATURES)

    @property
    def directed(self) -> tuple[list[tuple[str, float]], Indices]:
        """The `kinds` with directions from x also of elements that are turned, and the `kind`."""
        return self.reads.directed if self.reads else (self.kinds, self.kind)

    @property
    def kind(self) -> Indices:
        """Which of `kinds` each reading (R,) is."""
        return self.reads.kinds[1] if self.reads else np.repeat(np.arange(3), len(self))

    @property
    def kind_names(self) -> list[str]:
        """The names of `kinds`; xx, yy and xy of a curvature sensor."""
        return [name_of_reading(*kind) for kind in self.kinds] if self.reads else [*COMPONENTS]

    @property
    def kind_units(self) -> list[str]:
        """The units of `kinds`."""
        return [QUANTITIES[quantity] for quantity, _ in self.kinds]

    @property
    def each_reads(self) -> list[str]:
        """The names of the k readings of every element, reading k P + p that of element p.

        A `Refusal` where elements differ in what they read.
        """
        P, kind = len(self), self.kind
        first = kind[::P]
        blocks = np.array_equal(kind, np.repeat(first, P)[: len(kind)])
        in_order = np.array_equal(self.element, np.tile(np.arange(P), len(first))[: len(kind)])
        if len(kind) % P or not (blocks and in_order):
            raise Refusal(
                "expected the same readings of every element, all elements of one after the "
                f"other, got {len(kind)} readings of {P} elements; make them with reading_each"
            )
        return [self.kind_names[k] for k in first]

    def reading_name(self, channel: int) -> str:
        """What a reading is, in words: height of element 3."""
        return f"{self.kind_names[self.kind[channel]]} of element {self.element[channel]}"

    def by_kind(self, readings: Array) -> Array:
        """`readings` (..., R), by kind and element, (..., k, P); NaN where there is none.

        Those of a curvature sensor as they are, (..., 3, P).
        """
        if not self.reads:
            return readings
        found = np.full((*readings.shape[:-1], len(self.kinds), len(self)), np.nan)
        found[..., self.kind, self.element] = readings
        return found

    @property
    def senses_curvature(self) -> bool:
        """Whether a reading is of curvature, and depends on the slope too."""
        return not {name for name, _ in self.kinds}.isdisjoint(_CURVED)

    @property
    def senses_curvature_only(self) -> bool:
        """Whether a movement without curvature changes no reading."""
        return {name for name, _ in self.kinds}.issubset(_CURVED)

    @property
    def units(self) -> str:
        """The units of the readings, in words."""
        read = {name for name, _ in self.kinds}
        return " or ".join(dict.fromkeys(QUANTITIES[name] for name in QUANTITIES if name in read))

    def multipliers(self, sines: SineBasis) -> Array:
        """Factors (k, Ni, Nj) of the k `kinds` of readings by their average over gages or cells.

        For slopes and curvatures along x or y.
        """
        ki, kj = np.meshgrid(*sines.wavenumbers, indexing="ij")
        over_cell, L = _sinc(ki * self.cell[0] / 2) * _sinc(kj * self.cell[1] / 2), self.gage_length
        gages = gage_multipliers(sines, L)

        def factors(name: str, direction: float) -> Array:
            if name == "twist":
                return gages[2]
            along_y = int(abs(math.sin(direction)) > _DIAGONAL)
            if name == "curvature":
                return gages[along_y]
            return _sinc((ki, kj)[along_y] * L / 2) if name == "slope" and L else over_cell

        return np.stack([factors(*kind) for kind in self.kinds])

    @property
    def offsets(self) -> Array:
        """The readings (R, d) of each offset of 1 of a quantity whose zero is unknown."""
        if not self.reads:
            return np.empty((self.channels, 0))
        free = [k for k, (name, _) in enumerate(self.kinds) if name in self.reads.free]
        return np.equal.outer(self.kind, free).astype(float)

    def stated(self, noise: Iterable[tuple[str, float]]) -> list[float]:
        """That `noise` of each of `kinds`, by its name or that of its quantity; 0 without one."""
        by = dict(noise)
        return [by.get(name_of_reading(*kind), by.get(kind[0], 0.0)) for kind in self.kinds]

    def sigma(self, noise: Iterable[tuple[str, float]]) -> Array | None:
        """Standard deviation (R,) by the `noise` of readings that differ in it or unit.

        None where they do not. A `Refusal` where that of one is not stated.
        """
        each = self.stated(noise)
        if len(set(self.kind_units)) == len(set(each)) == 1:
            return None
        if 0.0 in each:
            unknown = self.kinds[each.index(0.0)][0]
            raise Refusal(
                f"expected the noise of readings that differ in unit, {self.units}, got none of "
                f"{unknown}; give noise in [readings.{unknown}]"
            )
        return np.array(each)[self.kind]

    def check_curvature_sensor(self, purpose: str) -> None:
        """Raise a `Refusal` where the elements do not read xx, yy and xy, as a `purpose` needs."""
        if self.reads:
            names = ", ".join(dict.fromkeys(name for name, _ in self.kinds))
            raise Refusal(
                f"expected a curvature sensor for {purpose}: xx, yy and xy of every element; got "
                f"readings of {names}"
            )

    def operator(self, basis: Basis, plate: Plate | None = None) -> Array:
        """M (R, N): `M @ coefficients.ravel()` is a frame's readings, flattened (Eqs. 2-5, 11).

        With a `plate`, that of its deflection under loads: a bent skin stretches under them.
        """
        if basis.patch != self.patch:
            raise Refusal(f"the layout is on {self.patch}, the basis on {basis.patch}; use one")
        curvature = plate.curvature(basis) if plate else partial(curvature_at, basis)
        if self.reads:
            rows = self._read_by(self.reads, basis, plate, curvature)
        else:
            rows = self.mean_curvature(basis, curvature)
        return rows if self.scale is None else self.scale[:, None] * rows

    def mean_curvature(self, basis: Basis, curvature: ValuesAt) -> Array:
        """Means over the gages (3 P, N) of the `curvature` (3, P, N) at positions (P, 2).

        Of elements that are turned, along their axes alone (P, N).
        """
        along = partial(_along, basis, self.positions, self.gage_length, curvature)
        if (turns := self.turns) is not None:
            return along(_unit(turns))
        if not self.gage_length:
            return np.concatenate(curvature(self.positions))
        return np.concatenate([along(_X), along(_Y), _twist(along)])

    def _read_by(
        self, reads: Readings, basis: Basis, plate: Plate | None, curvature: ValuesAt
    ) -> Array:
        """The operator (R, N), quantity by quantity."""
        M, L, H = np.empty((self.channels, basis.size)), self.gage_length, self.patch.arc_curvature
        for name in dict.fromkeys(name for name, _ in self.kinds):
            own = np.flatnonzero(reads.quantity == name)
            at, t = self.positions[reads.element[own]], reads.along[own]
            axis = _X if reads.turn is None else _unit(reads.turn[own])

            def slope(places: Array, t: Array = t) -> Array:
                found = _slope(basis, places, t)
                if H:
                    v = (plate.hoop(basis, places) if plate else hoop_at(basis, places))[0]
                    found += H * t[:, :1] * v
                return found

            if name == "height":
                M[own] = _over_cell(basis.at, self.patch, at, self.cell, axis)
            elif name == "slope" and not L:
                M[own] = _over_cell(slope, self.patch, at, self.cell, axis)
            elif name == "slope" and H:
                M[own] = _over_gage(_any_way(slope), self.patch, at, L, t)
            elif name == "slope":
                M[own] = (basis.at(at + L / 2 * t) - basis.at(at - L / 2 * t)) / L
            elif name == "curvature" or not L:
                xy = name == "twist"
                M[own] = curvature(at)[2] if xy else _along(basis, at, L, curvature, t)
            else:
                M[own] = _twist(partial(_along, basis, at, L, curvature))
        return M


# The deflected skin is r = r0 - f n0 + v t. r0 is the skin at rest, of curvature H along x, t and e
# are unit vectors along x and y, n0 the outward normal; f is the displacement inward, and v the one
# along the arc that the curvature of first order has: none on a flat skin. With the slopes
# p = f_x + H v and q = f_y and with w = v_y, the derivatives of r along t, e and n0 are
#     r_x = (1, 0, -p)     r_xx = (-H p, 0, -H - p_x)     r_xy = (0, 0, -p_y)
#     r_y = (w, 1, -q)     r_yy = (w_y, 0, -q_y)          r_x x r_y = (p, q - p w, 1) = W n.
# p_x, q_y and p_y are xx, yy and xy of first order. Gages along y have turned to r_y. So have gages
# along x, as the skin is not sheared: they lie along d = r_x - w r_y, and a gage along t = (c, s)
# along c d + s r_y. With the metric I, the scalar products of d and r_y, and the second form
# II_ij = -n . r_ij of the same vectors, with I_tt = c^2 I_dd + 2 c s I_dy + s^2 I_yy and II_tt
# alike, the readings are
#     along t: II_tt / I_tt - c^2 H         xy: (II_dy - H I_dy / 2) / sqrt(I_dd I_yy).
# Of first order they are that one; that the arc is hardly stretched, v_x = H f, is taken for
# granted. On a flat skin W^2 = 1 + p^2 + q^2, and they are
#     f_tt / (W (1 + f_t^2))      f_xy / (W sqrt((1 + p^2) (1 + q^2))).
# Both are of two unit vectors u and v, which are t and t, or x and y: II_uv / sqrt(I_uu I_vv). What
# shear takes off is (1 - u.v) H I_dy / 2. Heights and slopes are of first order by definition:
# their u and v, p, q and w are zero.
# On a shallow skin and a cap no tangential displacement is in it, but the curvature b of the base
# has xx, yy and xy. With b (p, q) = (k, l)
#     r_x = (1, 0, -p)     r_xx = (-p b_xx, -p b_xy, -b_xx - p_x)     r_x x r_y = (p, q, 1) = W n,
#     r_y = (0, 1, -q)     r_yy = (-q b_xy, -q b_yy, -b_yy - q_y)     r_xy between what both give:
# b_xx + p k, b_yy + q l and b_xy + (p l + q k) / 2 are added to W II, so that tilting a sphere
# bends it nowhere; b_tt is taken off along t, and (1 - u.v) (b_xx + b_yy) I_xy / 2 by shear.


class DeflectedSurface:
    """What R readings are on the deflected surface, from the `jet` (Q, ..., R) of each.

    That is the reading of first order, p and q as derived above; on a cylinder skin also w, w_y,
    q_y and p_y. `forms` (3, 3, R) are what of dd, dy and yy is in uu, vv and uv. `base` (3, 1)
    or (3, R) in 1/m is the curvature xx, yy, xy at rest; empty where that is flat.
    """

    def __init__(self, jet: Array, forms: Array, base: Array) -> None:
        self._jet, self._forms, self._base = jet, forms, base
        self._is_arc, self._is_bent = len(jet) > 3, len(base) > 0
        first, p, q = jet[:3]
        dd, dy, yy, m = p * p, p * q, q * q, q
        if self._is_arc:
            w, wy, qy, py = jet[3:]
            dd, dy = (p - w * q) ** 2 + w * w * (w * w - 1), dy - w * (w * w + yy)
            yy, m, in_y = yy + w * w, q - p * w, qy - p * wy
            in_d = base[0] * (1 + p * p) - w * (2 * py - w * in_y)
            first = first + self._mixed(2, in_d, -w * in_y, -p * wy)
        elif self._is_bent:
            bx, by, bxy = base
            k, o = bx * p + bxy * q, bxy * p + by * q
            first = first + self._mixed(2, bx + p * k, bxy + (p * o + q * k) / 2, by + q * o)
        self._first, self._area = first, 1 + p * p + m * m  # W II_uv and W^2
        self._lengths = [1 + self._mixed(k, dd, dy, yy) for k in range(2)]  # I_uu and I_vv
        self._length = np.sqrt(self._lengths[0]) * np.sqrt(self._lengths[1])
        self._scale = 1 / (np.sqrt(self._area) * self._length)
        self._second = self._ratio = self._scale * first
        if self._is_bent:
            shear = (base[0] + base[1]) / 2 * (1 - forms[2, 0] - forms[2, 2])
            self._sheared = shear / self._length
            self._ratio = self._second - self._sheared * dy

    def _mixed(self, k: int, dd: Array, dy: Array, yy: Array) -> Array:
        form = self._forms[k]
        return form[0] * dd + form[1] * dy + form[2] * yy

    @property
    def readings(self) -> Array:
        """What is read, (..., R)."""
        if not self._is_bent:
            return self._ratio
        xx, yy, xy = self._base
        return self._ratio - self._mixed(2, xx, xy, yy)

    @property
    def slope(self) -> Array:
        """The slope (..., R) along the steepest direction; 0 of heights and slopes."""
        return np.hypot(self._jet[1], self._jet[2])

    def jacobian(self) -> Array:
        """How the readings of one frame change with their jet, (Q, R)."""
        found, rates = np.zeros_like(self._jet), self._rates()
        found[0] = self._scale
        if self._is_bent:
            own = [1, 3, 4, 5, 6] if self._is_arc else [1, 2]
            found[own] = self._scale * self._of_second_form()
            found[1 : 1 + len(rates[1])] -= self._sheared * rates[1]
        of_u, of_v = (self._mixed(k, *rates[:3]) for k in range(2))
        in_u, in_v = (self._ratio / (2 * length) for length in self._lengths)
        change = self._second / self._area * rates[3] + in_u * of_u + in_v * of_v
        found[1 : 1 + len(change)] -= change
        return found

    def _rates(self) -> Array:
        """How I_dd, I_dy, I_yy and W^2 / 2 change with p, with q and with w, (4, 2 or 3, R)."""
        p, q = self._jet[1:3]
        none = np.zeros_like(p)
        if not self._is_arc:
            return np.array([[2 * p, none], [q, p], [none, 2 * q], [p, q]])
        w = self._jet[3]
        m, e = q - p * w, p - w * q
        return np.array(
            [
                [2 * e, -2 * w * e, 4 * w**3 - 2 * w - 2 * q * e],
                [q, p - 2 * w * q, -3 * w * w - q * q],
                [none, 2 * q, 2 * w],
                [p - w * m, m, -p * m],
            ]
        )

    def _of_second_form(self) -> Array:
        """How W II_uv changes with p, w, w_y, q_y and p_y, (5, R); without w with p and q."""
        if not self._is_arc:
            (p, q), (xx, yy, xy) = self._jet[1:3], self._base
            mean = (xx + yy) / 2
            with_p = self._mixed(2, 2 * xx * p + xy * q, xy * p + mean * q, xy * q)
            with_q = self._mixed(2, xy * p, mean * p + xy * q, 2 * yy * q + xy * p)
            return np.array([with_p, with_q])
        _, p, _, w, wy, qy, py = self._jet
        in_y, none, square = qy - p * wy, np.zeros_like(p), w * w
        in_dd = [
            2 * self._base[0] * p - square * wy,
            2 * (w * in_y - py),
            -square * p,
            square,
            -2 * w,
        ]
        in_dy, in_yy = [w * wy, -in_y, w * p, -w, none], [-wy, none, -p, none, none]
        return self._mixed(2, *np.array([in_dd, in_dy, in_yy]))


class NormalCurvature:
    """The map from coefficients to what the elements read of the deflected surface.

    Gages sense its true normal curvature along them; heights and slopes are those of first order. A
    gage of some length reads the mean of the curvature of first order along it, at the slope in its
    middle. With a `plate` the shapes are those of its deflection under loads.
    """

    def __init__(
        self,
        basis: Basis,
        layout: SensorLayout,
        dtype: DTypeLike = np.float64,
        plate: Plate | None = None,
    ) -> None:
        places, patch = layout.positions, basis.patch
        if isinstance(patch, Cap | MeshSkin):
            at = list(covariant_at(basis, places)[1:3])
        else:  # by shallow shell theory x and y meet at a right angle
            at = [basis.at(places, 1, 0), basis.at(places, 0, 1)]
        if H := patch.arc_curvature:
            v, *turns = plate.hoop(basis, places) if plate else hoop_at(basis, places)
            curvature = plate.curvature(basis)(places) if plate else curvature_at(basis, places)
            at = [at[0] + H * v, at[1], *turns, *curvature[1:]]
        self._at = np.stack(at).astype(dtype)
        self._first = layout.operator(basis, plate).astype(dtype)
        kinds, kind = layout.directed
        along = [_AXES if name == "twist" else [_unit(t)] * 2 for name, t in kinds]
        (a, b), (c, d) = np.moveaxis(np.array(along), 0, -1)
        forms = [
            [a * a, 2 * a * b, b * b],
            [c * c, 2 * c * d, d * d],
            [a * c, a * d + b * c, b * d],
        ]
        curved = np.isin([name for name, _ in kinds], _CURVED)
        self._forms = (curved * np.array(forms))[..., kind].astype(dtype)
        self._element, self._curved = layout.element, curved[kind]
        self._all_curved = bool(self._curved.all())
        self._columns = np.concatenate([self._first, *self._at]).T
        self.frame_shape, self._base = layout.frame_shape, np.empty((0, 1), dtype)
        if any(patch.curvatures):
            self._base = patch.read_at_rest(places)[:, layout.element].astype(dtype)

    @property
    def maps(self) -> Array:
        """From coefficients to the jet of a `DeflectedSurface`, (Q, R, N)."""
        return np.stack([self._first, *(self._at[:, self._element] * self._curved[:, None])])

    def surface(self, flat: Array) -> DeflectedSurface:
        """The surface at the elements, for flattened coefficients (..., N)."""
        values, R = np.dot(flat, self._columns), len(self._first)
        at = values[..., R:].reshape(*flat.shape[:-1], *self._at.shape[:2]).take(self._element, -1)
        if not self._all_curved:
            at *= self._curved
        jet = np.moveaxis(np.concatenate([values[..., None, :R], at], axis=-2), -2, 0)
        return DeflectedSurface(jet, self._forms, self._base)

    def __call__(self, coefficients: Array) -> Array:
        """Readings (..., 3, P) in 1/m, or (..., R), for `coefficients` (..., Ni, Nj)."""
        flat = coefficients.reshape(*coefficients.shape[:-2], self._columns.shape[0])
        return self.surface(flat).readings.reshape(*flat.shape[:-1], *self.frame_shape)
