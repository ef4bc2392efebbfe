"""Drift: a smooth change of all readings, which is no load, told beside a contact."""

import math
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from kappaskin.contact.point import NO_CONTACT, PointContact, left_by_chance, orthonormal
from kappaskin.errors import RankDeficient
from kappaskin.estimation import (
    DenseUncertainty,
    Direct,
    Estimator,
    Fast,
    Fit,
    LeastSquares,
    PatternCache,
    Uncertainty,
)
from kappaskin.frames import Array, Contact, Mask
from kappaskin.mechanics import Plate
from kappaskin.sensing import SensorLayout

_HINT = 21.7  # chi-squared of nine numbers that one frame in 100 without a drift exceeds
_EVIDENT = 36.0  # -2 ln of the likelihood ratio: one in 25,000
_OF_LOAD = 4  # unknowns of a load
_LEFT = 1e-3  # of frames of a drift and a load leave more than noise explains
_MOST = 2_000  # functions: the uncertainty of a shape beside a drift takes their whole covariance


@dataclass(frozen=True, slots=True, eq=False)
class FittedDrift:
    """A drift of `size` in 1/m by RMS; `readings` (3, P) without it, their `contacts` and `fit`.

    The fit is the original one, with the drift in its shape, of an estimator that has a memory, was
    given a sigma or has more than 2,000 functions.
    """

    size: float
    readings: Array
    contacts: tuple[Contact, Contact]
    fit: Fit


def level_and_slopes(layout: SensorLayout) -> Array:
    """A level, and slopes along x and y, of the readings of each of k kinds, (3 k, R).

    Of a curvature sensor that is of each component, (9, 3 P).
    """
    patch = layout.patch
    centred = (layout.positions - [patch.a / 2, patch.b / 2]) / [patch.a, patch.b]
    each = np.column_stack([np.ones(len(layout)), centred])[layout.element].T
    own = np.equal.outer(np.arange(len(layout.kinds)), layout.kind)
    return (own[:, None] * each).reshape(-1, layout.channels)


