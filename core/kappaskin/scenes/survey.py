"""A scene to what it does to its skin, before anything spoils the readings."""

from dataclasses import replace

import numpy as np

from kappaskin.scenes.effects.survey import Survey
from kappaskin.scenes.pressing import Pressing
from kappaskin.scenes.scene import Scene

_MOMENTS = 48  # evenly over the scene, besides those of its motions and those halfway
_LONGEST = 60.0  # s of a scene that nothing repeats in: what drifts has this long to do so
_STEP = 1e-3  # s over which a rate is told; less of a motion that is as fast


def moments_of(scene: Scene) -> list[float]:
    """Times in s, upwards, at which to look at a scene to have seen all of it."""
    if not (scene.moves or scene.laid):
        return [0.0]
    evenly = np.arange(_MOMENTS) * scene.duration / _MOMENTS
    each = [np.array(s.motion.moments) for s in scene.stimuli if s.motion]
    fastest = [(moments[1:] + moments[:-1]) / 2 for moments in each]  # of what eases
    laid = scene.laid.middles if scene.laid else []
    return np.unique(np.concatenate([evenly, *each, *fastest, laid])).tolist()


def time_to_watch(scene: Scene) -> float:
    """Seconds after which nothing new is to be seen of a scene, or all that counts has drifted."""
    return scene.duration if scene.moves or scene.laid else _LONGEST


def survey(scene: Scene) -> Survey:
    """Look at `scene` all over one repetition."""
    basis = scene.basis
    layout = replace(scene.layout, gage_length=0.0)
    times = np.array(moments_of(scene))
    M = layout.curvature_operator(basis)
    compliance = scene.plate.compliance(basis)
    pressing = Pressing(scene, scene.plate)
    step = min([_STEP, *(np.diff(s.motion.moments).min() / 4 for s in scene.stimuli if s.motion)])
    pairs = [(pressing(t), pressing(t + step) if scene.moves else None) for t in times.tolist()]
    forces = np.array([now.force.ravel() for now, _ in pairs])
    later = np.array([(then or now).force.ravel() for now, then in pairs])
    c = compliance.after(forces)
    curvature = (c @ M.T).reshape(len(times), 3, len(layout))
    if scene.laid is not None:
        laid = [np.repeat(scene.laid.curvature(t), len(layout)) for t in times.tolist()]
        curvature = np.reshape(laid, curvature.shape)
    scan, read_after = scene.sensor().scan(), np.zeros(3 * len(layout))
    read_after[scan.channels] = scan.times
    return Survey(
        scene.plate,
        basis,
        layout,
        scene.transduction,
        times,
        forces,
        c,
        curvature,
        np.abs(compliance.after(later - forces) @ M.T).max(axis=0) / step,
        time_to_watch(scene),
        read_after,
    )
