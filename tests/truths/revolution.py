"""Sanders' shell of revolution, harmonic by harmonic: first-order equations by collocation.

It shares no code with the library that it tests. Displacement is positive inward; curvature is what
back-to-back gages read, xx along the meridian, yy along the parallel, positive as of a second
derivative of it. Places are (s, azimuth): metres from the pole along the meridian, and radians.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.polynomial.legendre import leggauss
from scipy.linalg import solve_banded
from scipy.special import ellipe, ellipeinc, roots_genlaguerre

from navier import Load

_STAGES = 5  # Gauss points per segment: order 10 at its ends
_NEAREST = 1e-4  # of the length: an element at the pole is taken to be this far from it


class Meridian(Protocol):
    """What is turned about the axis of a shell, as `Spheroid`."""

    def at(self, s) -> tuple[np.ndarray, ...]: ...

    def points(self, s, azimuth) -> np.ndarray: ...


@dataclass(frozen=True)
class Spheroid:
    """A surface of the semi-axis `radius` at its equator and `height` at its pole, in m."""

    radius: float
    height: float

    @property
    def quarter(self):
        """Length in m of the meridian from the pole to the equator."""
        return self.radius * ellipe(1 - (self.height / self.radius) ** 2)

    def _angle(self, s):
        a, b, t = self.radius, self.height, np.asarray(s / self.quarter * np.pi / 2)
        for _ in range(6):  # Newton's steps to s = a E(t | 1 - b^2 / a^2)
            step = np.hypot(a * np.cos(t), b * np.sin(t))
            t = t - (a * ellipeinc(t, 1 - (b / a) ** 2) - s) / step
        return t

    def at(self, s):
        """r in m, cosine and sine of the normal's angle to the axis, and 1 / R1 in 1/m, at `s`."""
        a, b, t = self.radius, self.height, self._angle(s)
        step = np.hypot(a * np.cos(t), b * np.sin(t))
        return a * np.sin(t), a * np.cos(t) / step, b * np.sin(t) / step, a * b / step**3

    def points(self, s, azimuth):
        """Points (..., 3) in space, in m."""
        r, t = self.radius * np.sin(self._angle(s)), self._angle(s)
        x, y, z = r * np.cos(azimuth), r * np.sin(azimuth), self.height * np.cos(t)
        return np.stack(np.broadcast_arrays(x, y, z), -1)


def sphere(radius):
    return Spheroid(radius, radius)


# What of y = (u, v, w, b, and the forces that do work on them) vanishes at an end. At a pole what a
# harmonic must do to be smooth there: n = 1 moves it sideways (u = -v) and turns it.
_I = np.eye(8)
ENDS = {
    "clamped": _I[:4],
    "hinged": _I[[0, 1, 2, 7]],
    "diaphragm": _I[[4, 1, 2, 7]],
    "mirror": _I[[0, 3, 5, 6]],
    "free": _I[4:],
}
_POLE = [
    _I[[0, 1, 6, 3]],
    np.stack([_I[0] + _I[1], _I[2], _I[4] - _I[5], _I[6]]),
    _I[:4],
]