class SmoothDrift:
    """Tells a drift from a load: what warmth or a bent mount adds to all readings alike.

    It is a level and two slopes in each component, nine numbers. Where they explain much of what a
    contact leaves of the readings, a contact is searched for beside them. A drift is told if it
    makes the readings more likely by more than chance, and if with it they are explained to the
    noise: what a load on a large area leaves is no drift.
    """

    def __init__(self, plate: Plate, layout: SensorLayout, edge: str = "hinged") -> None:
        self._columns, self._live = level_and_slopes(layout), layout.live.ravel()
        self._frame_shape = layout.frame_shape
        self._beside = PointContact(plate, layout, edge, free=self._columns)
        self._directions = PatternCache[tuple[Array, int]]()
        self._reference: tuple[Estimator, Estimator] | None = None
        self._of_fit = PatternCache[Array]()

    def __call__(
        self,
        curvature: Array,
        fit: Fit,
        contacts: tuple[Contact, Contact],
        rest: Array,
        left: float,
    ) -> FittedDrift | None:
        """The drift, with the contacts and the fit without it; None where there is none.

        For `curvature` (3, P) in 1/m, NaN where missing, the `fit` to it, the `rest` (3 P,) that
        one load leaves of it, 0 where missing, and the squares `left` by the `contacts` found.
        """
        used = self._live & np.isfinite(curvature.ravel())
        Q, spare = self._directions(used, self._orthonormal)
        along = Q.dot(rest)
        score = float(along.dot(along))
        if not score > _HINT * max(float(rest.dot(rest)) - score, 0.0) / spare:
            return None
        told = self._noise(curvature, fit, used)
        if told is None:
            return None
        noise, of_noise = told
        judged = {"known_noise": np.array(noise), "spare": of_noise}
        most = spare * left_by_chance(_LEFT, spare, of_noise) * noise**2
        found = self._beside(curvature, replace(fit, **judged), most)
        after = self._beside.rest
        squares = float(after.dot(after)) / noise**2
        better = left / noise**2 - squares
        if found.present and not contacts[0].present:  # more unknowns, as Schwarz counts them
            better -= _OF_LOAD * math.log(used.sum())
        spare -= _OF_LOAD * found.present
        usual = spare * left_by_chance(_LEFT, spare, of_noise)
        if better < _EVIDENT or squares > usual:
            return None
        drift = self._beside.along + (Q @ np.where(used, curvature.ravel(), 0.0)) @ Q
        size = math.sqrt(float(drift.dot(drift)) / used.sum())
        estimator, readings = fit.estimator, curvature - drift.reshape(curvature.shape)
        if estimator.has_memory or estimator.sigma is not None or estimator.basis.size > _MOST:
            return FittedDrift(size, readings, (found, NO_CONTACT), fit)
        rows = self._beside.linear if found.present else np.empty((0, len(used)))
        beside = estimator(readings)
        whole = _beside_drift(beside, Q, np.where(used, rows, 0.0))
        beside = replace(beside, uncertainty=whole, **judged)
        contacts = self._beside(curvature, beside), NO_CONTACT
        return FittedDrift(size, readings, contacts, beside)

    def _orthonormal(self, used: Mask) -> tuple[Array, int]:
        """Directions (r, C) of a drift of the readings `used`, and how many readings are spare."""
        Q = orthonormal(np.where(used, self._columns, 0.0))
        return Q, max(int(np.count_nonzero(used)) - len(Q), 1)

    def _noise(self, curvature: Array, fit: Fit, used: Mask) -> tuple[float, int] | None:
        """Noise in 1/m that a shape and a drift leave together, and from how many spare readings.

        None where no shape is determined without a prior.
        """
        estimator = self._linear(fit.estimator)
        if estimator is None:
            return None
        try:
            own = fit if estimator is fit.estimator else estimator(curvature)
        except RankDeficient:
            return None
        residual = np.nan_to_num(own.residual.ravel())
        G = self._of_fit(used, lambda used: self._left_of_columns(estimator, used))
        left = residual - (G @ residual) @ G
        spare = int(cast("int", own.spare)) - len(G)
        return (math.sqrt(float(left.dot(left)) / spare), spare) if spare > 0 else None

    def _linear(self, estimator: Estimator) -> Estimator | None:
        """The estimator, if linear, or least squares of its functions; None where it is refused."""
        if type(estimator) in (LeastSquares, Fast, Direct):
            return estimator
        if self._reference is None or self._reference[0] is not estimator:
            try:
                linear = LeastSquares(estimator.basis, estimator.layout, estimator.sigma)
            except RankDeficient:
                return None
            self._reference, self._of_fit = (estimator, linear), PatternCache[Array]()
        return self._reference[1]

    def _left_of_columns(self, estimator: Estimator, used: Mask) -> Array:
        """Directions (r, C) of what a fit leaves of the drift's columns."""
        columns = np.where(used, self._columns, np.nan)
        columns = columns.reshape(-1, *self._frame_shape)
        return orthonormal(np.nan_to_num(estimator(columns).residual.reshape(len(columns), -1)))


def _beside_drift(fit: Fit, Q: Array, rows: Array) -> Uncertainty:
    """Uncertainty of a `fit` to readings less their drift along Q (r, C), which is estimated too.

    Beside a load, of which the readings and derivatives are `rows` (n, C). With P = 1 - J'(JJ')^-1J
    for the rows J, the drift is d = S Q P K, where S = (Q P Q')^-1 is its covariance for unit
    noise. With A = L Q' and B = L P Q', c = L (K - Q'd) has the covariance
    C - A S B' - B S A' + A S A', where C is that of c for a known drift, and L = C M'.
    """
    estimator, unit = fit.estimator, cast("Uncertainty", fit.uncertainty)

    def covariance() -> Array:
        M = np.where(np.isfinite(fit.readings).reshape(-1, 1), estimator.M, 0.0)
        C, J = unit.covariance_of(np.eye(estimator.basis.size)), orthonormal(rows)
        beside = Q - (Q @ J.T) @ J
        A, B = C @ (Q @ M).T, C @ (beside @ M).T
        S = np.linalg.inv(beside @ beside.T)
        across = A @ S @ B.T
        return C - across - across.T + A @ S @ A.T

    return DenseUncertainty(covariance)
