"""Computation of the effects in the strain gages."""

from collections.abc import Callable

import numpy as np

from kappaskin.bases import Basis
from kappaskin.frames import Array
from kappaskin.mechanics import Plate
from kappaskin.scenes.effects.at_work import RunningEffect
from kappaskin.sensing import NormalCurvature, PrandtlIshlinskii, SensorLayout, StandardLinearSolid


def finite_slope(
    basis: Basis, layout: SensorLayout, plate: Plate | None
) -> Callable[[Array], Array]:
    sensed = NormalCurvature(basis, layout, plate=plate)
    return lambda coefficients: sensed(coefficients).ravel()


def strain_limit(limit: float, share: float, shape: tuple[int, ...]) -> RunningEffect:
    beyond = np.zeros(shape)

    def read(curvature: Array, _: float) -> Array:
        np.maximum(beyond, curvature - limit, out=beyond)
        np.minimum(beyond, curvature + limit, out=beyond)
        return curvature + share * beyond

    return read


def hysteresis(loops: PrandtlIshlinskii, shape: tuple[int, ...]) -> RunningEffect:
    plays = loops.start()
    return lambda curvature, _: plays(curvature.ravel()).reshape(shape)


def creep(solid: StandardLinearSolid, shape: tuple[int, ...]) -> RunningEffect:
    relaxing = solid.start()
    return lambda curvature, time: relaxing(curvature.ravel(), time).reshape(shape)


def temperature(warmer: Callable[[float], float], gain: Array, offsets: Array) -> RunningEffect:
    def read(curvature: Array, time: float) -> Array:
        T = warmer(time)
        return (1 + gain * T) * curvature + T * offsets

    return read


def tolerance(gain: Array, offset: Array) -> RunningEffect:
    return lambda curvature, _: gain * curvature + offset
