"""Stretching: the forces by which a thin skin resists as its middle surface stretches."""

import math
from collections.abc import Callable, Iterable, Iterator
from functools import cached_property

import numpy as np
import scipy
from numpy.polynomial import legendre
from numpy.typing import NDArray

from kappaskin.bases import Basis, ProductBasis, gauss, has_free_tip
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.mechanics.loads import Load
from kappaskin.mechanics.plate import Plate

# von Karman's plate. A deflection w alone strains the middle surface by
#     e = (w_x^2 / 2, w_y^2 / 2, w_x w_y);
# displacements u, v in the plane relieve what they can. By the principle of complementary energy
# the energy that remains is the largest, over all membrane forces in equilibrium, of
#     int N . e - 1/2 int N . N / (E h),   N = (F_yy, F_xx, -F_xy) of Airy's stress function F.
# With F = sum c_m F_m it is b S^-1 b / 2: b_m = int N_m . e is quadratic in the coefficients of w,
# and S, the membrane compliance, is factored once. How the edge is held says which F may be:
#     held: any;   diaphragm: F = 0 along the edge, or x y, a uniform shear;
#     free: F and its slope vanish along the edge.
# A shallow skin (Marguerre) has the slopes s = (Hx (x - a/2), Hy (y - b/2)) at rest: in e stand the
# products of the slopes w_x + s_x and w_y + s_y, less those of s. That is e = (w_x^2 / 2 - Hx w,
# w_y^2 / 2 - Hy w, w_x w_y) for displacements u - s_x w, v - s_y w, alike along the edge, where w
# is zero. What it resists to first order is in the plate's compliance, and left out here.
# The F_m are products of polynomials: 1, t, 1 - t^2, t - t^3, and twice integrated Legendre
# polynomials, which vanish with their slopes at both ends. With eight more along a side than w has
# functions, the force under a point load is right to 3e-4 of itself.
_MORE_THAN_W = 8
_LEAST = 16  # polynomials along a side

_TOLERANCE = 1e-8  # of the force
_SLOW = 0.3  # of itself: a gradient that a step leaves larger calls for another Hessian
_LEAST_STIFF = 1e-3  # of the stiffness in bending
_ROUNDING = 1e-13  # of the largest eigenvalue
_SLACK = 1e-10  # of the energy, for rounding
_STEPS = 100
_ON_PATH, _CORRECTIONS = 1e-6, 20  # of the force that a linear skin needs; at most so many


_Solver = Callable[[Array], Array]


