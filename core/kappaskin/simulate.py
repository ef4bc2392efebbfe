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
        self._still: Truth | None = None
        self._take_skin(scene)

    def change(self, scene: Scene) -> None:
        """Go on with other loads, motion or effects on the same skin; new noise is seeded anew."""
        was, self.scene, self._still = self.scene, scene, None
        same_elements = np.array_equal(scene.layout.positions, was.layout.positions)
        skin = (scene.plate, scene.edge, scene.reference)
        if not (same_elements and skin == (was.plate, was.edge, was.reference)):
            self._take_skin(scene)
        if (scene.seed, scene.effects) != (was.seed, was.effects):
            self._rng = np.random.default_rng(scene.seed)

    def _take_skin(self, scene: Scene) -> None:
        """Compute what depends on the skin alone."""
        self._basis = scene.basis
        self._compliance = scene.plate.compliance(self._basis)
        self._operator = scene.layout.curvature_operator(self._basis)
        self._channels = np.arange(3 * len(scene.layout))

    def _truth(self, time: float) -> Truth:
        if self._still is not None:
            return self._still
        loads = self.scene.loads_at(time)
        force = sum((load.modal(self._basis) for load in loads), np.zeros(self._basis.shape))
        truth = Truth(self._compliance(force), contact_of(loads), self.scene.edge)
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
