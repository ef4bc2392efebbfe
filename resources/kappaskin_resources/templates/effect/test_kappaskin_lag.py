from pathlib import Path

import numpy as np
from kappaskin import load_scene
from kappaskin.scenes.effects import EFFECTS
from kappaskin_lag import LagEffect


def test_readings_follow_a_step():
    read = LagEffect(time_constant=0.1).start((3, 1), np.random.default_rng(0))
    read(np.full((3, 1), 1.0), 0.0)

    assert np.allclose(read(np.full((3, 1), 2.0), 0.1), 2 - np.exp(-1))


def test_a_scene_names_it():
    scene = load_scene(str(Path(__file__).with_name("lag.toml")))

    assert EFFECTS["lag"] is LagEffect
    assert LagEffect(time_constant=0.05) in scene.effects
