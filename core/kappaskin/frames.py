"""Frames of counts, and the estimates of shape and contact computed from them."""

import math
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from kappaskin._lazy import Displayed
from kappaskin._text import NO_FORCE, SNAPS

Array = NDArray[np.float64]
Counts = NDArray[np.int32]
Mask = NDArray[np.bool_]
Indices = NDArray[np.intp]

COMPONENTS = ("xx", "yy", "xy")
"""Curvature components, in the one order used everywhere."""

OVERTAKEN = 1.0
"""Seconds that a frame may be older than one before it, by a device's clock: more, it restarted."""


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """What a simulation knows of a frame: `coefficients` (Ri, Rj) in m, `contact` (2,) in m.

    `edge` names the functions that the coefficients belong to.
    """

    coefficients: Array
    contact: Array
    edge: str = "hinged"


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One scan of the skin: `counts` (C,) of the channels listed in `channels` (C,).

    Channel `component * P + element` is one reading of the (3, P) array of a skin with P
    elements. Times are in seconds: `device_time` on the device's own clock when the scan began,
    `host_time` on this machine's monotonic clock when the bytes were read, and on it `taken` +-
    `taken_sd`, when the scan began; NaN and infinity if unknown.
    """

    sequence: int
    device_time: float
    host_time: float
    channels: NDArray[np.intp]
    counts: Counts
    truth: Truth | None = None
    taken: float = math.nan
    taken_sd: float = math.inf


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened on the way, in words; `time` in s on this machine's monotonic clock.

    `kind` is one word: met, gap, gone, back, restarted, other, firmware, changed, rate, refused,
    engine.
    """

    time: float
    kind: str
    text: str


@dataclass(frozen=True, slots=True, eq=False)
class Contact:
    """A contact: `position` (2,) in m with `position_sd` (2,) in m, and how hard it is.

    `force` and `force_sd` in N, `displacement` and `displacement_sd` in m, of the skin at the
    contact: of the fitted shape, and on a cap or a mesh, which bend more closely around a load than
    its functions follow, of a load of this force and size; `spare` readings more than the loads
    need tell the noise. `single` says whether one load on a small area explains the readings: no
    line, no large area, no two contacts.
    `near_rim` warns that the contact is too near a held edge, where no force moves the skin, for a
    reliable position and force.
    `size` and `size_sd` in m^2 are the squared radius of the disc that the load is spread over;
    NaN where the skin does not tell it. `force_is_lower_bound` says that the skin may stretch, by
    which the force would change by more than its error bar (`kappaskin.contact.LargeDeflection`);
    `force_is_upper_bound` likewise that a curved skin softens. Where it `snaps_through` the force
    is NaN, as where the skin's material is unknown; the size is then that of the contact's area.
    Every number is NaN when the readings hold no contact that stands out of the noise.
    """

    position: Array
    position_sd: Array
    force: float
    force_sd: float
    displacement: float
    displacement_sd: float
    spare: int
    single: bool
    near_rim: bool
    size: float = math.nan
    size_sd: float = math.nan
    force_is_lower_bound: bool = False
    force_is_upper_bound: bool = False
    snaps_through: bool = False

    @property
    def present(self) -> bool:
        return math.isfinite(self.position.item(0))

    @property
    def force_bound(self) -> str:
        """What stands before the force: a sign where it is a lower or an upper bound."""
        least = "\N{GREATER-THAN OR EQUAL TO} " if self.force_is_lower_bound else ""
        return "\N{LESS-THAN OR EQUAL TO} " if self.force_is_upper_bound else least

    @property
    def no_force(self) -> str:
        """Why there is no force, in words; empty where there may be one."""
        return NO_FORCE if self.near_rim else SNAPS if self.snaps_through else ""

    @property
    def position_95(self) -> Array:
        """Half widths (2,) in m of the 95 % intervals of the position, by Student's t."""
        return self._reach * self.position_sd

    @property
    def force_95(self) -> float:
        """Half width in N of the 95 % interval of the force, by Student's t."""
        return self._reach * self.force_sd

    @property
    def displacement_95(self) -> float:
        """Half width in m of the 95 % interval of the displacement, by Student's t."""
        return self._reach * self.displacement_sd

    @property
    def load_radius(self) -> float:
        """Radius in m of the disc that the load is spread over."""
        return math.sqrt(self.size)

    @property
    def load_radius_95(self) -> Array:
        """The 95 % interval (2,) in m of the load's radius, by Student's t."""
        reach = self._reach * self.size_sd
        return np.sqrt(np.maximum([self.size - reach, self.size + reach], 0.0))

    @property
    def _reach(self) -> float:
        return float(scipy.special.stdtrit(max(self.spare, 1), 0.975))


