"""Element placement: observability of modes, predicted accuracy, D- and A-optimal placement.

Readings with noise of variance s^2 leave the coefficients the covariance s^2 (M'M)^-1. A D-optimal
placement makes the volume of that as small as can be, det M'M as large; an A-optimal one the mean
variance of the displacement over the skin, trace (M'M)^-1 G with G the functions' mean products.
Readings that differ in unit are divided by their noise first. Where their zero is unknown, M has a
column for each offset, and G zeros: what is determined of the shape is what is left beside them.
The information of elements on a load adds up: a placement may also make the mean error of loads
small.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import linalg

from kappaskin.bases import Basis
from kappaskin.errors import Refusal
from kappaskin.estimation.estimator import Estimator, column_lengths, combinations
from kappaskin.frames import Array, Indices, Mask
from kappaskin.sensing import SensorLayout
from kappaskin.skin import Cap, MeshSkin


def singular_values(basis: Basis, layout: SensorLayout) -> tuple[Array, Array]:
    """Singular values (F,) of the live readings, the best observed first, and shapes (F, Ni, Nj).

    They are those of M W with columns scaled to unit length: the first over the last is
    `LeastSquares.condition`. Where the readings do not determine all coefficients the last values
    are zero, or rounding, and no mixture of the last shapes changes the readings; the rigid motions
    of an elastic rim are among them where curvature alone is read. The squared coefficients of each
    shape, in m, sum to 1 m^2.
    """
    some, still = combinations(basis, layout)
    W = np.eye(basis.size) if some is None else some
    M_W = layout.operator(basis)[layout.live.ravel()] @ W
    length = column_lengths(M_W)
    A, back = M_W / length, W / np.where(np.isfinite(length), length, 1.0)
    R = cast("tuple[Array]", linalg.qr(A, mode="r"))[0][: A.shape[1]] if len(A) else A
    _, s, Vt = linalg.svd(R) if len(A) else (None, np.empty(0), np.eye(A.shape[1]))
    values = np.concatenate([s, np.zeros(A.shape[1] - len(s) + still.shape[1])])
    shapes = np.hstack([back @ Vt.T, still]).T
    shapes /= np.linalg.norm(shapes, axis=1, keepdims=True)
    return values, shapes.reshape(len(shapes), *basis.shape)


_SWEEPS = 20  # over all elements at most; most placements are done after three to eight
_GAIN = 1e-6  # of a criterion: a smaller one is not worth an exchange
_CROWD = 1.6  # the power that draws clustered elements to the middle
_MOST_CANDIDATES = 10_000
_TRIED = 12  # places for one element that determines loads, of those that promise most
_RIDGE = 1e-9  # of the information of a reading on average, so that too few elements are no error

Placement = Callable[[SensorLayout, Basis, float, ArrayLike | None], SensorLayout]
"""A function of layout, basis to determine, least distance in m, and sigma; a layout as large."""


def predicted_sd(
    estimator: Estimator, noise: float, positions: Array, curvature: Array | None = None
) -> Array:
    """Standard deviation (G,) in m of the displacement at `positions` (G, 2).

    For a `noise` of the readings in their unit, 1/m of curvature, or in units of the sigma that the
    estimator was given. How far estimates of one load differ from frame to frame, and what no
    reading determines of an elastic rim; from the covariance alone, without simulation. Neither
    what the basis cannot represent is in it nor what a prior decides. `curvature` (3, P), or other
    readings (R,), are those of the load without noise, at rest when None; `bayes` needs them: its
    prior's scale follows from them.
    """
    rows = estimator.basis.at(positions)
    undecided = np.linalg.norm(rows @ estimator.undecided, axis=1)
    return np.hypot(noise * estimator.scatter(noise, curvature).sd_of(rows), undecided)


def _as_they_are(
    layout: SensorLayout, basis: Basis, spacing: float, sigma: ArrayLike | None
) -> SensorLayout:
    return layout


def _clustered(
    layout: SensorLayout, basis: Basis, spacing: float, sigma: ArrayLike | None
) -> SensorLayout:
    """The same elements, drawn towards the middle of the skin."""
    half = np.array([layout.patch.a, layout.patch.b]) / 2
    u = layout.positions / half - 1
    places = half * (1 + np.sign(u) * np.abs(u) ** _CROWD)
    return replace(layout, positions=places, shape=None)


def _optimal(det: bool) -> Placement:
    return lambda layout, basis, spacing, sigma: _exchanged(layout, basis, spacing, sigma, det)


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


def place_elements(
    layout: SensorLayout, basis: Basis, by: str, spacing: float, sigma: ArrayLike | None = None
) -> SensorLayout:
    """As many elements as `layout` has, placed by the name `by` to determine `basis`.

    At least `spacing` in m from each other where the placement is optimal. Each reads what it did;
    `sigma` is the standard deviation of each reading, as an estimator takes it, and needed where
    readings differ in unit. Raises a `Refusal` where there is no room.
    """
    return PLACEMENTS[by](layout, basis, spacing, sigma)


LoadInformation = Callable[[Array], tuple[Array, Array, Array]]
"""The Fisher information (C, G, n, n) of elements at places (C, 2) on n unknowns of G loads.

