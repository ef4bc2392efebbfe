"""What each effect of a scene costs: leaving it out does what the scene without it shows."""

import json
import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

import kappaskin.studies
import kappaskin.studies.simulation
from kappaskin import Refusal, Scene, SensorLayout, load_scene
from kappaskin._processes import BackgroundProcess
from kappaskin.cli import REFUSED
from kappaskin.scenes import EffectSelection, plan
from kappaskin.scenes.effects import (
    CorruptedFrames,
    Creep,
    DroppedFrames,
    GaussianNoise,
    Temperature,
)
from kappaskin.studies import (
    Cost,
    EffectCost,
    Refused,
    Setting,
    cost_steps,
    costs,
    effect_costs,
    effect_rows,
    effects_text,
    usual_setting,
)

pytestmark = pytest.mark.slow

EIGHT = Setting("least-squares", (8, 8))
CENTRE = load_scene("centre")
EVERYTHING = EffectSelection()
FIGURES = ("rms_with", "rms_without")


@pytest.fixture(autouse=True)
def quick(monkeypatch) -> None:
    """Times are not what is tested here."""
    monkeypatch.setattr(kappaskin.studies.simulation, "_FRAMES", 1)


def told(scene: Scene, setting: Setting | None = None) -> dict[str, EffectCost]:
    return {cost.name: cost for cost in effect_costs(scene, setting or usual_setting(scene))}


@lru_cache
def ready(name: str) -> dict[str, EffectCost]:
    return told(load_scene(name))


def now(found: dict[str, EffectCost]) -> float:
    """The error as the scene is planned."""
    cost = next(cost for cost in found.values() if cost.rms_with is not None)
    return cost.rms_with if cost.kept else cost.rms_without


# Every scene


@pytest.mark.cases("centre", "failing-elements", "fingertip", "on-foam")
@pytest.mark.parametrize("name", ["centre", "fingertip", "failing-elements", "pencil", "on-foam"])
def test_every_effect_that_there_is_and_no_other_is_told_as_the_plan_has_it(name) -> None:
    found = ready(name)
    there = [entry for entry in plan(load_scene(name)) if entry.effect]
    assert list(found) == [entry.name for entry in there]
    for entry in there:
        cost = found[entry.name]
        assert cost.kept == entry.kept
        assert cost.bound == (None if entry.effect.authored else entry.size.error)
        assert 0 <= cost.time_per_frame < 1
        assert all(0 < getattr(cost, figure) < 1 for figure in FIGURES)
        assert (cost.rms_with if cost.kept else cost.rms_without) == now(found)


def test_the_effects_of_a_skin_that_stands_still_are_judged_as_settings_are() -> None:
    # The same load; other draws of the same noise.
    (cost,) = costs(CENTRE, [EIGHT])
    assert isinstance(cost, Cost)
    assert now(ready("centre")) == pytest.approx(cost.rms, rel=0.05)
    assert ready("centre")["uniform-noise"].rms_without == pytest.approx(cost.rms_exact, rel=1e-3)


def test_a_scene_without_effects_has_those_of_its_converter_and_its_slope() -> None:
    found = told(replace(CENTRE, effects=()))
    assert list(found) == ["finite-slope", "saturation", "quantisation"]
    assert found["quantisation"].rms_with == pytest.approx(now(found), rel=1e-12)
    strip = replace(load_scene("fingertip"), effects=())
    assert list(told(strip)) == ["saturation", "quantisation"]


@pytest.mark.parametrize(
    ("scene", "reason"),
    [
        (load_scene("calibration"), "the skin of calibration lies on cylinders"),
        (CENTRE.touched_by(), "the skin of centre is not pressed"),
    ],
)
def test_a_scene_without_a_load_is_refused(scene, reason) -> None:
    with pytest.raises(Refusal, match=reason):
        effect_costs(scene, EIGHT)


# What leaving out does


