"""What a scene does to its skin, before anything spoils it: by this effects are judged."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from kappaskin.bases import Basis
from kappaskin.frames import Array
from kappaskin.mechanics import Plate
from kappaskin.sensing import SensorLayout, Transduction


@dataclass(frozen=True, eq=False)
class Survey:
    """S moments of a scene of `duration` s, as linear theory on the whole plate has them.

    `coefficients` (S, N) in m at `times` (S,) in s are of `basis`; `forces` (S, N) in N the modal
    forces that make them, all zero where the skin lies on a cylinder; `curvature` (S, 3, P) in 1/m
    is what point-like elements of `layout` would read; `rates` (3 P,) in 1/m/s is the fastest that
    each of them changes, and `read_after` (3 P,) in s when in a scan it is read.
    """

    plate: Plate
    basis: Basis
    layout: SensorLayout
    transduction: Transduction
    times: Array
    forces: Array
    coefficients: Array
    curvature: Array
    rates: Array
    duration: float
    read_after: Array

    @cached_property
    def peak(self) -> float:
        """The largest reading in 1/m; that of one count where nothing touches."""
        return max(float(np.abs(self.curvature).max(initial=0.0)), self.transduction.resolution)

    @cached_property
    def operator(self) -> Array:
        """Coefficients to readings of point-like elements, (3 P, N)."""
        return replace(self.layout, gage_length=0.0).curvature_operator(self.basis)

    @cached_property
    def wavenumber(self) -> float:
        """k in 1/m of the scene: k^2 is the largest reading over the largest deflection."""
        bent = np.abs(self.coefficients @ self.operator.T).max(initial=0.0)
        deflection = self.coefficients @ self.basis.at(self.layout.positions).T
        most = np.abs(deflection).max(initial=0.0)
        return float(np.sqrt(bent / most)) if most else 0.0

    @cached_property
    def _whole(self) -> Array:
        return self._on(self.plate)

    def _on(self, plate: Plate) -> Array:
        # A compliance is symmetric: the rows are C F.
        return plate.compliance(self.basis).after(self.forces) @ self.operator.T

    def readings_on(self, plate: Plate) -> Array:
        """What point-like elements would read of the same forces on another `plate`, (S, 3 P)."""
        return self._whole if plate == self.plate else self._on(plate)

    @cached_property
    def slopes(self) -> Array:
        """Slopes (S, 2, P) of the skin along x and y at its elements."""
        places = self.layout.positions
        along = [self.basis.at(places, *order) for order in ((1, 0), (0, 1))]
        return np.stack([self.coefficients @ slope.T for slope in along], axis=1)

    def share(self, change: Array) -> float:
        """The largest `change` of a reading in 1/m as a share of the peak."""
        return float(np.abs(change).max(initial=0.0)) / self.peak
