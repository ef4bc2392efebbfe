"""The slopes route: readings to slopes and slopes to a surface, by scikit-fem's Poisson equations.

p = w_x and q = w_y come of the curvature, and w of them, each by one equation in its weak form,
which differentiates no reading:
    (grad p, grad v) = ((xx, xy), grad v),    (grad q, grad v) = ((xy, yy), grad v),
    (grad w, grad v) = ((p, q), grad v).
What a hinged rim holds is zero: w all round, p where y is 0 or b, q where x is 0 or a.
"""

from typing import Any, cast

import numpy as np
from scipy.interpolate import make_interp_spline

from kappaskin.frames import Array
from kappaskin.studies.compare.elements import Held, axes, library
from kappaskin.studies.compare.way import Way
from kappaskin.studies.tables import Case


def integrated(case: Case) -> Way:
    """The surface of a flat hinged skin with elements on a regular grid."""
    skfem, layout = library(), case.scene.layout
    shape, sides = cast("tuple[int, int]", layout.shape), (layout.patch.a, layout.patch.b)
    # As many cells as elements: twice as many take thrice the time for a tenth of the error.
    mesh = skfem.MeshQuad.init_tensor(*axes(sides, max(shape)))
    basis = skfem.Basis(mesh, skfem.ElementQuad2())
    K = skfem.BilinearForm(_stiffness).assemble(basis)
    on_x, on_y = (skfem.BilinearForm(form).assemble(basis) for form in (_pull_x, _pull_y))
    places = np.asarray(basis.doflocs)
    at_x, at_y = (
        np.flatnonzero(np.isclose(along * (side - along), 0))
        for along, side in zip(places, sides, strict=True)
    )
    for_p, for_q, for_w = Held(K, at_y), Held(K, at_x), Held(K, np.union1d(at_x, at_y))
    odd, even = (_splines(shape, sides, places, mirror) for mirror in (-1, 1))

    def solve(curvature: Array) -> Array:
        xx, yy, xy = (np.asarray(curvature[..., k, :]).T for k in range(3))
        xx, yy, xy = odd @ xx, odd @ yy, even @ xy
        p, q = for_p(on_x @ xx + on_y @ xy), for_q(on_x @ xy + on_y @ yy)
        return for_w(on_x @ p + on_y @ q).T

    kept = for_p.kept + for_q.kept + for_w.kept
    return Way(solve, lambda points: basis.probes(points.T), int(basis.N), kept=kept)


def _stiffness(u: Any, v: Any, _: Any) -> Any:
    return u.grad[0] * v.grad[0] + u.grad[1] * v.grad[1]


def _pull_x(u: Any, v: Any, _: Any) -> Any:
    return u * v.grad[0]


def _pull_y(u: Any, v: Any, _: Any) -> Any:
    return u * v.grad[1]


def _splines(
    shape: tuple[int, int], sides: tuple[float, float], places: Array, mirror: int
) -> Array:
    """The matrix (G, P) from one component's readings to the cubic spline at `places` (2, G).

    What lies beyond a hinged rim mirrors what lies inside: xx and yy with the other sign, -1, xy
    with the same.
    """
    X, Y = (_spline(*each, mirror) for each in zip(shape, sides, places, strict=True))
    return np.einsum("gp,gq->gqp", X, Y).reshape(places.shape[1], -1)


def _spline(count: int, side: float, along: Array, mirror: int) -> Array:
    """The same along one side, (G, count)."""
    centres = (np.arange(-count, 2 * count) + 0.5) * side / count
    there = np.eye(count)
    beyond = mirror * there[::-1]
    return make_interp_spline(centres, np.vstack([beyond, there, beyond]), k=3)(along)