class Stretching:
    """The stretching of a flat rectangular plate or strip of known thickness, or a shallow skin.

    Deflections are coefficients (Ni, Nj) in m of a `basis` of products; forces are modal ones in N.
    What the plate resists by bending, tension and foam, and a shallow skin by stretching in
    proportion to its deflection, is not in `force` and `tangent`.
    """

    def __init__(self, plate: Plate, basis: Basis) -> None:
        h, patch = plate.sheet_thickness, plate.patch
        known = plate.stretches or (patch.is_shallow and plate.rigidity)
        if not h or not known or not isinstance(basis, ProductBasis):
            raise Refusal(
                "stretching needs a shallow skin with a rigidity above zero in N m, or a flat "
                "rectangular plate or strip whose thickness is given, got a "
                f"{patch.name} with thickness {h} m and rigidity {plate.rigidity:g} N m"
            )
        if basis.patch != patch:
            raise Refusal(f"the plate is on {patch}, the basis on {basis.patch}; use one")
        self.plate, self.basis = plate, basis
        m, n = (_even(count) for count in basis.shape)
        x, wx = gauss(patch.a, math.ceil(1.6 * basis.Ni + m / 2) + 2)
        y, wy = gauss(patch.b, 1 if patch.strip else math.ceil(1.6 * basis.Nj + n / 2) + 2)
        self._weights = np.multiply.outer(wx, wy)
        values, slopes = basis.on_grid(x, y, 0, 1), basis.on_grid(x, y, 1, 0)
        self._X, self._dX, self._Y, self._dY = values.X, slopes.X, slopes.Y, values.Y
        A, B = _airy_functions(x, patch.a, m), _airy_functions(y, patch.b, n)
        # Factors along x (3, m, Gx) and y (3, n, Gy) of the membrane forces xx, yy, xy.
        self._A, self._B = np.stack([A[0], A[2], -A[1]]), np.stack([B[2], B[0], B[1]])
        # Even or odd along x, and along y: the membrane does not mix these four.
        numbers = np.arange(m * n).reshape(2, m // 2, 2, n // 2)
        self._order = numbers.swapaxes(1, 2).reshape(4, -1)
        self._stiffness = self._inverse(self._membrane_compliance(A, B, wx, wy, h))
        Hx, Hy = patch.curvatures
        self._sx: Array = np.multiply.outer(Hx * (x - patch.a / 2), np.ones_like(y))
        self._sy: Array = np.multiply.outer(np.ones_like(x), Hy * (y - patch.b / 2))
        self._linear = np.zeros((basis.size, basis.size))
        if patch.is_shallow:
            self._linear = self.tangent(np.zeros(basis.shape))
        self._last: tuple[Array, ...] = ()
        self._solve: _Solver | None = None

    def _membrane_compliance(self, A: Array, B: Array, wx: Array, wy: Array, h: float) -> Array:
        """S (m n, m n) in 1/N of products of the functions (3, m, Gx) in x and (3, n, Gy) in y."""

        def product(i: int, j: int) -> Array:
            along_x: Array = (A[i] * wx) @ A[j].T
            along_y: Array = (B[2 - i] * wy) @ B[2 - j].T
            return np.kron(along_x, along_y).astype(float)

        plate, nu, mixed = self.plate, self.plate.poisson, product(0, 2)
        whole = product(0, 0) + product(2, 2) - nu * (mixed + mixed.T)
        whole += 2 * (1 + nu) * product(1, 1)
        # A strip is held across its length.
        return whole * (1 - nu**2 if plate.patch.strip else 1) / (plate.modulus(h) * h)

    def _inverse(self, S: Array) -> Array:
        """The inverse (4, M, M) of the membrane compliance on the functions that are possible."""
        allowed = self._allowed(self._A.shape[1], self._B.shape[1]).ravel()[self._order]
        inverse = np.zeros((*self._order.shape, self._order.shape[1]))
        for out, keep, number in zip(inverse, allowed, self._order, strict=True):
            block = S[np.ix_(number[keep], number[keep])]
            scale = np.sqrt(np.diag(block))
            scaled = np.linalg.inv(block / np.multiply.outer(scale, scale))
            out[np.ix_(keep, keep)] = scaled / np.multiply.outer(scale, scale)
        return inverse

    def _allowed(self, m: int, n: int) -> NDArray[np.bool_]:
        """Which products (m, n) of `_airy_functions` are possible as the edge is held."""
        k, l = np.meshgrid(_degrees(m), _degrees(n), indexing="ij")
        inplane = self.plate.inplane_edge
        if self.plate.patch.strip:  # a uniform force along x, where both ends are held
            held = inplane == "held" and not has_free_tip(self.basis)
            return (k == 0) & (l == 2) & held
        return {
            "held": k + l >= 2,
            "diaphragm": ((k >= 2) & (l >= 2)) | ((k == 1) & (l == 1)),
            "free": (k >= 4) & (l >= 4),
        }[inplane]

    def _relieved(self, b: Array) -> Array:
        """S^-1 b (m n, R): coefficients of Airy's function for the strains `b` (m n, R)."""
        found = np.empty_like(b)
        found[self._order] = self._stiffness @ b[self._order]
        return found

    def _membrane(self, q: Array) -> tuple[Array, Array, Array, float]:
        """Slopes along x and y (Gx, Gy), weighted membrane forces (3, Gx, Gy) in N m, energy in J.

        The slopes are those at rest and of the deflection.
        """
        sx, sy = self._sx, self._sy
        wx, wy = self._dX @ q @ self._Y.T + sx, self._X @ q @ self._dY.T + sy
        strains = np.stack([(wx * wx - sx * sx) / 2, (wy * wy - sy * sy) / 2, wx * wy - sx * sy])
        strains *= self._weights
        m, n = self._A.shape[1], self._B.shape[1]
        b = (self._A @ strains @ self._B.swapaxes(1, 2)).sum(axis=0)
        c = self._relieved(b.reshape(-1, 1)).reshape(m, n)
        N = (self._A.swapaxes(1, 2) @ c @ self._B) * self._weights
        return wx, wy, N, float(b.ravel() @ c.ravel()) / 2

    def _energy(self, q: Array) -> tuple[float, Array]:
        """The energy in J of the deflection `q` (Ni, Nj) in m, and its derivatives, `force`."""
        wx, wy, (Nx, Ny, Nxy), energy = self._membrane(q)
        in_x, in_y = Nx * wx + Nxy * wy, Ny * wy + Nxy * wx
        force = self._dX.T @ in_x @ self._Y + self._X.T @ in_y @ self._dY
        linear = (self._linear @ q.ravel()).reshape(q.shape)
        return energy - float(np.vdot(q, linear)) / 2, force - linear

    def force(self, q: Array) -> Array:
        """Modal forces (Ni, Nj) in N that hold the membrane of the deflection `q` (Ni, Nj) in m."""
        return self._energy(q)[1]

    def tangent(self, q: Array) -> Array:
        """Derivatives (N, N) in N/m of `force` by the coefficients, at the deflection `q`."""
        wx, wy, (Nx, Ny, Nxy), _ = self._membrane(q)
        pairs, in_x, in_y = self._pairs, wx * self._weights, wy * self._weights
        shear = _sandwich(pairs["dX X"], Nxy, pairs["Y dY"])
        held = _sandwich(pairs["dX dX"], Nx, pairs["Y Y"]) + shear + shear.T
        held += _sandwich(pairs["X X"], Ny, pairs["dY dY"])
        # Derivatives (m n, N) of b.
        by = _sandwich(pairs["0 dX"], in_x, pairs["0 Y"])
        by += _sandwich(pairs["1 X"], in_y, pairs["1 dY"])
        by += _sandwich(pairs["2 dX"], in_y, pairs["2 Y"])
        by += _sandwich(pairs["2 X"], in_x, pairs["2 dY"])
        return held + by.T @ self._relieved(by) - self._linear

    @cached_property
    def _pairs(self) -> dict[str, Array]:
        """Products (L, R, G) of functions at the points along one side."""
        w = {"X": self._X.T, "dX": self._dX.T, "Y": self._Y.T, "dY": self._dY.T}
        of_w = ("dX dX", "dX X", "X X", "Y Y", "Y dY", "dY dY")
        pairs = {name: (w[name.split()[0]], w[name.split()[1]]) for name in of_w}
        for k in range(3):
            pairs |= {f"{k} {name}": (self._A[k], w[name]) for name in ("X", "dX")}
            pairs |= {f"{k} {name}": (self._B[k], w[name]) for name in ("Y", "dY")}
        return {name: one[:, None] * other for name, (one, other) in pairs.items()}

    @cached_property
    def _root(self) -> Array:
        """L (N, R) with L L' the compliance in bending."""
        C = self.plate.compliance(self.basis).after(np.eye(self.basis.size))
        values, vectors = np.linalg.eigh((C + C.T) / 2)
        there = values > _ROUNDING * values[-1]
        return vectors[:, there] * np.sqrt(values[there])

    # With q = L p the energy is p'p/2 - F'q and that of the membrane. Where that is compressed the
    # Hessian I + L'KL may be indefinite. One Hessian serves as long as it brings the gradient down.
    def __call__(self, modal: Array) -> Array:
        """Coefficients (Ni, Nj) in m under modal forces (Ni, Nj) in N, by Newton's method.

        The search starts from the last ones found: asked in order, that is quick. Raises a
        `Refusal` where it does not converge.
        """
        L, shape = self._root, modal.shape
        target = L.T @ modal.ravel()

        def state(p: Array) -> tuple[float, Array, Array]:
            q = (L @ p).reshape(shape)
            energy, f = self._energy(q)
            return float(energy + p @ p / 2 - target @ p), p + L.T @ f.ravel() - target, q

        p = min((*self._last, self._first(target)), key=lambda p: state(p)[0])
        (energy, gradient, q), before = state(p), math.inf
        for _ in range(_STEPS):
            size = float(np.linalg.norm(gradient))
            if size <= _TOLERANCE * np.linalg.norm(target):
                self._last = (p,)
                return q
            if (solve := self._solve) is None or size > _SLOW * before:
                self._solve = solve = _solver(np.eye(len(p)) + L.T @ self.tangent(q) @ L)
            step, before = -solve(gradient), size
            while (new := state(p + step))[0] > energy + _SLACK * abs(energy):
                step = step / 2
            p, (energy, gradient, q) = p + step, new
        raise Refusal(
            f"the deflection of a plate that stretches did not converge in {_STEPS} steps; use "
            "less force or a thicker plate, or omit its thickness"
        )

    def _first(self, linear: Array) -> Array:
        """The multiple s of the `linear` p whose energy is least: s + r s^3 = 1."""
        q, work = self._root @ linear, linear @ linear
        ratio = q @ self.force(q.reshape(self.basis.shape)).ravel() / (work or 1.0)
        if not ratio > 0:
            return linear
        root = math.sqrt(3 * ratio)
        return linear * (2 / root * math.sinh(math.asinh(1.5 * root) / 3))

    def path(self, modal: Array, depths: Iterable[float]) -> Iterator[tuple[float, Array]]:
        """The force in N, and coefficients (Ni, Nj) in m, at one after the other of `depths` in m.

        A depth is the displacement under the load, which has the modal forces `modal` (Ni, Nj) per
        N. The path ends before the depth where no load holds the skin: it snaps through.
        """
        L, shape = self._root, modal.shape
        target, force = L.T @ modal.ravel(), 0.0

        def state(p: Array) -> tuple[Array, Array]:
            q = (L @ p).reshape(shape)
            return q, np.eye(len(p)) + L.T @ self.tangent(q) @ L

        p = 0 * target
        q, hessian = state(p)
        for depth in depths:
            size = abs(depth) / float(target @ target) * float(np.linalg.norm(target))
            for _ in range(_CORRECTIONS):
                left = force * target - p - L.T @ self.force(q).ravel()
                further = depth - float(target @ p)
                if np.linalg.norm(left) + abs(further) * size / abs(depth) < _ON_PATH * size:
                    break
                step, more = np.linalg.solve(hessian, np.stack([left, target], axis=1)).T
                change = (further - float(target @ step)) / float(target @ more)
                p, force = p + step + change * more, force + change
                q, hessian = state(p)
            else:
                return
            if not np.linalg.eigvalsh(hessian)[0] > 0:
                return
            yield force, q

    def deflection(self, loads: Iterable[Load]) -> Array:
        """Coefficients (Ni, Nj) in m of the deflection under all `loads` at once."""
        modal = np.zeros(self.basis.shape)
        for load in loads:
            self.plate.check(load)
            modal += load.modal(self.basis)
        return self(modal)


def _solver(H: Array) -> _Solver:
    """What solves with the Hessian `H`, with the sizes of its eigenvalues if some are negative."""
    try:
        factor = scipy.linalg.cho_factor(H)
        return lambda gradient: scipy.linalg.cho_solve(factor, gradient)
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(H)
        sizes = np.maximum(np.abs(values), _LEAST_STIFF)
        return lambda gradient: vectors @ ((vectors.T @ gradient) / sizes)


def _even(count: int) -> int:
    """How many polynomials along a side on which w has `count` functions: an even number."""
    more = max(count + _MORE_THAN_W, _LEAST)
    return more + more % 2


def _degrees(count: int) -> NDArray[np.intp]:
    """Degrees (count,) of the polynomials, the even ones first."""
    return np.concatenate([np.arange(0, count, 2), np.arange(1, count, 2)])


def _airy_functions(x: Array, length: float, count: int) -> Array:
    """Values, slopes and second derivatives (3, count, P) at `x` (P,) on [0, length]."""
    series = np.zeros((count, count))  # of Legendre polynomials, one in each column
    series[:, 2:] = legendre.legint(np.eye(count - 2), 2, lbnd=-1)
    series[:4, :4] = [[1, 0, 2 / 3, 0], [0, 1, 0, 2 / 5], [0, 0, -2 / 3, 0], [0, 0, 0, -2 / 5]]
    t, order = 2 * x / length - 1, _degrees(count)
    derivatives = [legendre.legval(t, legendre.legder(series, d))[order] for d in range(3)]
    return np.stack(derivatives) * (2 / length) ** np.arange(3.0)[:, None, None]


def _sandwich(along_x: Array, field: Array, along_y: Array) -> Array:
    """Integrals (K L, I J) of `field` (Gx, Gy) times pairs (K, I, Gx) in x and (L, J, Gy) in y."""
    (K, I, Gx), (L, J, Gy) = along_x.shape, along_y.shape
    flat = along_x.reshape(K * I, Gx) @ field @ along_y.reshape(L * J, Gy).T
    return flat.reshape(K, I, L, J).swapaxes(1, 2).reshape(K * L, I * J)


def deflection_of(plate: Plate, basis: Basis) -> Callable[[Array], Array]:
    """Modal forces (Ni, Nj) in N to coefficients in m; it stretches where that can be computed."""
    return Stretching(plate, basis) if plate.stretches else plate.compliance(basis)


def shapes_under(plate: Plate, basis: Basis, forces: Array) -> Array:
    """Coefficients (S, N) in m under modal `forces` (S, N) in N, one moment after the other."""
    if not plate.stretches:
        return plate.compliance(basis).after(forces)
    stretching, each = Stretching(plate, basis), forces.reshape(-1, *basis.shape)
    return np.array([stretching(force) for force in each]).reshape(forces.shape)
