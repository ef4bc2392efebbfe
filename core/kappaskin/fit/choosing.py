"""What is uncertain of a shape to the readings that would tell most of it."""

import math

import numpy as np
from numpy.typing import NDArray

from kappaskin.frames import Array

_CANDIDATES = 100  # readings of which the next ones are chosen


def telling_most(B: Array, E: Array, worth: Array, count: int) -> NDArray[np.intp]:
    """Which `count` of R readings tell most, one after the other, of what is wanted.

    B (R, n) are the readings as rows of a root of their covariance in units of the noise, E (R, q)
    their covariances with what is wanted, in the same units: a reading takes the sum of E^2 over
    its own variance from the variances of those. Each counts by its `worth` (R,).
    """
    first = worth * np.vecdot(E, E) / (1 + np.vecdot(B, B))
    most = min(max(_CANDIDATES, count), len(first))
    left = np.argpartition(-first, most - 1)[:most]
    return left[_greedy(B[left] @ B[left].T, E[left], worth[left], count)]


def _greedy(shared: Array, wanted: Array, worth: Array, count: int) -> NDArray[np.intp]:
    variance, free = 1 + shared.diagonal(), np.ones(len(worth), bool)
    chosen = np.empty(count, np.intp)
    for n in range(count):
        told = worth * np.vecdot(wanted, wanted) / variance
        chosen[n] = k = int(np.argmax(np.where(free, told, -1.0)))
        free[k] = False
        # Given that reading, the others' covariances are less by what they share with it.
        root = math.sqrt(variance[k])
        g = shared[k] / root
        wanted = wanted - np.multiply.outer(g, wanted[k] / root)
        shared = shared - np.multiply.outer(g, g)
        variance = np.maximum(1 + shared.diagonal(), 1.0)
    return chosen
