"""What is uncertain of a shape to the readings that would tell most of it."""

import numpy as np
from numpy.typing import NDArray

from kappaskin.frames import Array

_CANDIDATES = 80  # readings of which the next ones are chosen
_AT_ONCE = 8  # of them, as good in the end as one by one


def telling_most(A: Array, P: Array, wanted: Array, worth: Array, count: int) -> NDArray[np.intp]:
    """Which `count` of R readings tell most, a few after the other, of what is `wanted` (q, F).

    The readings are A (R, F) times what has the covariance P (F, F) in units of the noise: each
    takes the sum of (wanted P A')^2 over its own variance from the variances of what is wanted.
    Each counts by its `worth` (R,).
    """
    AP = A @ P
    E = AP @ wanted.T
    first = worth * np.vecdot(E, E) / (1 + np.vecdot(AP, A))
    most = min(max(_CANDIDATES, count), len(first))
    left = np.argpartition(-first, most - 1)[:most]
    return left[_greedy(AP[left] @ A[left].T, E[left], worth[left], count)]


def _greedy(shared: Array, wanted: Array, worth: Array, count: int) -> NDArray[np.intp]:
    """The same of all R readings, whose signals share the covariance `shared` (R, R).

    A Cholesky factor of the covariance of those chosen, (count, R), grows some rows at a time.
    """
    R, variance = len(worth), 1 + shared.diagonal()
    both = np.hstack([shared, wanted])
    factor, chosen = np.empty((count, both.shape[1])), np.empty(count, np.intp)
    for first in range(0, count, _AT_ONCE):
        told = worth * np.vecdot(wanted, wanted) / variance
        told[chosen[:first]] = -1.0
        k = np.argsort(-told, kind="stable")[: min(_AT_ONCE, count - first)]
        chosen[first : first + len(k)] = k
        before = factor[:first]
        left = both[k] - before[:, k].T @ before
        L = np.linalg.cholesky(left[:, k] + np.eye(len(k)))
        factor[first : first + len(k)] = rows = np.linalg.solve(L, left)
        # Given those readings, the others are less uncertain by what they share with them.
        wanted = wanted - rows[:, :R].T @ rows[:, R:]
        variance = np.maximum(variance - np.sum(rows[:, :R] ** 2, axis=0), 1.0)
    return chosen
