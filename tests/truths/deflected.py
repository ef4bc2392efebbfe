"""A deflected skin in space, and what the gages on it read: the geometry of surfaces.

It shares no code with the library that it tests. The skin at rest is flat, or an arc along x; f is
the displacement inward. A bent skin also moves along its arc, by v, so that this does not become
longer, v_x = f / R; nor is it sheared: its gages along x turn with those along y, by v_y.
"""

from dataclasses import dataclass

import numpy as np


def sines(a, b, coefficients):
    """The function (x, y, dx, dy) of the sum of c_ij sin(i pi x/a) sin(j pi y/b).

    dx = -1 is an integral whose values at the two ends cancel.
    """

    def along(x, length, count, order):
        k = np.pi * np.arange(1, count + 1) / length
        if order >= 0:
            return k**order * np.sin(np.multiply.outer(x, k) + order * np.pi / 2)
        return ((1 + np.cos(k * length)) / 2 - np.cos(np.multiply.outer(x, k))) / k

    m, n = coefficients.shape

    def f(x, y, dx=0, dy=0):
        X, Y = along(x, a, m, dx), along(y, b, n, dy)
        return np.einsum("pi,ij,pj->p", X, coefficients, Y)

    return f


@dataclass(frozen=True)
class DeflectedSkin:
    """A skin of length `a` along x in m, bent to `radius` in m, displaced by f(x, y, dx, dy)."""

    a: float
    f: object
    radius: float = np.inf

    @property
    def base(self):
        """Curvature at rest in 1/m along x and y."""
        return 1 / self.radius, 0.0

    def _parts(self, x):
        """Unit vectors (P, 3) along the arc, across it and outward."""
        angle = (x - self.a / 2) / self.radius
        zero = np.zeros_like(angle)
        along = np.stack([np.cos(angle), zero, -np.sin(angle)], axis=-1)
        out = np.stack([np.sin(angle), zero, np.cos(angle)], axis=-1)
        return along, np.array([0.0, 1.0, 0.0]), out

    def _moved(self, x, y, dx, dy):
        """The derivatives of f and v, (P, 1) each; a flat skin needs no integral of f."""
        H, f = 1 / self.radius, self.f
        v = H * f(x, y, dx - 1, dy) if H else 0 * x
        return f(x, y, dx, dy)[:, None], v[:, None]

    def points(self, x, y):
        """Where the points x, y (P,) of the skin are, (P, 3) in m."""
        (t, e, n), (f, v) = self._parts(x), self._moved(x, y, 0, 0)
        middle = np.stack([x - self.a / 2, y, np.zeros_like(x)], axis=-1)
        if np.isfinite(self.radius):
            middle = self.radius * (n - [0.0, 0.0, 1.0]) + y[:, None] * e
        return middle - f * n + v * t

    def derivatives(self, x, y):
        """r_x, r_y, r_xx, r_yy and r_xy, each (P, 3): t' = -n/R and n' = t/R, rule by rule."""
        (t, e, n), H = self._parts(x), 1 / self.radius
        at = [self._moved(x, y, *order) for order in
              [(0, 0), (1, 0), (0, 1), (2, 0), (0, 2), (1, 1)]]  # fmt: skip
        (f, v), (fx, vx), (fy, vy), (fxx, vxx), (fyy, vyy), (fxy, vxy) = at
        return (
            (1 - H * f + vx) * t - (fx + H * v) * n,
            e - fy * n + vy * t,
            (vxx - 2 * H * fx - H**2 * v) * t - (H + fxx - H**2 * f + 2 * H * vx) * n,
            vyy * t - fyy * n,
            (vxy - H * fy) * t - (fxy + H * vy) * n,
        )

    def _forms(self, x, y):
        """The first and the second form of d and r_y, each (3, P): dd, yy and dy.

        d is along the gages along x, r_x turned back by v_y.
        """
        rx, ry, rxx, ryy, rxy = self.derivatives(x, y)
        n = np.cross(rx, ry)
        n /= np.linalg.norm(n, axis=1)[:, None]
        turn = self._moved(x, y, 0, 1)[1]
        d = rx - turn * ry

        def dot(one, other):
            return np.sum(one * other, axis=1)

        L, N, M = (-dot(second, n) for second in (rxx, ryy, rxy))
        w = turn[:, 0]
        first = np.stack([dot(d, d), dot(ry, ry), dot(d, ry)])
        return first, np.stack([L - 2 * w * M + w**2 * N, N, M - w * N])

    def readings(self, x, y):
        """xx, yy and xy (3, P) in 1/m of gages at x, y (P,): normal curvature less that at rest.

        The twist is the second form's mixed entry between unit vectors along the two gages, less
        what shear alone makes of the curvature at rest.
        """
        (Hx, Hy), (first, second) = self.base, self._forms(x, y)
        twist = (second[2] - (Hx + Hy) / 2 * first[2]) / np.sqrt(first[0] * first[1])
        return np.stack([second[0] / first[0] - Hx, second[1] / first[1] - Hy, twist])

    def read(self, quantity, x, y, direction):
        """A `quantity` at x, y (P,) along `direction` (P,) in rad from x, in SI units.

        A height is the displacement; a slope how far the tangent has turned, p and q of the surface
        in space; a curvature the normal curvature along c d + s r_y less that at rest.
        """
        c, s, H = np.cos(direction), np.sin(direction), 1 / self.radius
        if quantity == "height":
            return self.f(x, y)
        if quantity == "twist":
            return self.readings(x, y)[2]
        if quantity == "slope":
            v = self._moved(x, y, 0, 0)[1][:, 0]
            return c * (self.f(x, y, 1, 0) + H * v) + s * self.f(x, y, 0, 1)
        (Hx, Hy), (first, second) = self.base, self._forms(x, y)
        parts = np.stack([c * c, s * s, 2 * c * s])
        of_base = c * c * Hx + s * s * Hy
        return np.sum(parts * second, axis=0) / np.sum(parts * first, axis=0) - of_base

    def diagonal_difference(self, x, y):
        """Half of what the normal curvatures along the two diagonals differ by, (P,) in 1/m."""
        first, second = self._forms(x, y)
        both = [
            (second[0] + second[1] + 2 * sign * second[2])
            / (first[0] + first[1] + 2 * sign * first[2])
            for sign in (1, -1)
        ]
        return (both[0] - both[1]) / 2


@dataclass(frozen=True)
class ShallowSkin(DeflectedSkin):
    """A shallow skin of `radii` along x and y in m: nothing moves along it."""

    radii: tuple = (np.inf, np.inf)

    @property
    def base(self):
        return 1 / self.radii[0], 1 / self.radii[1]

    def derivatives(self, x, y):
        """In its own tangents and normal, whose turning stretches nothing: 1 - f/R is 1."""
        (Hx, Hy), (t, e, n) = self.base, np.eye(3)
        f, fx, fy, fxx, fyy, fxy = (self.f(x, y, *order)[:, None] for order in
             [(0, 0), (1, 0), (0, 1), (2, 0), (0, 2), (1, 1)])  # fmt: skip
        return (
            t - fx * n,
            e - fy * n,
            -Hx * fx * t - (Hx + fxx + Hx**2 * f) * n,
            -Hy * fy * e - (Hy + fyy + Hy**2 * f) * n,
            -(Hx * fy * t + Hy * fx * e) / 2 - fxy * n,
        )
