"""A scene to what it does to its skin, before anything spoils the readings."""

import numpy as np

from kappaskin.effects import Survey
from kappaskin.scene.scene import Scene

_MOMENTS = 48  # evenly over the scene, besides those at which a motion changes
_LONGEST = 60.0  # s of a scene that nothing repeats in: what drifts has this long to do so
_STEP = 1e-3  # s over which a rate is told


def survey(scene: Scene) -> Survey:
    """Look at `scene` at some fifty moments of one repetition."""
    basis, layout, duration = scene.basis, scene.layout, scene.duration
    times = np.unique([*np.arange(_MOMENTS) * duration / _MOMENTS, *scene.moments])
    M = layout.curvature_operator(basis)
    compliance = scene.plate.compliance(basis)
    shape = len(times), 3, len(layout)

    def forces_at(moments: np.ndarray) -> np.ndarray:
        found = np.zeros((len(moments), basis.size))
        for force, time in zip(found, moments.tolist(), strict=True):
            for load in scene.loads_at(time):
                force += load.modal(basis).ravel()
        return found

    forces = forces_at(times)
    c = compliance.after(forces)
    later = compliance.after(forces_at(times + _STEP)) if scene.moves else c
    curvature = (c @ M.T).reshape(shape)
    if scene.laid is not None:
        laid = [np.repeat(scene.laid.curvature(t), len(layout)) for t in times.tolist()]
        curvature = np.reshape(laid, shape)
    return Survey(
        scene.plate,
        basis,
        layout,
        scene.transduction,
        times,
        forces,
        c,
        curvature,
        float(np.abs((later - c) @ M.T).max(initial=0.0)) / _STEP,
        duration if scene.moves or scene.laid else _LONGEST,
        scene.sensor().scan().duration,
    )
