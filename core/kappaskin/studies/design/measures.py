"""Design accuracy: measured in blocks of simulated frames, and predicted."""

import math
import statistics
from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from typing import cast

import numpy as np
import scipy

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
    place_for_loads,
    predicted_sd,
)
from kappaskin.frames import Array, Contact, Indices, Mask, Truth
from kappaskin.mechanics import DiscLoad, Plate, PointLoad
from kappaskin.scenes import Indenter, Scene, Simulator, kept_effects, planned
from kappaskin.sensing import SensorLayout
from kappaskin.skin import Cap, MeshSkin, Patch
from kappaskin.studies.accuracy import covered, points_on, rms_distance, seconds, shares_of
from kappaskin.studies.summed import summed_functions

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
    return _distance(block.scene.plate.patch, found, block.contact)


def _distance(patch: Patch, found: Array, true: Array) -> Array:
    """Distance (T,) in m of places `found` (T, 2) from `true` ones.

    On a cap or a mesh, through the air; on a strip, along x.
    """
    if isinstance(patch, Cap | MeshSkin):
        return np.linalg.norm(patch.at_rest(found)[0] - patch.at_rest(true)[0], axis=-1)
    return np.linalg.norm((found - true)[:, : 1 if patch.strip else 2], axis=-1)


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


def known_noise(scene: Scene) -> float:
    """As `noise_of`; a `Refusal` where there is none."""
    if noise := noise_of(scene):
        return noise
    raise Refusal(
        "expected noise that counts at the scene's accuracy, to predict errors from, got none "
        f"in {scene.name}; add or raise [effects.gaussian-noise], or press less hard"
    )


@lru_cache(8)
def _predicted_rms(estimator: Estimator, noise: float) -> float:
    patch = estimator.basis.patch
    points = points_on(patch)
    return math.sqrt(predicted_sd(estimator, noise, points) ** 2 @ shares_of(patch, points))


def _predicted(block: FrameBlock) -> Array:
    if block.estimator.has_prior:  # which counts on other skins than one at rest
        return np.array([np.nan])
    return np.array([_predicted_rms(block.estimator, noise_of(block.scene))])


@lru_cache(2)
def _point_contact(scene: Scene, layout: SensorLayout) -> PointContact:
    return PointContact(scene.plate, layout, scene.edge, layout.sigma(scene.transduction.noise))


PressedLoad = PointLoad | DiscLoad


def pressed_load(scene: Scene) -> PressedLoad:
    """The load of a scene by which errors of contact and force are predicted.

    The first of several that differ in their place alone.
    """
    loads = [load for load in scene.loads if isinstance(load, PressedLoad)]
    alike = {replace(load, x=0.0, y=0.0) for load in loads}
    if len(alike) == 1 and len(loads) == len(scene.stimuli):
        return loads[0]
    raise Refusal(
        "expected one point or disc that presses, or some alike, to predict errors of contact and "
        f"force, got {len(scene.stimuli)} stimuli; press with one point or disc"
    )


def _contact_covariance(
    scene: Scene, layout: SensorLayout, load: PressedLoad, noise: float
) -> Array:
    """Covariance (3, 3) due to noise: of the force as a share, and of the place on the skin in m.

    Along the frame of the skin there.
    """
    if scene.plate.unknown_material:
        raise Refusal("expected a skin of known material to predict a force, got an unknown one")
    found = _point_contact(scene, layout).covariance(*_pressed(load), load.force, noise)
    to_skin = np.diag([1 / load.force, 1.0, 1.0])
    to_skin[1:, 1:] = _to_skin(scene, load)
    return to_skin @ found @ to_skin.T


def _pressed(load: PressedLoad) -> tuple[float, float, float]:
    """Where a load is in m, and its radius squared in m^2."""
    return load.x, load.y, load.radius**2 if isinstance(load, DiscLoad) else 0.0


def _to_skin(scene: Scene, load: PressedLoad) -> Array:
    """The map (2, 2) of steps in x and y to those along the frame of the skin under a load."""
    slopes = scene.plate.patch.base(load.x, load.y).slopes
    return np.linalg.inv(slopes) if slopes else np.eye(2)


