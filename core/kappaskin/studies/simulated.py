"""A scene to arrays: every reading of so many frames, with the truth beside it."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kappaskin.errors import Refusal
from kappaskin.scenes import Scene, Simulator, plan

_MOST = 10_000_000  # readings: 80 MB for each array of them


def simulated_readings(
    scene: Scene, frames: int, seed: int | None = None
) -> dict[str, NDArray[Any]]:
    """Frames of `scene`: what `kappaskin simulate` writes, each array (T, ...).

    A frame that the link loses is NaN in `curvature` and -1 in `counts`, on all its channels.
    """
    P, skin = len(scene.layout), scene.plate.patch
    if not 1 <= frames <= _MOST // (3 * P):
        raise Refusal(f"expected 1 to {_MOST // (3 * P)} frames of {3 * P} channels, got {frames}")
    scene = scene if seed is None else replace(scene, seed=seed)
    simulator, scan = Simulator(scene), scene.sensor().scan()
    time = np.arange(frames) / scene.rate
    curvature = np.full((frames, 3 * P), np.nan)
    counts = np.full((frames, 3 * P), -1, np.int32)
    truth = np.full((frames, *scene.basis.shape), np.nan)
    contact = np.full((frames, 2), np.nan)
    for n, moment in enumerate(time.tolist()):
        true, reading = simulator.reading(scan, moment)
        if true is not None:
            truth[n], contact[n] = true.coefficients, true.contact
        if not simulator.failure(n):
            curvature[n] = reading
            counts[n] = scene.transduction.counts(reading)
    size = (skin.a,) if skin.strip else (skin.a, skin.b)
    places = scene.layout.positions
    return {
        "counts": counts.reshape(frames, 3, P),
        "curvature": curvature.reshape(frames, 3, P),
        "truth": truth,
        "time": time,
        "contact": contact,
        "plan": np.array(json.dumps([entry.to_json() for entry in plan(scene)])),
        "size": np.array(size),
        "positions": places[:, :1] if skin.strip else places,
        "radius": np.array(skin.radius),
    }
