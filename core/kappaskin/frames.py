"""The values that travel: a frame of counts in, an estimate of shape and contact out."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Counts = NDArray[np.int32]
Mask = NDArray[np.bool_]

COMPONENTS = ("xx", "yy", "xy")
"""Curvature components, in the one order used everywhere."""


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
    elements. Times are in seconds: `device_time` on the device's own clock, `host_time` on this
    machine's monotonic clock, when the bytes were read.
    """

    sequence: int
    device_time: float
    host_time: float
    channels: NDArray[np.intp]
    counts: Counts
    truth: Truth | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Touch:
    """A contact: `position` (2,) in m with `position_sd` (2,) in m, and how hard it is.

    `force` and `force_sd` in N, `displacement` and `displacement_sd` in m, of the skin at the
    contact; `single` says whether one point load explains the readings as well as the shape does.
    Every number is NaN when the readings hold no contact that stands out of the noise.
    """

    position: Array
    position_sd: Array
    force: float
    force_sd: float
    displacement: float
    displacement_sd: float
    single: bool

    @property
    def present(self) -> bool:
        return bool(np.isfinite(self.force))


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """Everything a view, a publisher or a file may show of one frame.

    `curvature` and `residual` (3, P) in 1/m, NaN where a reading is missing; `coefficients`
    (Ni, Nj) in m; `surface` (ny, nx) in m; `noise` is the standard deviation of a reading in 1/m
    as the residual tells it. `true_surface`, `true_contact`, `error_at_load` and `error_rms` (all
    in m) are NaN unless a simulation made the frame. `ready_time` is when the estimate was done,
    on the clock of `host_time`.
    """

    generation: int
    sequence: int
    device_time: float
    host_time: float
    ready_time: float
    curvature: Array
    residual: Array
    coefficients: Array
    surface: Array
    noise: float
    touch: Touch
    true_surface: Array
    true_contact: Array
    error_at_load: float
    error_rms: float
