"""A scene to a file of readings, with the truth beside them."""

import sys
from pathlib import Path

from kappaskin.cli.common import Whole, save_arrays
from kappaskin.scenes import load_scene
from kappaskin.studies import simulated_readings


def simulate(scene: str = "", *, frames: Whole, out: Path, seed: Whole | None = None) -> None:
    """Simulate a scene into an NPZ file.

    It has `counts` and `curvature` (T, 3, P), the `truth` (T, Ni, Nj) in m, `time` (T,) in s, the
    `contact` (T, 2) in m, NaN where nothing touches or a frame was lost, and the `plan` as JSON.
    The same seed gives the same bytes.

    Example: `kappaskin simulate tapping --frames 1000 --out taps.npz`

    Parameters
    ----------
    scene
        The name of a ready scene, or a file that ends in .toml; the default one when left out.
    frames
        How many frames.
    seed
        The seed of all that is random; the scene's own when left out.
    out
        The file to write.
    """
    found = simulated_readings(load_scene(scene), frames, seed)
    save_arrays(out, found)
    print(f"{out}: {frames} frames", file=sys.stderr)
