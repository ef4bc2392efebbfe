"""Finite slope at work."""

from collections.abc import Callable

from kappaskin.bases import Basis
from kappaskin.frames import Array
from kappaskin.sensing import NormalCurvature, SensorLayout


def finite_slope(basis: Basis, layout: SensorLayout) -> Callable[[Array], Array]:
    sensed = NormalCurvature(basis, layout)
    return lambda coefficients: sensed(coefficients).ravel()
