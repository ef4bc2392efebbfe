"""Scanned regions: the channels of each frame, and the accuracy that they give."""

import math
from dataclasses import dataclass
from functools import cached_property
from operator import index
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from kappaskin.bases import basis_for
from kappaskin.errors import Refusal
from kappaskin.frames import Array, Mask
from kappaskin.mechanics import PointLoad
from kappaskin.sensing import Scan, Sensor

_FUNCTIONS = 15  # along each side, of the shape a point load makes: Table 1's definition
_SINGULAR = 1e-6  # share of the best seen direction below which one is not seen at all


@dataclass(frozen=True)
class Region:
    """Which elements every frame scans while the others take turns, or which channels it scans.

    `around` is "off" (every frame scans everything), "elements" (those in `elements`), or "skin" or
    "intrinsic": the elements within `radius` m of the contact as reported by the skin itself or by
    a force/torque sensor at the base of the fingertip, and everything while there is none. A
    `share` of the other elements is scanned besides in each frame, so that each is scanned every
    1 / share frames. With a share of 0 none are, until the readings held of them have expired and
    those left determine no shape; then everything is scanned once.

    Or `around` is "turns": every frame scans a `share` of all channels, in turn; or "adaptive": as
    many, the most informative about the contact and the surface as chosen by the estimator
    (`Tracking`); with any other estimator they take turns.

    `rate` is the requested frame rate in 1/s; the scan may allow less.
    """

    OFF: ClassVar = "off"
    ELEMENTS: ClassVar = "elements"
    SKIN: ClassVar = "skin"
    INTRINSIC: ClassVar = "intrinsic"
    TURNS: ClassVar = "turns"
    ADAPTIVE: ClassVar = "adaptive"

    around: str = OFF
    elements: tuple[int, ...] = ()
    radius: float = 0.025
    share: float = 0.1
    rate: float = 500.0

    def __post_init__(self) -> None:
        if self.around not in (self.OFF, *_AROUND):
            raise Refusal(
                f"expected a region around {', '.join(_AROUND[:-1])} or {_AROUND[-1]}, or "
                f"{self.OFF}, got {self.around!r}"
            )
        for name in ("radius", "rate"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise Refusal(f"expected Region.{name} above zero, got {value}")
        if not 0 <= self.share <= 1:
            raise Refusal(f"expected Region.share between 0 and 1, got {self.share}")
        if self.by_channel and not self.share:
            raise Refusal(f"expected Region.share above zero for {self.around}, got 0")
        if self.around == self.ELEMENTS and not self.elements:
            raise Refusal("expected at least one element in the region, got none; select some")

    @property
    def by_channel(self) -> bool:
        """Whether frames scan a share of all channels."""
        return self.around in (self.TURNS, self.ADAPTIVE)

    def chosen(self, count: int) -> Mask:
        """Mask (count,) of the `elements`; raises a `Refusal` for one that does not exist."""
        try:
            elements = [index(p) for p in self.elements]
        except TypeError as error:
            raise Refusal(f"expected elements as whole numbers, got {self.elements}") from error
        if any(not 0 <= p < count for p in elements) or len(set(elements)) < len(elements):
            raise Refusal(
                f"expected elements from 0 to {count - 1}, each once, got {self.elements!s:.80}"
            )
        return np.isin(np.arange(count), elements)


_AROUND = (Region.ELEMENTS, Region.SKIN, Region.INTRINSIC, Region.TURNS, Region.ADAPTIVE)


class Scanner:
    """Makes the scan of each next frame: the region, and the other elements in turn."""

    def __init__(self, sensor: Sensor, region: Region) -> None:
        self._sensor, self._region = sensor, region
        self._all = sensor.scan()
        self._inside = (
            region.chosen(len(sensor.layout)) if region.around == Region.ELEMENTS else None
        )
        self._turn = 0
        self._live = np.flatnonzero(sensor.layout.live.ravel())
        self._chosen: NDArray[np.intp] | None = None
        if region.by_channel and not self._live.size:
            raise Refusal(
                f"expected channels to scan, got {sensor.layout}, all of them dead; scan everything"
            )

    @property
    def rate(self) -> float:
        """Requested frame rate in 1/s."""
        return self._region.rate

    @property
    def inside(self) -> Mask | None:
        """The elements (P,) that every frame scans; None while it scans all."""
        return self._inside

    def follow(self, centre: Array) -> None:
        """Scan around `centre` (2,) in m from the next frame on; everything if it is NaN.

        The element nearest to it is always scanned, however small the radius.
        """
        self._inside = None
        if np.isfinite(centre).all():
            distance = np.hypot(*(self._sensor.layout.positions - centre).T)
            self._inside = distance <= max(self._region.radius, float(distance.min()))

    @property
    def count(self) -> int:
        """Number of channels in a frame that scans a share of all."""
        return _elements_per_turn(self._region.share, len(self._live))

    def choose(self, channels: NDArray[np.intp]) -> None:
        """Scan these `channels` (C,) in the next frame."""
        self._chosen = channels

    def __call__(self) -> Scan:
        """The scan of the next frame, its channels in increasing order."""
        if self._region.by_channel:
            chosen, self._chosen = self._chosen, None
            return self._sensor.scan(self._next_channels() if chosen is None else chosen)
        if self._inside is None:
            return self._all
        elements = self._inside.copy()
        elements[self._in_turn()] = True
        return self._sensor.scan(np.flatnonzero(elements[self._sensor.layout.element]))

    def _next_channels(self) -> NDArray[np.intp]:
        next_ones = (self._turn + np.arange(self.count)) % len(self._live)
        self._turn = int(next_ones[-1]) + 1
        return np.sort(self._live[next_ones])

    def _in_turn(self) -> NDArray[np.intp]:
        """The next of the elements outside the region, from where the last frame stopped."""
        outside = np.flatnonzero(~np.asarray(self._inside))
        count = _elements_per_turn(self._region.share, len(outside))
        if not count:
            return outside[:0]
        first = np.searchsorted(outside, self._turn)
        next_ones = outside[(first + np.arange(count)) % len(outside)]
        self._turn = int(next_ones[-1]) + 1
        return next_ones


def _elements_per_turn(share: float, outside: int) -> int:
    """How many of `outside` elements are scanned in one frame."""
    return math.ceil(share * outside - 1e-9)


def contact_bound(
    sensor: Sensor, contact: PointLoad, noise: float, weight: Array | None = None
) -> Array:
    """The Cramer-Rao bound (3,): standard deviations of x and y in m and of the force in N.

    No unbiased estimate of a point load from one frame with Gaussian `noise` in 1/m is better: the
    bound is the inverse of J'WJ / noise^2, with J the derivatives of the readings in the three
    unknowns and W the `weight` (P,) of each element, how often a frame reads it; None means 1.
    Infinite where the readings do not determine them.
    """
    layout = sensor.layout
    across = 1 if layout.patch.strip else _FUNCTIONS
    basis = basis_for(layout.patch, sensor.edge, _FUNCTIONS, across)
    compliance = sensor.plate.compliance(basis)
    by_force, by_x, by_y = (
        compliance(f.reshape(basis.shape)).ravel() for f in basis.jet(contact.x, contact.y)[:3]
    )
    slopes = np.stack([contact.force * by_x, contact.force * by_y, by_force], axis=1)
    each = np.ones(len(layout)) if weight is None else weight
    weights = np.where(layout.live.ravel(), each[layout.element], 0.0)
    M = layout.operator(basis, sensor.plate)
    J: Array = np.sqrt(weights).reshape(-1, 1) * (M @ slopes)
    length = np.linalg.norm(J, axis=0)
    observed = length > 0  # not y on a strip, nor where a contact of no force is
    bound = np.full(3, np.inf)
    if observed.any():
        # Metres and newtons: scaled to unit length, then inverted.
        _, s, Vt = np.linalg.svd(J[:, observed] / length[observed], full_matrices=False)
        if s[-1] > _SINGULAR * s[0] and len(s) == observed.sum():
            bound[observed] = noise * np.linalg.norm(Vt.T / s, axis=1) / length[observed]
    return bound


@dataclass(frozen=True, eq=False)
class ScanTradeoff:
    """The gain in rate and the loss in accuracy of scanning a region.

    `channels` in a frame, `scan_time` in s, frame rate `rate` in 1/s and `gain`, its ratio to that
    of full scans. `bound` (3,) are the least standard deviations of x and y in m and of the force
    in N from one frame; `full_bound` (3,) with everything scanned.
    """

    channels: int
    scan_time: float
    rate: float
    full_rate: float
    bound: Array
    full_bound: Array

    @cached_property
    def gain(self) -> float:
        return self.rate / self.full_rate if math.isfinite(self.full_rate) else 1.0

    @staticmethod
    def of(sensor: Sensor, region: Region, contact: PointLoad, noise: float) -> "ScanTradeoff":
        """The tradeoff of `region` for a `contact` inside it, at `noise` in 1/m.

        Rates are those that the scans allow. An element outside counts by how often it is scanned.
        """
        scanner = Scanner(sensor, region)
        if region.around in (Region.SKIN, Region.INTRINSIC):
            scanner.follow(contact.centre())
        scan, full = scanner(), sensor.scan()
        inside = scanner.inside
        weight = np.full(len(sensor.layout), region.share if region.by_channel else 1.0)
        if inside is not None and not inside.all():
            outside = int((~inside).sum())
            weight[~inside] = _elements_per_turn(region.share, outside) / outside
        return ScanTradeoff(
            len(scan.channels),
            scan.duration,
            scan.rate,
            full.rate,
            contact_bound(sensor, contact, noise, weight),
            contact_bound(sensor, contact, noise),
        )
