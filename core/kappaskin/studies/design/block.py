"""A setup and a seed to a block of frames: what was true, what was read, what was fitted."""

from collections.abc import Generator
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import cast

import numpy as np

from kappaskin.bases import Basis
from kappaskin.contact import ContactObject, ObjectFinder, PointContact
from kappaskin.errors import Refusal
from kappaskin.estimation import Estimator, Fit, in_time
from kappaskin.frames import Array, Touch, Truth
from kappaskin.mechanics import Plate
from kappaskin.scenes import Scene, Simulator, kept_effects
from kappaskin.scenes.effects import Hysteresis
from kappaskin.studies.cost.bench import points_on
from kappaskin.studies.design.setup import Setup


@lru_cache(8)
def _lengths(basis: Basis, reference: Basis) -> tuple[Array, Array, Array]:
    """A (N, N), B (Nr, N) and C (Nr, Nr) with |c A - w B|^2 + |w C|^2 the surfaces' distance^2.

    By RMS over the skin. The functions of both on G points are Q R, and Q changes no lengths.
    """
    points, N = points_on(basis.patch), basis.size
    functions = np.hstack([basis.at(points), reference.at(points)]) / np.sqrt(len(points))
    R = cast("Array", np.linalg.qr(functions, mode="r")).T
    return R[:N, :N].copy(), R[N:, :N].copy(), R[N:, N:].copy()


@lru_cache(2)
def _contact_finder(estimator: Estimator, plate: Plate, edge: str) -> PointContact:
    return PointContact(plate, estimator.layout, edge)


@lru_cache(2)
def _object_finder(estimator: Estimator, plate: Plate, edge: str) -> ObjectFinder:
    return ObjectFinder(plate, estimator.layout, edge)


@dataclass(frozen=True, eq=False)
class Block:
    """T frames that a `simulator` made, and what `estimator` makes of them.

    `truths` are T, or one of a skin that nothing moves on; `curvature` (T, 3, P) in 1/m.
    """

    simulator: Simulator
    estimator: Estimator
    truths: list[Truth]
    curvature: Array

    @property
    def scene(self) -> Scene:
        return self.simulator.scene

    @cached_property
    def fits(self) -> list[Fit]:
        """The fit of each frame, by an estimator that may remember those before."""
        return [self.estimator(K) for K in self.curvature]

    @cached_property
    def fit(self) -> Fit:
        """The fit of all frames, each of which is taken in once by what remembers."""
        return in_time(self.fits) if self.estimator.remembers else self.estimator(self.curvature)

    @cached_property
    def coefficients(self) -> Array:
        """What was fitted, (T, N) in m."""
        return self.fit.coefficients.reshape(len(self.curvature), -1)

    @cached_property
    def true(self) -> Array:
        """The true coefficients, (T, Nr) in m or (1, Nr)."""
        return np.array([truth.coefficients.ravel() for truth in self.truths])

    @cached_property
    def contact(self) -> Array:
        """Where the skin was pressed, (T, 2) in m or (1, 2)."""
        return np.array([truth.contact for truth in self.truths])

    def forces(self) -> Array:
        """What pressed in all, (T,) in N or (1,)."""
        times = _times(self.scene, len(self.truths)).tolist()
        return np.array([sum(load.force for load in self.simulator.loads(t)) for t in times])

    def apart(self) -> Array:
        """RMS over the skin of what was fitted less what was true, (T,) in m."""
        A, B, C = _lengths(self.estimator.basis, self.scene.basis)
        inside, outside = self.coefficients @ A - self.true @ B, self.true @ C
        return np.sqrt(np.vecdot(inside, inside) + np.vecdot(outside, outside))

    def off(self, points: Array) -> Array:
        """What was fitted less what was true at `points` (G, 2), (T, G) in m."""
        fitted = self.coefficients @ self.estimator.basis.at(points).T
        return fitted - self.true @ self.scene.basis.at(points).T

    @cached_property
    def touches(self) -> list[Touch]:
        """The contact that each frame tells."""
        find = _contact_finder(self.estimator, self.scene.plate, self.scene.edge)
        return [find(K, fit) for K, fit in zip(self.curvature, self.fits, strict=True)]

    def objects(self) -> Generator[ContactObject]:
        """The object that each frame tells."""
        find = _object_finder(self.estimator, self.scene.plate, self.scene.edge)
        for K, fit, touch in zip(self.curvature, self.fits, self.touches, strict=True):
            yield find(K, float(fit.noise), touch)


def _times(scene: Scene, frames: int) -> Array:
    return np.arange(frames) / scene.rate


def block_of(setup: Setup, estimator: Estimator, seed: int) -> Block:
    """`setup.measure.frames` frames, spoilt as `seed` decides."""
    scene = replace(setup.scene, layout=estimator.layout, seed=seed)
    simulator, times = Simulator(scene), _times(scene, setup.measure.frames)
    truths, read = simulator.readings(scene.sensor().scan(), times)
    if setup.fit.compensate:
        read = _compensated(scene, read)
    read[:, ~scene.layout.live.ravel()] = np.nan
    known = [truth for truth in truths if truth is not None]
    return Block(simulator, estimator, known, read.reshape(len(times), 3, -1))


def _compensated(scene: Scene, read: Array) -> Array:
    """Readings (T, 3 P) in 1/m, one after the other, with the scene's loops undone."""
    loops = [effect for effect in kept_effects(scene) if isinstance(effect, Hysteresis)]
    if not loops:
        raise Refusal("expected a scene with hysteresis to compensate, got none of it")
    undo = loops[0].operator(read.shape[1]).inverse.start()
    return np.array([undo(frame) for frame in read])