def _predicted_contact(block: FrameBlock) -> Array:
    """The mean distance of normal errors with the variances u >= v along their main axes."""
    v, u = np.linalg.eigvalsh(_covariances(block)[:, 1:, 1:]).T
    return np.sqrt(2 * u / np.pi) * cast("Array", scipy.special.ellipe(1 - v / u))


def _predicted_force(block: FrameBlock) -> Array:
    return np.sqrt(2 / np.pi * _covariances(block)[:, 0, 0])


def _covariances(block: FrameBlock) -> Array:
    """The covariances (T, 3, 3) of the block's contacts, by noise alone."""
    load = pressed_load(block.scene)
    if len(block.scene.stimuli) > 1:
        raise Refusal(
            "expected one load, to predict errors in each frame from, got several; leave one"
        )
    each = zip(block.contact.tolist(), block.forces().tolist(), strict=True)
    loads = [replace(load, x=x, y=y, force=force) for (x, y), force in each]
    layout, noise = block.estimator.layout, noise_of(block.scene)
    return np.array([_contact_covariance(block.scene, layout, load, noise) for load in loads])


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
    "predicted-contact": StudyMeasure(
        "error of the contact position due to noise alone, predicted", "mm", 1e3, _predicted_contact
    ),
    "predicted-force": StudyMeasure(
        "error of the force due to noise alone, predicted", "%", 1e2, _predicted_force
    ),
    "rate": StudyMeasure("highest frame rate by the conversion time", "frames/s", 1.0, _rate),
    "time": StudyMeasure("time to fit a frame", "us", 1e6, _time),
}
"""What can be measured, by name; lengths in m, rates in 1/s, times in s, the others shares of 1.

All but `time` are the same wherever they are computed.
"""


# The accuracy that a design will have before it is built, predicted and checked by simulation

_SPACING = 0.4  # of the mean distance between elements: places that are tried
_SIDE, _PRESSED_SIDE = 41, 25  # points along each side of the maps, and of those of presses
_BLOCK, _MOST, _MOST_PRESSES = 250, 5_000, 2_000  # frames at a time, and in all
_NEAR_RIM = 1 / 15  # of the shorter side: nearer to the rim, no force is reported
_AREA_STEPS = 513


PLACED_BY = (*PLACEMENTS, "contact")
"""Placements by name: those of `PLACEMENTS`, and the one that determines the scene's load best."""
_LOADS = _PRESSED_SIDE**2  # places of the load at most
_TOGETHER = 500  # candidates whose readings of a load are computed together


def check_name(by: str) -> None:
    """Raise a `Refusal` for a name that is none of `PLACED_BY`."""
    if by not in PLACED_BY:
        raise Refusal(f"expected by among {', '.join(PLACED_BY)}, got {by!r}")


def placed_estimator(
    scene: Scene, functions: tuple[int, int], by: str, distance: float, method: str
) -> Estimator:
    """The estimator of a `method` for elements placed `by` a name, at a least `distance` in m."""
    patch, (Ni, Nj) = scene.plate.patch, functions
    basis = basis_for(patch, scene.edge, Ni, 1 if patch.strip else Nj)
    sigma = scene.layout.sigma(scene.transduction.noise)
    if by == "contact":
        layout = place_for_loads(scene.layout, distance, partial(_load_information, scene))
    else:
        layout = place_elements(scene.layout, basis, by, distance, sigma)
    return estimator_for(method, basis, layout, sigma)


