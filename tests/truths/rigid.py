"""A rigid object on a hinged plate: where it bears, by nonnegative least squares.

It shares no code with the library that it tests. Forces F >= 0 on even tiles of a grid leave a gap
g = G F - (d - h) >= 0 under an object whose underside is h above its lowest point at the depth d,
and F g = 0. These are the conditions of the least of |L'F - L^-1 (d - h)| with G = L L', F >= 0.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from navier import HingedPlate, Load


def ball(radius):
    """Height in m of a ball's underside over its lowest point, of dx and dy in m."""
    return lambda dx, dy: radius - np.sqrt(np.maximum(radius**2 - dx**2 - dy**2, 0))


@dataclass(frozen=True, eq=False)
class Pressed:
    """Forces (n,) in N on tiles around `places` (n, 2) in m.

    There the plate is displaced by `moved` (n,) in m, and the gap (n,) in m is left. A tile is
    taken as a disc of the same area, of `radius` in m.
    """

    plate: HingedPlate
    places: np.ndarray
    radius: float
    forces: np.ndarray
    moved: np.ndarray
    gap: np.ndarray

    @property
    def force(self):
        """The whole force in N."""
        return self.forces.sum()

    @property
    def energy(self):
        """Energy in J of the bent plate."""
        return self.forces @ self.moved / 2

    def readings(self, elements, gage_length=0.0):
        """Curvature xx, yy, xy (3, P) in 1/m at `elements` (P, 2) in m, as `HingedPlate`'s."""
        bearing = np.flatnonzero(self.forces)
        loads = [Load(*self.places[i], self.forces[i], self.radius) for i in bearing]
        c = sum(self.plate.coefficients(load) for load in loads)
        return self.plate.curvature(c, elements, gage_length)


class Compliance:
    """How a plate gives under forces at the tiles of a square grid.

    The grid has `count` x `count` tiles of `pitch` in m around (x, y) in m; tile means of the
    displacement (n, n) in m/N are those of discs of the same area.
    """

    def __init__(self, plate, x, y, pitch, count):
        steps = pitch * (np.arange(count) - (count - 1) / 2)
        self.plate, self.middle, self.radius = plate, np.array([x, y]), pitch / np.sqrt(np.pi)
        self.places = self.middle + np.stack(np.meshgrid(steps, steps), -1).reshape(-1, 2)
        spread = plate.mean(Load(0.0, 0.0, radius=self.radius))
        softness = spread**2 / plate.stiffness
        # G of two tiles: products of sines at both in x, and in y, with the softness between.
        (k, l), lines = plate.waves(), self.middle + steps[:, None]
        X, Y = np.sin(np.outer(lines[:, 0], k)), np.sin(np.outer(lines[:, 1], l))
        XX, YY = ((S[:, None] * S).reshape(count**2, -1) for S in (X, Y))
        G = (XX @ softness @ YY.T).reshape((count,) * 4)
        self.G = G.transpose(2, 0, 3, 1).reshape(count**2, count**2)

    def press(self, height, depth):
        """What bears where an object of that `height` of dx and dy is `depth` in m deep."""
        bare = depth - height(*(self.places - self.middle).T)
        L = np.linalg.cholesky((self.G + self.G.T) / 2)
        forces, _ = nnls(L.T, np.linalg.solve(L, bare), maxiter=50 * len(L))
        moved = self.G @ forces
        return Pressed(self.plate, self.places, self.radius, forces, moved, moved - bare)
