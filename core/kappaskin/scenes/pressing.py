"""A scene and a time to the forces on its skin."""

from typing import NamedTuple

import numpy as np

from kappaskin.frames import Array
from kappaskin.mechanics import Indentation, IndentationSolver, Load, Plate, PointLoad
from kappaskin.scenes.scene import Scene
from kappaskin.scenes.stimulus import Indenter, contact_of


class Pressed(NamedTuple):
    """What presses at one moment: modal `force` (Ri, Rj) in N, and the `contact` (2,) in m.

    That is the centre of force, NaN where nothing touches. `loads` make the force: those of the
    scene, or a point load wherever a rigid object bears.
    """

    force: Array
    contact: Array
    loads: tuple[Load, ...]


class Pressing:
    """What presses on the skin of `scene`, as if it were `plate`, at one time after the other.

    A rigid object is sought from where it was: asked in order, that is quick.
    """

    def __init__(self, scene: Scene, plate: Plate) -> None:
        self._plate, self._basis = plate, scene.basis
        self._press: IndentationSolver | None = None
        self._last: Indentation | None = None
        self.take(scene)

    def take(self, scene: Scene) -> None:
        """Go on with what touches the same skin in another `scene`."""
        self._scene, self._indenter = scene, scene.indenter
        if self._indenter and self._press is None:
            self._press = IndentationSolver(self._plate, self._basis)

    def __call__(self, time: float) -> Pressed:
        """What presses at `time` in s."""
        stimulus = self._indenter
        if stimulus is None or self._press is None or not isinstance(stimulus.what, Indenter):
            loads = self._scene.loads_at(time)
            force = np.zeros(self._basis.shape) if not loads else loads[0].modal(self._basis)
            for load in loads[1:]:
                force = force + load.modal(self._basis)
            return Pressed(force, contact_of(loads), loads)
        pose = stimulus.pose_at(time)
        if not pose.amount:
            return Pressed(np.zeros(self._basis.shape), np.full(2, np.nan), ())
        self._last = found = stimulus.what.into(self._press, pose, self._last)
        bearing = found.forces > 0
        places = zip(found.points[bearing].tolist(), found.forces[bearing].tolist(), strict=True)
        loads = tuple(PointLoad(x, y, force) for (x, y), force in places)
        return Pressed(found.modal, found.centre, loads)
