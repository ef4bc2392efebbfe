"""A scene to frames: the counts a real device would send, with the truth beside them."""

from collections.abc import Callable

import numpy as np

from kappaskin.frames import Array, Frame, Truth
from kappaskin.mechanics import Load
from kappaskin.scan import Scan
from kappaskin.scene import Scene, contact_of


class Simulator:
    """Makes the frames of a scene; they must be asked for in order to repeat with a seed.

    Each channel is read at its own instant of the scan, on a skin that moves meanwhile; the truth
    that comes with a frame is that of its start.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._still: Truth | None = None
        self._take_skin(scene)
        self._start_effects()

    def change(self, scene: Scene) -> None:
        """Go on with other loads, motion or effects; the effects start anew if they changed.

        Another list of them, another seed or another number of elements does.
        """
        was, self.scene, self._still = self.scene, scene, None
        same_elements = scene.layout.gage_length == was.layout.gage_length and np.array_equal(
            scene.layout.positions, was.layout.positions
        )
        skin = (scene.plate, scene.edge, scene.reference)
        if not (same_elements and skin == (was.plate, was.edge, was.reference)):
            self._take_skin(scene)
        same_size = len(scene.layout) == len(was.layout)
        if not same_size or (scene.seed, scene.effects) != (was.seed, was.effects):
            self._start_effects()

    def _start_effects(self) -> None:
        rng, shape = np.random.default_rng(self.scene.seed), (3 * len(self.scene.layout),)
        self._effects = [effect.start(shape, rng) for effect in self.scene.effects]

    def _take_skin(self, scene: Scene) -> None:
        """Compute what depends on the skin alone."""
        self._basis = scene.basis
        self._compliance = scene.plate.compliance(self._basis)
        self._operator = scene.layout.curvature_operator(self._basis)
        self._scan = scene.sensor().scan()

    def _truth(self, time: float) -> Truth:
        if self._still is not None:
            return self._still
        loads = self.scene.loads_at(time)
        truth = Truth(self._shape(loads), contact_of(loads), self.scene.edge)
        if not self.scene.moves:
            self._still = truth
        return truth

    def _shape(self, loads: tuple[Load, ...]) -> Array:
        """Coefficients (Ri, Rj) in m of the deflection under `loads`."""
        force = sum((load.modal(self._basis) for load in loads), np.zeros(self._basis.shape))
        return self._compliance(force)

    def _read(self, scan: Scan, time: float, truth: Truth) -> Array:
        """Curvature (3 P,) of a scan begun at `time`; channels outside it as at the start."""
        scene, first = self.scene, self._operator @ truth.coefficients.ravel()
        if not scene.moves:
            return first
        # The parabola through start, middle and end, at the share s of the scan.
        middle, last = (
            self._operator @ self._shape(scene.loads_at(t)).ravel()
            for t in (time + scan.duration / 2, time + scan.duration)
        )
        s = np.zeros(len(first))
        s[scan.channels] = scan.times / scan.duration
        return first + s * (4 * middle - 3 * first - last + s * 2 * (first + last - 2 * middle))

    def _true(self, scan: Scan, time: float) -> tuple[Truth | None, Array]:
        """The truth, None where no coefficients can tell it, and curvature (3 P,) in 1/m."""
        if self.scene.laid is not None:
            return None, np.repeat(self.scene.laid.curvature(time), len(self.scene.layout))
        truth = self._truth(time)
        return truth, self._read(scan, time, truth)

    def frame(self, n: int, clock: Callable[[], float]) -> Frame:
        """Frame `n` of all channels, begun at device time n / rate."""
        return self.scanned(self._scan, n, n / self.scene.rate, clock)

    def scanned(self, scan: Scan, n: int, time: float, clock: Callable[[], float]) -> Frame:
        """Frame `n` of what `scan` reads, begun at device `time`; dead channels read nothing."""
        scene = self.scene
        truth, curvature = self._true(scan, time)
        for effect in self._effects:
            curvature = effect(curvature, time)
        curvature[~scene.layout.live.ravel()] = 0.0
        counts = scene.transduction.counts(curvature[scan.channels])
        return Frame(n & 0xFFFFFFFF, time, clock(), scan.channels, counts, truth)