def _load_information(scene: Scene, places: Array) -> tuple[Array, Array, Array]:
    """What elements at `places` (C, 2) tell of the scene's load all over the skin.

    As `place_for_loads` takes it: of the force as a share and the place along the skin.
    """
    load, noise, layout = pressed_load(scene), known_noise(scene), scene.layout
    seen = _map_of(scene, "contact")
    some = np.random.default_rng(0).permutation(len(seen.points))[:_LOADS]
    loads = [replace(load, x=x, y=y) for x, y in seen.points[some].tolist()]
    told = list[Array]()
    for part in np.split(places, range(_TOGETHER, len(places), _TOGETHER)):
        find = _point_contact(scene, layout.read_alike(part))
        each = [find.information(*_pressed(one), one.force, noise) for one in loads]
        told.append(np.stack(each, axis=1))
    information = np.concatenate(told)
    errors = np.zeros((2, *information.shape[1:]))
    to_skin = np.array([_to_skin(scene, one) for one in loads])
    shares = seen.shares[seen.on][some]
    errors[0, :, 0, 0] = shares
    errors[1, :, 1:3, 1:3] = shares[:, None, None] * np.swapaxes(to_skin, 1, 2) @ to_skin
    known = np.zeros(information.shape[2:])
    known[-1, -1] = 1.0  # of the profile
    return information, known, errors


@dataclass(frozen=True)
class Design:
    """A `scene` with its elements placed `by` one of `PLACED_BY`.

    Shapes are reconstructed by least squares with Ni x Nj `functions`.
    """

    scene: Scene
    functions: tuple[int, int] = (8, 8)
    by: str = "scene"

    def __post_init__(self) -> None:
        check_name(self.by)

    def estimator(self) -> Estimator:
        """The estimator with the elements placed; raises a `Refusal` where they cannot be."""
        layout = self.scene.layout
        check_placement(layout, self.by)
        spacing = _SPACING * math.sqrt(_area(self.scene.plate.patch) / len(layout))
        return placed_estimator(self.scene, self.functions, self.by, spacing, "least-squares")

    def placed(self) -> "Design":
        """The same with the elements of its scene where they are placed."""
        layout = self.estimator().layout
        return replace(self, scene=replace(self.scene, layout=layout), by="scene")


def _area(patch: Patch) -> float:
    """The area in m^2 of a cap or a mesh, of other skins that of their box."""
    if isinstance(patch, MeshSkin):
        return float(patch.areas.sum())
    if not isinstance(patch, Cap):
        return patch.a * patch.b
    away, step = np.linspace(0.0, patch.rim_radius, _AREA_STEPS, retstep=True)
    return 2 * math.pi * float(np.trapezoid(patch.meridian(away).radius, dx=float(step)))


@dataclass(frozen=True, eq=False)
class _Map:
    """`places` (ny, nx, 2) in m of a skin, and the `shares` (ny, nx) of it they are for.

    At `x` (nx,) and `y` (ny,) in m; on a mesh its n nodes, (n, 2), (n,) and so on. `on` (ny, nx)
    are those on the skin where something is known.
    """

    x: Array
    y: Array
    places: Array
    on: Mask
    shares: Array

    @classmethod
    def of(cls, patch: Patch, side: int, margin: float = -math.inf) -> "_Map":
        """`side` x `side` points of a `patch`, or nodes, at least `margin` in m from its rim."""
        if isinstance(patch, MeshSkin):
            places = patch.places
            on = patch.depth(places) >= margin
            shares = np.where(on, patch.areas, 0.0)
            return cls(places[:, 0], places[:, 1], places, on, shares / shares.sum())
        x, y = patch.grid(side, 2 if patch.strip else side)
        places = np.stack(np.meshgrid(x, y), axis=-1)
        points = places.reshape(-1, 2)
        on = patch.contains(points) & (patch.depth(points) >= margin)
        shares = np.zeros((len(y), len(x)))
        shares.ravel()[on] = patch.area(points[on])
        shares[[0, -1]] /= 2  # half of a tile
        shares[:, [0, -1]] /= 2
        return cls(x, y, places, on.reshape(shares.shape), shares / shares.sum())

    @property
    def points(self) -> Array:
        """Those (G, 2) in m that are `on`."""
        return self.places[self.on]

    def filled(self, values: Array) -> Array:
        """A map (ny, nx) of `values` (G,) at the points; NaN elsewhere."""
        made = np.full(self.on.shape, np.nan)
        made[self.on] = values
        return made


PREDICTIONS = ("displacement", "contact", "force")
"""What the error of is predicted."""


