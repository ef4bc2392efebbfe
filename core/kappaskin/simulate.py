"""A scene to frames: the counts a real device would send, with the truth beside them."""

from collections.abc import Callable

import numpy as np

from kappaskin.frames import Frame, Truth
from kappaskin.scene import Scene, contact_of


class Simulator:
    """Makes the frames of a scene; `frame(n)` must be asked for in order to repeat with a seed."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._rng = np.random.default_rng(scene.seed)
        self._basis = scene.basis
        self._operator = scene.layout.curvature_operator(self._basis)
        self._channels = np.arange(3 * len(scene.layout))
        self._still: Truth | None = None

    def change(self, scene: Scene) -> None:
        """Go on with other loads, motion or effects on the same skin; new noise is seeded anew."""
        was, self.scene, self._still = self.scene, scene, None
        same_skin = np.array_equal(scene.layout.positions, was.layout.positions)
        if not (same_skin and scene.basis == was.basis):
            self._basis = scene.basis
            self._operator = scene.layout.curvature_operator(self._basis)
            self._channels = np.arange(3 * len(scene.layout))
        if (scene.seed, scene.effects) != (was.seed, was.effects):
            self._rng = np.random.default_rng(scene.seed)

    def _truth(self, time: float) -> Truth:
        if self._still is not None:
            return self._still
        loads = self.scene.loads_at(time)
        truth = Truth(self.scene.plate.deflection(loads, self._basis), contact_of(loads))
        if self.scene.motion is None:
            self._still = truth
        return truth

    def frame(self, n: int, clock: Callable[[], float]) -> Frame:
        """Frame `n`, taken at device time n / rate; dead channels read no curvature."""
        scene = self.scene
        time = n / scene.rate
        truth = self._truth(time)
        curvature = self._operator @ truth.coefficients.ravel()
        for effect in scene.effects:
            curvature = effect.apply(curvature, self._rng)
        curvature[~scene.layout.live.ravel()] = 0.0
        counts = scene.transduction.counts(curvature)
        return Frame(n & 0xFFFFFFFF, time, clock(), self._channels, counts, truth)