@dataclass(frozen=True)
class RevolvedShell:
    """A shell from `start` to `end` along its `meridian` in m.

    Flexural `rigidity` D in N m and `thickness` h in m make E h = 12 (1 - nu^2) D / h^2. It is held
    at the end as `edge`, at the start as `begin` of `ENDS`, or has its pole there. All is the sum
    of its `harmonics`, each solved in so many `segments`.
    """

    meridian: Meridian
    end: float
    start: float = 0.0
    rigidity: float = 3.7e-3
    thickness: float = 0.25e-3
    poisson: float = 0.3
    edge: str = "clamped"
    begin: str = "pole"
    harmonics: range = range(121)
    segments: int = 64

    def displacement(self, load, places):
        """Displacement (G,) in m at `places` (G, 2)."""
        return self.mover(places)(load)

    def mover(self, places) -> Callable[[Load], np.ndarray]:
        """The map from a load to displacement (G,) in m at `places` (G, 2)."""
        read = self._reader(places, slice(0, 1))
        return lambda load: read(load)[0]

    def reader(self, elements) -> Callable[[Load], np.ndarray]:
        """The map from a load to curvature xx, yy, xy (3, P) in 1/m at `elements` (P, 2)."""
        return self._reader(elements, slice(1, 4))

    # Of y, the solution under a load, an element reads l y at its s. By reciprocity (J H symmetric)
    # that is the work of the load on the w of the solution that jumps by J l at that s, wherever
    # the load is: a table of influences by s, made once.

    def _reader(self, places, which):
        s, ring = np.unique(np.maximum(places[:, 0], _NEAREST * self.end), return_inverse=True)
        nodes, table = self._influence(s, which)
        n = self._n[:, None]

        def read(load):
            s0, azimuth = np.hypot(load.x, load.y), np.arctan2(load.y, load.x)
            shares = np.sum([self._shares(part, s0, nodes) for part in _discs(load)], axis=0)
            used = np.flatnonzero(shares.any(axis=(0, 2)))
            used = slice(used[0], used[-1] + 1)
            influences = table[:, used].reshape(len(n), -1, table.shape[-1])
            by_ring = -shares[:, used].reshape(len(n), 1, -1) @ influences
            by_ring = by_ring.reshape(len(n), len(s), -1)
            turn = n * (places[:, 1] - azimuth)
            waves = np.stack([np.cos(turn)] * 3 + [np.sin(turn)])[which]
            return np.einsum("nec,cne->ce", by_ring[:, ring.ravel()], waves)

        return read

    @property
    def _n(self):
        return np.array(self.harmonics, float)

    def forms(self, n, s):
        """Sanders' strains (N, S, 6, 7) and readings (N, S, 4, 7), of u v w b u' v' b'.

        At `s` in units of the end, as all lengths are. w and b, the turn along the meridian, are
        outward; v and the shears go as sin(n t), the others as cos(n t).
        """
        u, v, w, b, du, dv, db = np.eye(7)
        r, c, S, H = (value[:, None] for value in self._scaled(s))
        n = n[:, None, None]
        dw = H * u - b
        b2 = (n * w + S * v) / r
        db2 = (n * dw + S * dv + c * (H - S / r) * v - c * n * w / r) / r
        e1, e2, g = du + H * w, (n * v + c * u + S * w) / r, dv - (n * u + c * v) / r
        k1, k2, bent = db, (n * b2 + c * b) / r, db2 - (n * b + c * b2) / r
        k12 = bent + (S / r - H) / 2 * (dv + (c * v + n * u) / r)
        # The strains of the faces, at z from the middle, by dz at z = 0.
        xy = (bent - H * dv + S / r * (n * u + c * v) / r) / 2
        read = -w, k1 - H * e1, k2 - S / r * e2, xy
        zero = np.zeros((*np.broadcast_shapes(n.shape, r.shape)[:2], 7))
        strains = e1, e2, g, k1, k2, k12
        return np.stack([zero + e for e in strains], -2), np.stack([zero + e for e in read], -2)

    def _scaled(self, s):
        r, c, S, H = self.meridian.at(s * self.end)
        return r / self.end, c, S, H * self.end

    def _equations(self, n, s):
        """H (N, S, 8, 8) of y' = H y and readings (N, S, 4, 8), where C and the end are units."""
        nu, bending = self.poisson, (self.thickness / self.end) ** 2 / 12
        law = np.zeros((6, 6))
        law[:3, :3] = [[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]]
        law[3:, 3:] = law[:3, :3] * bending
        strains, read = self.forms(n, s)
        r, _, _, H = self._scaled(s)
        A, B = strains[..., :4], strains[..., 4:]
        stress = r[:, None, None] * law
        At, Bt = A.swapaxes(-1, -2) @ stress, B.swapaxes(-1, -2) @ stress
        moved, G = [0, 1, 3], np.linalg.inv(Bt @ B)
        by_q, by_p = -G @ (Bt @ A), np.zeros((*G.shape[:-1], 4))
        by_p[..., moved] = G
        rates = np.concatenate([by_q, by_p], -1)  # u', v' and b'
        M = np.zeros((*G.shape[:2], 8, 8))
        M[..., moved, :] = rates
        M[..., 2, 0], M[..., 2, 3] = H, -1.0  # b is the slope: w' = H u - b
        M[..., 4:, :4] = At @ A
        M[..., 4:, :] += At @ B @ rates
        M[..., 4, 6], M[..., 7, 6] = M[..., 4, 6] - H, M[..., 7, 6] + 1.0
        read_q, read_rates = read[..., :4], read[..., 4:]
        rows = read_rates @ rates
        rows[..., :4] += read_q
        return M, rows

    def _influence(self, s, which):
        """Nodes (M + 1,) and w of each reading's influence, (N, M, stages + 1, readings).

        In segments between nodes, at their beginning and at their Gauss points, of w in m per N on
        a harmonic; lengths are in m.
        """
        even = np.linspace(self.start, self.end, self.segments + 1)
        apart = np.abs(even[:, None] - s).min(1) > 0.3 * (even[1] - even[0])
        apart[[0, -1]] = True
        nodes = np.unique(np.concatenate([even[apart], s]))
        x, table = nodes / self.end, []
        jumped = np.searchsorted(nodes, s)
        for n in self._n:
            steps, inner = self._steps(np.array([n]), x)
            if self.begin == "pole":  # the shares of the four take the place of y there
                steps[0, 0, :, :4], inner[0, 0, :, :4] = self._from_pole(n, x[1])
            _, rows = self._equations(np.array([n]), s / self.end)
            rows = rows[0, :, which]
            jumps = np.zeros((len(x), 8, *rows.shape[:2]))
            for ring, (node, row) in enumerate(zip(jumped, rows, strict=True)):
                jumps[node, :, ring] = np.concatenate([row[:, 4:], -row[:, :4]], 1).T
            at_nodes = self._solved(n, steps[0], jumps.reshape(len(x), 8, -1))
            table.append(np.einsum("mkb,mbr->mkr", inner[0], at_nodes[:-1]))
        scale = np.array([1, *[1 / self.end**2] * 3])[which] / (12 * self.rigidity)
        return nodes, np.stack(table) * np.tile(scale * self.thickness**2, len(s))

    def _steps(self, n, x):
        """Of each segment y at its end (N, M, 8, 8), and w inside (N, M, stages + 1, 8), of y."""
        c, a, weights = _gauss()
        h = np.diff(x)
        at = x[:-1, None] + h[:, None] * c
        M, _ = self._equations(n, at.ravel())
        M = M.reshape(len(n), *at.shape, 8, 8)
        size = 8 * _STAGES
        coupled = np.einsum("m,jk,nmjab->nmjakb", h, a, M).reshape(len(n), len(h), size, size)
        rates = np.linalg.solve(np.eye(size) - coupled, M.reshape(len(n), len(h), size, 8))
        rates = rates.reshape(len(n), len(h), _STAGES, 8, 8)
        end = np.eye(8) + np.einsum("m,k,nmkab->nmab", h, weights, rates)
        inside = np.eye(8)[2] + np.einsum("m,jk,nmkb->nmjb", h, a, rates[..., 2, :])
        begin = np.broadcast_to(np.eye(8)[2], (*inside.shape[:2], 1, 8))
        inside = np.concatenate([begin, inside], 2)
        return end, inside

    def _from_pole(self, n, h):
        """y (8, 4) at `h`, and w (stages + 1, 4) before it, of the four solutions that are smooth.

        They all vanish at the pole but for rigid motions, so that y there does not tell them apart.
        """
        c, a, weights = _gauss()
        M, _ = self._equations(np.array([n]), h * c)
        size = 8 * _STAGES
        M = h * M[0]  # what is solved for is h y'
        coupled = np.eye(size) - np.einsum("jk,jab->jakb", a, M).reshape(size, size)
        held = _POLE[min(int(n), 2)]
        system = np.block([[coupled, -M.reshape(size, 8)], [np.zeros((4, size)), held]])
        smooth = np.linalg.svd(system)[2][-4:].T
        rates, pole = smooth[:size].reshape(_STAGES, 8, 4), smooth[size:]
        inside = (pole + np.tensordot(a, rates, 1))[:, 2]
        return pole + np.tensordot(weights, rates, 1), np.vstack([pole[2], inside])

    def _solved(self, n, steps, jumps):
        """y (M + 1, 8, readings) at the nodes, after their jumps."""
        M, band = len(steps), 11
        size = 8 * (M + 1)
        matrix = np.zeros((2 * band + 1, size))

        def put(row, column, block):
            i, j = np.indices(block.shape)
            matrix[band + row - column + i - j, column + j] = block

        begin = ENDS["free" if self.begin == "pole" else self.begin]
        put(0, 0, begin)
        for m, step in enumerate(steps):
            put(4 + 8 * m, 8 * m, -step)
            put(4 + 8 * m, 8 * m + 8, np.eye(8))
        put(size - 4, size - 8, ENDS[self.edge])
        right = np.zeros((size, jumps.shape[-1]))
        right[4 : size - 4] = jumps[1:].reshape(size - 8, -1)
        right[:4] = begin @ jumps[0]
        return solve_banded((band, band), matrix, right).reshape(M + 1, 8, -1)

    def _shares(self, load, s0, nodes):
        """What the harmonics of an inward load at `s0` weigh the influences with.

        (N, M, stages + 1); their product is the work, but for its sign, of the load.
        """
        s, weights = self._pieces(load, s0, nodes)
        segment = np.clip(np.searchsorted(nodes, s, side="right") - 1, 0, len(nodes) - 2)
        shares = _lagrange((s - nodes[segment]) / np.diff(nodes)[segment])
        spread = np.zeros((len(s), len(nodes) - 1, _STAGES + 1))
        spread[np.arange(len(s)), segment] = shares
        return (weights @ spread.reshape(len(s), -1)).reshape(-1, *spread.shape[1:])

    def _pieces(self, load, s0, nodes):
        """Places (Q,) along the meridian and the force (N, Q) in N of each harmonic there."""
        n = self._n[:, None]
        if not load.radius:
            return np.array([s0]), load.force * np.where(n, 1, 0.5) / np.pi
        c = load.radius
        low, high = abs(s0 - c), s0 + c
        middle, half = (low + high) / 2, (high - low) / 2
        inner = nodes[(nodes > low) & (nodes < high)]
        # By an angle, as the width of the disc goes as a root at both ends.
        s, weights = _composite(np.arcsin(np.clip((inner - middle) / half, -1, 1)), np.pi / 2)
        s, weights = middle + half * np.sin(s), weights * half * np.cos(s)
        if s0 < c:  # parallels that lie in the disc whole
            inner = nodes[(nodes > 0) & (nodes < low)]
            whole, more = _composite(inner - low / 2, low / 2)
            s, weights = np.append(whole + low / 2, s), np.append(more, weights)
        wide = self._half_width(s, s0, c)
        arcs = weights * self.meridian.at(s)[0] / np.pi
        force = np.where(n, 2 * np.sin(n * wide) / np.maximum(n, 1), wide) * arcs
        total = np.sum(2 * np.pi * force[0])
        return s, np.where(s < self.end, force, 0.0) * load.force / total

    def _half_width(self, s, s0, c):
        """Azimuth (Q,) in rad to either side of the parallels at `s` within geodesic `c` of `s0`.

        A geodesic is taken for an arc of the curvature that it has at `s0`: on a sphere it is.
        """
        middle = self.meridian.points(s0, 0.0)
        _, cos, sin, _ = self.meridian.at(s0)
        normal = np.array([sin, 0.0, cos])
        r, _, z = self.meridian.points(s, 0.0).T
        low, high = np.zeros_like(s), np.full_like(s, np.pi)
        for _ in range(50):
            azimuth = (low + high) / 2
            to = np.stack([r * np.cos(azimuth), r * np.sin(azimuth), z], -1) - middle
            chord2 = np.maximum(np.sum(to**2, -1), 1e-30)
            bend = np.abs(to @ normal) / np.sqrt(chord2)  # sine of half of the arc's angle
            arc = np.sqrt(chord2) * np.where(bend > 1e-6, np.arcsin(bend) / (bend + 1e-300), 1.0)
            low, high = np.where(arc < c, (azimuth, high), (low, azimuth))
        return (low + high) / 2


