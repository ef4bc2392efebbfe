import re
import tomllib
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from PySide6.QtWidgets import QApplication

from kappaskin import Refusal, load_scene, planned, read_scene
from kappaskin.scenes import SCENES, scene_file
from kappaskin_app.features.scene import scene_text
from kappaskin_app.features.scene.editing import SceneEditing
from kappaskin_app.features.scene.scene_text import OFF, ON, PLANNED, forced, shifted
from kappaskin_app.shell.history import History
from kappaskin_app.shell.loads import GrabbedStimulus, loads_at
from kappaskin_app.shell.selection import LoadHandle
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.settings.scene import Written

READY = [name for name in SCENES if load_scene(name).stimuli]


def text_of(name: str) -> str:
    return scene_file(name).read_text(encoding="utf-8")


def read(text: str, name: str):
    return read_scene(text, scene_file(name))


@pytest.mark.cases(
    "camera", "demo", "failing-elements", "fingertip", "long-gages", "saddle", "slipping", "sphere"
)
@pytest.mark.parametrize("name", SCENES)
def test_an_effect_forced_on_or_off_is_and_the_rest_of_the_scene_stays(name) -> None:
    scene, text = load_scene(name), text_of(name)
    for how, kept in ((ON, True), (OFF, False)):
        changed = read(forced(text, "quantisation", how), name)
        assert ("quantisation" not in planned(changed).choice.off) == kept
        assert changed.effects == scene.effects
        for time in (0.0, 0.7):
            assert _drawn(changed, time) == _drawn(scene, time)
        assert changed.choice.accuracy == scene.choice.accuracy


def test_an_effect_left_to_the_plan_again_is_forced_no_more() -> None:
    text = text_of("pencil")
    on = forced(text, "quantisation", ON)
    assert read(on, "pencil").choice.on == {"quantisation"}
    off = forced(on, "quantisation", OFF)
    assert (read(off, "pencil").choice.on, read(off, "pencil").choice.off) == (
        frozenset(),
        {"quantisation"},
    )
    again = read(forced(off, "quantisation", PLANNED), "pencil").choice
    assert not again.on | again.off
    assert again.auto


def test_in_a_list_of_effects_one_is_forced_by_being_in_it() -> None:
    listed = text_of("centre").replace('choose = "linear"', 'choose = ["uniform-noise"]')
    on = read(forced(listed, "quantisation", ON), "centre").choice
    assert on.on == {"uniform-noise", "quantisation"}
    for how in (OFF, PLANNED):
        assert "uniform-noise" not in read(forced(listed, "uniform-noise", how), "centre").choice.on


def test_comments_and_order_stay() -> None:
    text = text_of("pencil")
    changed = forced(shifted(text, 0, 0.001, -0.002), "saturation", OFF)
    assert "# frames/s: a rigid object takes milliseconds to compute" in changed
    resting = re.sub(r"path = \[.*?\n\]\n", "", text, flags=re.DOTALL)
    assert resting != text
    there = [line for line in resting.splitlines() if not line.startswith(("x =", "y ="))]
    left = iter(changed.splitlines())
    assert all(line in left for line in there)


@pytest.mark.parametrize("name", READY)
def test_a_touch_that_is_shifted_in_the_text_is_where_it_was_dragged_to(name) -> None:
    scene = load_scene(name)
    start = loads_at(scene, _pressed_at(scene))[0]
    x, y = start.load.centre().tolist()
    held = GrabbedStimulus.at_place(scene, _pressed_at(scene), x, y)
    assert held is not None
    moved = held.moved_to(x + 1e-3, y)
    assert held.moved
    text = shifted(text_of(name), held.number, *held.by)
    written = read(text, name)
    for time in (0.0, 0.3, _pressed_at(scene)):
        there = [touch.load.centre() for touch in loads_at(written, time)]
        expected = [touch.load.centre() for touch in loads_at(moved, time)]
        assert np.allclose(there, expected, atol=1e-6)


def test_the_only_touch_is_shifted_where_it_is_no_array_as_well() -> None:
    text = text_of("tapping").replace("[[touch]]", "[touch]")
    assert read(shifted(text, 0, 0.001, 0.0), "tapping").stimuli[0].what.x == 0.061


def _drawn(scene, time: float) -> list[object]:
    return [touch.load for touch in loads_at(scene, time)]


def _pressed_at(scene) -> float:
    """A time in s at which something presses."""
    times = np.linspace(0, scene.duration, 50, endpoint=False).tolist()
    return next(time for time in times if loads_at(scene, time))


