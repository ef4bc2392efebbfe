"""A hinged plate's deflection by scikit-fem, and what its other uses here share."""

import importlib
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import SuperLU, splu

from kappaskin.errors import Refusal
from kappaskin.frames import Array, Mask
from kappaskin.mechanics import GaussianLoad, Plate
from kappaskin.studies.compare.way import Way


def library() -> Any:
    """scikit-fem; raises a `Refusal` where it is not installed."""
    try:
        return importlib.import_module("skfem")
    except ImportError as error:
        raise Refusal(
            'expected scikit-fem to compare with; `pip install "kappaskin[compare]"` installs it'
        ) from error


def axes(sides: tuple[float, float], cells: int) -> list[Array]:
    """Where so many cells end along each of the two `sides` in m."""
    return [np.linspace(0.0, side, cells + 1) for side in sides]


class Held:
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


def bent(plate: Plate, element: str, cells: int) -> Way:
    """A plate hinged all round, of Argyris or Morley elements on cells x cells squares, halved.

    Its energy is D/2 ((1 - nu) w_ij w_ij + nu w_ii w_jj), integrated.
    """
    skfem, sides, nu = library(), (plate.patch.a, plate.patch.b), plate.poisson
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
    still = Held(skfem.BilinearForm(energy).assemble(basis), rim)
    work, places = skfem.LinearForm(_work), np.asarray(basis.global_coordinates())

    def solve(load: GaussianLoad) -> Array:
        return still(work.assemble(basis, pressure=_pressure(load, places)))

    return Way(solve, lambda points: basis.probes(points.T), int(basis.N), kept=still.kept)


def _work(v: Any, at: Any) -> Any:
    return at["pressure"] * v


def _pressure(load: GaussianLoad, places: Array) -> Array:
    """In Pa at `places` (2, ...) in m."""
    square = (places[0] - load.x) ** 2 + (places[1] - load.y) ** 2
    return load.force * np.exp(-square / (2 * load.sd**2)) / (2 * np.pi * load.sd**2)
