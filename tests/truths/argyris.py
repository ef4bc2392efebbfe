"""A plate by finite elements: Argyris' triangles, quintic and with continuous slopes.

It shares no code with the library that it tests. Displacement is positive inward, and curvature
the plain second derivatives f_xx, f_yy and f_xy.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from skfem import (
    Basis,
    BilinearForm,
    ElementTriArgyris,
    FacetBasis,
    LinearForm,
    MeshTri,
    condense,
    solve,
)
from skfem.helpers import dd, ddot, trace

# What an edge along y holds of a function and its derivatives; along x the same with x and y
# exchanged. Where the slope is free so is the moment, which needs no constraint.
_HELD = {
    "clamped": ("u", "u_x", "u_y", "u_xy", "u_yy", "u_n"),
    "hinged": ("u", "u_y", "u_yy"),
    "springs": (),
}
_EXCHANGED = {"u_x": "u_y", "u_y": "u_x", "u_yy": "u_xx"}


@dataclass(frozen=True)
class ArgyrisPlate:
    """A square plate of `side` in m and flexural `rigidity` D in N m, its `edge` one of `_HELD`.

    On `springs` of a stiffness in N/m^2 along the rim it is free to turn there.
    """

    side: float = 0.1
    rigidity: float = 3.7e-3
    edge: str = "clamped"
    cells: int = 32
    poisson: float = 0.3
    springs: float = 0.0

    def displacement(self, load, places):
        """Displacement (G,) in m at `places` (G, 2) in m under a load with an sd."""
        return self._at(self._solved(load), places, "value")

    def readings(self, load, elements):
        """Curvature xx, yy, xy (3, P) in 1/m at `elements` (P, 2) in m under a load with an sd."""
        found = self._at(self._solved(load), elements, "hess")
        return np.stack([found[0, 0], found[1, 1], found[0, 1]])

    @cached_property
    def _basis(self):
        steps = np.linspace(0, self.side, self.cells + 1)
        mesh = MeshTri.init_tensor(steps, steps).with_boundaries({
            "along y": lambda p: np.isclose(p[0] % self.side, 0, atol=1e-9 * self.side),
            "along x": lambda p: np.isclose(p[1] % self.side, 0, atol=1e-9 * self.side),
        })  # fmt: skip
        return Basis(mesh, ElementTriArgyris(), intorder=10)

    @cached_property
    def _energy(self):
        # Held edges leave nothing of what Poisson's ratio adds to the energy.
        D, nu, k = self.rigidity, self.poisson, self.springs

        def bending(u, v, _):
            return D * ((1 - nu) * ddot(dd(u), dd(v)) + nu * trace(dd(u)) * trace(dd(v)))

        energy = BilinearForm(bending).assemble(self._basis)
        if not k:
            return energy
        rim = FacetBasis(self._basis.mesh, ElementTriArgyris(), intorder=10)
        return energy + BilinearForm(lambda u, v, _: k * u * v).assemble(rim)

    def _solved(self, load):
        def work(v, w):
            t = (w.x[0] - load.x) ** 2 + (w.x[1] - load.y) ** 2
            return load.force * np.exp(-t / (2 * load.sd**2)) / (2 * np.pi * load.sd**2) * v

        names, basis = _HELD[self.edge], self._basis
        exchanged = [_EXCHANGED.get(name, name) for name in names]
        held = [
            basis.get_dofs("along y").all(list(names)),
            basis.get_dofs("along x").all(exchanged),
        ]
        pressed = LinearForm(work).assemble(basis)
        if not names:
            return solve(self._energy, pressed)
        return solve(*condense(self._energy, pressed, D=np.unique(np.concatenate(held))))

    def _at(self, c, places, what):
        basis = self._basis
        cells = basis.mesh.element_finder()(*places.T)
        local = basis.mapping.invF(places.T[:, :, None], tind=cells)
        found = 0.0
        for i, dofs in enumerate(basis.dofs.element_dofs[:, cells]):
            (function,) = basis.elem.gbasis(basis.mapping, local, i, tind=cells)
            values = np.asarray(function) if what == "value" else function.hess
            found = found + c[dofs] * values[..., 0]
        return found
