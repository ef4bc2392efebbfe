"""Sanders' cylindrical shell that bends and stretches, by Ritz.

It shares no code with the library that it tests. A panel of x along the arc and y along the axis;
displacements f positive inward, v along x and u along y. Waves along the axis do not mix: each is a
sine of y, for u a cosine, times Legendre polynomials of x.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.polynomial.hermite_e import hermegauss
from numpy.polynomial.legendre import legder, leggauss, legvander

from navier import Load

leggauss = cache(leggauss)  # a load asks for it each time

# P_k - c P_(k+2) vanishes at both ends with c = 1, where it is an integral of P_(k+1), and its
# slope does with c = k (k + 1) / ((k + 2) (k + 3)).
_ENDS = {
    "held": np.ones_like,
    "guided": lambda k: k * (k + 1) / ((k + 2) * (k + 3)),
    "let go": np.zeros_like,
}
# What holds f, v and u at the straight edges. A mirror is a plane of symmetry.
EDGES = {
    "hoop": ("held", "held", "let go"),
    "diaphragm": ("held", "let go", "held"),
    "free": ("let go", "let go", "let go"),
    "mirror": ("guided", "held", "let go"),
}


@dataclass(frozen=True)
class CylinderShell:
    """A panel of `arc` x `length`, bent along its arc to `radius`, all in m.

    Flexural `rigidity` D in N m and `thickness` h in m make E h = 12 (1 - nu^2) D / h^2. The curved
    ends are diaphragms (f = v = 0, u let go); `edge`, one of `EDGES`, is that of the straight ones.
    """

    arc: float
    length: float
    radius: float
    rigidity: float = 3.7e-3
    thickness: float = 0.25e-3
    poisson: float = 0.3
    edge: str = "hoop"
    polynomials: int = 60
    waves: int = 96

    def displacement(self, load, places):
        """f, v and u (3, G) in m at `places` (G, 2) in m."""
        return self.moved(self._forces(load), places)

    def moved(self, forces, places):
        """The same under `forces` (waves, 3 polynomials) in N: the work on each function per m."""
        c = np.linalg.solve(self._stiffness, forces[..., None])[..., 0]
        (f, v, u), ky = self.functions(places[:, 0]), np.outer(self.wavenumbers, places[:, 1])
        waves = np.sin(ky), np.sin(ky), np.cos(ky)
        return np.stack([np.sum(c @ g.T * s, 0) for g, s in zip((f, v, u), waves, strict=True)])

    def pressed(self, inward, along):
        """Forces of pressures in N/m^2 that are functions of x, inward and along x."""
        x, weights = self._gauss
        f, v, _ = self.functions(x)
        k, b = self.wavenumbers, self.length
        return np.outer(
            (1 - np.cos(k * b)) / k, (weights * inward(x)) @ f + (weights * along(x)) @ v
        )

    def reader(self, elements, gage_length=0.0) -> Callable[[Load], np.ndarray]:
        """The map from a load to curvature xx, yy, xy (3, P) in 1/m at `elements` (P, 2) in m.

        A back-to-back pair reads f_xx + f/R^2, f_yy and the twist f_xy + (v_y - u_x) / (2 R), each
        as the mean over gages of `gage_length` in m along x, along y and along both diagonals.
        """
        N = self.polynomials
        rows = self._gages(elements, gage_length)
        # Only f is pressed, and the stiffness is symmetric.
        by_wave = [
            np.linalg.solve(K, M.T)[:N].T for K, M in zip(self._stiffness, rows, strict=True)
        ]
        table = np.hstack(by_wave)
        return lambda load: (table @ self._forces(load)[:, :N].ravel()).reshape(3, -1)

    @property
    def wavenumbers(self):
        return np.pi * np.arange(1, self.waves + 1) / self.length

    @cached_property
    def _stiffness(self):
        """Of each wave (waves, 3 N, 3 N) in N/m."""
        R, nu, D = self.radius, self.poisson, self.rigidity
        C = 12 * D / self.thickness**2  # E h / (1 - nu^2)
        law = np.array([[1, nu, 0], [nu, 1, 0], [0, 0, 2 * (1 - nu)]])
        x, weights = self._gauss
        (f, v, u), (fx, vx, ux), (fxx, _, _) = (self.functions(x, order) for order in range(3))

        def energy(*strains):
            e = np.stack(strains)
            stress = np.einsum("ab,bqi,q->aqi", law, e, weights)
            return np.tensordot(e, stress, ((0, 1), (0, 1))) * self.length / 2

        # Sanders' strains; all but the shears, of which these are halves, go as sines.
        return np.stack(
            [
                C * energy(vx - f / R, -k * u, (ux + k * v) / 2)
                + D * energy(fxx + vx / R, -(k**2) * f, k * fx + (3 * k * v - ux) / (4 * R))
                for k in self.wavenumbers
            ]
        )

    @property
    def _gauss(self):
        at, weights = leggauss(self.polynomials + 4)
        return (at + 1) * self.arc / 2, weights * self.arc / 2

    def functions(self, x, order=0):
        """Functions (3, G, 3 N) of f, v and u at `x` (G,), or a derivative of them."""
        N, (G,) = self.polynomials, x.shape
        k, values = np.arange(float(N)), legvander(2 * x / self.arc - 1, N + 1)
        found = np.zeros((3, G, 3, N))
        for i, end in enumerate(EDGES[self.edge]):
            made = np.eye(N + 2, N)
            made[np.arange(N) + 2, np.arange(N)] = -_ENDS[end](k)
            made = legder(made, order, 2 / self.arc) if order else made
            found[i, :, i] = values[:, : len(made)] @ made
        return found.reshape(3, G, 3 * N)

    def _forces(self, load):
        """The work (waves, 3 N) of a load on each function per m."""
        x, y, k = load.x, load.y, self.wavenumbers
        if load.radius:
            # Chords across the disc at x + r sin t, of half length r cos t.
            t, weights = leggauss(40)
            t, weights = t * np.pi / 2, weights * np.cos(t * np.pi / 2) ** 2
            steps = load.radius * np.sin(t)
            along_y = np.sinc(np.outer(k, load.radius * np.cos(t)) / np.pi)
        else:
            t, weights = hermegauss(30)
            steps, weights = load.sd * t, weights / weights.sum()
            along_y = np.exp(-((k[:, None] * load.sd) ** 2) / 2) * np.ones_like(t)
        f = self.functions(x + steps)[0]
        return load.force * np.sin(k * y)[:, None] * ((along_y * weights) @ f)

    def _gages(self, elements, gage_length):
        """What the elements read (3 P, 3 N) of each function, for each wave in turn."""
        at, weights = leggauss(8) if gage_length else (np.zeros(1), np.full(1, 2.0))
        d, steps = np.sqrt(0.5), at * gage_length / 2

        def mean(ex, ey):
            places = elements[:, None] + np.multiply.outer(steps, (ex, ey))
            for xx, yy, xy in self._curvature(places.reshape(-1, 2)):
                normal = ex**2 * xx + ey**2 * yy + 2 * ex * ey * xy
                yield np.tensordot(weights / 2, normal.reshape(len(elements), len(at), -1), (0, 1))

        for xx, yy, up, down in zip(mean(1, 0), mean(0, 1), mean(d, d), mean(d, -d), strict=True):
            yield np.vstack([xx, yy, (up - down) / 2])

    def _curvature(self, places):
        """xx, yy and xy (3, G, 3 N) of each function, for each wave in turn."""
        R, (x, y) = self.radius, places.T
        (f, v, _), (fx, _, ux), (fxx, _, _) = (self.functions(x, order) for order in range(3))
        for k in self.wavenumbers:
            s, c = np.sin(k * y)[:, None], np.cos(k * y)[:, None]
            yield (fxx + f / R**2) * s, -(k**2) * f * s, (k * fx + (k * v - ux) / (2 * R)) * c
