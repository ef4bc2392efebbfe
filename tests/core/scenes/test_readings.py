"""Scenes whose elements read heights, slopes, or curvature along any direction."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kappaskin import Refusal, Simulator
from kappaskin.scenes import plan, read_scene, write_scene
from kappaskin.scenes.effect_plan import kept_effects
from kappaskin.scenes.effects import StatedNoise
from kappaskin.sensing import DigitalReadings, SensorLayout, Transduction
from kappaskin.skin import Patch
from navier import HingedPlate, Load

A, D = 0.06, 3.7e-3
TEXT = """
format = 1
rate = 60.0
reference = [60, 60]

[skin]
size = [0.06, 0.06]
rigidity = 3.7e-3

[elements]
grid = [7, 6]
reads = {reads}

{rest}

[[touch]]
what = "disc"
x = 0.034
y = 0.022
radius = 0.004
force = 0.1
"""


def scene_of(*reads, rest=""):
    written = str(list(reads)).replace("'", '"')
    return read_scene(TEXT.format(reads=written, rest=rest), Path("scene.toml"))


def truth_of(name, places):
    """What the plate of the scene truly has, by Navier's sum."""
    plate = HingedPlate(A, A, D)
    return plate.read(plate.coefficients(Load(0.034, 0.022, 0.1, radius=0.004)), places, name)


# How near the theory's 60 x 60 functions come to the truth, of its peak.
WITHIN = {"height": 1e-5, "slope@20": 1e-3, "curvature@45": 0.02, "twist": 0.02}


@pytest.mark.parametrize("name", WITHIN)
def test_a_scene_reads_what_the_plate_truly_has(name):
    digital = name.startswith(("height", "slope"))
    scene = scene_of(name, rest="[readings]\nresolution = 1e-10" if digital else "")
    frame = Simulator(scene).frame(0, lambda: 0.0)

    read = scene.sensor().nominal(frame)

    true = truth_of(name, scene.layout.positions)
    assert np.abs(read - true).max() < WITHIN[name] * np.abs(true).max()


def test_reading_k_p_plus_an_element_is_number_k_of_it():
    names = ("height", "slope@20", "twist")
    scene = scene_of(*names)
    read = scene.sensor().nominal(Simulator(scene).frame(0, lambda: 0.0)).reshape(3, 42)
    for name, own in zip(names, read, strict=True):
        true = truth_of(name, scene.layout.positions)
        np.testing.assert_allclose(own, true, atol=0.02 * np.abs(true).max())


def test_xx_yy_and_xy_are_a_curvature_sensor_as_before():
    assert scene_of("xx", "yy", "xy").layout.reads is None
    assert scene_of("curvature@0", "curvature@90", "twist").layout.reads is None
    assert scene_of("xx", "yy").layout.each_reads == ["curvature@0", "curvature@90"]


@pytest.mark.parametrize(
    ("reads", "rest"),
    [
        (["height"], "[readings]\nnoise = 5e-6"),
        (["slope@0", "slope@90"], "[readings]\nresolution = 1e-5"),
        (
            ["slope@-30", "height"],
            "[readings.height]\nnoise = 1e-6\n[readings.slope]\nnoise = 0.01",
        ),
        (["curvature@45", "twist"], '[electronics]\nlike = "second"'),
        (["height"], "[effects.tolerance]\ngain_sd = 0.01\noffset_sd = 1e-5"),
    ],
)
def test_a_written_scene_reads_back(reads, rest):
    scene = scene_of(*reads, rest=rest)
    again = read_scene(write_scene(scene), Path("scene.toml"))
    assert again.layout.each_reads == scene.layout.each_reads == reads
    assert (again.transduction, again.effects) == (scene.transduction, scene.effects)
    assert write_scene(again) == write_scene(scene)