def _discs(load):
    """Loads over discs that are the `load` together: of radius c c^3 exp(-c^2 / 2 sd^2) / 2 sd^4.

    That is a Gaussian's share of them, u exp(-u) by u = c^2 / 2 sd^2.
    """
    if not load.sd:
        return [load]
    u, shares = roots_genlaguerre(8, 1)
    return [
        replace(load, sd=0.0, radius=load.sd * np.sqrt(2 * each), force=load.force * share)
        for each, share in zip(u, shares, strict=True)
    ]


def _composite(breaks, half):
    """Gauss points and weights (Q,) over [-half, half] in pieces between the `breaks`."""
    ends = np.concatenate([[-half], np.sort(breaks), [half]])
    at, weights = leggauss(8)
    middle, wide = (ends[1:] + ends[:-1])[:, None] / 2, np.diff(ends)[:, None] / 2
    return (middle + wide * at).ravel(), (wide * weights).ravel()


def _gauss():
    """Gauss points c on [0, 1], integrals a_jk from 0 to c_j of the polynomial k, weights b."""
    at, weights = leggauss(_STAGES)
    c = (at + 1) / 2
    powers = np.arange(_STAGES)
    fit = np.linalg.inv(np.vander(c, increasing=True))
    return c, (c[:, None] ** (powers + 1) / (powers + 1)) @ fit, weights / 2


def _lagrange(t):
    """Values (Q, stages + 1) at `t` of the polynomials through 0 and the Gauss points of [0, 1]."""
    c = np.append(0, _gauss()[0])
    apart = t[:, None, None] - c + np.zeros((len(c), 1))
    gaps = c[:, None] - c
    own = np.eye(len(c), dtype=bool)
    return np.prod(np.where(own, 1, apart), -1) / np.prod(np.where(own, 1, gaps), -1)
