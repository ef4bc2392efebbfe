"""Von Karman's hinged plate, which stretches as it deflects, by Ritz and Newton.

It shares no code with the library that it tests. The deflection is a sum of sines, the in-plane
displacements u and v are sums of polynomials, found exactly for each deflection.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial.legendre import legder, leggauss, legvander
from scipy.sparse import block_array, csc_array, kron
from scipy.sparse.linalg import LinearOperator, cg, splu

from navier import HingedPlate

# Whether u is held on the edges x = 0 and a, and on y = 0 and b. Where it is let go, the force
# along it vanishes; v is the same with x and y exchanged. Levy's edges (1942) are "straight".
INPLANE = {
    "held": (True, True),
    "diaphragm": (False, True),
    "free": (False, False),
    "straight": (True, False),
}


@dataclass(frozen=True)
class StretchingPlate:
    """A plate of a x b and `thickness` h in m, and flexural `rigidity` D in N m, hinged.

    `inplane`, one of `INPLANE`, is how its edges are held in the plane. `sines` each way deflect
    with membrane forces; those beyond, up to `modes`, as without: they only sharpen a load.
    """

    a: float = 0.1
    b: float = 0.1
    rigidity: float = 3.7e-3
    thickness: float = 0.25e-3
    poisson: float = 0.3
    inplane: str = "held"
    sines: int = 26
    polynomials: int = 36
    modes: int = 240

    def displacement(self, load, places):
        """Displacement (G,) in m at `places` (G, 2) in m."""
        return self._linear.surface(self.coefficients(load), places)

    def readings(self, load, elements, gage_length=0.0):
        """Curvature xx, yy, xy (3, P) in 1/m at `elements` (P, 2) in m, as `HingedPlate`'s."""
        return self._linear.curvature(self.coefficients(load), elements, gage_length)

    def coefficients(self, load):
        """c_ij (modes, modes) in m."""
        n, forces = self.sines, self._linear.forces(load)
        c = forces / self._linear.stiffness
        c[:n, :n] = self.equilibrium(forces[:n, :n])
        return c

    def equilibrium(self, forces, tolerance=1e-9):
        """c (sines, sines) in m under `forces`, the work on each sine per m, by Newton's steps.

        Each is shortened until it lowers the energy, which at the equilibrium is least.
        """
        c = np.zeros_like(forces)
        energy, gradient, hessian = self._at(c, forces)
        for _ in range(60):
            step, _ = cg(hessian, -gradient.ravel(), rtol=1e-3, M=self._inverse_stiffness)
            step = step.reshape(c.shape)
            short = 1.0
            most = energy + 1e-10 * abs(energy)  # of rounding
            while (found := self._at(c + short * step, forces))[0] > most and short > 1e-9:
                short /= 2
            c, (energy, gradient, hessian) = c + short * step, found
            if short == 1.0 and np.abs(step).max() < tolerance * np.abs(c).max():
                return c
        raise ArithmeticError(f"no equilibrium in 60 steps under {forces.max():.3g} N")

    @cached_property
    def _linear(self):
        return HingedPlate(self.a, self.b, self.rigidity, self.modes)

    @cached_property
    def _sines(self):
        return HingedPlate(self.a, self.b, self.rigidity, self.sines)

    @cached_property
    def _inverse_stiffness(self):
        inverse = 1 / self._sines.stiffness.ravel()
        shape = (inverse.size,) * 2
        return LinearOperator(shape, matvec=lambda r: inverse * r.ravel(), dtype=float)

    def energy(self, c, forces):
        """Energy in J of the deflection `c` in m under `forces` in N."""
        return self._at(c, forces)[0]

    def _at(self, c, forces):
        """Energy in J, its gradient in N, and its Hessian as an operator in N/m."""
        bending = self._sines.stiffness
        wx, wy = self._slopes(c)
        strain = self._relaxed(np.stack([wx**2 / 2, wy**2 / 2, wx * wy]))
        N = self._forces_of(strain)
        energy = np.sum(bending * c**2) / 2 - np.sum(forces * c)
        energy += np.sum(self._weights * N * strain) / 2
        gradient = bending * c - forces + self._work(N, wx, wy)

        def product(p):
            px, py = self._slopes(p.reshape(c.shape))
            more = self._relaxed(np.stack([wx * px, wy * py, wx * py + wy * px]))
            p_work = self._work(N, px, py) + self._work(self._forces_of(more), wx, wy)
            return (bending * p.reshape(c.shape) + p_work).ravel()

        # Without its type it would be multiplied once to see it.
        return energy, gradient, LinearOperator((c.size, c.size), matvec=product, dtype=float)

    def _forces_of(self, strain):
        """Membrane forces xx, yy, xy in N/m of strains xx, yy and shear."""
        nu, C = self.poisson, 12 * self.rigidity / self.thickness**2
        xx, yy, shear = strain
        return C * np.stack([xx + nu * yy, yy + nu * xx, (1 - nu) / 2 * shear])

    def _relaxed(self, strain):
        """`strain` and that of the u and v which minimise the energy with it."""
        (X, X1), (Y, Y1) = self._along_u
        (X_, X1_), (Y_, Y1_) = self._along_v
        xx, yy, xy = self._weights * self._forces_of(strain)
        pull_u = X1.T @ xx @ Y + X.T @ xy @ Y1
        pull_v = X_.T @ yy @ Y1_ + X1_.T @ xy @ Y_
        pull = np.concatenate([pull_u.ravel(), pull_v.ravel()])
        found = np.zeros_like(pull)
        found[self._moving] = -self._inplane_solver.solve(pull[self._moving])
        u, v = found[: pull_u.size].reshape(pull_u.shape), found[pull_u.size :]
        v = v.reshape(pull_v.shape)
        return strain + np.stack(
            [X1 @ u @ Y.T, X_ @ v @ Y1_.T, X @ u @ Y1.T + X1_ @ v @ Y_.T],
        )

    def _slopes(self, c):
        (S, Sx), (T, Ty) = self._waves
        return Sx @ c @ T.T, S @ c @ Ty.T

    def _work(self, N, px, py):
        """The work of membrane forces N at slopes p on each sine per m."""
        (S, Sx), (T, Ty) = self._waves
        xx, yy, xy = self._weights * N
        return Sx.T @ (xx * px + xy * py) @ T + S.T @ (yy * py + xy * px) @ Ty

    @cached_property
    def _points(self):
        """Gauss points on [-1, 1]: products of four sines of the highest waves are integrated."""
        return leggauss(2 * max(self.sines, self.polynomials) + 20)

    @cached_property
    def _weights(self):
        _, weights = self._points
        return np.outer(weights, weights) * self.a * self.b / 4

    @cached_property
    def _waves(self):
        """Sines and their slopes at the points, along x and along y."""
        at = (self._points[0] + 1) / 2
        turns = [np.outer(at * side, k) for side, k in self._sides]
        waves = [k for _, k in self._sides]
        return [(np.sin(t), k * np.cos(t)) for t, k in zip(turns, waves, strict=True)]

    @property
    def _sides(self):
        return tuple(zip((self.a, self.b), self._sines.waves(), strict=True))

    @cached_property
    def _along_u(self):
        """Polynomials of u and their slopes at the points, along x and along y."""
        across, along = INPLANE[self.inplane]
        return self._polynomials(across, self.a), self._polynomials(along, self.b)

    @cached_property
    def _along_v(self):
        across, along = INPLANE[self.inplane]
        return self._polynomials(along, self.a), self._polynomials(across, self.b)

    def _polynomials(self, held, side):
        """1 and t where the ends are let go, then integrals of P_1, P_2 ..., 0 at both ends."""
        n = self.polynomials
        k = np.arange(n)
        bubbles = np.eye(n + 2, n)
        bubbles[k + 2, k] = -1
        made = bubbles / np.sqrt(4 * k + 6)
        if not held:
            made = np.hstack([np.eye(n + 2, 2), made])
        t = self._points[0]
        slopes = legvander(t, n) @ legder(made) * 2 / side
        return legvander(t, n + 1) @ made, slopes

    @cached_property
    def _moving(self):
        """The functions (U,) of u and v but three of a free sheet: it neither shifts nor turns."""
        (X, _), (Y, _) = self._along_u
        first_v = X.shape[1] * Y.shape[1]
        (X_, _), (Y_, _) = self._along_v
        moving = np.ones(first_v + X_.shape[1] * Y_.shape[1], bool)
        if self.inplane == "free":
            moving[[0, 1, first_v]] = False  # u = 1, u = y, v = 1
        return moving

    @cached_property
    def _inplane_solver(self):
        """The factors of the stiffness of u and v in the plane."""
        weights, nu = self._points[1], self.poisson
        C = 12 * self.rigidity / self.thickness**2
        (u_x, u_y), (v_x, v_y) = self._along_u, self._along_v

        def product(p, q, side):
            made = p.T @ (weights[:, None] * q) * side / 2
            return csc_array(np.where(np.abs(made) > 1e-13 * np.abs(made).max(), made, 0))

        def both(p, q, i, j, m, n):
            """Integral of a derivative of p, of order i in x and j in y, times one of q."""
            return kron(product(p[0][i], q[0][m], self.a), product(p[1][j], q[1][n], self.b))

        u, v, G = (u_x, u_y), (v_x, v_y), (1 - nu) / 2
        uu = both(u, u, 1, 0, 1, 0) + G * both(u, u, 0, 1, 0, 1)
        uv = nu * both(u, v, 1, 0, 0, 1) + G * both(u, v, 0, 1, 1, 0)
        vv = both(v, v, 0, 1, 0, 1) + G * both(v, v, 1, 0, 1, 0)
        K = C * block_array([[uu, uv], [uv.T, vv]], format="csc")
        return splu(K[self._moving][:, self._moving].tocsc())
