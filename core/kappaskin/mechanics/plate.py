"""A simply supported plate: from loads to the coefficients of its deflection."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from kappaskin.bases import SineBasis
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.mechanics.loads import Load
from kappaskin.patch import Patch


@dataclass(frozen=True)
class Plate:
    """A thin plate on a patch, hinged along its edges, with flexural `rigidity` D in N m."""

    patch: Patch
    rigidity: float = 3.7e-3

    def __post_init__(self) -> None:
        if not 0 < self.rigidity < np.inf:
            raise Refusal(f"expected a rigidity above zero in N m, got {self.rigidity}")

    @classmethod
    def of_material(cls, patch: Patch, E: float, nu: float, h: float) -> "Plate":
        """D = E h^3 / (12 (1 - nu^2)): Young's modulus E in Pa, Poisson's ratio, thickness in m.

        The paper prints (1 + v^2) below Eq. 9; the plate's rigidity has (1 - nu^2).
        """
        if not (E > 0 and h > 0 and -1 < nu <= 0.5):
            raise Refusal(
                f"expected E > 0 Pa, h > 0 m and -1 < nu <= 0.5, got E={E}, nu={nu}, h={h}"
            )
        return cls(patch, E * h**3 / (12 * (1 - nu**2)))

    def compliance(self, basis: SineBasis) -> Array:
        """Coefficient per modal force, 4 / (a b D (k_i^2 + k_j^2)^2), (Ni, Nj) in m/N (Eq. 9)."""
        return 4 / (self.patch.a * self.patch.b * self.rigidity * basis.laplacian**2)

    def deflection(self, loads: Iterable[Load], basis: SineBasis) -> Array:
        """Coefficients (Ni, Nj) in m of the deflection under all `loads` at once."""
        force = np.zeros(basis.shape)
        for load in loads:
            load.check(self.patch)
            force += load.modal(basis)
        return self.compliance(basis) * force
