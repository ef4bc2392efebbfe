"""Response of a hinged flat skin beyond the functions of a scene's true shape."""

from collections.abc import Sequence

import numpy as np

from kappaskin.bases import Basis, SineBasis, basis_for
from kappaskin.frames import Array
from kappaskin.mechanics import Load
from kappaskin.scenes import Scene
from kappaskin.sensing import SensorLayout
from kappaskin.skin import Cap
from kappaskin.studies.accuracy import grid_on

_WAVES = 90  # each way: readings under discs of 1 mm radius stand to 1 % of their noise in Table 1
_ON_CAP = 30, 61  # along and around: contacts under discs of 1.5 mm on a fingertip stand to 5 %

_ALL = slice(None)


def summed_functions(scene: Scene) -> tuple[int, int]:
    """Functions of a true shape that readings no longer change with; the scene's if unknown."""
    (Ri, Rj), patch = scene.reference, scene.plate.patch
    if isinstance(patch, Cap):
        return max(Ri, _ON_CAP[0]), max(Rj, _ON_CAP[1])
    if not SummedResponse.is_known(scene):
        return Ri, Rj
    return max(Ri, _WAVES), 1 if patch.strip else max(Rj, _WAVES)


class SummedResponse:
    """What `loads`, those of T moments, do to a scene's skin beyond its 15 x 15 or so functions.

    A load that is small beside the elements' distance bends the skin in waves that are finer: they
    change the readings, but are not part of the scene's true shape. `coefficients` (T, N) in m are
    those of the functions of `basis`, to be added to that shape.
    """

    def __init__(self, scene: Scene, loads: Sequence[tuple[Load, ...]]) -> None:
        self._plate, patch = scene.plate, scene.plate.patch
        self._reference = reference = scene.basis
        Ri, Rj = reference.shape
        self.basis: Basis = basis_for(patch, scene.edge, *summed_functions(scene))
        known: dict[tuple[Load, ...], Array] = {}
        for those in loads:
            if those not in known:
                c = self._plate.deflection(those, self.basis)
                c[:Ri, :Rj] -= self._plate.deflection(those, reference)
                known[those] = c.ravel()
        self.coefficients = np.array([known[those] for those in loads])

    @staticmethod
    def is_known(scene: Scene) -> bool:
        """Whether the response is known: under loads, of a hinged skin that mixes no sines."""
        sines = isinstance(scene.basis, SineBasis) and not scene.plate.mixes_sines
        return sines and scene.indenter is None

    def errors(
        self,
        basis: Basis,
        fitted: Array,
        true: Array,
        contact: Array,
        frames: slice = _ALL,
    ) -> tuple[Array, Array]:
        """Signed errors at `contact` (T, 2), and RMS errors over the skin, (T,) in m.

        Of coefficients `fitted` (T, N) of the functions of `basis` in some of the `frames`; `true`
        (T, Nr) in m are those of the scene's true shape in these.
        """
        grid = grid_on(basis.patch)

        def of(one: Basis, c: Array) -> tuple[Array, Array]:
            at = np.vecdot(one.at(contact), c)
            return at, one.on_grid(*grid)(c.reshape(-1, *one.shape))

        (e, w), (e0, w0), (e1, w1) = (
            of(one, c)
            for one, c in (
                (basis, fitted),
                (self._reference, true),
                (self.basis, self.coefficients[frames]),
            )
        )
        return e - e0 - e1, np.sqrt(np.mean((w - w0 - w1) ** 2, axis=(-2, -1)))

    def readings(self, layout: SensorLayout) -> Array:
        """Readings of T frames to be added to what the elements read of the true shape."""
        operator = layout.operator(self.basis, self._plate)
        return (self.coefficients @ operator.T).reshape(-1, *layout.frame_shape)
