"""Accuracy of an estimate over the skin, and the time and memory that it takes."""

import statistics
import time
import tracemalloc
from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache
from typing import TypeVar, cast

import numpy as np
import scipy

from kappaskin.bases import Basis, SineBasis
from kappaskin.estimation import Fit
from kappaskin.frames import Array
from kappaskin.skin import Patch

_POINTS = 101  # of the surface along each side, edges included, as in Table 1
_BAND_SIDE = 21  # points along each side at which error bars are judged, less those on the edges
_Made = TypeVar("_Made")


def root_mean_square(values: Array) -> float:
    """The root of the mean square of all `values`, in their unit."""
    return float(np.sqrt(np.mean(values**2)))


@lru_cache(8)
def _lengths(basis: Basis, reference: Basis) -> tuple[Array, Array, Array]:
    """A (N, N), B (Nr, N) and C (Nr, Nr) with |c A - w B|^2 + |w C|^2 the surfaces' distance^2.

    By RMS over the skin. The functions of both on G points are Q R, and Q changes no lengths.
    """
    points, N = points_on(basis.patch), basis.size
    shares = shares_of(basis.patch, points)
    functions = np.hstack([basis.at(points), reference.at(points)]) * np.sqrt(shares)[:, None]
    R = cast("Array", np.linalg.qr(functions, mode="r")).T
    return R[:N, :N].copy(), R[N:, :N].copy(), R[N:, N:].copy()


def _orthogonal(basis: Basis) -> bool:
    """Whether the functions are orthogonal on the grid, with a mean square of (50 / 101)^2."""
    sines = isinstance(basis, SineBasis) and max(basis.shape) < _POINTS - 1
    return sines and not basis.patch.strip


def rms_distance(basis: Basis, fitted: Array, reference: Basis, true: Array) -> Array:
    """The distance of surfaces by RMS over the skin, (T,) in m.

    Of coefficients `fitted` (T, N) of the functions of `basis`, and `true` (T, Nr) or (1, Nr) of
    those of the `reference`, in m.
    """
    if _orthogonal(basis) and _orthogonal(reference):
        sides = np.maximum(basis.shape, reference.shape)
        off = np.zeros((max(len(fitted), len(true)), *sides))
        off[:, : basis.shape[0], : basis.shape[1]] = fitted.reshape(-1, *basis.shape)
        off[:, : reference.shape[0], : reference.shape[1]] -= true.reshape(-1, *reference.shape)
        return np.linalg.norm(off, axis=(1, 2)) * (_POINTS - 1) / (2 * _POINTS)
    A, B, C = _lengths(basis, reference)
    inside, outside = fitted @ A - true @ B, true @ C
    return np.sqrt(np.vecdot(inside, inside) + np.vecdot(outside, outside))


def covered(fit: Fit, reference: Basis, true: Array) -> Array:
    """The share of the skin that lies within the 95 % bands of a fit, (T,).

    `true` (T, Nr) or (1, Nr) in m are coefficients of the functions of the `reference`.
    """
    patch, c = reference.patch, fit.coefficients
    x, y = (along[1:-1] for along in patch.grid(_BAND_SIDE, 3 if patch.strip else _BAND_SIDE))
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    points = points[patch.contains(points)]
    fitted = c.reshape(len(c), -1) @ fit.estimator.basis.at(points).T
    reach = scipy.special.stdtrit(np.maximum(fit.spare, 1), 0.975)
    bands = np.reshape(reach, (-1, 1)) * fit.surface_sd(points)
    held = np.abs(fitted - true @ reference.at(points).T) <= bands
    return np.average(held, axis=1, weights=patch.area(points))


def shares_of(patch: Patch, points: Array) -> Array:
    """The shares (G,) of the skin's area that evenly spaced `points` (G, 2) of x and y are for."""
    area = patch.area(points)
    return area / area.sum()


def points_on(patch: Patch) -> Array:
    """The points (G, 2) of the skin over which errors are averaged."""
    points = np.stack(np.meshgrid(*grid_on(patch)), axis=-1).reshape(-1, 2)
    return points[patch.contains(points)]


def grid_on(patch: Patch) -> tuple[Array, Array]:
    """x (nx,) and y (ny,) in m of the grid that these points lie on."""
    return patch.grid(_POINTS, 2 if patch.strip else _POINTS)


def traced(made: Callable[[], _Made]) -> tuple[_Made, int]:
    """What is made, and the most bytes that were held while making it."""
    mine = not tracemalloc.is_tracing()
    if mine:
        tracemalloc.start()
    try:
        tracemalloc.reset_peak()
        before = tracemalloc.get_traced_memory()[0]
        thing = made()
        return thing, tracemalloc.get_traced_memory()[1] - before
    finally:
        if mine:
            tracemalloc.stop()


def medians_in_turn(
    timed: Sequence[Callable[[], Iterable[float]]], turns: tuple[int, int], budget: float
) -> list[float]:
    """Median seconds of each of the things that are `timed` turn by turn, all in every turn.

    So what else the machine does slows all of them alike. `turns` are the least and the most; after
    about `budget` seconds no more than the least are begun.
    """
    taken = [list[float]() for _ in timed]
    (least, most), end = turns, time.perf_counter() + budget
    for turn in range(most):
        if turn >= least and time.perf_counter() >= end:
            break
        for times, run in zip(taken, timed, strict=True):
            times += run()
    return [statistics.median(times) for times in taken]


def seconds(call: Callable[..., object], *arguments: object) -> float:
    """How long a call with these `arguments` takes."""
    begun = time.perf_counter()
    call(*arguments)
    return time.perf_counter() - begun