@dataclass(frozen=True, slots=True, eq=False)
class LocalGeometry:
    """The skin around a point, or around P points (leading axis), as rolling and sliding need it.

    In the sense of Montana (doi:10.1177/027836498800700302): `position` (..., 3) in m; `frame`
    (..., 3, 3), whose rows are the unit vectors along x, across it, and the outward normal, to the
    side that objects press from; `curvature_form` K (..., 2, 2) and `torsion_form` T (..., 2) in
    1/m; `metric` (..., 2, 2), what a step in the coordinates x, y is along the frame. Montana's
    coordinates are orthogonal and his metric is diagonal. The coordinates of a bent skin are not;
    the frame's first vector stays along x, and the metric is upper triangular: his formulas hold
    with it as they stand. On a cap it stays along the axis that its elements read by, and all four
    numbers of the metric count. Curvature is positive where the skin is convex seen from outside,
    so that a flat skin with a slight displacement f has K = [[f_xx, f_xy], [f_xy, f_yy]] (Eqs.
    3-5).

    `covariance` (..., 3, 3) in 1/m^2 is that of xx, yy and xy of K.
    """

    position: Array
    frame: Array
    metric: Array
    curvature_form: Array
    torsion_form: Array
    covariance: Array

    @property
    def normal(self) -> Array:
        """The outward unit normal (..., 3)."""
        return self.frame[..., 2, :]

    @property
    def first_form(self) -> Array:
        """Scalar products (..., 2, 2) of the surface's derivatives along x and y."""
        return np.swapaxes(self.metric, -1, -2) @ self.metric

    @property
    def second_form(self) -> Array:
        """The second fundamental form (..., 2, 2) in 1/m, with K's sign."""
        return np.swapaxes(self.metric, -1, -2) @ self.curvature_form @ self.metric

    @property
    def mean(self) -> Array:
        """Mean curvature (...) in 1/m."""
        return np.trace(self.curvature_form, axis1=-2, axis2=-1) / 2

    @property
    def gaussian(self) -> Array:
        """Gaussian curvature (...) in 1/m^2."""
        xx, yy, xy = self._components
        return xx * yy - xy**2

    @property
    def principal(self) -> Array:
        """Principal curvatures (..., 2) in 1/m, the larger one first."""
        xx, yy, xy = self._components
        half = np.hypot((xx - yy) / 2, xy)
        return np.stack([self.mean + half, self.mean - half], axis=-1)

    @property
    def angle(self) -> Array:
        """Angle (...) in rad from x to the larger principal curvature; 0 where both are equal."""
        xx, yy, xy = self._components
        return np.arctan2(xy, (xx - yy) / 2) / 2

    @property
    def directions(self) -> Array:
        """Unit vectors (..., 2, 3) along the two principal curvatures."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        turn = np.stack([np.stack([c, s], axis=-1), np.stack([-s, c], axis=-1)], axis=-2)
        return turn @ self.frame[..., :2, :]

    @property
    def mean_sd(self) -> Array:
        """Standard deviation (...) of the mean curvature in 1/m."""
        return self._sd(np.array([0.5, 0.5, 0.0]))

    @property
    def gaussian_sd(self) -> Array:
        """Standard deviation (...) of the Gaussian curvature in 1/m^2, of first order."""
        xx, yy, xy = self._components
        return self._sd(np.stack([yy, xx, -2 * xy], axis=-1))

    @property
    def principal_sd(self) -> Array:
        """Standard deviations (..., 2) of the principal curvatures in 1/m, of first order."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        first = np.stack([c**2, s**2, 2 * c * s], axis=-1)
        second = np.stack([s**2, c**2, -2 * c * s], axis=-1)
        return np.stack([self._sd(first), self._sd(second)], axis=-1)

    @property
    def _components(self) -> tuple[Array, Array, Array]:
        K = self.curvature_form
        return K[..., 0, 0], K[..., 1, 1], K[..., 0, 1]

    def _sd(self, gradient: Array) -> Array:
        """Standard deviation (...) of what changes with xx, yy, xy by `gradient` (..., 3)."""
        variance = np.einsum("...i,...ij,...j->...", gradient, self.covariance, gradient)
        return np.sqrt(np.maximum(variance, 0.0))


@dataclass(frozen=True, slots=True, eq=False)
class Estimate(Displayed):
    """Everything a view, a publisher or a file may show of one frame.

    `nominal` (3, P) in 1/m is what this frame brought as Eq. 8 reads it, whatever calibration and
    tare make of it, `curvature` and `residual` (3, P) in 1/m what they do; NaN where a reading is
    missing; `fresh` (3, P) which readings this frame brought: the others are held from earlier
    ones; `coefficients` (Ni, Nj) in m; `surface` (ny, nx) in m, NaN off the skin and where the
    setup leaves it out; `noise` is the standard deviation of a reading in 1/m as the residual tells
    it; `suspect` (P,) numbers in `FAULTS` why an element was left out, 0 if it was not; `converged`
    is False where an iteration gave up for least squares; `fit_time` in s is what the fit took;
    `drift` in 1/m, by RMS, is how far all readings have smoothly shifted, 0 where no drift is told;
    the shape and contacts are without it. `second` is a weaker contact beside `contact`, which are
    told as two; none is there where its numbers are NaN. `geometry` is that of the skin at the
    first contact. `true_surface`, `true_contact`, `error_at_load` and `error_rms` (all in m) are
    NaN unless a simulation made the frame. `ready_time` is when the estimate was done, on the clock
    of `host_time`; `taken` +- `taken_sd`, in s on it too, when the scan began, as the frame says.
    """

    generation: int
    sequence: int
    device_time: float
    host_time: float
    taken: float
    taken_sd: float
    ready_time: float
    nominal: Array
    curvature: Array
    fresh: Mask
    residual: Array
    coefficients: Array
    surface: Array
    noise: float
    suspect: NDArray[np.uint8]
    converged: bool
    fit_time: float
    drift: float
    contact: Contact
    second: Contact
    geometry: LocalGeometry
    true_surface: Array
    true_contact: Array
    error_at_load: float
    error_rms: float

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """The contacts that are there, the strongest first: none, one or two."""
        return tuple(one for one in (self.contact, self.second) if one.present)
