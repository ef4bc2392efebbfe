"""Which effects a scene calls for: what is left out changes nothing that counts."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from kappaskin import (
    GaussianLoad,
    Patch,
    Plate,
    Refusal,
    Scene,
    SensorLayout,
    Simulator,
    load_scene,
)
from kappaskin.scenes import SCENES, EffectSelection, Orbit, kept_effects, plan
from kappaskin.scenes.cylinders import Presentation, schedule
from kappaskin.scenes.effect_plan import effects_of
from kappaskin.scenes.effects import EFFECTS, Creep, CrossTalk, GaussianNoise, Tolerance
from kappaskin.scenes.scene import survey
from kappaskin.scenes.stimulus import (
    HoldStep,
    MotionPath,
    PressStep,
    RecordedMotion,
    ReleaseStep,
    TapStep,
)
from planned import measured, random_scene

pytestmark = pytest.mark.slow

RANDOM = {"gaussian-noise", "uniform-noise", "flicker-noise", "mains-hum", "tolerance"}
READY = pytest.mark.parametrize("name", SCENES)
# Each kind of skin, load, motion and reading once; the others are more objects and loads of a kind.
KINDS = (
    "calibration", "camera", "creep-hold", "demo", "exploring", "failing-elements", "fingertip",
    "hot-room", "long-gages", "on-foam", "saddle", "saturation", "slipping", "sphere", "stretching",
)  # fmt: skip


def readings(scene, times):
    simulator, scan = Simulator(scene), scene.sensor().scan()
    return np.array([simulator.reading(scan, time)[1] for time in times])


def moments(scene, count=25):
    """Times all over the scene, none of them one of those that it was surveyed at."""
    return (np.arange(count) + 0.37) * scene.duration / count


@READY
def test_no_scene_presses_deeper_than_its_sheet_allows_without_saying_why(name):
    scene = load_scene(name)
    if scene.plate.patch.arc_curvature or scene.laid:
        return
    x, y = scene.plate.patch.grid(31, 31)
    moments = survey(scene).coefficients.reshape(-1, *scene.basis.shape)
    deepest = np.abs(scene.basis.on_grid(x, y)(moments)).max()

    if deepest > 2 * (scene.plate.thickness or 0.25e-3):
        assert "skin has no thickness here and does not stretch" in scene.text
    else:
        assert scene.plate.thickness


@pytest.mark.cases(*KINDS)
@READY
def test_every_known_effect_is_in_the_plan_with_its_size_and_why(name):
    entries = plan(load_scene(name)).entries

    assert [entry.name for entry in entries] == list(EFFECTS)
    assert all(entry.why for entry in entries)
    assert all(entry.size.error >= 0 and entry.size.number >= 0 for entry in entries)
    json.dumps([entry.to_json() for entry in entries], allow_nan=False)


@pytest.mark.cases(*(f"0.1-{name}" for name in KINDS))
@READY
@pytest.mark.parametrize("accuracy", [0.01, 0.1])
def test_what_is_left_out_changes_no_reading_by_more_than_the_accuracy(name, accuracy):
    scene = load_scene(name)
    # Random effects draw from streams of their own: those kept are the same in both.
    auto = replace(
        scene, choice=EffectSelection(auto=True, accuracy=accuracy, on=frozenset(RANDOM))
    )
    every = replace(scene, choice=EffectSelection())
    times = moments(scene)

    change = np.abs(readings(auto, times) - readings(every, times)).max() / survey(scene).peak

    assert change <= accuracy
    assert plan(auto).left_out <= accuracy


@pytest.mark.parametrize("seed", range(12))
def test_omitting_one_effect_of_many_changes_no_reading_by_more_than_the_plan_says(seed):
    for name, error, change in measured(random_scene(np.random.default_rng(seed))):
        # What moves is surveyed at 48 moments, between which it may be a little larger.
        assert change <= 1.02 * error + 1e-9, name


@pytest.mark.parametrize("share", [0.02, 0.5])
def test_cross_talk_of_offsets_that_exceed_the_signal_is_planned_for(share):
    scene = replace(BARE.touched_by(GaussianLoad(0.05, 0.05, 0.01, 0.01)), effects=(
        Creep(0.05, 8.0), Tolerance(0.05, 10.0), CrossTalk(share)
    ))  # fmt: skip
    ((error, change),) = [pair for name, *pair in measured(scene) if name == "cross-talk"]
    assert 0.5 * error <= change <= error
    assert error > 20 * share  # of the peak, of which offsets are many times


SQUARE = Patch(0.1, 0.1)
BARE = Scene(
    "bare", Plate(SQUARE), SensorLayout.regular(SQUARE, 10, 10), choice=EffectSelection(auto=True)
)
LOAD = GaussianLoad(0.05, 0.05, 0.01, 2.0)
RARE = {
    "a press": MotionPath((HoldStep(100.0), PressStep(0.05), HoldStep(1.0), ReleaseStep(0.05))),
    "a tap": MotionPath((HoldStep(100.0), TapStep(0.1))),
    "taps": MotionPath((HoldStep(100.0), TapStep(0.5, times=3))),
    "a record's end": RecordedMotion(
        np.array([0.0, 100.0, 100.1]), np.eye(3)[[0, 0, 2]] * [0, 0, 1]
    ),
}


@pytest.mark.parametrize("motion", RARE.values(), ids=RARE)
def test_what_happens_within_a_moment_of_a_long_scene_is_planned_for(motion):
    scene = BARE.touched_by(LOAD, motion=motion)
    times = np.linspace(100, np.nextafter(motion.duration, 0), 200)

    planned, whole = (readings(s, times) for s in (scene, replace(scene, choice=EffectSelection())))

    assert np.abs(planned - whole).max() < 0.01 * np.abs(whole).max()


@pytest.mark.parametrize("motion", [Orbit(0.01, 1e-3), TapStep(1.0, times=1000)], ids=str)
def test_the_skew_of_what_comes_again_a_thousand_times_a_second_is_kept(motion):
    motion = motion if isinstance(motion, Orbit) else MotionPath((motion,))

    assert "skew" in {effect.name for effect in kept_effects(BARE.touched_by(LOAD, motion=motion))}


def test_the_smallest_cylinder_is_planned_for_however_long_another_is_held():
    laid = Presentation(schedule(hold=5000.0), 1.0)
    scene = BARE.laid_on(laid)

    assert survey(scene).peak == max(np.abs(step.curvature).max() for step in laid.steps)
    assert "saturation" in {effect.name for effect in kept_effects(scene)}


@pytest.mark.cases(*KINDS)
@READY
def test_noise_that_is_left_out_is_as_small_as_the_accuracy(name):
    scene = replace(load_scene(name), choice=EffectSelection(auto=True, accuracy=0.2))
    out = {entry.name: entry for entry in plan(scene) if not entry.kept and entry.effect}
    for effect in out.keys() & RANDOM:
        alone = replace(scene, choice=EffectSelection(off=frozenset(EFFECTS) - {effect}))
        bare = replace(scene, choice=EffectSelection(off=frozenset(EFFECTS)))
        times = moments(scene)
        change = readings(alone, times) - readings(bare, times)
        assert np.abs(change).max() / survey(scene).peak <= out[effect].size.error


def test_the_random_stream_of_an_effect_is_its_own():
    scene = load_scene("tapping")
    both = replace(scene, choice=EffectSelection())
    without = replace(
        scene, choice=EffectSelection(off=frozenset({"skew", "finite-slope", "quantisation"}))
    )
    silent = replace(
        scene, choice=EffectSelection(off=frozenset({"gaussian-noise", "quantisation"}))
    )
    bare = replace(silent, choice=EffectSelection(off=silent.choice.off | without.choice.off))
    times = moments(scene)

    noise = readings(without, times) - readings(bare, times)
    other = readings(replace(both, choice=EffectSelection(off=frozenset({"quantisation"}))), times)

    np.testing.assert_allclose(other - readings(silent, times), noise, atol=1e-9)


def test_effects_can_be_forced_on_and_off():
    scene = load_scene("tapping")
    forced = replace(
        scene,
        choice=EffectSelection(
            True, 0.01, frozenset({"quantisation"}), frozenset({"gaussian-noise"})
        ),
    )
    kept = {effect.name for effect in kept_effects(forced)}
    assert "quantisation" in kept
    assert "gaussian-noise" not in kept


def test_failures_are_kept_whatever_the_accuracy():
    scene = load_scene("failing-elements")
    kept = kept_effects(replace(scene, choice=EffectSelection(auto=True, accuracy=0.9)))
    assert {"dead", "stuck", "intermittent"} <= {effect.name for effect in kept}


@pytest.mark.cases(*KINDS)
@READY
def test_what_is_kept_without_a_look_is_what_the_plan_keeps(name):
    scene = replace(load_scene(name), choice=EffectSelection(off=frozenset({"finite-slope"})))
    kept = plan(scene).kept
    assert kept_effects(scene) == kept
    assert all(effects_of(scene)[effect.name] is not None for effect in kept)


def test_what_is_left_out_is_neither_imported_nor_run():
    code = """
