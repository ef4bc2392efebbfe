"""Readings of the elements around each one to what it should read itself, and how surely."""

from typing import cast

import numpy as np
import scipy
from numpy.typing import NDArray

from kappaskin.frames import Array, Mask
from kappaskin.sensing import SensorLayout

_COUNT = 20  # elements around one, that tell of it: two rings of a grid without its corners
_BESIDE = 8  # of them are next to it
_CLOSE = 1.6  # distances of elements: as far as they reach on a grid
_LENGTHS = (1.2, 2.5)  # of what bends the skin, in distances of elements
_NOISE = 1e-3  # in power, beside what a neighbour reads
_MISSING = 1e9  # the same, of a reading that is not there
_AT_ONCE = 512  # elements whose weights are computed together: 15 MB each time

Indices = NDArray[np.intp]


def _covariance(apart: Array) -> Array:
    """Covariances (3, 3, ...) of the curvatures of two elements that are `apart` (2, ...).

    Of a displacement with the covariance exp(-r^2/2 l^2), the mean over the lengths l: its fourth
    derivatives are He_m(x/l) He_n(y/l) exp(-r^2/2 l^2), m + n = 4, with Hermite's polynomials.
    Scaled so that the variance of xx and of yy is 1, and that of xy 1/3.
    """
    total = np.zeros((3, 3, *apart.shape[1:]))
    for length in _LENGTHS:
        u, v = apart / length
        bell = np.exp(-(u**2 + v**2) / 2) / (3 * len(_LENGTHS))
        uu, vv = u**2 - 1, v**2 - 1
        total[0, 0] += (uu * (uu - 4) - 2) * bell
        total[1, 1] += (vv * (vv - 4) - 2) * bell
        total[0, 1] += uu * vv * bell
        total[0, 2] += (uu - 2) * u * v * bell
        total[1, 2] += (vv - 2) * u * v * bell
    total[2, 2] = total[1, 0] = total[0, 1]
    total[2, :2] = total[:2, 2]
    return total


class Neighbours:
    """What the P elements of a layout tell of each other: kriging from the nearest ones.

    Nothing is asked of the whole skin, so that the cost grows as the number of elements. What an
    element reads itself has no part in what it should read. `weights` (P, 3, 3 k) for the
    `channels` (P, 3 k) around each; `spread` (P, 3) is the variance of what they leave open, in
    units of the mean square of what they read.
    """

    def __init__(self, layout: SensorLayout) -> None:
        P = len(layout)
        k = min(_COUNT, P - 1)
        apart, near = scipy.spatial.KDTree(layout.positions).query(layout.positions, k + 1)
        near = cast("Indices", near).reshape(P, k + 1)[:, 1:]
        pitch = float(np.median(np.reshape(apart, (P, k + 1))[:, 1:2])) if k else 1.0
        self._at = layout.positions.T / (pitch or 1.0)
        self.near = near
        """The elements (P, k) around each."""
        self.channels: Indices = (near[:, None] + P * np.arange(3)[:, None]).reshape(P, 3 * k)
        self.beside: Indices = self.channels.reshape(P, 3, k)[:, :, :_BESIDE].reshape(P, -1)
        """The channels (P, c) of the elements next to each."""
        close = (np.reshape(apart, (P, k + 1))[:, 1:] < _CLOSE * pitch).sum(axis=1)
        self.alone: Array = _BESIDE / np.clip(close, 1, _BESIDE)
        """How many times fewer elements are close to each (P,) than inside a grid."""
        self.weights = np.zeros((P, 3, 3 * k))
        self.spread = np.ones((P, 3))
        self.leave_out(np.zeros(3 * P, bool), np.arange(P))

    def touched_by(self, channels: Mask) -> Indices:
        """The elements of which some of `channels` (3 P,) tell."""
        return np.flatnonzero(channels[self.channels].any(axis=1))

    def leave_out(self, missing: Mask, elements: Indices) -> None:
        """Let `elements` be told of without the channels that are `missing` (3 P,)."""
        for start in range(0, len(elements), _AT_ONCE):
            self._weigh(missing, elements[start : start + _AT_ONCE])

    def _weigh(self, missing: Mask, elements: Indices) -> None:
        near, E = self._at[:, self.near[elements]], len(elements)
        k = near.shape[2]
        between = _covariance(near[:, :, :, None] - near[:, :, None])
        S = between.transpose(2, 0, 3, 1, 4).reshape(E, 3 * k, 3 * k)
        apart = _covariance(near - self._at[:, elements, None])
        beside = apart.transpose(2, 1, 3, 0).reshape(E, 3 * k, 3)
        noise = np.where(missing[self.channels[elements]], _MISSING, _NOISE)
        S[:, np.arange(3 * k), np.arange(3 * k)] += noise
        W = np.linalg.solve(S, beside)
        own = np.diag(_covariance(np.zeros(2)))
        self.weights[elements] = W.swapaxes(1, 2)
        self.spread[elements] = np.maximum(own - np.sum(W * beside, axis=1), 0.0)

    def told(self, readings: Array, elements: Indices) -> tuple[Array, Array]:
        """What `elements` (E,) should read and the mean square around them, (T, 3, E) each.

        From `readings` (T, 3 P), NaN where one of those around is.
        """
        around = readings.T[self.channels[elements]]  # (E, 3 k, T)
        told = np.matmul(self.weights[elements], around)
        power = np.einsum("ert,ert->et", around, around) / max(around.shape[1], 1)
        spread = self.spread[elements][:, :, None] * power[:, None]
        return told.transpose(2, 1, 0), spread.transpose(2, 1, 0)