@dataclass(frozen=True, eq=False)
class Prospect:
    """What is predicted of a design: the error `sd` (ny, nx) due to noise, NaN where there is none.

    It is the standard deviation of the displacement in m, or, of the contact's position in m or of
    the force as a share, the root of the mean square error under the scene's load at each place.
    `x` (nx,) and `y` (ny,) are in m, `shares` (ny, nx) how much of the skin each point stands for;
    on a mesh x, y, sd and shares (n,) are those of its nodes;
    `positions` (P, 2) where the elements are, `rate` in 1/s what the conversions allow; infinite
    where readings come all at once. `of` is one of `PREDICTIONS`, of a contact's under its `load`.
    """

    x: Array
    y: Array
    sd: Array
    shares: Array
    positions: Array
    rate: float
    of: str = PREDICTIONS[0]
    load: PressedLoad | None = None

    def surface(self, patch: Patch, nx: int, ny: int, sd: Array | None = None) -> Array:
        """The error, or an `sd` of a check, between its points on a grid (ny, nx) of the `patch`.

        NaN where none is predicted.
        """
        from scipy.interpolate import LinearNDInterpolator  # needed by few

        points = np.stack(np.meshgrid(*patch.grid(nx, ny)), axis=-1).reshape(-1, 2)
        places = np.column_stack([self.x, self.y])
        if self.sd.ndim > 1:
            places = np.stack(np.meshgrid(self.x, self.y), axis=-1).reshape(-1, 2)
        values = (self.sd if sd is None else sd).ravel()
        known = np.isfinite(values)
        found: Array = LinearNDInterpolator(places[known], values[known])(points)
        near = values[known][_nearest(places[known], points)]
        predicted = np.isfinite(self.sd.ravel())[_nearest(places, points)]
        found = np.where(np.isfinite(found), found, near)
        return np.where(predicted & patch.contains(points), found, np.nan).reshape(ny, nx)

    @property
    def rms(self) -> float:
        """The square root of the mean variance over the skin."""
        return _over_skin(self.sd, self.shares)

    @property
    def median(self) -> float:
        """What half of the skin has less than."""
        on = np.isfinite(self.sd)
        order = np.argsort(self.sd[on])
        share = np.cumsum(self.shares[on][order])
        return float(self.sd[on][order][np.searchsorted(share, 0.5)])

    @property
    def worst(self) -> float:
        """The largest on the skin."""
        return float(np.nanmax(self.sd))


def _nearest(places: Array, points: Array) -> Indices:
    """The numbers of the `places` that are nearest to each of the `points`."""
    return np.asarray(scipy.spatial.KDTree(places).query(points)[1])


@dataclass(frozen=True, eq=False)
class Check:
    """What came of simulating a design for so many `frames`.

    `sd` (ny, nx) is what the displacement in m varied by at the points of its prospect; `rms` in m
    over the skin is the error of the reconstruction, what the functions cannot represent included.
    Of contacts and forces both are the errors of what was estimated from the readings, in the units
    of the prospect; `shares` (ny, nx) are its own.
    """

    frames: int
    sd: Array
    rms: float
    shares: Array

    @property
    def rms_sd(self) -> float:
        """The square root of the mean variance over the skin, as its prospect's `rms`."""
        return _over_skin(self.sd, self.shares)

    def over(self, predicted: Prospect) -> float:
        """`rms_sd` over that which is predicted of the same points."""
        known = np.where(np.isfinite(self.sd), predicted.sd, np.nan)
        return self.rms_sd / _over_skin(known, self.shares)


def _over_skin(sd: Array, shares: Array) -> float:
    """The root of the mean square over the skin of errors (ny, nx), where they are known."""
    on = np.isfinite(sd)
    return float(np.sqrt(shares[on] @ sd[on] ** 2 / shares[on].sum()))


