"""The accuracy that a design will have before it is built, predicted and checked by simulation."""

import math
from collections.abc import Generator
from dataclasses import dataclass, replace

import numpy as np

from kappaskin.bases import basis_for
from kappaskin.estimation import (
    Estimator,
    check_placement,
    estimator_for,
    place_elements,
    predicted_sd,
)
from kappaskin.frames import Array, Mask
from kappaskin.scenes import Scene, Simulator
from kappaskin.skin import Patch
from kappaskin.studies.design.measures import noise_of
from kappaskin.studies.design.setup import PlacementSettings

_SPACING = 0.4  # of the mean distance between elements: places that are tried
_SIDE = 41  # points along each side of the maps
_BLOCK, _MOST = 250, 5_000  # frames at a time, and in all


@dataclass(frozen=True)
class Design:
    """A `scene` with its elements placed `by` one of `PLACEMENTS`.

    Shapes are reconstructed by least squares with Ni x Nj `functions`.
    """

    scene: Scene
    functions: tuple[int, int] = (8, 8)
    by: str = "scene"

    def __post_init__(self) -> None:
        PlacementSettings(self.by)  # for its refusal

    def estimator(self) -> Estimator:
        """The estimator with the elements placed; raises a `Refusal` where they cannot be."""
        scene, patch = self.scene, self.scene.plate.patch
        check_placement(scene.layout, self.by)
        Ni, Nj = self.functions
        basis = basis_for(patch, scene.edge, Ni, 1 if patch.strip else Nj)
        spacing = _SPACING * math.sqrt(patch.a * patch.b / len(scene.layout))
        return estimator_for(
            "least-squares", basis, place_elements(scene.layout, basis, self.by, spacing)
        )


def _shares(on: Mask) -> Array:
    """How much of the skin each point of a map stands for, (ny, nx): half on its first and last."""
    shares = on.astype(float)
    shares[[0, -1]] /= 2
    shares[:, [0, -1]] /= 2
    return shares / shares.sum()


def _over_skin(sd: Array) -> float:
    """The square root of the mean variance over the skin, in m."""
    on = np.isfinite(sd)
    return float(np.sqrt(_shares(on)[on] @ sd[on] ** 2))


@dataclass(frozen=True, eq=False)
class Prospect:
    """What is predicted of a design: `sd` (ny, nx) of the displacement in m, NaN off the skin.

    `x` (nx,) and `y` (ny,) are in m, `positions` (P, 2) where the elements are, `rate` in 1/s what
    the conversions allow.
    """

    x: Array
    y: Array
    sd: Array
    positions: Array
    rate: float

    @property
    def rms(self) -> float:
        """The square root of the mean variance over the skin, in m."""
        return _over_skin(self.sd)

    @property
    def worst(self) -> float:
        """The largest standard deviation on the skin, in m."""
        return float(np.nanmax(self.sd))


@dataclass(frozen=True, eq=False)
class Check:
    """What came of simulating a design for so many `frames`.

    `sd` (ny, nx) in m is what the displacement varied by at the points of its prospect; `rms` in m
    over the skin is the error of the reconstruction, what the functions cannot represent included.
    """

    frames: int
    sd: Array
    rms: float

    @property
    def rms_sd(self) -> float:
        """The square root of the mean variance over the skin, in m, as its prospect's `rms`."""
        return _over_skin(self.sd)


def _points(patch: Patch) -> tuple[Array, Array, Mask, Array]:
    """The map's x and y, which of its points (ny, nx) are on the skin, and those (G, 2)."""
    x, y = patch.grid(_SIDE, 2 if patch.strip else _SIDE)
    grid = np.stack(np.meshgrid(x, y), axis=-1)
    on: Mask = patch.contains(grid.reshape(-1, 2)).reshape(grid.shape[:2])
    return x, y, on, grid[on]


def _on_map(on: Mask, values: Array) -> Array:
    made = np.full(on.shape, np.nan)
    made[on] = values
    return made


def prospect(design: Design) -> Prospect:
    """The standard deviations that the covariance predicts of a design, without a simulation."""
    estimator = design.estimator()
    x, y, on, points = _points(design.scene.plate.patch)
    sd = predicted_sd(estimator, noise_of(design.scene), points)
    layout = estimator.layout
    rate = 1 / design.scene.transduction.scan_time(3 * len(layout))
    return Prospect(x, y, _on_map(on, sd), layout.positions, rate)


def check(design: Design, frames: int = _MOST, seed: int = 0) -> Generator[Check]:
    """What simulating a design gives, after every few frames until there are so many.

    The readings are made as all simulations make them, with every effect of the scene.
    """
    estimator = design.estimator()
    _, _, on, points = _points(design.scene.plate.patch)
    scene = replace(design.scene, layout=estimator.layout, seed=seed)
    simulator, scan = Simulator(scene), scene.sensor().scan()
    rows, shares = estimator.basis.at(points), _shares(on)[on]
    true_rows = scene.basis.at(points)
    count, mean, squares, off = 0, np.zeros(len(points)), np.zeros(len(points)), 0.0
    while count < frames:
        T = min(_BLOCK, frames - count)
        truths, read = simulator.readings(scan, (count + np.arange(T)) / scene.rate)
        known = np.array([truth.coefficients.ravel() for truth in truths if truth is not None])
        fitted = estimator(read.reshape(T, 3, -1)).coefficients.reshape(T, -1) @ rows.T
        error = fitted - known @ true_rows.T
        off += float(np.sum(error**2 @ shares))
        # Chan's way to add what differs from one mean to what does from another.
        here = error.mean(axis=0)
        share = T / (count + T)
        squares += np.sum((error - here) ** 2, axis=0) + count * share * (here - mean) ** 2
        mean += share * (here - mean)
        count += T
        sd = np.sqrt(squares / max(count - 1, 1))
        yield Check(count, _on_map(on, sd), float(np.sqrt(off / count)))
