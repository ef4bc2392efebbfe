"""Design accuracy: measured in blocks of simulated frames, and predicted."""

import math
import statistics
from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from kappaskin.bases import basis_for
from kappaskin.contact import ContactObject, PointContact, contacts_of, object_finder
from kappaskin.errors import Refusal
from kappaskin.estimation import (
    PLACEMENTS,
    Estimator,
    Fit,
    check_placement,
    estimator_for,
    place_elements,
    predicted_sd,
)
from kappaskin.frames import Array, Contact, Mask, Truth
from kappaskin.mechanics import Plate
from kappaskin.scenes import Indenter, Scene, Simulator, kept_effects
from kappaskin.skin import Patch
from kappaskin.studies.accuracy import covered, points_on, rms_distance, root_mean_square, seconds

# Blocks of frames: what was true, what was read, what was fitted


@lru_cache(2)
def _contact_finder(
    estimator: Estimator, plate: Plate, edge: str
) -> Callable[[Array, Fit], Contact]:
    layout = estimator.layout
    if not (layout.reads or plate.unknown_material):
        return PointContact(plate, layout, edge)
    find = contacts_of(plate, layout, estimator.basis, edge, estimator.sigma)
    return lambda readings, fit: find(readings, fit)[0]


@lru_cache(2)
def _object_finder(
    estimator: Estimator, plate: Plate, edge: str
) -> Callable[[Array, float, Contact], ContactObject]:
    return object_finder(plate, estimator.layout, edge, estimator)


@dataclass(frozen=True, eq=False)
class FrameBlock:
    """T frames that a `simulator` made, and what `estimator` makes of them.

    `truths` are T, or one of a skin that nothing moves on; `readings` are (T, 3, P) in 1/m of a
    curvature sensor, (T, R) in units of theirs of others.
    """

    simulator: Simulator
    estimator: Estimator
    truths: list[Truth]
    readings: Array

    @property
    def scene(self) -> Scene:
        return self.simulator.scene

    @cached_property
    def fits(self) -> list[Fit]:
        """The fit of each frame, by an estimator that may remember those before."""
        return [self.estimator(K) for K in self.readings]

    @cached_property
    def fit(self) -> Fit:
        """The fit of all frames, each of which is taken in once by what remembers."""
        return (
            Fit.stacked(self.fits) if self.estimator.has_memory else self.estimator(self.readings)
        )

    @cached_property
    def coefficients(self) -> Array:
        """The fitted coefficients, (T, N) in m."""
        return self.fit.coefficients.reshape(len(self.readings), -1)

    @cached_property
    def true(self) -> Array:
        """The true coefficients, (T, Nr) in m or (1, Nr)."""
        return np.array([truth.coefficients.ravel() for truth in self.truths])

    @cached_property
    def contact(self) -> Array:
        """True contact positions, (T, 2) in m or (1, 2)."""
        return np.array([truth.contact for truth in self.truths])

    def forces(self) -> Array:
        """True total force, (T,) in N or (1,)."""
        times = frame_times(self.scene, len(self.truths)).tolist()
        return np.array([sum(load.force for load in self.simulator.loads(t)) for t in times])

    def rms_error(self) -> Array:
        """RMS error of the fitted surface over the skin, (T,) in m."""
        basis, reference = self.estimator.basis, self.scene.basis
        return rms_distance(basis, self.coefficients, reference, self.true)

    @cached_property
    def contacts(self) -> list[Contact]:
        """The contact that is found in each frame."""
        find = _contact_finder(self.estimator, self.scene.plate, self.scene.edge)
        return [find(K, fit) for K, fit in zip(self.readings, self.fits, strict=True)]

    def objects(self) -> Generator[ContactObject]:
        """The object that is recognised in each frame."""
        find = _object_finder(self.estimator, self.scene.plate, self.scene.edge)
        for K, fit, contact in zip(self.readings, self.fits, self.contacts, strict=True):
            yield find(K, float(fit.noise), contact)


def frame_times(scene: Scene, frames: int) -> Array:
    return np.arange(frames) / scene.rate


# The measures

