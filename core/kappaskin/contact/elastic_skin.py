"""From point forces to what the elements read and how far the skin gives, finely resolved."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from kappaskin.bases import basis_for
from kappaskin.contact.rigid_contacts import PointForces
from kappaskin.errors import Refusal
from kappaskin.frames import Array, Mask
from kappaskin.mechanics import Plate
from kappaskin.sensing import SensorLayout

_MOST = 2000  # elements: 100 MB
_SEARCHED = np.array([0.025, 0.045, 0.07, 0.1, 0.14, 0.19, 0.26, 0.35])  # of the shorter side
_ANGLES = 16
_SOFT, _HEAVY = 1e-7, 1e3  # of a compliance: keep places apart, and the sum of the forces

_BLUR = 0.11  # of `bend` times the force, one half wave away: measured against 301 x 301 functions
_FALL = 1.6  # the power with which that falls


class ElasticSkin:
    """A plate with elements on it, answering to point forces."""

    def __init__(self, plate: Plate, layout: SensorLayout, edge: str, functions: int) -> None:
        patch = plate.patch
        if patch.strip:
            raise Refusal(
                "a strip bends along x alone: expected a skin with two sides to tell objects by"
            )
        if not plate.rigidity:
            raise Refusal("a drum head has no curvature to tell objects by: expected a rigidity")
        if len(layout) > _MOST:
            raise Refusal(
                f"expected at most {_MOST} elements to tell objects by, got {len(layout)}"
            )
        self.patch, self.side, self._layout = patch, min(patch.a, patch.b), layout
        self._basis = basis_for(patch, edge, functions, functions)
        self._compliance = plate.compliance(self._basis)
        # Most of the time goes into reading it: half of the memory.
        M = self._compliance.after(layout.curvature_operator(self._basis))
        self._M: NDArray[np.float32] = M.astype(np.float32)
        self.half_wave = max(patch.a, patch.b) / functions
        self.bend = 1 / (4 * math.pi * plate.rigidity)
        """What the curvature inside a ring or an arc loses per N and e-fold of its size, in 1/m."""

    def _on_skin(self, points: Array) -> Array:
        return np.array([self.patch.inward(x, y) for x, y in points.tolist()])

    def _felt(self, points: Array) -> Array:
        return self._basis.at(self._on_skin(points))

    def readings(self, forces: PointForces) -> tuple[Array, Array]:
        """Curvature (R,) in 1/m of all channels, and its derivatives (R, n)."""
        points = self._on_skin(forces.points)
        f, fx, fy = (self._basis.at(points, *order) for order in ((0, 0), (1, 0), (0, 1)))
        moved = forces.weights * forces.moves.transpose(2, 0, 1)
        modal = np.vstack([forces.weights @ f, forces.growth @ f + moved[0] @ fx + moved[1] @ fy])
        answer = (self._M @ modal.T.astype(np.float32)).astype(float)
        return answer[:, 0], answer[:, 1:]

    def gives(self, forces: PointForces, points: Array) -> Array:
        """Displacement (k,) in m at `points` (k, 2)."""
        modal = forces.weights @ self._felt(forces.points)
        return self._felt(points) @ self._compliance.after(modal[None])[0]

    def pressed(self, points: Array, gap: Array, force: float) -> Array:
        """Forces (k,) in N, none below zero, of a rigid object that presses with `force` in all.

        Its surface lies `gap` (k,) in m behind its tip at `points` (k, 2).
        """
        from scipy.optimize import nnls  # slow to import, and seldom needed

        felt = self._felt(points)
        G = self._compliance.after(felt) @ felt.T
        G[np.diag_indices_from(G)] *= 1 + _SOFT
        L = linalg.cholesky(G, lower=True)
        # The least p'Gp / 2 + p'gap with a given sum: the sum as one more, heavy row.
        heavy = _HEAVY * math.sqrt(G.max())
        A = np.vstack([L.T, np.full(len(gap), heavy)])
        b = np.append(linalg.solve_triangular(L, -gap, lower=True), heavy * force)
        return nnls(A, b)[0]

    def unresolved(self, forces: PointForces) -> Array:
        """Variance (R,) in 1/m^2 of what finer functions would add to the readings.

        Only an element within a half wave or two of a force sees it.
        """
        apart = self._layout.positions[:, None] - forces.points
        waves = np.hypot(apart[..., 0], apart[..., 1]) / self.half_wave
        blur = (_BLUR * self.bend * forces.weights) ** 2 * np.maximum(waves, 0.2) ** (-2 * _FALL)
        return np.tile(blur.sum(axis=1), 3)

    def best_pair(self, around: Array, readings: Array, used: Mask) -> tuple[Array, Array]:
        """The two points (2, 2) in m near `around` whose pushes explain the readings best.

        With their forces (2,) in N, of one sign. `readings` (R,) are zero where not `used`.
        """
        angles = 2 * np.pi * np.arange(_ANGLES) / _ANGLES
        out = np.stack([np.multiply.outer(_SEARCHED, f(angles)).ravel() for f in (np.cos, np.sin)])
        points = self._on_skin(around + self.side * np.vstack([np.zeros(2), out.T]))
        T = (self._felt(points) @ self._M.T) * used
        G, h = T @ T.T, T @ readings
        own = np.diag(G)
        squares = np.multiply.outer(own, own)
        det = squares - G**2
        det[det <= 1e-6 * squares] = np.inf  # one and the same point
        # Both forces of every pair at once, by Cramer's rule.
        one = (np.multiply.outer(h, own) - h * G) / det
        two = one.T
        explained = np.where(one * two > 0, one * h[:, None] + two * h, -np.inf)
        i, j = np.unravel_index(int(np.argmax(explained)), explained.shape)
        return points[[i, j]], np.array([one[i, j], two[i, j]])
