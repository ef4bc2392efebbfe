"""Solvers to compare: our estimators, NumPy's and SciPy's least squares, finite elements."""

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline
from scipy.sparse.linalg import SuperLU, lsqr, splu

from kappaskin.bases import basis_for
from kappaskin.errors import lacking
from kappaskin.estimation import column_lengths, estimator_for
from kappaskin.frames import Array, Mask
from kappaskin.mechanics import GaussianLoad, Plate
from kappaskin.studies.paper import LoadCase


@dataclass(frozen=True, eq=False)
class Solver:
    """A solver, made once for what does not change from one question to the next.

    `solve` takes a question, readings (..., 3, P) in 1/m or a load, to `count` unknowns (..., U);
    `at` makes of points (G, 2) in m the matrix (G, U) from unknowns to displacements. `kept` are
    bytes that it holds where Python does not count them.
    """

    solve: Callable[[Any], Array]
    at: Callable[[Array], Any]
    count: int
    error_bars: bool = False
    kept: int = 0


# Readings to coefficients, by our estimators and by what NumPy and SciPy have for it


def kappaskin_solver(
    case: LoadCase, method: str, functions: tuple[int, int] | None = None, error_bars: bool = False
) -> Solver:
    """One of our methods, with the case's functions or so many others."""
    scene = case.scene
    basis = basis_for(scene.plate.patch, scene.edge, *(functions or case.fit.basis.shape))
    fit = estimator_for(method, basis, scene.layout)

    def solve(curvature: Array) -> Array:
        found = fit(curvature)
        if error_bars:
            _ = found.sd  # made when asked for
        return found.coefficients.reshape(*curvature.shape[:-2], -1)

    return Solver(solve, basis.at, basis.size, error_bars)


# The others are given our operator and functions, which their user would have to write first.


def _operator(case: LoadCase) -> tuple[Array, Mask]:
    """M (R, N), and which readings (3, P) are its rows."""
    layout = case.scene.layout
    return layout.curvature_operator(case.fit.basis)[layout.live.ravel()], layout.live


def lstsq_solver(case: LoadCase) -> Solver:
    """LAPACK's least squares, anew in each frame."""
    M, live = _operator(case)

    def solve(curvature: Array) -> Array:
        return cast("Array", np.linalg.lstsq(M, curvature[..., live].T)[0]).T

    return Solver(solve, case.fit.basis.at, M.shape[1])


def pinv_solver(case: LoadCase) -> Solver:
    """The pseudo-inverse, made once, and a product per frame."""
    M, live = _operator(case)
    inverse = np.linalg.pinv(M, rcond=max(M.shape) * np.finfo(float).eps).T  # as lstsq has it

    def solve(curvature: Array) -> Array:
        return curvature[..., live] @ inverse

    return Solver(solve, case.fit.basis.at, M.shape[1])


def lsqr_solver(case: LoadCase) -> Solver:
    """LSQR with its usual tolerances, on columns of unit length."""
    M, live = _operator(case)
    length = column_lengths(M)
    A = M / length

    def solve(curvature: Array) -> Array:
        if curvature.ndim > 2:
            return np.stack([solve(frame) for frame in curvature])
        return cast("Array", lsqr(A, curvature[live])[0]) / length

    return Solver(solve, case.fit.basis.at, M.shape[1])


# Finite elements: a hinged plate's deflection, and what their other uses here share


def scikit_fem() -> Any:
    """scikit-fem; raises a `Refusal` where it is not installed."""
    try:
        return importlib.import_module("skfem")
    except ImportError as error:
        raise lacking("compare", "a comparison", error) from error


def axes(sides: tuple[float, float], cells: int) -> list[Array]:
    """Where so many cells end along each of the two `sides` in m."""
    return [np.linspace(0.0, side, cells + 1) for side in sides]