def test_dead_elements_and_cells_read_back():
    text = TEXT.format(reads='["height"]\ndead = [3]\ncell = [0.002, 0.001]', rest="")
    layout = read_scene(text, Path("scene.toml")).layout
    assert layout.dead == [3]
    assert layout.cell == (0.002, 0.001)
    again = read_scene(write_scene(read_scene(text, Path("scene.toml"))), Path("scene.toml"))
    assert (again.layout.dead, again.layout.cell) == (layout.dead, layout.cell)


def test_the_stated_noise_is_that_of_each_quantity():
    rest = "[readings.height]\nnoise = 2e-6\n[readings.slope]\nnoise = 0.003"
    scene = scene_of("height", "slope@0", rest=rest)
    simulator, sensor = Simulator(scene), scene.sensor()
    read = np.array([sensor.nominal(simulator.frame(n, lambda: 0.0)) for n in range(300)])
    noise = read.std(axis=0, ddof=1).reshape(2, 42)
    # A mean over 42 x 299 squares is off by 0.6 %.
    np.testing.assert_allclose(np.sqrt((noise**2).mean(axis=1)), [2e-6, 0.003], rtol=0.03)
    assert sensor.sigma is not None
    np.testing.assert_array_equal(sensor.sigma, np.repeat([2e-6, 0.003], 42))


@pytest.mark.parametrize(
    ("effect", "why"),
    [
        ("strain-limit]\nshare = 0.1", "metal foil has the limit"),
        ('hysteresis]\nlike = "second"', "gages on a substrate"),
        ("creep]\nshare = 0.1\ntime_constant = 8.0", "the bond of a gage"),
        ("cross-talk]\nshare = 0.02", "no multiplexer"),
    ],
)
def test_effects_of_strain_gages_are_refused_for_others(effect, why):
    with pytest.raises(Refusal, match=rf"of elements that read height: .*{why}"):
        scene_of("height", rest=f"[effects.{effect}")
    scene_of("curvature@45", rest=f"[effects.{effect}")  # which gages may read


@pytest.mark.parametrize("name", ["finite-slope", "skew", "saturation"])
def test_effects_that_do_not_occur_are_said_to_be_none(name):
    with pytest.raises(Refusal, match=f"effects that occur in this scene, got {name}"):
        scene_of("height", rest=f'[effects]\non = ["{name}"]')


def test_gages_along_any_direction_read_less_on_a_slope_and_heights_do_not():
    steep = '[effects]\non = ["finite-slope"]'
    scene = scene_of("height", "curvature@30", rest=steep)
    plain = scene_of("height", "curvature@30", rest='[effects]\noff = ["finite-slope"]')
    (bent, read), (_, first) = (
        Simulator(each).reading(each.sensor().scan(), 0.0) for each in (scene, plain)
    )
    c = bent.coefficients.ravel()
    at = [scene.basis.at(scene.layout.positions, *order) @ c for order in [(1, 0), (0, 1)]]
    along = math.cos(math.pi / 6) * at[0] + math.sin(math.pi / 6) * at[1]
    less = np.sqrt(1 + at[0] ** 2 + at[1] ** 2) * (1 + along**2)

    (height, curvature), (plain_height, plain_curvature) = read.reshape(2, -1), first.reshape(2, -1)
    np.testing.assert_allclose(height, plain_height, rtol=1e-12)
    np.testing.assert_allclose(curvature * less, plain_curvature, rtol=1e-9, atol=1e-9)
    assert less.max() > 1.001


