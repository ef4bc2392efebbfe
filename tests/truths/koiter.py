"""Koiter's shell over a rectangle that is bent both ways, by Ritz.

It shares no code with the library that it tests. The surface is an arc along x carried along an arc
along y, with the metric that it has: r_x and r_y are unit vectors that are not quite orthogonal.
A displacement is u r_x + v r_y + f n, with the unit normal n inward. To first order, from places in
space alone, metric and second form change by 2 gamma and rho,

    gamma_ab = (r_a . U_b + r_b . U_a) / 2      rho_ab = n . (U_ab - G^c_ab U_c)

and the energy is that of Koiter and Sanders, of gamma and rho_ab - (b_a^c gamma_cb + b_b^c
gamma_ca) / 2.

A hinged plate's answer (Navier) carries what is sharp under a small load, so that only the rest,
which is smooth, is left to the Legendre polynomials.
"""

from dataclasses import dataclass
from functools import cache, cached_property, lru_cache

import numpy as np
from numpy.polynomial.legendre import legder, leggauss, legvander
from scipy.linalg import cho_factor, cho_solve

from navier import HingedPlate

ORDERS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
FIRST, SECOND = (1, 2), ((3, 4), (4, 5))  # where derivatives by a, and by a and b, stand in them
U, V, F = range(3)


