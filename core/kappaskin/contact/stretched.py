"""A load on a skin that stretches: its readings, linearised about the shape that the skin has."""

import numpy as np

from kappaskin.bases import ORDERS, basis_for
from kappaskin.frames import Array
from kappaskin.mechanics import Plate, Stretching
from kappaskin.sensing import SensorLayout

# With C the compliance in bending and f(q) the forces of the membrane, a load F at (x, y) gives the
# skin the shape q + C f(q) = F C t, where t is what each function feels at (x, y), and the readings
# F T - M C f(q), where T are those of a unit load on a skin that does not stretch. About a shape q0
# with the forces f0 and their derivatives K it is linear in F, F dx and F dy:
#     q = q0 + d + F g + F dx g_x + F dy g_y   with   (I + C K) (d, g, g_x, g_y) =
#                                                     (-q0 - C f0, C t, C t_x, C t_y).
# Only as many functions as a membrane feels take part: it smooths what bends it.
_FUNCTIONS = 8  # along each side
_XX, _YY = ORDERS.index((2, 0)), ORDERS.index((0, 2))


class StretchedSkin:
    """The shape of a skin of known thickness under a load, step by step with the load's search."""

    def __init__(self, plate: Plate, layout: SensorLayout, edge: str) -> None:
        self._basis = basis_for(
            plate.patch, edge, _FUNCTIONS, 1 if plate.patch.strip else _FUNCTIONS
        )
        self._stretching = Stretching(plate, self._basis)
        compliance = plate.compliance(self._basis)
        self._C = compliance.after(np.eye(self._basis.size))
        self._readings = compliance.after(layout.operator(self._basis))
        self._q, self._change = np.zeros(self._basis.size), np.zeros((4, self._basis.size))

    def begin(self, x: float, y: float, displacement: float) -> None:
        """Begin with the shape under a load at (x, y) in m, of this `displacement` there in m."""
        t = self._basis.jet(x, y, 0)[0]
        shape = self._C @ t
        self._q = shape * (displacement / float(t @ shape))

    def stretch(self, x: float, y: float, s: float, unit: float, rows: Array) -> None:
        """Turn readings and derivatives `rows` (5, C) of a load of `unit` N into the skin's.

        The load is spread over a disc of radius sqrt(s) in m. The last row, what the elements read,
        becomes what is linear in the load.
        """
        shape, C = self._basis.shape, self._C
        f = self._stretching.force(self._q.reshape(shape)).ravel()
        K = self._stretching.tangent(self._q.reshape(shape))
        jet = self._basis.jet(x, y)
        felt = unit * jet[:3]
        felt[0] += unit * s / 8 * (jet[_XX] + jet[_YY])
        right = np.vstack([-self._q - C @ f, felt @ C])
        self._change = np.linalg.solve(np.eye(len(C)) + C @ K, right.T).T
        relief = self._change @ K
        rows[4] += self._readings @ (f + relief[0])
        rows[:3] -= relief[1:] @ self._readings.T

    def move(self, force: float, dx: float, dy: float) -> None:
        """Take the step to a load of `force` units, `force` times dx and dy further."""
        self._q = self._q + np.array([1.0, force, dx, dy]) @ self._change

    def more(self, x: float, y: float, force: float) -> float:
        """Displacement in m under `force` N at (x, y), less that of a skin that only bends."""
        t = self._basis.jet(x, y, 0)[0]
        return float(t @ (self._q - force * (self._C @ t)))