@pytest.mark.parametrize(
    ("name", "most"),
    [("sphere", 0.1), ("line", 0.1), ("two-contacts", 0.08), ("fingertip-cap", 0.01844)],
)
def test_a_touch_stops_at_the_rim(name: str, most: float) -> None:
    scene = load_scene(name)
    held = GrabbedStimulus.at_place(scene, _pressed_at(scene), 0.05, 0.05)
    assert held is not None
    held.moved_to(0.055, 0.05)
    load = held.moved_to(5.0, 0.05).stimuli[held.number].what
    reached = load.x1 if name == "line" else load.x
    assert reached == pytest.approx(most, abs=2e-4)
    read(shifted(text_of(name), held.number, *held.by), name)  # the text is a scene too


def test_a_touch_that_is_held_rests_with_its_whole_force() -> None:
    scene = load_scene("fingertip-cap")
    held = GrabbedStimulus.at_place(scene, 2.7, 0.009, 0.011)  # nothing presses then
    assert held is not None
    assert held.moved
    for played in (
        held.resting,
        read(shifted(text_of("fingertip-cap"), held.number, *held.by), ""),
    ):
        for time in (0.0, 2.7, 5.9):
            load = next(each.load for each in loads_at(played, time) if each.number == held.number)
            assert load.centre() == pytest.approx((0.009, 0.011))
            assert load.force == 0.1
    grabbed = GrabbedStimulus.at_place(scene, 4.0, 0.01, 0.01)
    assert grabbed is not None
    (rolling,) = loads_at(scene, 4.0)
    assert not grabbed.moved  # it stands where it was until it is moved
    assert grabbed.resting.stimuli[2].what.centre() == pytest.approx(rolling.load.centre())


def test_of_two_touches_the_nearer_one_is_held() -> None:
    scene = load_scene("two-contacts")
    time = _pressed_at(scene)
    for touch in loads_at(scene, time):
        held = GrabbedStimulus.at_place(scene, time, *touch.load.centre().tolist())
        assert held is not None
        assert held.number == touch.number


def test_what_lies_on_cylinders_has_nothing_to_hold() -> None:
    assert GrabbedStimulus.at_place(load_scene("calibration"), 0.0, 0.05, 0.05) is None


def test_own_scenes_need_no_file(tmp_path: Path) -> None:
    scene = read_scene(forced(text_of("centre"), "saturation", OFF), tmp_path / "own.toml")
    assert scene.name == "own"
    assert replace(scene, name="centre").choice.off == {"saturation", "finite-slope"}


def test_a_text_that_cannot_be_changed_is_refused() -> None:
    with pytest.raises(Refusal, match="expected a scene in TOML"):
        forced("format =", "saturation", OFF)
    with pytest.raises(Refusal, match="expected a scene in TOML"):
        shifted("format = 1\nformat = 1", 0, 0.0, 0.0)
    with pytest.raises(Refusal, match="expected a scene with touch 3, got one with 2"):
        shifted(text_of("two-contacts"), 2, 0.0, 0.0)
    with pytest.raises(Refusal, match="expected a scene with touch 1, got one with 0"):
        shifted("format = 1", 0, 0.0, 0.0)


def test_a_touch_is_dragged_in_the_text(qapp: QApplication) -> None:
    written = Written(text_of("two-contacts"), scene_file("two-contacts"))
    history, scene = History(Settings(written=written)), load_scene("two-contacts")
    session = SimpleNamespace(
        scene=scene,
        time=0.5 * scene.duration,
        refusal="",
        move=lambda _: None,
        playing=SimpleNamespace(connect=lambda _: None),
    )
    editing = SceneEditing(history, cast("Any", session), LoadHandle())
    touch = loads_at(scene, session.time)[0]
    x, y = touch.load.centre()
    editing.grab(x, y)
    editing.drag(x + 1e-3, y)
    editing.release()
    assert history.settings.written != written


def test_a_step_is_added_before_the_last_release_under_headings_too() -> None:
    steps = [{"step": "press", "seconds": 1.0}, {"step": "release", "seconds": 1.0}]
    text = "[[touch]]\n" + "".join(
        f'\n[[touch.path]]\nstep = "{one["step"]}"\nseconds = 1.0\n' for one in steps
    )
    assert tomllib.loads(text)["touch"][0]["path"] == steps
    after = scene_text.add_step(text, ("touch", 0, "path"), "hold")
    path = tomllib.loads(after)["touch"][0]["path"]
    assert [path[0], path[2]] == steps
    assert path[1]["step"] == "hold"
    assert '\n\n[[touch.path]]\nstep = "release"' in after


def test_a_value_is_put_into_a_new_table_of_one_that_stands_in_a_line() -> None:
    after = scene_text.put_in("electronics = { gain = 2.0 }\n", ("electronics", "bridge"), "k", 2.1)
    assert tomllib.loads(after) == {"electronics": {"gain": 2.0, "bridge": {"k": 2.1}}}