def _map_of(scene: Scene, of: str) -> _Map:
    """The points of the skin; of contacts, those where the scene's load is away from the rim."""
    if of not in PREDICTIONS:
        raise Refusal(f"expected to predict one of {', '.join(PREDICTIONS)}, got {of!r}")
    patch = scene.plate.patch
    if of == "displacement":
        return _Map.of(patch, _SIDE)
    load, side = pressed_load(scene), patch.a if patch.strip else min(patch.a, patch.b)
    radius = load.radius if isinstance(load, DiscLoad) else 0.0
    return _Map.of(patch, _PRESSED_SIDE, max(1.001 * radius, _NEAR_RIM * side))


def prospect(design: Design, of: str = "displacement") -> Prospect:
    """The error of one of `PREDICTIONS` by the covariance of a design, without a simulation."""
    estimator, scene, seen = design.estimator(), design.scene, _map_of(design.scene, of)
    layout, noise = estimator.layout, known_noise(scene)
    if of == "displacement":
        sd = predicted_sd(estimator, noise, seen.points)
    else:
        loads = [replace(pressed_load(scene), x=x, y=y) for x, y in seen.points.tolist()]
        covariances = [_contact_covariance(scene, layout, load, noise) for load in loads]
        each = np.array([one.diagonal() for one in covariances])
        sd = np.sqrt(each[:, 1:].sum(axis=1) if of == "contact" else each[:, 0])
    scan_time = scene.transduction.scan_time(layout.channels)
    rate = 1 / scan_time if scan_time else math.inf
    load = None if of == "displacement" else pressed_load(scene)
    return Prospect(seen.x, seen.y, seen.filled(sd), seen.shares, layout.positions, rate, of, load)


def check(design: Design, frames: int = _MOST, of: str = "displacement") -> Generator[Check]:
    """What simulating a design gives, after every few frames until there are so many.

    The readings are made as all simulations make them, with every effect of the scene. Of
    displacements these are frames under the scene's load; of contacts and forces it presses at one
    point of the map after the other, and what presses is found as in every frame of a sensor. Those
    that are reported as perhaps on the rim, whose force is not determined, are left out.
    """
    seen = _map_of(design.scene, of)
    if of == "displacement":
        yield from _check_displacement(design, seen, frames)
    else:
        yield from _check_contacts(design, of, seen, min(frames, _MOST_PRESSES))


def _check_contacts(design: Design, of: str, seen: _Map, frames: int) -> Generator[Check]:
    estimator, load = design.estimator(), pressed_load(design.scene)
    scene, reference = design.scene, summed_functions(design.scene)
    scene = replace(scene, layout=estimator.layout, seed=0, reference=reference)
    scene = planned(scene)  # not at every press
    simulator, scan, places = Simulator(scene), scene.sensor().scan(), seen.points
    find = _contact_finder(estimator, scene.plate, scene.edge)
    squares, counts, count = np.zeros(len(places)), np.zeros(len(places)), 0
    order = np.random.default_rng(0).permutation(len(places))
    while count < frames:
        for n in np.take(order, np.arange(count, min(count + _BLOCK, frames)), mode="wrap"):
            x, y = places[n].tolist()
            simulator.change(scene.touched_by(replace(load, x=x, y=y)))
            _, read = simulator.reading(scan, count / scene.rate)
            readings = read.reshape(scene.layout.frame_shape)
            contact = find(readings, estimator(readings))
            error = contact.force / load.force - 1
            if of == "contact":
                error = _distance(scene.plate.patch, contact.position[None], places[[n]])[0]
            count += 1
            if contact.present and not contact.near_rim:
                counts[n] += 1
                squares[n] += error**2
        known = np.where(counts, squares / np.maximum(counts, 1), np.nan)
        sd = seen.filled(np.sqrt(known))
        yield Check(count, sd, _over_skin(sd, seen.shares), seen.shares)


def _check_displacement(design: Design, seen: _Map, frames: int) -> Generator[Check]:
    estimator, points = design.estimator(), seen.points
    scene = replace(design.scene, layout=estimator.layout, seed=0)
    simulator, scan = Simulator(scene), scene.sensor().scan()
    rows, shares = estimator.basis.at(points), seen.shares[seen.on]
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
        yield Check(count, seen.filled(sd), float(np.sqrt(off / count)), seen.shares)