_CALLS = 21  # of a fit that is timed


@dataclass(frozen=True)
class StudyMeasure:
    """Something to measure: values (T,) of a block's frames, NaN where a frame has none.

    `title` is what it is called, `unit` what it is shown in, `scale` how many of those the value's
    own unit has. Where there are no frames to average over, it is one value. A `share` is one of
    something, from nothing to all.
    """

    title: str
    unit: str
    scale: float
    of: Callable[[FrameBlock], Array]
    share: bool = False


def _at_load(block: FrameBlock) -> Array:
    at = block.estimator.basis.at(block.contact)
    true = np.vecdot(block.scene.basis.at(block.contact), block.true)
    return np.vecdot(at, block.coefficients) - true


def _contact(block: FrameBlock) -> Array:
    found = np.array([contact.position for contact in block.contacts])
    return np.hypot(*(found - block.contact).T)


def _force(block: FrameBlock) -> Array:
    """As a share of the largest force in the block."""
    found, true = np.array([contact.force for contact in block.contacts]), block.forces()
    largest = np.abs(true).max()
    return np.abs(found - true) / (largest if largest else np.nan)


def _found(block: FrameBlock) -> Array:
    return np.array([float(contact.present) for contact in block.contacts])


def _radius_of(block: FrameBlock) -> float:
    stimulus = block.scene.indenter
    rigid = stimulus.what.rigid if stimulus and isinstance(stimulus.what, Indenter) else None
    if (radius := getattr(rigid, "radius", None)) is None:
        raise Refusal("expected a sphere or a cylinder that presses, to measure errors of radius")
    return radius


def _radius(block: FrameBlock) -> Array:
    true = _radius_of(block)
    off = np.array([abs(found.radius / true - 1) for found in block.objects()])
    return np.where(np.isfinite(off), off, np.nan)


def _covered(block: FrameBlock) -> Array:
    """The share of the skin that lies within the 95 % bands, (T,)."""
    held = covered(block.fit, block.scene.basis, block.true)
    return np.where(np.isnan(block.fit.noise), np.nan, held)  # which makes no bands


