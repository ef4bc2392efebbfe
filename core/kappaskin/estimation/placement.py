"""Element placement: observability of modes, predicted accuracy, D- and A-optimal placement.

Readings with noise of variance s^2 leave the coefficients the covariance s^2 (M'M)^-1. A D-optimal
placement makes the volume of that as small as can be, det M'M as large; an A-optimal one the mean
variance of the displacement over the skin, trace (M'M)^-1 G with G the functions' mean products.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from kappaskin.bases import Basis
from kappaskin.errors import Refusal
from kappaskin.estimation.estimator import Estimator, column_lengths
from kappaskin.frames import Array, Mask
from kappaskin.sensing import SensorLayout


def singular_values(basis: Basis, layout: SensorLayout) -> tuple[Array, Array]:
    """Singular values (F,) of the live readings, the best observed first, and shapes (F, Ni, Nj).

    They are those of M W with columns scaled to unit length: the first over the last is
    `LeastSquares.condition`. Where the readings do not determine all coefficients the last values
    are zero, or rounding, and no mixture of the last shapes changes the readings; the rigid motions
    of an elastic rim are among them. The squared coefficients of each shape, in m, sum to 1 m^2.
    """
    W = np.eye(basis.size) if basis.free is None else basis.free
    M_W = layout.operator(basis)[layout.live.ravel()] @ W
    length = column_lengths(M_W)
    A, back = M_W / length, W / np.where(np.isfinite(length), length, 1.0)
    R = cast("tuple[Array]", linalg.qr(A, mode="r"))[0][: A.shape[1]] if len(A) else A
    _, s, Vt = linalg.svd(R) if len(A) else (None, np.empty(0), np.eye(A.shape[1]))
    values = np.concatenate([s, np.zeros(A.shape[1] - len(s))])
    shapes = (back @ Vt.T).T
    if basis.unobservable is not None:
        values = np.concatenate([values, np.zeros(basis.unobservable.shape[1])])
        shapes = np.vstack([shapes, basis.unobservable.T])
    shapes /= np.linalg.norm(shapes, axis=1, keepdims=True)
    return values, shapes.reshape(len(shapes), *basis.shape)


_SWEEPS = 20  # over all elements at most; most placements are done after three to eight
_GAIN = 1e-6  # of a criterion: a smaller one is not worth an exchange
_CROWD = 1.6  # the power that draws clustered elements to the middle
_MOST_CANDIDATES = 10_000
_RIDGE = 1e-9  # of the information of a reading on average, so that too few elements are no error

Placement = Callable[[SensorLayout, Basis, float], SensorLayout]
"""A function of layout, basis to determine, and least distance in m; a layout as large."""


def predicted_sd(
    estimator: Estimator, noise: float, positions: Array, curvature: Array | None = None
) -> Array:
    """Standard deviation (G,) in m of the displacement at `positions` (G, 2), for `noise` in 1/m.

    How far estimates of one load differ from frame to frame, and what no reading determines of an
    elastic rim; from the covariance alone, without simulation. Neither what the basis cannot
    represent is in it nor what a prior decides. `curvature` (3, P) in 1/m are the readings of the
    load without noise, at rest when None; `bayes` needs them: its prior's scale follows from them.
    """
    rows = estimator.basis.at(positions)
    undecided = np.linalg.norm(rows @ estimator.undecided, axis=1)
    return np.hypot(noise * estimator.scatter(noise, curvature).sd_of(rows), undecided)


def _at(places: Array, layout: SensorLayout) -> SensorLayout:
    """Elements like those of `layout` at `places` (P, 2) in m."""
    layout.check_curvature_sensor("a new placement")
    return replace(SensorLayout.scattered(layout.patch, places), gage_length=layout.gage_length)


def _as_they_are(layout: SensorLayout, basis: Basis, spacing: float) -> SensorLayout:
    return layout


def _clustered(layout: SensorLayout, basis: Basis, spacing: float) -> SensorLayout:
    """The same elements, drawn towards the middle of the skin."""
    half = np.array([layout.patch.a, layout.patch.b]) / 2
    u = layout.positions / half - 1
    return _at(half * (1 + np.sign(u) * np.abs(u) ** _CROWD), layout)


def _optimal(det: bool) -> Placement:
    return lambda layout, basis, spacing: _exchanged(layout, basis, spacing, det)


PLACEMENTS: dict[str, Placement] = {
    "scene": _as_they_are,
    "clustered": _clustered,
    "D": _optimal(det=True),
    "A": _optimal(det=False),
}
"""Placements by name: as in the scene, clustered in the middle, D-optimal, A-optimal."""


def check_placement(layout: SensorLayout, by: str) -> None:
    """Raise a `Refusal` for a layout whose elements cannot be placed `by` this name."""
    if by != "scene" and layout.patch.strip:
        raise Refusal("expected a 2-D skin to place elements on, got a strip")
    if by != "scene" and not layout.live.all():
        raise Refusal("expected only live elements for a new placement, got dead ones among them")


def place_elements(layout: SensorLayout, basis: Basis, by: str, spacing: float) -> SensorLayout:
    """As many elements as `layout` has, placed by the name `by` to determine `basis`.

    At least `spacing` in m from each other where the placement is optimal.
    """
    return PLACEMENTS[by](layout, basis, spacing)


def _candidates(layout: SensorLayout, spacing: float) -> Array:
    """Candidate places (C, 2) in m on the skin, at least `spacing` in m from each other."""
    patch = layout.patch
    m, n = (math.floor(side / spacing + 1e-9) for side in (patch.a, patch.b))
    places = np.empty((0, 2))
    if 0 < m * n <= _MOST_CANDIDATES:
        places = SensorLayout.regular(patch, m, n).positions
        places = places[patch.depth(places) >= layout.gage_length / 2]
    if len(places) <= len(layout):
        raise Refusal(
            f"expected a spacing that leaves more than {len(layout)} places on a tiling of "
            f"at most {_MOST_CANDIDATES}, got {m} x {n} at {spacing:g} m"
        )
    return places


def _exchanged(layout: SensorLayout, basis: Basis, spacing: float, det: bool) -> SensorLayout:
    """The layout after every exchange of one element for a free place that gains (Fedorov's).

    It starts from the free places nearest to the scene's elements, and takes the best exchange for
    one element after the other, until none gains.
    """
    places = _candidates(layout, spacing)
    rows, products = _scaled(layout, basis, places)
    chosen = _nearest(layout.positions, places)
    free = np.ones(len(places), bool)
    free[chosen] = False
    for _ in range(_SWEEPS):
        if not sum([_exchange(rows, products, chosen, free, n, det) for n in range(len(chosen))]):
            break
    return _at(places[np.sort(chosen)], layout)


def _scaled(layout: SensorLayout, basis: Basis, places: Array) -> tuple[Array, Array]:
    """Readings (C, 3, F) of F functions by elements at `places`, each function scaled to unit size.

    And the mean products (F, F) of the functions over the skin, scaled alike.
    """
    W = np.eye(basis.size) if basis.free is None else basis.free
    M = _at(places, layout).operator(basis) @ W
    length = np.linalg.norm(M, axis=0) / math.sqrt(len(places))
    points, weights = basis.quadrature()
    shapes = basis.at(points) @ W / length
    products = (weights[:, None] * shapes).T @ shapes / weights.sum()
    return np.ascontiguousarray((M / length).reshape(3, len(places), -1).swapaxes(0, 1)), products


def _nearest(positions: Array, places: Array) -> NDArray[np.intp]:
    """The numbers (P,) of different `places` (C, 2), the nearest free one for each position."""
    left, chosen = np.ones(len(places), bool), list[int]()
    for position in positions:
        away = np.where(left, np.hypot(*(places - position).T), np.inf)
        chosen.append(int(np.argmin(away)))
        left[chosen[-1]] = False
    return np.array(chosen, np.intp)


def _exchange(
    rows: Array, products: Array, chosen: NDArray[np.intp], free: Mask, n: int, det: bool
) -> bool:
    """Move element `n` of those `chosen` to a better free place; whether there was one.

    With M'M = A of the others and a place's rows r (3, F), det(A + r'r) = det(A) det(1 + r V r'),
    V = A^-1, and trace((A + r'r)^-1 G) = trace(V G) - trace((1 + r V r')^-1 r V G V r').
    """
    others = rows[np.delete(chosen, n)].reshape(-1, rows.shape[2])
    A = others.T @ others
    V = np.linalg.inv(A + _RIDGE * len(chosen) * np.eye(len(A)))
    here = np.append(np.flatnonzero(free), chosen[n])
    r = rows[here]
    rV = r @ V
    S = np.eye(3) + rV @ r.swapaxes(1, 2)
    if det:
        information = np.linalg.slogdet(S)[1]
    else:
        shared = np.linalg.solve(S, rV @ products @ rV.swapaxes(1, 2))
        information = np.trace(shared, axis1=1, axis2=2) / np.trace(V @ products)
    best = int(np.argmax(information))
    if not information[best] > information[-1] + _GAIN:
        return False
    free[chosen[n]], free[here[best]] = True, False
    chosen[n] = here[best]
    return True