def test_without_it_is_the_scene_that_never_had_it() -> None:
    scene = load_scene("failing-elements")
    left_out = frozenset(entry.name for entry in plan(scene) if not entry.kept)
    scene = replace(scene, choice=EffectSelection(off=left_out | {"finite-slope"}))
    found = told(scene)
    for effect in scene.effects:
        others = tuple(one for one in scene.effects if one is not effect)
        assert found[effect.name].rms_without == now(told(replace(scene, effects=others)))
    assert {"stuck", "intermittent", "gaussian-noise"} <= set(found)


@pytest.mark.parametrize("name", ["failing-elements", "fingertip"])
def test_without_dead_elements_is_the_skin_where_all_live(name) -> None:
    whole = replace(load_scene(name), choice=EVERYTHING, effects=(GaussianNoise(0.2),))
    P = len(whole.layout)
    alive = SensorLayout(whole.layout.patch, whole.layout.positions,
                         whole.layout.live.any(axis=1)[:, None].repeat(P, axis=1),
                         whole.layout.shape)  # fmt: skip
    whole = replace(whole, layout=alive)
    dead = replace(whole, layout=alive.without([P // 2]))
    setting = replace(EIGHT, functions=(8, 1) if whole.plate.patch.strip else (8, 8))
    found = told(dead, setting)
    assert found["dead"].rms_without == now(told(whole, setting))
    assert found["dead"].rms_without < found["dead"].rms_with
    assert "dead" not in told(whole, setting)


def test_with_what_is_left_out_is_the_scene_that_keeps_it() -> None:
    scene = load_scene("tapping")
    without = replace(scene, choice=EffectSelection(off=frozenset({"skew", "finite-slope"})))
    slope = replace(scene, choice=EffectSelection(off=frozenset({"skew"})))
    found, other = told(without), told(slope)
    assert not found["finite-slope"].kept
    assert other["finite-slope"].kept
    for figure in FIGURES:
        assert getattr(found["finite-slope"], figure) == getattr(other["finite-slope"], figure)
    assert now(other) == found["finite-slope"].rms_with


def test_what_is_random_is_drawn_alike_with_and_without_any_other_effect() -> None:
    # A hundredth of a percent of warming, beside noise: unpaired draws would differ by percents.
    tiny = Temperature(1e-4, 60.0, 0.0, 0.0, 1e-4)
    found = told(replace(CENTRE, effects=(*CENTRE.effects, tiny)))
    cost = found["temperature"]
    assert cost.rms_with == pytest.approx(cost.rms_without, rel=1e-6)
    assert [getattr(cost, figure) for cost in ready("centre").values() for figure in FIGURES] == [
        getattr(cost, figure) for cost in told(CENTRE).values() for figure in FIGURES
    ]


def test_skew_and_drift_show_though_settings_are_judged_standing_still() -> None:
    skew = ready("tapping")["skew"]
    assert skew.rms_with > 2 * skew.rms_without
    scene = replace(CENTRE, effects=(GaussianNoise(0.01), Creep(0.1, 10.0)))
    creep = told(scene)["creep"]
    assert creep.rms_with > 20 * creep.rms_without


def test_creep_errs_by_the_share_of_the_shape_that_is_gone() -> None:
    # y = (1 - phi (1 - exp(-t / tau))) x: the shape itself, smaller; moments over a minute.
    share, tau = 0.1, 10.0
    scene = replace(CENTRE, effects=(Creep(share, tau),))
    (cost,) = costs(scene, [EIGHT])
    t = np.add.outer(60.0 * np.arange(20) / 20, np.arange(8, 10) / scene.rate)
    gone = share * (1 - np.exp(-t / tau)).mean()
    assert told(scene)["creep"].rms_with == pytest.approx(gone * cost.shape_rms, rel=2e-2)


def test_foam_is_judged_from_the_shape_of_the_skin_that_lies_on_it() -> None:
    scene = load_scene("on-foam")
    still = replace(scene, effects=()).touched_by(*scene.loads)
    x, y = still.plate.patch.grid(101, 101)
    on_grid = still.basis.on_grid(x, y)
    bare = replace(still.plate, foundation=0.0)
    w, w_bare = (on_grid(p.deflection(still.loads, still.basis)) for p in (still.plate, bare))
    off = math.sqrt(np.mean((w_bare - w) ** 2))

    foam = told(still)["foam"]
    assert foam.kept
    assert foam.rms_without == pytest.approx(off, rel=2e-3)
    assert foam.rms_with < 1e-3 * foam.rms_without
    left_out = told(replace(still, choice=EffectSelection(off=scene.choice.off | {"foam"})))["foam"]
    assert not left_out.kept
    assert (left_out.rms_with, left_out.rms_without) == (foam.rms_with, foam.rms_without)


def test_readings_on_a_rail_are_missing_and_steps_count_where_they_are_simulated() -> None:
    saturation = ready("saturation")["saturation"]
    assert saturation.kept
    assert saturation.rms_with > 1.1 * saturation.rms_without
    coarse = replace(CENTRE.transduction, converter=replace(CENTRE.transduction.converter, bits=8))
    scene = replace(CENTRE, effects=(), transduction=coarse, choice=EVERYTHING)
    steps = told(replace(scene, choice=EffectSelection(off=frozenset({"finite-slope"}))))[
        "quantisation"
    ]
    assert steps.rms_with > 1.1 * steps.rms_without


def test_a_failure_of_the_link_is_not_in_the_frames_that_arrive() -> None:
    scene = replace(CENTRE, effects=(DroppedFrames(0.1), CorruptedFrames(0.2)))
    found = told(scene)
    for name in ("dropped-frames", "corrupted-frames"):
        cost = found[name]
        assert (cost.kept, cost.bound, cost.rms_with, cost.rms_without) == (True, None, None, None)
    assert now(found) == now(told(replace(scene, effects=())))


# Settings


@pytest.mark.parametrize(
    ("m", "n", "functions"), [(10, 10, (8, 8)), (7, 7, (7, 7)), (2, 2, (2, 2)), (1, 1, (1, 1))]
)
def test_the_usual_setting_has_as_many_functions_as_the_elements_carry(m, n, functions) -> None:
    scene = replace(CENTRE, layout=SensorLayout.regular(CENTRE.plate.patch, m, n))
    setting = usual_setting(scene)
    assert setting.method == "least-squares"
    assert setting.elements == (m, n)
    assert setting.functions == functions


def test_the_usual_setting_of_a_strip_goes_along_it() -> None:
    assert usual_setting(load_scene("fingertip")).functions == (8, 1)


def test_elements_that_carry_nothing_are_refused() -> None:
    scene = replace(CENTRE, layout=CENTRE.layout.without(range(100)))
    with pytest.raises(Refusal, match="expected enough elements for a shape, got the 100"):
        usual_setting(scene)


def test_a_setting_that_gives_no_answer_is_refused() -> None:
    with pytest.raises(Refusal, match="140 of the 144"):
        effect_costs(CENTRE, replace(EIGHT, functions=(12, 12)))


@pytest.mark.full
def test_the_setting_decides_what_is_read_and_how() -> None:
    every = told(CENTRE, EIGHT)
    six = replace(EIGHT, functions=(4, 4))
    half = told(CENTRE, replace(six, scanned="half"))
    assert now(half) > now(told(CENTRE, six))
    assert now(told(CENTRE, replace(EIGHT, elements=(16, 16)))) < now(every)
    # A filter follows where it is given the frames before.
    bare = replace(load_scene("tapping"), effects=())
    assert now(told(bare, replace(six, method="tracking"))) < 2 * now(told(bare, six))
    single = now(told(CENTRE, replace(EIGHT, precision="float32")))
    assert single == pytest.approx(now(every), rel=1e-4)
    assert single != now(every)


# Rows and text


def test_rows_are_json() -> None:
    scene = replace(load_scene("failing-elements"), effects=(DroppedFrames(0.1),))
    setting = usual_setting(scene)
    found = effect_costs(scene, setting)
    rows = effect_rows(scene, setting, found)
    assert json.loads(json.dumps(rows, allow_nan=False)) == rows
    for row, cost in zip(rows, found, strict=True):
        assert (row["effect"], row["kept"]) == (cost.name, cost.kept)
        assert (row["scene"], row["functions"]) == (scene.name, list(setting.functions))
        assert (row["rms_with_mm"] is None) == (cost.rms_with is None)
    dead = next(row for row in rows if row["effect"] == "dead")
    assert dead["error"] is None
    assert dead["rms_without_mm"] == 1e3 * found[rows.index(dead)].rms_without


def test_the_table_says_each_effect_in_a_line() -> None:
    long = EffectCost("corrupted-frames", True, 12.3456e-3, None, None, None)
    found = [*ready("tapping").values(), long]
    lines = effects_text(load_scene("tapping"), EIGHT, found).splitlines()
    assert max(map(len, lines)) <= 100
    assert "the scene tapping, with least-squares, 8 x 8 functions" in lines[0]
    table = {line.split()[0]: line.split()[1:] for line in lines[-len(found) :]}
    assert list(table) == [cost.name for cost in found]
    assert table["skew"][0] == "yes"
    assert table["quantisation"][0] == "no"
    assert table["corrupted-frames"] == ["yes", "12345.6", "-", "-", "-"]


# In the background, and as a command


def test_a_process_of_its_own_tells_of_effects_after_the_first_cost() -> None:
    settings = EIGHT, replace(EIGHT, functions=(4, 4))
    with BackgroundProcess("cost", cost_steps, CENTRE, settings, EIGHT) as measuring:
        first, (of, effects), other = measuring.wait()
    assert (first.setting, of, other.setting) == (EIGHT, EIGHT, settings[1])
    here = ready("centre")
    for cost in effects:
        assert cost.rms_with == pytest.approx(here[cost.name].rms_with, rel=1e-9)


def test_a_setting_that_cannot_judge_effects_leaves_the_others_alone() -> None:
    many = replace(EIGHT, functions=(12, 12))
    ((of, effects),) = cost_steps(CENTRE, [], many)
    assert of == many
    assert isinstance(effects, Refused)
    assert "140 of the 144" in effects.reason


def test_the_command_tells_of_effects_alone(run) -> None:
    code, printed, errors = run("cost", "--scene", "fingertip", "--effects", "--json")
    assert (code, errors) == (0, "")
    rows = json.loads(printed)
    assert [row["effect"] for row in rows] == ["uniform-noise", "saturation", "quantisation"]
    assert all(row["functions"] == [8, 1] for row in rows)
    assert rows[0]["rms_without_mm"] < 1e-3 * rows[0]["rms_with_mm"]
    code, printed, _ = run("cost", "--scene", "fingertip", "--effects")
    assert code == 0
    assert "settings tried" not in printed
    assert "uniform-noise     yes" in printed


def test_the_command_tells_people_of_effects_below_the_settings(run, monkeypatch) -> None:
    monkeypatch.setattr(kappaskin.studies, "settings_to_try", lambda scene: [EIGHT])
    code, printed, _ = run("cost")
    assert code == 0
    assert printed.index("1 settings tried") < printed.index("What each effect costs in the scene")
    code, printed, _ = run("cost", "--json")
    assert [row["method"] for row in json.loads(printed)] == ["least-squares"]


def test_effects_that_cannot_be_told_take_nothing_from_the_settings(run, monkeypatch) -> None:
    def refuse(scene: Scene) -> Setting:
        raise Refusal("expected more")

    monkeypatch.setattr(kappaskin.studies, "settings_to_try", lambda scene: [EIGHT])
    monkeypatch.setattr(kappaskin.studies, "usual_setting", refuse)
    code, printed, _ = run("cost")
    assert code == 0
    assert printed.endswith("What each effect costs cannot be measured: expected more\n")


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--within", "1mm"], "expected --effects without --within and --plot"),
        (["--plot", "cost.svg"], "expected --effects without --within and --plot"),
        (["--scene", "calibration"], "lies on cylinders"),
    ],
)
def test_what_effects_cannot_be_told_with_is_refused(run, tmp_path, monkeypatch, arguments, reason):
    monkeypatch.chdir(tmp_path)
    code, printed, errors = run("cost", "--effects", *arguments)
    assert (code, printed) == (REFUSED, "")
    assert reason in errors
    assert not list(tmp_path.iterdir())