def noise_of(scene: Scene) -> float:
    """The standard deviation of all noise there is that differs from reading to reading.

    In the unit of the readings; where they differ in unit, over what [readings] states of each.
    """
    layout, sigma = scene.layout, scene.layout.sigma(scene.transduction.noise)
    noise = np.zeros(layout.channels // len(layout))
    for effect in kept_effects(scene):
        noise = np.hypot(noise, getattr(effect, "each", getattr(effect, "rms", 0.0)))
    noise = noise if sigma is None else noise / sigma[:: len(layout)]
    if not np.allclose(noise, noise[0], atol=0):
        each = zip(layout.each_reads, noise.tolist(), strict=True)
        raise Refusal(
            "expected the same noise in all readings, or in readings that differ in unit what "
            "[readings] states, to predict accuracy from, got "
            f"{', '.join(f'{own:.3g} in {name}' for name, own in each)}"
            f"{'' if sigma is None else ' times that'}; leave out other effects of noise"
        )
    return float(noise[0])


@lru_cache(8)
def _predicted_rms(estimator: Estimator, noise: float) -> float:
    sd = predicted_sd(estimator, noise, points_on(estimator.basis.patch))
    return root_mean_square(sd)


def _predicted(block: FrameBlock) -> Array:
    if block.estimator.has_prior:  # which counts on other skins than one at rest
        return np.array([np.nan])
    return np.array([_predicted_rms(block.estimator, noise_of(block.scene))])


def _rate(block: FrameBlock) -> Array:
    rate = block.scene.sensor().scan().rate
    return np.array([rate if math.isfinite(rate) else math.nan])  # of readings that come at once


def _time(block: FrameBlock) -> Array:
    _ = block.fit  # an estimator with a memory takes all frames in before
    frames = block.readings[np.arange(_CALLS) % len(block.readings)]
    return np.array([statistics.median(seconds(block.estimator, K) for K in frames)])


MEASURES = {
    "rms": StudyMeasure("RMS error of the shape", "mm", 1e3, FrameBlock.rms_error),
    "at-load": StudyMeasure("error at the load, signed", "mm", 1e3, _at_load),
    "contact": StudyMeasure("error of the contact position", "mm", 1e3, _contact),
    "force": StudyMeasure("error of the force, relative to the largest", "%", 1e2, _force),
    "found": StudyMeasure("share of frames with a contact", "%", 1e2, _found, share=True),
    "radius": StudyMeasure("error of the object's radius", "%", 1e2, _radius),
    "covered": StudyMeasure("skin within the 95 % bands", "%", 1e2, _covered, share=True),
    "predicted": StudyMeasure("RMS error due to noise alone, predicted", "mm", 1e3, _predicted),
    "rate": StudyMeasure("highest frame rate by the conversion time", "frames/s", 1.0, _rate),
    "time": StudyMeasure("time to fit a frame", "us", 1e6, _time),
}
"""What can be measured, by name; lengths in m, rates in 1/s, times in s, the others shares of 1.

All but `time` are the same wherever they are computed.
"""


# The accuracy that a design will have before it is built, predicted and checked by simulation

_SPACING = 0.4  # of the mean distance between elements: places that are tried
_SIDE = 41  # points along each side of the maps
_BLOCK, _MOST = 250, 5_000  # frames at a time, and in all


def placed_estimator(
    scene: Scene, functions: tuple[int, int], by: str, distance: float, method: str
) -> Estimator:
    """The estimator of a `method` for elements placed `by` a name, at a least `distance` in m."""
    patch, (Ni, Nj) = scene.plate.patch, functions
    basis = basis_for(patch, scene.edge, Ni, 1 if patch.strip else Nj)
    sigma = scene.layout.sigma(scene.transduction.noise)
    layout = place_elements(scene.layout, basis, by, distance, sigma)
    return estimator_for(method, basis, layout, sigma)


@dataclass(frozen=True)
class Design:
    """A `scene` with its elements placed `by` one of `PLACEMENTS`.

    Shapes are reconstructed by least squares with Ni x Nj `functions`.
    """

    scene: Scene
    functions: tuple[int, int] = (8, 8)
    by: str = "scene"

    def __post_init__(self) -> None:
        if self.by not in PLACEMENTS:
            raise Refusal(f"expected by among {', '.join(PLACEMENTS)}, got {self.by!r}")

    def estimator(self) -> Estimator:
        """The estimator with the elements placed; raises a `Refusal` where they cannot be."""
        layout, patch = self.scene.layout, self.scene.plate.patch
        check_placement(layout, self.by)
        spacing = _SPACING * math.sqrt(patch.a * patch.b / len(layout))
        return placed_estimator(self.scene, self.functions, self.by, spacing, "least-squares")


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
    the conversions allow; infinite where readings come all at once.
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
    scan_time = design.scene.transduction.scan_time(estimator.layout.channels)
    rate = 1 / scan_time if scan_time else math.inf
    return Prospect(x, y, _on_map(on, sd), estimator.layout.positions, rate)


def check(design: Design, frames: int = _MOST) -> Generator[Check]:
    """What simulating a design gives, after every few frames until there are so many.

    The readings are made as all simulations make them, with every effect of the scene.
    """
    estimator = design.estimator()
    _, _, on, points = _points(design.scene.plate.patch)
    scene = replace(design.scene, layout=estimator.layout, seed=0)
    simulator, scan = Simulator(scene), scene.sensor().scan()
    rows, shares = estimator.basis.at(points), _shares(on)[on]
    true_rows = scene.basis.at(points)
    count, mean, squares, off = 0, np.zeros(len(points)), np.zeros(len(points)), 0.0
    while count < frames:
        T = min(_BLOCK, frames - count)
        truths, read = simulator.readings(scan, (count + np.arange(T)) / scene.rate)
        known = np.array([truth.coefficients.ravel() for truth in truths if truth is not None])
        fits = estimator(read.reshape(T, *scene.layout.frame_shape))
        fitted = fits.coefficients.reshape(T, -1) @ rows.T
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
