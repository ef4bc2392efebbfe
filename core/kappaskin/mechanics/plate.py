"""An elastic skin: from loads to the coefficients of its deflection."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from kappaskin.bases import Basis, SineBasis
from kappaskin.bases.basis import curvature_at
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.mechanics.loads import Load
from kappaskin.patch import Patch


@dataclass(frozen=True, eq=False)
class Compliance:
    """Coefficients per modal force, in m/N: `values` (N,) where functions do not mix, else (N, N).

    With a `volume` (N,) in m^2, the integral of each function, a fluid below keeps the volume.
    """

    values: Array
    volume: Array | None = None

    def __call__(self, modal: Array) -> Array:
        """Coefficients (Ni, Nj) in m under the modal forces (Ni, Nj) in N."""
        return self.after(modal.reshape(1, -1)).reshape(modal.shape)

    def after(self, M: Array) -> Array:
        """M C (R, N) for the rows M (R, N) of an operator on coefficients."""
        free = M * self.values if self.values.ndim == 1 else M @ self.values
        if self.volume is None:
            return free
        # The pressure that makes the volume vanish: C - C v v'C / v'C v.
        under_pressure = replace(self, volume=None).after(self.volume[None])[0]
        share = (M @ under_pressure) / (self.volume @ under_pressure)
        return free - np.multiply.outer(share, under_pressure)


@dataclass(frozen=True)
class Plate:
    """A thin skin on a patch: a plate with flexural `rigidity` D in N m, and what else holds it.

    A drum head has `tension` T in N/m, a foam below it the `foundation` modulus k_f in N/m^3, a
    fluid below it keeps its volume. `poisson` matters where an edge gives or the skin is bent.
    """

    patch: Patch
    rigidity: float = 3.7e-3
    tension: float = 0.0
    foundation: float = 0.0
    fluid: bool = False
    poisson: float = 0.3

    def __post_init__(self) -> None:
        if not 0 < self.rigidity < np.inf:
            raise Refusal(f"expected a rigidity above zero in N m, got {self.rigidity}")
        for name, unit in (("tension", "N/m"), ("foundation", "N/m^3")):
            if not 0 <= (value := getattr(self, name)) < np.inf:
                raise Refusal(f"expected a {name} of at least zero in {unit}, got {value}")
        if not -1 < self.poisson <= 0.5:
            raise Refusal(f"expected -1 < Poisson's ratio <= 0.5, got {self.poisson}")

    @classmethod
    def of_material(cls, patch: Patch, E: float, nu: float, h: float) -> "Plate":
        """D = E h^3 / (12 (1 - nu^2)): Young's modulus E in Pa, Poisson's ratio, thickness in m.

        The paper prints (1 + v^2) below Eq. 9; the plate's rigidity has (1 - nu^2).
        """
        if not (E > 0 and h > 0 and -1 < nu <= 0.5):
            raise Refusal(
                f"expected E > 0 Pa, h > 0 m and -1 < nu <= 0.5, got E={E}, nu={nu}, h={h}"
            )
        return cls(patch, E * h**3 / (12 * (1 - nu**2)), poisson=nu)

    def compliance(self, basis: Basis) -> Compliance:
        """What each coefficient answers to modal forces, by Ritz; closed form for flat sines.

        There it is 4 / (a b (D k^4 + T k^2 + k_f)) with k^2 = k_i^2 + k_j^2 (Eq. 9, extended).
        """
        if isinstance(basis, SineBasis) and not self.patch.base_curvature:
            k2 = basis.laplacian.ravel()
            area = self.patch.a * self.patch.b / (2 if self.patch.strip else 4)
            stiffness = self.rigidity * k2**2 + self.tension * k2 + self.foundation
            values: Array = 1 / (area * stiffness)
        else:
            values = self._by_ritz(basis)
        if not self.fluid:
            return Compliance(values)
        points, weights = basis.quadrature()
        return Compliance(values, weights @ basis.at(points))

    def _by_ritz(self, basis: Basis) -> Array:
        """The inverse (N, N) of the energy's second derivative, on what the edges leave free."""
        points, weights = basis.quadrature()
        xx, yy, xy = curvature_at(basis, points)

        def product(left: Array, right: Array) -> Array:
            return (left.T * weights) @ right

        nu, f = self.poisson, basis.at(points)
        mixed = product(xx, yy)
        bending = product(xx, xx) + product(yy, yy) + nu * (mixed + mixed.T)
        bending += 2 * (1 - nu) * product(xy, xy)
        slopes = sum(product(s, s) for s in (basis.at(points, 1, 0), basis.at(points, 0, 1)))
        whole = self.rigidity * bending + self.tension * slopes + self.foundation * product(f, f)
        W = np.eye(basis.size) if basis.free is None else basis.free
        K = W.T @ whole @ W
        # Against the bending that the base curvature may cancel, as in a rigid translation.
        bare = whole + self.rigidity * self.patch.base_curvature**4 * product(f, f)
        scale = np.sqrt(np.diag(W.T @ bare @ W))
        values, vectors = np.linalg.eigh(K / np.multiply.outer(scale, scale))
        if not values[0] > 1e-13 * values[-1]:
            raise Refusal(
                "the skin moves as a whole without bending: expected edges that hold it; pin the "
                "ends of the arc, open it by less than 180 degrees, or put foam below it"
            )
        V = W @ (vectors / scale[:, None])
        return (V / values) @ V.T

    def deflection(self, loads: Iterable[Load], basis: Basis) -> Array:
        """Coefficients (Ni, Nj) in m of the deflection under all `loads` at once."""
        force = np.zeros(basis.shape)
        for load in loads:
            load.check(self.patch)
            force += load.modal(basis)
        return self.compliance(basis)(force)