With it the information of the prior (n, n), and weights E (m, G, n, n) of m kinds of errors: the
mean square of an error is the sum of trace E V over the loads, with their covariance V.
"""


def place_for_loads(
    layout: SensorLayout, spacing: float, information_at: LoadInformation
) -> SensorLayout:
    """As many elements as `layout` has, at least `spacing` in m apart, that determine loads best.

    They make the sum of the mean squares of all kinds of errors small, each over what it is with
    the elements where they are, by exchanges of one element after the other. Where none gains,
    that is `layout` itself. Raises a `Refusal` where there is no room.
    """
    places = _candidates(layout, spacing)
    information, prior, errors = information_at(np.concatenate([places, layout.positions]))
    information, own = np.split(information, [len(places)])
    total: Array = prior + own.sum(axis=0)
    ridge = _RIDGE * np.diag(np.diagonal(total, axis1=1, axis2=2).mean(axis=0))
    V = _inverses(total + ridge)
    E: Array = np.einsum("mgij,m->gij", errors, 1 / np.einsum("mgij,gij->m", errors, V))
    chosen, free = _nearest(layout.positions, places), np.ones(len(places), bool)
    free[chosen] = False
    total = prior + ridge + information[chosen].sum(axis=0)
    least = float(np.vdot(E, _inverses(total)))
    for _ in range(_SWEEPS):
        before = least
        for n, here in enumerate(chosen.tolist()):
            others = total - information[here]
            left_over = _inverses(others)
            # What a little of an element would gain shows where to try all of it.
            slope = left_over @ E @ left_over
            gains = np.asarray(np.tensordot(information, slope, 3), float)
            tried = np.flatnonzero(free)
            for there in tried[np.argsort(gains[tried])[-_TRIED:]].tolist():
                after = others + information[there]
                left = float(np.vdot(E, _inverses(after)))
                if left < least * (1 - _GAIN):
                    least, total, chosen[n] = left, after, there
            free[here], free[chosen[n]] = True, False
        if least == before:
            break
    if least > len(errors) * (1 - _GAIN):
        return layout
    return replace(layout, positions=places[np.sort(chosen)], shape=None)


def _inverses(W: Array) -> Array:
    return np.asarray(np.linalg.inv(W), float)


def _sigma_of_each(layout: SensorLayout, sigma: ArrayLike | None) -> Array:
    """The standard deviation (R,) of each reading; 1 where all weigh the same."""
    given = np.asarray(1.0 if sigma is None else sigma, float)
    if sigma is None and " or " in layout.units:
        raise Refusal(
            f"expected the sigma of readings that differ in unit, {layout.units}, to place their "
            "elements, got none; give each its standard deviation"
        )
    fits = given.shape in ((), layout.frame_shape)
    if not fits or not np.all((given > 0) & (given < math.inf)):
        raise Refusal(
            f"expected a finite sigma above zero of {', '.join(layout.kind_names)}, one number or "
            f"of shape {layout.frame_shape}, to place their elements; got {sigma!s:.80}"
        )
    return np.broadcast_to(given, layout.frame_shape).reshape(-1)


def _candidates(layout: SensorLayout, spacing: float) -> Array:
    """Candidate places (C, 2) in m on the skin, at least `spacing` in m from each other."""
    patch, places = layout.patch, np.empty((0, 2))
    count = patch.a * patch.b / spacing**2
    m, n = (math.floor(side / spacing + 1e-9) for side in (patch.a, patch.b))
    if m * n and count <= _MOST_CANDIDATES * (1 + 1e-9):
        if isinstance(patch, MeshSkin):
            places = patch.places[patch.spread(len(patch.places), spacing)]
        elif isinstance(patch, Cap):
            places = SensorLayout.on_rings(patch, _rings(patch, spacing)).positions
        else:
            places = SensorLayout.regular(patch, m, n).positions
        places = places[layout.has_room(places)]
    if len(places) <= len(layout):
        raise Refusal(
            f"expected a spacing that leaves more than {len(layout)} places, at most "
            f"{_MOST_CANDIDATES}, got about {count:.3g} at {spacing:g} m"
        )
    return places


def _rings(cap: Cap, spacing: float) -> list[int]:
    """The places on each ring of a cap, at least `spacing` in m from each other through the air."""
    count = max(math.floor(cap.rim_radius / spacing + 0.5), 1)
    away: Array = cap.rim_radius / (count - 0.5) * np.arange(1.0, count)
    chord = spacing / (2 * cap.meridian(away).radius)
    around = np.floor(np.pi / np.arcsin(np.minimum(chord, 1.0))).astype(int)
    return [1, *around.tolist()]


def _exchanged(
    layout: SensorLayout, basis: Basis, spacing: float, sigma: ArrayLike | None, det: bool
) -> SensorLayout:
    """The layout after every exchange of one element for a free place that gains (Fedorov's).

    It starts from the free places nearest to the scene's elements, and takes the best exchange for
    one element after the other, until none gains.
    """
    places = _candidates(layout, spacing)
    rows, which, products = _scaled(layout, basis, places, sigma)
    chosen = _nearest(layout.positions, places)
    free = np.ones(len(places), bool)
    free[chosen] = False
    of_each = [layout.element == n for n in range(len(chosen))]
    for _ in range(_SWEEPS):
        moved = 0
        for n, own in enumerate(of_each):
            others = rows[chosen[layout.element[~own]], which[~own]]
            moved += _exchange(rows[:, which[own]], others, products, chosen, free, n, det)
        if not moved:
            break
    alike = all(np.array_equal(which[own], which[of_each[0]]) for own in of_each)
    return replace(layout, positions=places[np.sort(chosen) if alike else chosen], shape=None)


def _scaled(
    layout: SensorLayout, basis: Basis, places: Array, sigma: ArrayLike | None
) -> tuple[Array, Indices, Array]:
    """Readings (C, k, F) over their `sigma` at `places`, of F unknowns; which of k each (R,) is.

    And the mean products (F, F) over the skin of what they are as shapes: functions, or nothing of
    an offset. Each unknown is scaled to unit size.
    """
    given, C = _sigma_of_each(layout, sigma), len(places)
    kinds = np.column_stack([layout.kind, given])
    _, first, which = np.unique(kinds, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)  # as the first element has them
    which, first = np.argsort(order)[which.reshape(-1)], first[order]
    there = layout.reading_at(places, first)
    some, _ = combinations(basis, layout)
    W = np.eye(basis.size) if some is None else some
    M = np.hstack([there.operator(basis) @ W, there.offsets]) / np.repeat(given[first], C)[:, None]
    length = np.linalg.norm(M, axis=0) / math.sqrt(C)
    points, weights = basis.quadrature()
    shapes = basis.at(points) @ np.pad(W, [(0, 0), (0, M.shape[1] - W.shape[1])]) / length
    products = (weights[:, None] * shapes).T @ shapes / weights.sum()
    rows = (M / length).reshape(len(first), C, -1).swapaxes(0, 1)
    return np.ascontiguousarray(rows), which, products


def _nearest(positions: Array, places: Array) -> NDArray[np.intp]:
    """The numbers (P,) of different `places` (C, 2), the nearest free one for each position."""
    left, chosen = np.ones(len(places), bool), list[int]()
    for position in positions:
        away = np.where(left, np.hypot(*(places - position).T), np.inf)
        chosen.append(int(np.argmin(away)))
        left[chosen[-1]] = False
    return np.array(chosen, np.intp)


def _exchange(
    rows: Array,
    others: Array,
    products: Array,
    chosen: NDArray[np.intp],
    free: Mask,
    n: int,
    det: bool,
) -> bool:
    """Move element `n` of those `chosen` to a better free place; whether there was one.

    With M'M = A of the readings of `others` (R, F) and a place's rows r (k, F),
    det(A + r'r) = det(A) det(1 + r V r'), V = A^-1, and
    trace((A + r'r)^-1 G) = trace(V G) - trace((1 + r V r')^-1 r V G V r').
    """
    A = others.T @ others
    V = np.linalg.inv(A + _RIDGE * len(chosen) * np.eye(len(A)))
    here = np.append(np.flatnonzero(free), chosen[n])
    r = rows[here]
    rV = r @ V
    S = np.eye(rows.shape[1]) + rV @ r.swapaxes(1, 2)
    if det:
        information = np.linalg.slogdet(S)[1]
    else:
        shared = np.linalg.solve(S, rV @ products @ rV.swapaxes(1, 2))
        variance = np.trace(V @ products) - np.trace(shared, axis1=1, axis2=2)
        information = -variance / variance[-1]
    best = int(np.argmax(information))
    if not information[best] > information[-1] + _GAIN:
        return False
    free[chosen[n]], free[here[best]] = True, False
    chosen[n] = here[best]
    return True
