"""Plates: the deflection of an elastic skin under loads."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np

from kappaskin.bases import (
    Basis,
    CapBasis,
    ElasticBasis,
    MeshBasis,
    ModeBasis,
    ProductBasis,
    SineBasis,
    curvature_at,
    hoop_at,
    overlaps,
)
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.mechanics.cap import CapShell
from kappaskin.mechanics.loads import Load, is_point
from kappaskin.mechanics.shell import Sheet, Tangential, shallow_stiffness
from kappaskin.skin import Cap, MeshSkin, Patch


@dataclass(frozen=True, eq=False)
class Compliance:
    """Coefficients per modal force in m/N: `values` (N,) where functions do not mix, else (N, N).

    With `volume` (N,) in m^2, the integral of each function, a fluid below keeps its volume.
    """

    values: Array
    volume: Array | None = None

    def __call__(self, modal: Array) -> Array:
        """Coefficients (Ni, Nj) in m under modal forces (Ni, Nj) in N."""
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


_UNMIXED = 1e-10  # of two functions' own compliances: what they share by rounding


def _unmixed(values: Array) -> Array:
    """A compliance (N, N) as (N,) where no functions are mixed, as a plate's own modes are not."""
    own = values.diagonal()
    shared = values**2 - np.diag(own**2)
    return own.copy() if (shared <= _UNMIXED**2 * np.multiply.outer(own, own)).all() else values


_AT_ENDS = 0.85  # over the root of the number of nodes, of a force (`tests/truths/test_meshes.py`)

USUAL_THICKNESS = 0.25e-3
"""Thickness in m of a bent skin that was given none: substrate and gages."""

INPLANE = ("held", "diaphragm", "free", "hoop")
"""Boundary conditions in the plane of the skin, along its edge.

`held`: no displacement. `diaphragm`: no membrane force across the edge, no displacement along it.
`free`: no membrane force across the edge, no shear. `hoop`, of a bent skin: the hoop displacement
is held, the axial one free. Of a cylinder skin they are those of the straight edges; the curved
ones hold the radial and the hoop displacement and leave the axial one free. Of a shallow skin, as
of a flat one, they are those of all four edges, and there is no `hoop`; where they are free, it
does not slide along itself as a whole. Of a cap they are those of its rim: `held` and, of less than
a hemisphere, `diaphragm`, which lets it slide along the meridian.
"""


_HARDLY = 1e-8  # of the bending stiffness of the longest wave: what stretching adds is left out
_LARGEST_ERROR = 0.03  # of a force, by the theory of shallow skins
_STIFFEST = 1e50  # in SI units; and its inverse: squares of what they make of loads are numbers


def _check_size(expected: str, value: float) -> None:
    if value and not 1 / _STIFFEST <= value <= _STIFFEST:
        raise Refusal(
            f"expected {expected}, if above zero from {1 / _STIFFEST:g} to {_STIFFEST:g}, "
            f"got {value}"
        )