import sys
from kappaskin import Simulator, load_scene
scene = load_scene("hot-room")
scan = scene.sensor().scan()
ran = set()

def note(frame, event, _):
    code = frame.f_code
    if event == "call" and "at_work" in code.co_filename and code.co_name != "<module>":
        ran.add(code.co_qualname.split(".")[0])

sys.setprofile(note)
Simulator(scene).reading(scan, 0.0)
sys.setprofile(None)
room = "kappaskin.scenes.effects.at_work."
print(sorted(name.removeprefix(room) for name in sys.modules if name.startswith(room)))
print(sorted(ran))
"""
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert told.stdout.splitlines() == ["['electronics', 'gages']", "['gaussian', 'temperature']"]


def test_the_command_tells_the_plan(run):
    code, out, err = run("plan", "tapping", "--json")
    rows = json.loads(out)["effects"]
    assert (code, err) == (0, "")
    assert [row["effect"] for row in rows] == list(EFFECTS)
    there = {row["effect"]: row for row in rows if row["microseconds"] is not None}
    assert there["skew"]["kept"]
    assert not there["quantisation"]["kept"]
    code, out, _ = run("plan", "tapping")
    assert code == 0
    assert "scan time times rate of curvature" in out


def test_the_command_simulates_the_same_bytes_for_the_same_seed(run, tmp_path):
    files = [tmp_path / f"{n}.npz" for n in range(3)]
    for file, seed in zip(files, (1, 1, 2), strict=True):
        code, *_ = run("simulate", "tapping", "--frames", 60, "--seed", seed, "--out", file)
        assert code == 0
    first, second, third = (file.read_bytes() for file in files)
    assert first == second
    assert first != third
    with np.load(files[0]) as found:
        assert found["counts"].shape == found["curvature"].shape == (60, 3, 100)
        assert found["truth"].shape == (60, 15, 15)
        assert found["time"].shape == (60,)
        assert found["contact"].shape == (60, 2)
        assert len(json.loads(str(found["plan"]))) == len(EFFECTS)
    code, *_ = run("reconstruct", files[0], "--out", tmp_path / "shapes.npz")
    assert code == 0


@pytest.mark.parametrize("frames", [0, -1, 10**9])
def test_so_many_frames_are_refused(run, tmp_path, frames):
    code, _, err = run("simulate", "--frames", frames, "--out", tmp_path / "x.npz")
    assert code == 2
    assert "expected 1 to" in err


def test_a_drum_head_is_planned_with_its_tension(run, tmp_path):
    (tmp_path / "drum.toml").write_text(
        "format = 1\n[skin]\nsize = [0.1, 0.1]\nrigidity = 0.0\ntension = 50.0\n"
        '[[touch]]\nwhat = "disc"\nx = 0.05\ny = 0.05\nradius = 0.01\nforce = 0.1\n'
    )
    code, out, _ = run("plan", tmp_path / "drum.toml", "--json")
    assert code == 0
    (tension,) = (row for row in json.loads(out)["effects"] if row["effect"] == "tension")
    assert tension["why"] == "not in this scene"  # it is the skin, and cannot be left out
    assert (
        run("simulate", tmp_path / "drum.toml", "--frames", 2, "--out", tmp_path / "x.npz")[0] == 0
    )


def test_two_effects_of_one_name_are_refused():
    with pytest.raises(Refusal, match="each effect once, got gaussian-noise"):
        replace(load_scene("centre"), effects=(GaussianNoise(0.1), GaussianNoise(0.2)))


@pytest.mark.parametrize(("name", "quantity"), [("camera", "height"), ("tilts", "slope")])
def test_the_command_tells_the_plan_of_heights_and_slopes(run, name, quantity):
    code, out, err = run("plan", name)

    assert (code, err) == (0, "")
    assert f"shares of the peak {quantity}" in out
    assert "gaussian-noise" in out
