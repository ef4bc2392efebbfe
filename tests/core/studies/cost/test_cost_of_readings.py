"""Cost of accuracy with elements that read heights or slopes."""

import numpy as np
import pytest

from kappaskin.scenes import load_scene
from kappaskin.studies import Cost, Setting, costs, effect_costs, usual_setting

# At the centres of an m x n tiling the sines, and their slopes, are orthogonal: with a noise of s
# the coefficients of heights vary by 4 s^2 / (m n), and those of slopes along x and y by that over
# k_i^2 + k_j^2. Each function has a mean square of 1/4 over the skin.
_N = 15  # functions along each side, as many as the true shape has: the noise is all the error


def _cost(name, elements, scanned="all"):
    setting = Setting("least-squares", (_N, _N), elements, scanned=scanned)
    (found,) = costs(load_scene(name), [setting])
    assert isinstance(found, Cost), found
    return found


@pytest.mark.parametrize("m", [20, 30])
def test_the_error_of_heights_is_that_of_their_noise(m):
    found = _cost("camera", (m, m))

    assert found.channels == m * m
    assert found.conversion_time == 0
    assert found.rms_exact < 1e-6 * found.rms
    np.testing.assert_allclose(found.rms, 5e-6 * _N / m, rtol=0.03)


def test_the_error_of_slopes_is_that_of_their_noise():
    m, side, s = 20, 0.1, 5e-4
    k = np.arange(1, _N + 1) * np.pi / side
    expected = s / m * np.sqrt(np.sum(1 / np.add.outer(k**2, k**2)))

    found = _cost("tilts", (m, m))

    assert found.channels == 2 * m * m
    np.testing.assert_allclose(found.rms, expected, rtol=0.08)


def test_half_of_the_heights_are_scanned():
    setting = Setting("least-squares", (8, 8), (20, 20), scanned="half")
    (found,) = costs(load_scene("camera"), [setting])

    assert isinstance(found, Cost)
    assert found.channels == 200


@pytest.mark.parametrize("name", ["camera", "tilts"])
def test_the_noise_of_heights_and_slopes_has_a_cost(name):
    scene = load_scene(name)
    found = {cost.name: cost for cost in effect_costs(scene, usual_setting(scene))}

    noise = found["gaussian-noise"]
    assert noise.rms_with > noise.rms_without
    assert "quantisation" in found
