"""Marguerre's shallow shell, which softens and snaps through, in Legendre polynomials.

It shares no code with the library that it tests. The displacements u and v along the shell and w
inward are polynomials; at each depth of the middle Newton's method finds the force there.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial.legendre import leggauss, legvander

# Which of u, v and w the edges x = 0 and a hold, and which y = 0 and b.
EDGES = {
    "diaphragm": ("v w", "u w"),
    "held": ("u v w", "u v w"),
    "panel": ("u v w", ""),  # of Sabir and Lock (1972): hinged along its straight edges, else free
}


@dataclass(frozen=True)
class ShallowShell:
    """A shallow shell of a x b m, `thickness` h in m, of `modulus` E in Pa, pressed in its middle.

    `curvatures` are along x and y in 1/m, above zero where it is convex seen from outside, from
    where the load presses, on a disc of `radius` in m. Displacements are even or odd about the
    middle, as the load has it: a shell that gives way to one side is not found. There are
    `polynomials` of each kind along a side.
    """

    a: float
    b: float
    curvatures: tuple[float, float]
    thickness: float = 0.25e-3
    modulus: float = 12 * (1 - 0.3**2) * 3.7e-3 / 0.25e-3**3
    poisson: float = 0.3
    edges: str = "diaphragm"
    radius: float = 0.0
    polynomials: int = 14

    def path(self, depths):
        """Force in N and unknowns (N,) at each of the `depths` in m of the middle."""
        q, force, found = np.zeros(self._size), 0.0, []
        for depth in depths:
            for _ in range(30):
                _, gradient, hessian = self.energy(q)
                left, further = force * self.load - gradient, depth - self.load @ q
                small = np.linalg.norm(left) < 1e-7 * abs(force) * np.linalg.norm(self.load)
                if small and abs(further) < 1e-7 * abs(depth):
                    break
                step, more = np.linalg.solve(hessian, np.stack([left, self.load], 1)).T
                change = (further - self.load @ step) / (self.load @ more)
                q, force = q + step + change * more, force + change
            else:
                raise ArithmeticError(f"no equilibrium at a depth of {depth} m in 30 steps")
            found.append((force, q))
        return found

    def limit(self, depths):
        """Depth in m and force in N where the force first falls; else the last ones."""
        forces = [force for force, _ in self.path(depths)]
        first = next((k for k in range(1, len(forces)) if forces[k] < forces[k - 1]), None)
        k = len(forces) if first is None else first
        return depths[k - 1], forces[k - 1]

    def curvature(self, q, places):
        """Curvature xx, yy, xy (3, P) in 1/m that pairs of gages read at `places` (P, 2) in m."""
        rows = self._at(*(2 * places / (self.a, self.b) - 1).T)
        (Hx, Hy), w = self.curvatures, rows["w"] @ q
        return np.stack([rows["wxx"] @ q + Hx**2 * w, rows["wyy"] @ q + Hy**2 * w, rows["wxy"] @ q])

    @cached_property
    def stiffness(self):
        """The force in N per m of depth of a linear shell."""
        hessian = self.energy(np.zeros(self._size))[2]
        return 1 / (self.load @ np.linalg.solve(hessian, self.load))

    def energy(self, q):
        """Energy in J, its gradient (N,) and Hessian (N, N) at the unknowns `q` (N,)."""
        (Hx, Hy), (M, of_plane), (w, x, y) = self.curvatures, self._plane, self._inward
        plane, inward = np.split(q, [len(of_plane)])
        depth, wx, wy = w @ inward, x @ inward, y @ inward
        bent = np.concatenate([wx**2 / 2 - Hx * depth, wy**2 / 2 - Hy * depth, wx * wy])
        of_x, of_y = wx[:, None], wy[:, None]
        A = np.concatenate([of_x * x - Hx * w, of_y * y - Hy * w, of_x * y + of_y * x])
        e = M @ plane + bent
        N, stress, flexural = self._stress(e), self._stress(A), self._bending @ q
        energy = (N @ e + flexural @ q) / 2
        gradient = flexural + np.concatenate([N @ M, N @ A])
        xx, yy, xy = N.reshape(3, -1, 1)
        of_inward = A.T @ stress + x.T @ (xx * x + xy * y) + y.T @ (xy * x + yy * y)
        mixed = M.T @ stress
        return energy, gradient, self._bending + np.block([[of_plane, mixed], [mixed.T, of_inward]])

    def _stress(self, strain):
        """Forces xx, yy, xy in N/m, times weights (3 G, ...), of a `strain` (3 G, ...)."""
        nu = self.poisson
        law = np.array([[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]])
        law = law * self.modulus * self.thickness / (1 - nu**2)
        by_point = (law @ strain.reshape(3, -1)).reshape(3, len(self._weights), -1)
        return (by_point * self._weights[:, None]).reshape(strain.shape)

    @cached_property
    def _plane(self):
        """Strains (3 G, U) of the unknowns of u and v, and their part (U, U) of the Hessian."""
        B, held = self._rows, 2 * self.polynomials**2
        M = np.concatenate([B["ux"], B["vy"], B["uy"] + B["vx"]])[:, :held]
        return M, M.T @ self._stress(M)

    @cached_property
    def _inward(self):
        """Rows (3, G, W) of w and its slopes, of the unknowns of w."""
        return np.stack([self._rows[name] for name in ("w", "wx", "wy")])[
            ..., 2 * self.polynomials**2 :
        ]

    @cached_property
    def _bending(self):
        B, nu, g = self._rows, self.poisson, self._weights
        D = self.modulus * self.thickness**3 / (12 * (1 - nu**2))
        xx, yy, xy = B["wxx"], B["wyy"], B["wxy"]
        mixed = (xx.T * g) @ yy
        both = (xx.T * g) @ xx + (yy.T * g) @ yy + nu * (mixed + mixed.T)
        return D * (both + 2 * (1 - nu) * (xy.T * g) @ xy)

    @cached_property
    def load(self):
        """Work (N,) in N per m of a unit load on each unknown."""
        if not self.radius:
            return self._at(np.zeros(1), np.zeros(1))["w"][0]
        t, share = leggauss(8)
        r = self.radius * np.sqrt((t + 1) / 2)
        turn = 2 * np.pi * (np.arange(16) + 0.5) / 16
        x, y = np.outer(r, np.cos(turn)).ravel(), np.outer(r, np.sin(turn)).ravel()
        return np.repeat(share / 32, 16) @ self._at(2 * x / self.a, 2 * y / self.b)["w"]

    @cached_property
    def _points(self):
        """Points on a quarter, from the middle in half sides, and weights in m^2 of the whole."""
        t, weights = leggauss(2 * self.polynomials + 4)
        x, y = (of.ravel() for of in np.meshgrid((t + 1) / 2, (t + 1) / 2, indexing="ij"))
        return x, y, np.outer(weights, weights).ravel() * self.a * self.b / 4

    @property
    def _weights(self):
        return self._points[2]

    @cached_property
    def _rows(self):
        return self._at(*self._points[:2])

    @property
    def _size(self):
        return self.load.size

    def _at(self, x, y):
        """Rows (P, N) of the displacements' derivatives at P points, from the middle."""
        at_x, at_y = EDGES[self.edges]
        fields, kinds = [], (("u", 1, 0), ("v", 0, 1), ("w", 0, 0))
        for name, odd_x, odd_y in kinds:
            along_x = self._along(x, self.a, odd_x, name in at_x)
            along_y = self._along(y, self.b, odd_y, name in at_y)
            fields.append((along_x, along_y))
        count = self.polynomials**2
        rows = {}
        for number, ((name, _, _), (X, Y)) in enumerate(zip(kinds, fields, strict=True)):
            for order, (i, j) in ORDERS.items():
                made = np.zeros((len(x), 3 * count))
                made[:, number * count : (number + 1) * count] = np.einsum(
                    "pm,pn->pmn", X[i], Y[j]
                ).reshape(len(x), -1)
                rows[name + order] = made
        return rows

    def _along(self, t, side, odd, held):
        """Polynomials and two derivatives (3, P, n), even or `odd`, 0 at ends that are `held`."""
        n = self.polynomials
        series = np.zeros((2 * n + 3, n))
        k = 2 * np.arange(n) + odd
        if held:  # P_(k+2) - P_k is zero at both ends
            series[k + 2, np.arange(n)], series[k, np.arange(n)] = 1, -1
        else:
            series[k, np.arange(n)] = 1
        series /= np.sqrt(1 + k) ** 3
        derivatives = [np.polynomial.legendre.legder(series, d) for d in range(3)]
        return [
            legvander(t, len(of) - 1) @ of * (2 / side) ** d for d, of in enumerate(derivatives)
        ]


ORDERS = {"": (0, 0), "x": (1, 0), "y": (0, 1), "xx": (2, 0), "yy": (0, 2), "xy": (1, 1)}