@pytest.mark.parametrize(
    "effect",
    [
        "gaussian-noise]\nrms = 1e-5",
        "uniform-noise]\nrms = 1e-5",
        "flicker-noise]\nrms = 1e-5",
        "mains-hum]\namplitude = 1e-5",
        "tolerance]\ngain_sd = 0.01\noffset_sd = 1e-5",
        "temperature]\nrise = 5.0\ntime_constant = 0.1\noffset = 1e-5",
        "stuck]\nelements = [7]",
        "intermittent]\nelements = [7]\non = 0.02\noff = 0.02",
    ],
)
def test_other_effects_change_heights_by_what_they_say(effect):
    scene, plain = scene_of("height", rest=f"[effects.{effect}"), scene_of("height")
    name = effect.partition("]")[0]
    changed = np.array(
        [
            Simulator(scene).readings(scene.sensor().scan(), np.arange(30) / 60)[1]
            - Simulator(plain).readings(plain.sensor().scan(), np.arange(30) / 60)[1]
        ]
    )[0]
    failing = name in ("stuck", "intermittent")
    others = np.delete(changed, 7, axis=1)
    assert (others == 0).all() if failing else (np.abs(others).max() > 1e-6)
    assert np.abs(changed).max() < (1e-2 if failing else 1e-3)
    if name == "intermittent":
        assert set(np.sign(changed[:, 7])) == {-1.0, 0.0}  # down to the reading of rest, and back


def test_a_plan_judges_effects_by_the_peak_of_what_is_read():
    scene = scene_of("height", rest="[effects.gaussian-noise]\nrms = 1e-5")
    sizes = {entry.name: entry.size.number for entry in plan(scene)}
    peak = np.abs(truth_of("height", scene.layout.positions)).max()
    assert sizes["gaussian-noise"] == pytest.approx(1e-5 / peak, rel=1e-3)


def test_a_plan_judges_readings_of_several_units_each_by_its_peak():
    rest = "[readings.height]\nnoise = 1e-8\n[readings.slope]\nnoise = 1e-5"
    scene = scene_of("height", "slope@0", rest=rest)
    entries = {entry.name: entry for entry in plan(scene)}
    heights, slopes = (truth_of(n, scene.layout.positions) for n in ("height", "slope@0"))
    shares = 1e-8 / np.abs(heights).max(), 1e-5 / np.abs(slopes).max()
    # Too little to be simulated, but error bars rely on it.
    assert shares[0] < shares[1] < 1e-3
    assert entries["gaussian-noise"].size.number == pytest.approx(shares[1], rel=1e-3)
    assert not entries["quantisation"].kept
    assert [type(effect) for effect in kept_effects(scene)] == [StatedNoise]


REFUSED = {
    "no such reading": (["depth"], "", "expected a reading among xx, yy, xy, height"),
    "no direction": (["slope"], "", "slope@DEGREES"),
    "a direction of a height": (["height@3"], "", "got 'height@3'"),
    "twice": (["height", "height"], "", "each once"),
    "none": ([], "", "at least one reading"),
    "gages of heights": (["height"], "[electronics]", r"no strain gages .* that read height"),
    "numbers of gages": (["xx"], "[readings]\nnoise = 1.0", r"expected \[electronics\]"),
    "two noises": (
        ["height"],
        "[readings]\nnoise = 1e-6\n[effects.gaussian-noise]\nrms = 1e-6",
        "expected one noise",
    ),
    "cylinders": (["height"], "[cylinders]", "expected no touch|expected a curvature sensor"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_no_sensor_reads_is_refused(what):
    reads, rest, message = REFUSED[what]
    with pytest.raises(Refusal, match=message):
        scene_of(*reads, rest=rest)


def test_a_bridge_of_heights_is_refused_and_rosettes_have_one():
    scene = scene_of("height")
    with pytest.raises(Refusal, match="expected digital readings of height"):
        replace(scene, transduction=Transduction())
    assert isinstance(scene.transduction, DigitalReadings)
    assert isinstance(scene_of("curvature@45").transduction, Transduction)


def test_elements_that_differ_in_what_they_read_make_no_scene():
    scene = scene_of("height")
    layout = SensorLayout.regular(Patch(A, A), 2, 1).reading(
        [0, 1, 1], ["height", "height", "twist"]
    )
    with pytest.raises(Refusal, match="the same readings of every element"):
        replace(scene, layout=layout)
