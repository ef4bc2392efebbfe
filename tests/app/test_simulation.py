from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin import LineLoad, PointLoad, load_scene
from kappaskin_app.settings import LOAD_CASES, Settings
from kappaskin_app.simulation import dragged, scene_of

CASES = [case for case, _ in LOAD_CASES]


@pytest.mark.parametrize("case", ["circle", "centre", "off-centre", "line"])
def test_a_ready_case_is_the_ready_scene(case: str) -> None:
    assert scene_of(Settings(load_case=case)).loads == load_scene(case).loads


def test_free_cases_press_where_they_are_told() -> None:
    settings = Settings(x=0.02, y=0.03, x_end=0.08, y_end=0.07, force=0.2)
    loads = {case: scene_of(replace(settings, load_case=case)).loads for case in CASES}
    assert loads["point"] == (PointLoad(0.02, 0.03, 0.2),)
    assert loads["two-points"] == (PointLoad(0.02, 0.03, 0.1), PointLoad(0.08, 0.07, 0.1))
    assert loads["free-line"] == (LineLoad(0.02, 0.03, 0.08, 0.07, 0.2),)


def test_no_noise_means_no_effect() -> None:
    assert scene_of(Settings(noise_kind="none")).effects == ()
    assert scene_of(Settings(noise_rms=0.0)).effects == ()


@given(
    st.sampled_from(CASES),
    st.tuples(*[st.floats(-1, 1)] * 2),
    st.tuples(*[st.floats(0, 0.1)] * 4),
    st.booleans(),
)
def test_a_dragged_load_stays_on_the_skin(
    case: str, to: tuple[float, float], ends: tuple[float, ...], end: bool
) -> None:
    x, y, x_end, y_end = ends
    settings = Settings(load_case=case, x=x, y=y, x_end=x_end, y_end=y_end)
    scene = scene_of(replace(settings, **dragged(settings, *to, end)))
    for load in scene.loads:
        load.check(scene.plate.patch)


def test_a_dragged_point_is_where_it_was_dragged_to() -> None:
    settings = Settings(load_case="circle")
    (load,) = scene_of(replace(settings, **dragged(settings, 0.031, 0.062, False))).loads
    assert np.allclose(load.centre(), [0.031, 0.062])