@dataclass(frozen=True)
class Panel:
    """A skin of `a` x `b`, bent to the radii `Rx` along x and `Ry` along y, all in m.

    Flexural `rigidity` D in N m and `thickness` h in m make E h = 12 (1 - nu^2) D / h^2. All edges
    are `hinged` or `clamped`, and in the plane of the skin `held`, a `diaphragm` (only what is
    along the edge is held) or `free`. A sphere whose edges are free slides on itself, and what is
    nearly one nearly does: the mean displacement along it, and the rotation, are held.
    """

    a: float
    b: float
    Rx: float
    Ry: float
    rigidity: float = 3.7e-3
    thickness: float = 0.25e-3
    poisson: float = 0.3
    inplane: str = "diaphragm"
    edge: str = "hinged"
    polynomials: int = 32
    modes: int = 240

    def displacement(self, load, places):
        """u, v and f (3, G) in m at `places` (G, 2) in m."""
        c = self._solved(self._unbalanced(load).reshape(1, -1))[0]
        at = self._functions(*places.T)
        jets = np.einsum("ign,in->ig", at[:, 0], c.reshape(3, -1))
        jets[F] += self._known(load, *places.T, np.vecdot)[0]
        return jets

    def reader(self, elements):
        """The map from a load to curvature xx, yy, xy (3, P) in 1/m at `elements` (P, 2) in m.

        By how much the strains of both faces differ along a gage, over the thickness, along r_x,
        along r_y, and half of what they do along the diagonals r_x + r_y and r_x - r_y.
        """
        x, y = elements.T
        reads, at = self._reads(x, y), self._functions(x, y)
        rows = np.einsum("ridp,idpn->rpin", reads, at, optimize=True)
        table = self._solved(rows.reshape(3 * len(x), -1))

        def read(load):
            known = np.einsum("rdp,dp->rp", reads[:, F], self._known(load, x, y, np.vecdot))
            return known + (table @ self._unbalanced(load).ravel()).reshape(3, -1)

        return read

    # Geometry

    def _changes(self, x, y):
        """gamma and rho (2, 2, 3, 6, ...) of the fields' derivatives, metric and second form."""
        Hx, Hy = 1 / self.Rx, 1 / self.Ry
        X, Y = Hx * (x - self.a / 2), Hy * (y - self.b / 2)
        (sx, cx), (sy, cy), one = (np.sin(X), np.cos(X)), (np.sin(Y), np.cos(Y)), np.ones_like(x)
        M = sx * sy  # r_x . r_y
        W = np.sqrt(1 - M**2)
        metric, inverse = np.array([[one, M], [M, one]]), np.array([[one, -M], [-M, one]]) / W**2
        form = np.array([[Hx * cy / W, 0 * one], [0 * one, Hy * cx / W]])
        turn = np.zeros((2, 2, 2, *x.shape))  # r_d . r_ab
        turn[1, 0, 0], turn[0, 1, 1] = Hx * cx * sy, Hy * sx * cy
        G = np.einsum("cd...,dab...->cab...", inverse, turn)
        mixed = np.einsum("ac...,cb...->ab...", form, inverse)
        gamma, rho = np.zeros((2, 2, 2, 3, 6, *x.shape))
        for a in range(2):
            for b in range(2):
                gamma[a, b, F, 0] -= form[a, b]
                rho[a, b, F, SECOND[a][b]] += 1
                rho[a, b, F, 0] -= (mixed[a] * form[:, b]).sum(0)
                for i in range(2):
                    gamma[a, b, i, FIRST[b]] += metric[a, i]
                    gamma[a, b, i, 0] += turn[a, i, b]
                    rho[a, b, i, FIRST[a]] += form[i, b]
                    rho[a, b, i, FIRST[b]] += form[i, a]
                    rho[a, b, F, FIRST[i]] -= G[i, a, b]
                    rho[a, b, i, 0] -= (G[:, a, b] * form[i]).sum(0)
        return (gamma + gamma.swapaxes(0, 1)) / 2, rho, metric, form

    def _strains(self, x, y):
        """Strains and bendings (6, 3, 6, ...) along and across r_x, and dA / dx dy (...)."""
        gamma, rho, metric, form = self._changes(x, y)
        M, W = metric[0, 1], np.sqrt(1 - metric[0, 1] ** 2)
        inverse = np.array([[1 + 0 * M, -M], [-M, 1 + 0 * M]]) / W**2
        half = np.einsum("ad...,dc...,cbij...->abij...", form, inverse, gamma) / 2
        J = np.array([[1 + 0 * M, -M / W], [0 * M, 1 / W]])
        of = [
            np.einsum("ap...,bq...,abij...->pqij...", J, J, each)
            for each in (gamma, rho - half - half.swapaxes(0, 1))
        ]
        return np.stack([each[p] for each in of for p in ((0, 0), (1, 1), (0, 1))]), W

    def _reads(self, x, y):
        """What gages read (3, 3, 6, ...) of the fields' derivatives."""
        gamma, rho, metric, form = self._changes(x, y)

        def along(*d):
            g, b = (np.einsum("a,b,ab...->...", d, d, each) for each in (metric, form))
            gamma_d, rho_d = (np.einsum("a,b,abij...->ij...", d, d, each) for each in (gamma, rho))
            return (rho_d - 2 * b / g * gamma_d) / g

        return np.stack([along(1, 0), along(0, 1), (along(1, 1) - along(1, -1)) / 2])

    @cached_property
    def _law(self):
        nu, D = self.poisson, self.rigidity
        plane = np.array([[1, nu, 0], [nu, 1, 0], [0, 0, 2 * (1 - nu)]])
        return np.kron(np.diag([12 * D / self.thickness**2, D]), plane)

    # Functions

    def _ends(self, field):
        """How the functions of a field end along x and along y."""
        if field == F:
            return self.edge, self.edge
        across = "hinged" if self.inplane == "held" else "loose"
        along = "loose" if self.inplane == "free" else "hinged"
        return (across, along) if field == U else (along, across)

    def _along(self, field, x, y):
        """Functions of x and of y, with two derivatives, (3, G, N) each."""
        ends = zip(self._ends(field), (self.a, self.b), (x, y), strict=True)
        return [_polynomials(end, side, at, self.polynomials) for end, side, at in ends]

    def _functions(self, x, y):
        """Derivatives (3, 6, G, N N) of the functions of u, v and f."""
        found = np.zeros((3, 6, len(x), self.polynomials**2))
        for field in range(3):
            X, Y = self._along(field, x, y)
            for d, (dx, dy) in enumerate(ORDERS):
                found[field, d] = np.einsum("gm,gn->gmn", X[dx], Y[dy]).reshape(len(x), -1)
        return found

    @cached_property
    def _blocks(self):
        """Scales, factors and the functions' numbers of the even and odd ones, which do not mix."""
        N, (x, wx), (y, wy) = self.polynomials, *self._rule(self.polynomials + 8)
        (x, wx), (y, wy) = ((at[: len(at) // 2], w[: len(w) // 2]) for at, w in ((x, wx), (y, wy)))
        S, W = self._strains(*np.meshgrid(x, y, indexing="ij"))
        weights = 4 * (wx[:, None] * wy * W).ravel()
        along, blocks = [self._along(field, x, y) for field in range(3)], []
        for px, py in np.ndindex(2, 2):
            B, numbers = [], []
            for field, (X, Y) in enumerate(along):
                m, n = np.arange(px ^ (field == U), N, 2), np.arange(py ^ (field == V), N, 2)
                part = sum(
                    S[:, field, d, :, :, None, None]
                    * X[dx][:, None, m, None]
                    * Y[dy][None, :, None, n]
                    for d, (dx, dy) in enumerate(ORDERS)
                )
                B.append(part.reshape(6, len(weights), -1))
                numbers.append((field * N * N + m[:, None] * N + n).ravel())
            B, numbers = np.concatenate(B, axis=-1), np.concatenate(numbers)
            stress = np.einsum("st,tqn,q->sqn", self._law, B, weights, optimize=True)
            K = np.tensordot(B, stress, ((0, 1), (0, 1)))
            if self.inplane == "free":
                fixed = np.isin(numbers, self._slides)
                K[fixed], K[:, fixed] = 0.0, 0.0
                K[fixed, fixed] = 1.0
            scale = 1 / np.sqrt(np.diag(K))
            factor = cho_factor(K * scale * scale[:, None], overwrite_a=True)
            blocks.append((numbers, scale, factor))
        return blocks

    @property
    def _slides(self):
        """The numbers of u = 1, u = y and v = 1."""
        return [0, 1, self.polynomials**2]

    def _solved(self, forces):
        """Coefficients (R, 3 N N) under `forces` (R, 3 N N)."""
        found = np.zeros_like(forces)
        for numbers, scale, factor in self._blocks:
            found[:, numbers] = cho_solve(factor, (forces[:, numbers] * scale).T).T * scale
        if self.inplane == "free":
            found[:, self._slides] = 0.0
        return found

    def _rule(self, count):
        at, weights = _gauss(2 * (count // 2))
        return [((at + 1) * side / 2, weights * side / 2) for side in (self.a, self.b)]

    # Loads

    @property
    def _plate(self):
        return HingedPlate(self.a, self.b, self.rigidity, self.modes)

    def _sharp(self, load, x, y, pairs):
        """Derivatives (6, ...) of the plate's answer; `pairs` makes them of factors (G, n)."""
        c, (k, l) = self._plate.coefficients(load), self._plate.waves()
        along = [_wave(k, x, dx) @ c for dx in range(3)]
        return np.stack([pairs(along[dx], _wave(l, y, dy)) for dx, dy in ORDERS])

    def _known(self, load, x, y, pairs):
        """The same, with a lift that clamps it where the edges are clamped."""
        known = self._sharp(load, x, y, pairs)
        if self.edge == "hinged":
            return known
        lift, N = self._lift(self._plate.coefficients(load)), self.polynomials
        X, Y = _polynomials("hinged", self.a, x, N), _polynomials("hinged", self.b, y, N)
        return known + np.stack([pairs(X[dx] @ lift, Y[dy]) for dx, dy in ORDERS])

    def _lift(self, c):
        """Coefficients (N, N) of hinged functions whose slopes at the edges undo the plate's.

        What undoes them along x, and along y, less what both do in the corners.
        """
        k, l = self._plate.waves()
        (x, ends_x, f_x, _, undo_x), (y, ends_y, f_y, slopes_y, undo_y) = (
            self._edge(side) for side in (self.a, self.b)
        )
        at_x = np.linalg.lstsq(f_y, _wave(l, y, 0) @ c.T @ _wave(k, ends_x, 1).T)[0].T
        at_y = np.linalg.lstsq(f_x, _wave(k, x, 0) @ c @ _wave(l, ends_y, 1).T)[0]
        return undo_x @ (at_x @ slopes_y.T) @ undo_y.T - undo_x @ at_x - at_y @ undo_y.T

    def _edge(self, side):
        """Places, ends, the functions there and their slopes, and what makes slopes (N, 2) of 1."""
        count, ends = self.polynomials, np.array([0.0, side])
        at = (_gauss(2 * count)[0] + 1) * side / 2
        slopes, undo = _polynomials("hinged", side, ends, count)[1], np.zeros((count, 2))
        undo[:2] = np.linalg.inv(slopes[:, :2])
        return at, ends, _polynomials("hinged", side, at, count)[0], slopes, undo

    def _unbalanced(self, load):
        """The work (3, N, N) on each function of what the known part leaves of a load.

        A hinged plate's own bending does the work of the load on all that vanishes at the edge.
        """
        (x, wx), (y, wy), law, along = self._grid

        def product(X, Y):
            return X @ Y.T

        known = self._known(load, x, y, product)
        work = np.einsum("idexy,exy->idxy", law, known)
        sharp = known if self.edge == "hinged" else self._sharp(load, x, y, product)
        xx, xy, yy = sharp[3:] * wx[:, None] * wy
        D, nu = self.rigidity, self.poisson
        work[F, 3] -= D * (xx + nu * yy)
        work[F, 4] -= 2 * D * (1 - nu) * xy
        work[F, 5] -= D * (yy + nu * xx)
        found = np.zeros((3, self.polynomials, self.polynomials))
        for field, (X, Y) in enumerate(along):
            for d, (dx, dy) in enumerate(ORDERS):
                found[field] -= X[dx].T @ work[field, d] @ Y[dy]
        return found

    @cached_property
    def _grid(self):
        (x, wx), (y, wy) = self._rule(2 * self.polynomials + 48)
        S, W = self._strains(*np.meshgrid(x, y, indexing="ij"))
        weights = wx[:, None] * wy * W
        law = np.einsum("st,sidxy,texy,xy->idexy", self._law, S, S[:, F], weights, optimize=True)
        return (x, wx), (y, wy), law, [self._along(field, x, y) for field in range(3)]


_gauss = cache(leggauss)


def _wave(k, x, order):
    """sin(k x) or a derivative of it, (G, n)."""
    return _waves(k.tobytes(), x.tobytes(), order)


@lru_cache(100)  # each load has them at the same places
def _waves(k, x, order):
    k, x = np.frombuffer(k), np.frombuffer(x)
    return k**order * np.sin(np.multiply.outer(x, k) + order * np.pi / 2)


def _polynomials(end, side, at, count):
    """Combinations of Legendre polynomials and two derivatives of them (3, G, count).

    `loose` at both ends, zero there (`hinged`), or zero with a zero slope (`clamped`).
    """
    k = np.arange(float(count))
    made = np.eye(count + 4, count)
    steep = [(k + i) * (k + i + 1) for i in (0, 2, 4)]  # twice the slope of P_(k+i) at its end
    second = {
        "loose": 0 * k,
        "hinged": 1 + 0 * k,
        "clamped": (steep[2] - steep[0]) / (steep[2] - steep[1]),
    }[end]
    rows = np.arange(count)
    made[rows + 2, rows] = -second
    made[rows + 4, rows] = second - 1 if end == "clamped" else 0.0
    values = legvander(2 * at / side - 1, count + 3)
    return np.stack(
        [
            values[:, : count + 4 - order] @ (legder(made, order, 2 / side) if order else made)
            for order in range(3)
        ]
    )