@dataclass(frozen=True)
class Plate:
    """A thin skin on a patch: a plate of flexural `rigidity` D in N m, and what supports it.

    `tension` T in N/m: a drum head has it, and may have no rigidity. `foundation` modulus k_f in
    N/m^3 of a foam below. `fluid`: below is a fluid that keeps its volume. `poisson`: Poisson's
    ratio, which matters where an edge is elastic or the skin is bent. `rim_stiffness` in N/m per m
    of an elastic rim: the default lets it give by 0.2 mm under a load that presses the default skin
    of 0.1 x 0.1 m in by 5 mm. `thickness` h in m of a uniform sheet: a flat skin that was given
    none does not stretch, a bent one is 0.25 mm thick, or as its `axial_stiffness` E h in N/m has
    it, unless that is zero. `inplane` is how its edge is held in its plane, one of `INPLANE`; empty
    means `held`, of a skin of one radius `hoop`, of one of two radii `diaphragm`. Of an
    `unknown_material` no force is told; a simulation bends it like any other.
    """

    patch: Patch
    rigidity: float = 3.7e-3
    tension: float = 0.0
    foundation: float = 0.0
    fluid: bool = False
    poisson: float = 0.3
    axial_stiffness: float | None = None
    rim_stiffness: float = 2e3
    thickness: float | None = None
    inplane: str = ""
    unknown_material: bool = False

    def __post_init__(self) -> None:
        for value, expected in (
            (self.tension, "a tension of at least zero in N/m"),
            (self.foundation, "a foundation of at least zero in N/m^3"),
            (self.axial_stiffness or 0.0, "an axial stiffness of at least zero in N/m"),
            (self.rim_stiffness, "a rim stiffness of at least zero in N/m^2"),
        ):
            if not 0 <= value < np.inf:
                raise Refusal(f"expected {expected}, got {value}")
            _check_size(expected, value)
        if not (0 < self.rigidity < np.inf or (self.rigidity == 0 and self.tension)):
            raise Refusal(
                f"expected a rigidity above zero in N m, got {self.rigidity}; with a "
                "tension above zero, zero is allowed too"
            )
        _check_size("a rigidity in N m", self.rigidity)
        if not -1 < self.poisson <= 0.5:
            raise Refusal(f"expected -1 < Poisson's ratio <= 0.5, got {self.poisson}")
        self._check_sheet()

    def _check_sheet(self) -> None:
        h = self.thickness
        if h is not None and not 0 < h <= min(self.patch.a, self.patch.b):
            raise Refusal(
                f"expected a thickness above zero, at most the skin's shorter side in m, got {h}"
            )
        if h is not None and not self.rigidity:
            raise Refusal(
                "expected a rigidity above zero in N m with a thickness: its modulus follows from "
                "both; omit the thickness of a drum head"
            )
        possible = INPLANE if self.patch.arc_curvature else INPLANE[:-1]
        if isinstance(self.patch, Cap):
            self._check_cap(self.patch)
        if isinstance(self.patch, MeshSkin):
            self._check_mesh(self.patch)
        if self.inplane and self.inplane not in possible:
            raise Refusal(
                f"expected inplane among {', '.join(possible)} for a "
                f"{self.patch.name if any(self.patch.curvatures) else 'flat skin'}, got "
                f"{self.inplane!r:.40}"
            )
        if self.patch.is_shallow and self.theory_error > _LARGEST_ERROR:
            raise Refusal(
                f"shallow shell theory may err by {self.theory_error:.1%} in a force on a "
                f"{self.patch.name} with edges that are free in plane: expected at most "
                f"{_LARGEST_ERROR:.0%}; hold the edges in plane, or use larger radii"
            )

    def _check_cap(self, cap: Cap) -> None:
        if not self.rigidity:
            raise Refusal(f"expected a rigidity above zero in N m of a {cap.name}, got 0")
        if self.inplane == "free" or (self.inplane == "diaphragm" and cap.is_hemisphere):
            raise Refusal(
                f"expected inplane held of a {cap.name}, or diaphragm of less than a hemisphere, "
                f"got {self.inplane}: such a rim lets the cap turn or bend without stretching, and "
                "its force is not determined"
            )

    def _check_mesh(self, mesh: MeshSkin) -> None:
        if self.thickness not in (None, mesh.thickness):
            raise Refusal(
                f"expected the thickness of the mesh, {mesh.thickness} m, got {self.thickness}"
            )
        for name, value in (
            ("rigidity", not self.rigidity),
            ("tension", self.tension),
            ("fluid", self.fluid),
            ("axial_stiffness", self.axial_stiffness is not None),
        ):
            if value:
                raise Refusal(
                    f"expected {'a' if name == 'rigidity' else 'no'} {name} of a {mesh.name}, got "
                    f"{getattr(self, name)}: it bends and stretches as a sheet of its thickness "
                    "and rigidity does"
                )
        if self.inplane not in ("", "held"):
            raise Refusal(
                f"expected inplane held of a {mesh.name}, got {self.inplane}; of a mesh a part of "
                "the rim can be held instead"
            )

    @classmethod
    def of_material(cls, patch: Patch, E: float, nu: float, h: float) -> "Plate":
        """D = E h^3 / (12 (1 - nu^2)): Young's modulus E in Pa, Poisson's ratio, thickness in m.

        The paper prints (1 + v^2) below Eq. 9; the plate's rigidity has (1 - nu^2).
        """
        if not (E > 0 and h > 0 and -1 < nu <= 0.5):
            raise Refusal(
                f"expected E > 0 Pa, h > 0 m and -1 < nu <= 0.5, got E={E}, nu={nu}, h={h}"
            )
        D = E * h**3 / (12 * (1 - nu**2))
        return cls(patch, D, poisson=nu, thickness=h)

    @property
    def sheet_thickness(self) -> float | None:
        """Thickness h in m by which it stretches; None for a flat skin that was given none."""
        if isinstance(self.patch, MeshSkin):
            return self.thickness or self.patch.thickness
        if self.thickness is not None or not any(self.patch.curvatures):
            return self.thickness
        D, C = self.rigidity, self.axial_stiffness
        return math.sqrt(12 * (1 - self.poisson**2) * D / C) if D and C else USUAL_THICKNESS

    @property
    def inplane_edge(self) -> str:
        """How its edge is held in its plane, one of `INPLANE`."""
        usual = "hoop" if self.patch.arc_curvature else "held"
        return self.inplane or ("diaphragm" if isinstance(self.patch.radius, tuple) else usual)

    @property
    def stretches(self) -> bool:
        """Whether it is a flat rectangle or strip of known thickness, as `Stretching` needs."""
        flat = type(self.patch) is Patch and not any(self.patch.curvatures)
        return flat and self.thickness is not None

    @property
    def theory_error(self) -> float:
        """Standard deviation by the theory of thin or shallow skins: as a share of a force.

        And on a shallow skin of the distance of its place from the middle. On a mesh it is half of
        h H / 12, by which measures of bending that are as right to first order (Love's, Sanders',
        Koiter's) differ where strains of bending are as large as those of stretching; and where
        only a part of its rim is held, that of the finite elements around the ends of that part.

        1 / (R k)^2 of the longest wave times its share of bending, twice where the edges are
        diaphragms, four times where they are free, not where they are held: a saddle's, mostly,
        which bends without stretching (`tests/truths/koiter.py`).
        """
        if isinstance(self.patch, MeshSkin):
            xx, yy, xy = self.patch.read_at_rest(self.patch.places)
            square: Array = xx**2 + yy**2 + 2 * xy**2
            H = math.sqrt(float(square.mean()) / 2)
            ends = _AT_ENDS * self.patch.is_held_in_part / math.sqrt(len(self.patch.points))
            return math.hypot((self.sheet_thickness or 0.0) * H / 24, ends)
        times = {"diaphragm": 2.0, "free": 4.0}.get(self.inplane_edge, 0.0)
        if not self.patch.is_shallow or not times:
            return 0.0
        k2, (Hx, Hy) = (np.pi / np.array([self.patch.a, self.patch.b])) ** 2, self.patch.curvatures
        stretch = (1 - self.poisson**2) * self.membrane_stiffness * (k2 @ (Hy, Hx)) ** 2
        bend, rest = self.rigidity * k2.sum() ** 4, self.tension * k2.sum() ** 3 + stretch
        rest += self.foundation * k2.sum() ** 2
        return float(times * self.patch.steepness * bend / (bend + rest))

    def modulus(self, h: float) -> float:
        """Young's modulus E = 12 (1 - nu^2) D / h^3 in Pa of a sheet of thickness `h` in m."""
        return 12 * (1 - self.poisson**2) * self.rigidity / h**3

    @property
    def membrane_stiffness(self) -> float:
        """C = E h / (1 - nu^2) = 12 D / h^2 in N/m; zero for a flat skin without a thickness."""
        h = self.sheet_thickness
        return 12 * self.rigidity / h**2 if h else 0.0

    def check(self, load: Load) -> None:
        """Raise a `Refusal` for a load off the patch, or one that moves the skin without limit."""
        load.check(self.patch)
        if self.rigidity == 0 and is_point(load) and not self.patch.strip:
            raise Refusal(
                f"a skin without rigidity deflects without limit under a point load: expected a "
                f"distributed load (a disc, a rectangle, a Gaussian), got {load}"
            )

    def compliance(self, basis: Basis) -> Compliance:
        """The compliance by Ritz's method; in closed form where it does not mix sines.

        There it is 4 / (a b K) with K = D k^4 + T k^2 + k_f and k^2 = k_i^2 + k_j^2 (Eq. 9,
        extended), of a shallow skin with diaphragms E h (k_i^2 / Ry + k_j^2 / Rx)^2 / k^4 more
        (Reissner; Marguerre), less T (1 / Rx^2 + 1 / Ry^2) under the pressure that makes T.
        """
        if basis.patch != self.patch:
            raise Refusal(f"the plate is on {self.patch}, the basis on {basis.patch}; use one")
        if isinstance(basis, SineBasis) and not self.mixes_sines:
            k2, (Hx, Hy) = basis.laplacian.ravel(), self.patch.curvatures
            area = self.patch.a * self.patch.b / (2 if self.patch.strip else 4)
            stiffness = self.rigidity * k2**2 + self.tension * k2 + self.foundation
            if self.patch.is_shallow:
                ki, kj = basis.wavenumbers
                stretch = np.add.outer(ki**2 * Hy, kj**2 * Hx).ravel() / k2
                stiffness += (1 - self.poisson**2) * self.membrane_stiffness * stretch**2
                stiffness -= self.tension * (Hx**2 + Hy**2)
                self._check_held(bool((stiffness > 0).all()))
            values: Array = 1 / (area * stiffness)
        else:
            values = self._by_ritz(basis)
            if isinstance(basis, MeshBasis) or (
                isinstance(basis, ModeBasis) and not any(self.patch.curvatures)
            ):
                values = _unmixed(values)
        if self.fluid and not isinstance(basis, CapBasis):
            return self._over_fluid(values, basis)
        return Compliance(values)

    def compliance_by_wave(self, basis: CapBasis) -> Array:
        """The compliance (M, Ni, Ni) of a cap on the functions of each number m of waves around."""
        shell = cap_shell(self, basis)
        found = self._inverse(shell.stiffness, shell.bare)
        if self.fluid:
            found[0] = Compliance(found[0], shell.volume).after(np.eye(basis.Ni))
        return found

    def _over_fluid(self, values: Array, basis: Basis) -> Compliance:
        if isinstance(basis, ProductBasis):
            volume = basis.volumes()
        else:
            points, weights = basis.quadrature()
            volume = weights @ basis.at(points)
        swelling = float(volume @ Compliance(values).after(volume[None])[0])
        # An arc whose ends are pinned keeps the volume already: no pressure moves it.
        isochoric = swelling <= 1e-12 * (volume @ volume) * np.abs(values).max()
        return Compliance(values, None if isochoric else volume)

    @property
    def mixes_sines(self) -> bool:
        """Whether a load that is a sine each way moves it in others too.

        A shallow skin that hardly stretches over the longest wave moves as a flat one.
        """
        if not self.patch.is_shallow or self.inplane_edge == "diaphragm":
            return bool(self.patch.arc_curvature)
        stretch = self.membrane_stiffness * self.patch.steepness**2  # times k^4, over H^2
        return stretch > _HARDLY * self.rigidity * max(map(abs, self.patch.curvatures)) ** 2

    @property
    def _is_shell(self) -> bool:
        """Whether f alone does not tell how far it moves along itself.

        The planar arc and a bent drum head are inextensible: v_x = H f.
        """
        return bool(self.patch.arc_curvature and self.rigidity) and not self.patch.strip

    def sheet(self, sliding: bool = False) -> Sheet:
        """The bent sheet that it is; `sliding` edges let v go however they are held in plane."""
        if not self._is_shell:
            raise Refusal(
                f"expected a bent skin with two sides and a rigidity above zero, got {self}"
            )
        of_sheet = self.rigidity, self.membrane_stiffness, self.poisson
        below, held = (self.tension, self.foundation, self.fluid), self.inplane_edge
        v_held = held in ("hoop", "held") and not sliding
        return Sheet(self.patch, *of_sheet, *below, v_held, held in ("diaphragm", "held"))

    def _tangential(self, basis: Basis) -> Tangential:
        return Tangential(self.sheet(isinstance(basis, SineBasis) and basis.sliding), basis)

    def _stiffness(self, basis: Basis) -> tuple[Array, Array]:
        """Stiffness matrix (N, N) in N/m, and the same without its negative terms, for scaling."""
        if isinstance(basis, MeshBasis):
            of_sheet = self.rigidity, self.membrane_stiffness, self.poisson, self.foundation
            whole = basis.functions.stiffness(*of_sheet)
            return whole, whole
        nu, (Hx, Hy), overlap = self.poisson, self.patch.curvatures, overlaps(basis)
        H = math.hypot(Hx, Hy)
        xx, yy, xy = (2, 0), (0, 2), (1, 1)
        # Of modes, half the time it takes is theirs.
        squares = overlap((0, 0), (0, 0)) if H or self.foundation else 0.0
        mixed = overlap(xx, yy)
        bending = overlap(xx, xx) + overlap(yy, yy) + nu * (mixed + mixed.T)
        bending += 2 * (1 - nu) * overlap(xy, xy)
        whole = self.rigidity * bending + self.foundation * squares
        if self.tension:
            whole += self.tension * (overlap((1, 0), (1, 0)) + overlap((0, 1), (0, 1)))
        if isinstance(basis, ElasticBasis):
            along, per_length = basis.rim()
            rim = basis.at(along)
            whole += self.rim_stiffness * (rim.T * per_length) @ rim
        if not H:
            return whole, whole
        negative = self.tension * H**2 * squares
        if self._is_shell:
            whole += self.membrane_stiffness * H**2 * squares
            negative += self._tangential(basis).relief
        elif self.patch.is_shallow:
            in_plane = self.membrane_stiffness, nu, self.inplane_edge
            whole += shallow_stiffness(self.patch, *in_plane, basis)
        elif self.patch.strip:
            both = overlap(xx, (0, 0))
            whole += self.rigidity * H**4 * squares
            negative -= self.rigidity * H**2 * (both + both.T)
        return whole - negative, whole

    def _by_ritz(self, basis: Basis) -> Array:
        """Inverse (N, N) of the stiffness."""
        if isinstance(basis, CapBasis):
            return cap_shell(self, basis).by_function(self.compliance_by_wave(basis))
        K, bare = self._stiffness(basis)
        inextensible = self.patch.arc_curvature and not self._is_shell
        if basis.free is None or not inextensible:
            return self._inverse(K, bare)
        W = basis.free
        return W @ self._inverse(W.T @ K @ W, W.T @ bare @ W) @ W.T

    def _inverse(self, K: Array, bare: Array) -> Array:
        """Inverse (..., N, N) of stiffnesses, scaled by `bare` so that it is well conditioned."""
        scale = np.sqrt(np.einsum("...ii->...i", bare))
        values, vectors = np.linalg.eigh(K / (scale[..., None] * scale[..., None, :]))
        self._check_held(bool((values[..., 0] > 1e-13 * values[..., -1]).all()))
        V = vectors / scale[..., None]
        return (V / values[..., None, :]) @ np.swapaxes(V, -1, -2)

    @staticmethod
    def _check_held(held: bool) -> None:
        if not held:
            raise Refusal(
                "the skin moves as a whole without bending: expected edges that hold it; pin the "
                "ends of the arc, use an opening angle below 180 degrees, springs below an elastic "
                "rim, or foam below the skin"
            )

    def curvature(self, basis: Basis) -> Callable[[Array], Array]:
        """The map from positions (P, 2) in m to the curvature (3, P, N) in 1/m per m of functions.

        That of the skin under loads along its normal: a bent one stretches under them, and its
        tangential displacements follow from its stiffness.
        """
        if isinstance(basis, CapBasis):
            return cap_shell(self, basis).curvature_at
        if isinstance(basis, MeshBasis):
            return basis.curvature_at
        if self._is_shell:
            return self._tangential(basis).curvature_at
        return partial(curvature_at, basis)

    def hoop(self, basis: Basis, positions: Array) -> Array:
        """Displacement v along the arc with v_y and v_yy, (3, P, N) per m of each function.

        At `positions` (P, 2) in m of a bent skin.
        """
        if self._is_shell:
            return self._tangential(basis).hoop_at(positions)
        return hoop_at(basis, positions)

    def deflection(self, loads: Iterable[Load], basis: Basis) -> Array:
        """Coefficients (Ni, Nj) in m of the deflection under all `loads` at once."""
        force = np.zeros(basis.shape)
        for load in loads:
            self.check(load)
            force += load.modal(basis)
        return self.compliance(basis)(force)


@lru_cache(4)
def cap_shell(plate: Plate, basis: CapBasis) -> CapShell:
    """The shell that a plate on a cap is, on the functions of a `basis`."""
    support = plate.tension, plate.foundation, plate.inplane_edge == "diaphragm"
    return CapShell(basis, plate.rigidity, plate.membrane_stiffness, plate.poisson, *support)