class ConstrainedSystem:
    """Unknowns of which some are `held` at zero, with their matrix K (N, N) factored once."""

    def __init__(self, K: Any, held: NDArray[np.intp]) -> None:
        self._free = np.setdiff1d(np.arange(int(K.shape[0])), held)
        self._factors = cast("SuperLU", splu(K[self._free][:, self._free].tocsc()))
        self.kept = 12 * self._factors.nnz
        """Bytes of the factors, which SuperLU holds: a number and a place for each."""

    def __call__(self, force: Array) -> Array:
        """The unknowns (N,) or (N, T) that K makes of `force`, of the same shape."""
        found = np.zeros(force.shape)
        found[self._free] = self._factors.solve(force[self._free])
        return found


def plate_solver(plate: Plate, element: str, cells: int) -> Solver:
    """A plate hinged all round, of Argyris or Morley elements on cells x cells squares, halved.

    Its energy is D/2 ((1 - nu) w_ij w_ij + nu w_ii w_jj), integrated.
    """
    skfem, sides, nu = scikit_fem(), (plate.patch.a, plate.patch.b), plate.poisson
    mesh = skfem.MeshTri.init_tensor(*axes(sides, cells))
    basis = skfem.Basis(mesh, getattr(skfem, f"ElementTri{element}")(), intorder=8)

    def energy(u: Any, v: Any, _: Any) -> Any:
        (uxx, uxy), (_, uyy) = u.hess
        (vxx, vxy), (_, vyy) = v.hess
        product = uxx * vxx + 2 * uxy * vxy + uyy * vyy
        return plate.rigidity * ((1 - nu) * product + nu * (uxx + uyy) * (vxx + vyy))

    def held(axis: int, side: float, along: str) -> NDArray[np.intp]:
        def on_edge(places: Array) -> Mask:
            return np.isclose(places[axis] * (side - places[axis]), 0)

        # Where w is zero along an edge, so are its derivatives along it.
        zero = ["u", f"u_{along}", f"u_{2 * along}"]
        return basis.get_dofs(mesh.facets_satisfying(on_edge)).all(zero)

    rim = np.union1d(held(0, sides[0], "y"), held(1, sides[1], "x"))
    still = ConstrainedSystem(skfem.BilinearForm(energy).assemble(basis), rim)
    work, places = skfem.LinearForm(_work), np.asarray(basis.global_coordinates())

    def solve(load: GaussianLoad) -> Array:
        return still(work.assemble(basis, pressure=_pressure(load, places)))

    return Solver(solve, lambda points: basis.probes(points.T), int(basis.N), kept=still.kept)


def _work(v: Any, at: Any) -> Any:
    return at["pressure"] * v


def _pressure(load: GaussianLoad, places: Array) -> Array:
    """In Pa at `places` (2, ...) in m."""
    square = (places[0] - load.x) ** 2 + (places[1] - load.y) ** 2
    return load.force * np.exp(-square / (2 * load.sd**2)) / (2 * np.pi * load.sd**2)


# The slopes route, by scikit-fem's Poisson equations.
#
# p = w_x and q = w_y come of the curvature, and w of them, each by one equation in its weak form,
# which differentiates no reading:
#     (grad p, grad v) = ((xx, xy), grad v),    (grad q, grad v) = ((xy, yy), grad v),
#     (grad w, grad v) = ((p, q), grad v).
# What a hinged rim holds is zero: w all round, p where y is 0 or b, q where x is 0 or a.


def slopes_solver(case: LoadCase) -> Solver:
    """The surface of a flat hinged skin with elements on a regular grid."""
    skfem, layout = scikit_fem(), case.scene.layout
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
    for_p, for_q, for_w = (
        ConstrainedSystem(K, at_y),
        ConstrainedSystem(K, at_x),
        ConstrainedSystem(K, np.union1d(at_x, at_y)),
    )
    odd, even = (_splines(shape, sides, places, mirror) for mirror in (-1, 1))

    def solve(curvature: Array) -> Array:
        xx, yy, xy = (np.asarray(curvature[..., k, :]).T for k in range(3))
        xx, yy, xy = odd @ xx, odd @ yy, even @ xy
        p, q = for_p(on_x @ xx + on_y @ xy), for_q(on_x @ xy + on_y @ yy)
        return for_w(on_x @ p + on_y @ q).T

    kept = for_p.kept + for_q.kept + for_w.kept
    return Solver(solve, lambda points: basis.probes(points.T), int(basis.N), kept=kept)


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
