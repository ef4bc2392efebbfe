"""Scene files that are written: what is read from them is the scene that was written."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kappaskin import (
    Cap,
    DiscLoad,
    Disk,
    GaussianLoad,
    LineLoad,
    Patch,
    Plate,
    PointLoad,
    Polygon,
    RectangleLoad,
    Refusal,
    Scene,
    SensorLayout,
    Simulator,
    Stimulus,
    Transduction,
    load_scene,
    read_scene,
    write_scene,
)
from kappaskin.mechanics import Block, Cylinder, HeightMap, Mesh, Punch, Sphere, Wedge
from kappaskin.scenes import (
    SCENES,
    EffectSelection,
    Indenter,
    Orbit,
    kept_effects,
    plan,
    scene_file,
)
from kappaskin.scenes.cylinders import Presentation, schedule
from kappaskin.scenes.effect_plan import effects_of
from kappaskin.scenes.effects import (
    EFFECTS,
    FIRST_GENERATION_LOOPS,
    SECOND_GENERATION_LOOPS,
    CorruptedFrames,
    Creep,
    Foam,
    GaussianNoise,
    Hysteresis,
    IntermittentElements,
    StrainLimit,
    StuckElements,
    Temperature,
    Tolerance,
)
from kappaskin.scenes.effects.electronics import CrossTalk, FlickerNoise, MainsHum
from kappaskin.scenes.scene import LINEAR
from kappaskin.scenes.stimulus import (
    HoldStep,
    MotionPath,
    PressStep,
    RecordedMotion,
    ReleaseStep,
    SlideStep,
    TapStep,
    TurnStep,
)
from kappaskin.sensing import FIRST_GENERATION, SECOND_GENERATION
from kappaskin.sources import information

SQUARE = Patch(0.1, 0.1)
BARE = Scene("bare", Plate(SQUARE), SensorLayout.regular(SQUARE, 4, 4))
FROM_FILES = ("bolt", "coin", "exploring")
LIKE_A_SPHERE = ("cylinder", "edge", "pencil")  # shapes that other tests here write
PRESSED = BARE.touched_by(PointLoad(0.05, 0.05))


def again(scene: Scene) -> Scene:
    return read_scene(write_scene(scene), Path(f"{scene.name}.toml"))


def counts(scene: Scene, frames: int = 4):
    simulator = Simulator(replace(scene, rate=frames / scene.duration))  # all over the scene
    return [simulator.frame(n, lambda: 0.0).counts for n in range(frames)]


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.full] if name in LIKE_A_SPHERE else [])
        for name in SCENES
        if name not in FROM_FILES
    ],
)
def test_a_ready_scene_is_the_same_once_written_and_read(name):
    scene = load_scene(name)

    read = again(scene)

    assert information.sensor_to_json(read.sensor()) == information.sensor_to_json(scene.sensor())
    assert plan(read).entries == plan(scene).entries
    np.testing.assert_array_equal(counts(read), counts(scene))
    assert (read.title, read.text, read.duration) == (scene.title, scene.text, scene.duration)
    assert write_scene(read) == write_scene(scene)


@pytest.mark.parametrize(
    ("radius", "written"),
    [
        (0.05, "0.05"),
        ((0.4, 0.5), "[0.4, 0.5]"),
        ((-0.4, 0.5), "[-0.4, 0.5]"),
        ((np.inf, 0.4), "[inf, 0.4]"),
        ((0.4, np.inf), "[0.4, inf]"),
    ],
)
def test_the_radii_of_a_bent_skin_are_written_and_read(radius, written):
    patch = Patch(0.1, 0.08, radius)
    scene = Scene("bent", Plate(patch), SensorLayout.regular(patch, 4, 4))

    assert f"\nradius = {written}  # m\n" in write_scene(scene)
    assert again(scene).plate == scene.plate


@pytest.mark.parametrize(
    ("cap", "written"),
    [
        (Cap(0.008), ""),
        (Cap(0.008, 1.2), "angle = 1.2  # rad\n"),
        (Cap(0.008, np.pi / 2, 1.3), "stretch = 1.3\n"),
    ],
)
def test_a_cap_is_written_and_read(cap, written):
    scene = Scene("cap", Plate(cap), SensorLayout.on_rings(cap, [1, 6, 12]), edge="clamped")

    assert f'shape = "cap"\nradius = 0.008  # m\n{written}' in write_scene(scene)
    assert again(scene).plate == scene.plate
    np.testing.assert_array_equal(again(scene).layout.positions, scene.layout.positions)


def test_a_scene_is_written_as_a_person_would_write_it():
    disk = Disk(0.05)
    scene = Scene(
        "mine",
        replace(Plate(disk), tension=20.0),
        replace(SensorLayout.regular(disk, 6, 5).without([3, 7]), gage_length=2e-5),
        (
            Stimulus(
                GaussianLoad(0.05, 0.05, 0.004, 0.15),
                MotionPath((PressStep(1.0, to=2.0), ReleaseStep(0.5))),
            ),
            Stimulus(PointLoad(0.04, 0.05), Orbit(0.01, 4)),
        ),
        (Creep(0.1, 8), GaussianNoise(0.1)),
        replace(SECOND_GENERATION, amplifier=replace(SECOND_GENERATION.amplifier, gain=90.0)),
        edge="clamped",
        choice=EffectSelection(auto=True, off=frozenset({"skew"})),
        title='The "drum"',
        text='One\n"two" \\ three.\n',
    )

    assert (
        write_scene(scene)
        == '''format = 1
title = "The \\"drum\\""
text = """
One
"two" \\\\ three.
"""

[skin]
shape = "disk"
rim_radius = 0.05  # m
tension = 20.0  # N/m
edge = "clamped"

[elements]
grid = [6, 5]
dead = [3, 7]
gage_length = 2e-5  # m

[electronics]
like = "second"

[electronics.amplifier]
gain = 90.0

[effects]
off = ["skew"]

[effects.creep]
share = 0.1
time_constant = 8.0  # s

[effects.gaussian-noise]
rms = 0.1  # 1/m

[[touch]]
what = "gaussian"
x = 0.05
y = 0.05
sd = 0.004
force = 0.15  # N
path = [
    { step = "press", to = 2.0, seconds = 1.0 },
    { step = "release", seconds = 0.5 },
]

[[touch]]
what = "point"
x = 0.04
y = 0.05
force = 1.0  # N
orbit = { radius = 0.01, period = 4.0 }
'''
    )


# Any scene

numbers = st.floats(1e-3, 1.0)
shares = st.floats(0.0, 0.9)
PATCHES = [
    SQUARE,
    Patch(0.12, 0.07, strip=True),
    Patch(0.04, 0.03, 12.9e-3),
    Disk(0.05),
    Polygon([(0, 0), (0.1, 0), (0.1, 0.05), (0.05, 0.1), (0, 0.1)]),
]


@st.composite
def layouts(draw, patch: Patch) -> SensorLayout:
    if draw(st.booleans()):
        layout = SensorLayout.regular(patch, *draw(st.tuples(*[st.integers(1, 12)] * 2)))
    else:
        places = st.tuples(st.floats(0.2, 0.7), st.floats(0.2, 0.7))
        shares_of_sides = draw(st.lists(places, min_size=1, max_size=9))
        layout = SensorLayout.scattered(patch, np.array(shares_of_sides) * (patch.a, patch.b))
    dead = draw(st.sets(st.integers(0, len(layout) - 1), max_size=len(layout) - 1))
    longest = float(patch.depth(layout.positions).min())
    lengths = [0.0, longest] if longest > 1e-6 else [0.0]  # not that of one on the rim
    return replace(layout.without(dead), gage_length=draw(st.sampled_from(lengths)))


@st.composite
def motions(draw, patch: Patch):
    if draw(st.booleans()):
        return draw(st.none() | st.builds(Orbit, st.floats(0, 0.05 * patch.b), numbers))
    by = st.floats(-0.01 * patch.b, 0.01 * patch.b)
    eases = st.sampled_from(["smooth", "linear"])
    step = st.one_of(
        st.builds(PressStep, numbers, eases, shares),
        st.builds(HoldStep, numbers, eases),
        st.builds(SlideStep, numbers, eases, st.tuples(by, by)),
        st.builds(TurnStep, numbers, eases, st.floats(-3, 3)),
        st.builds(TapStep, numbers, eases, st.integers(1, 9)),
    )
    return MotionPath((*draw(st.lists(step, max_size=4)), ReleaseStep(draw(numbers))))


@st.composite
def stimuli(draw, patch: Patch, stretches: bool = False):
    x, y = 0.4 * patch.a, 0.4 * patch.b
    size = st.floats(1e-4, 0.03 * patch.b)
    if draw(st.booleans()):
        rigid = st.one_of(
            st.builds(Sphere, size),
            st.builds(Cylinder, size, size),
            st.builds(Wedge, st.floats(0.1, 3.0), size, size, st.sampled_from([0.0, 2e-5])),
            st.builds(Punch, size),
            st.builds(Block, size, size),
        )
        pressed = "force" if stretches else draw(st.sampled_from(["force", "depth"]))
        what = Indenter(
            draw(rigid), x, y, **{pressed: draw(st.floats(1e-4, 0.02))}, turn=draw(shares)
        )
        return (Stimulus(what, draw(motions(patch))),)
    loads = st.one_of(
        st.builds(PointLoad, st.just(x), st.just(y), numbers),
        st.builds(LineLoad, st.just(x), st.just(y), st.just(x * 1.1), st.just(y), numbers),
        st.builds(DiscLoad, st.just(x), st.just(y), size, numbers),
        st.builds(RectangleLoad, st.just(x), st.just(y), size, size, numbers),
        st.builds(GaussianLoad, st.just(x), st.just(y), size, numbers),
    )
    made = st.builds(Stimulus, loads, motions(patch))
    return tuple(draw(st.lists(made, max_size=3)))


@st.composite
def electronics(draw) -> Transduction:
    chain = draw(st.sampled_from([Transduction(), FIRST_GENERATION, SECOND_GENERATION]))
    amplifier = replace(chain.amplifier, gain=draw(st.sampled_from([100.0, 33.3])))
    bits = draw(st.sampled_from([chain.converter.bits, 14]))
    settling = draw(st.sampled_from([0.0, 1e-7]))
    return replace(
        chain,
        amplifier=amplifier,
        converter=replace(chain.converter, bits=bits),
        multiplexer=replace(chain.multiplexer, settling_time=settling),
    )


@st.composite
def effects(draw, chain: Transduction):
    loops = st.builds(
        Hysteresis,
        st.just((1.0, 2.5)),
        st.tuples(shares, shares).map(lambda p: (p[0] / 2, p[1] / 2)),
        st.floats(0.5, 2.0),
    )
    each = [
        st.builds(StrainLimit, st.just(chain), shares),
        st.sampled_from([FIRST_GENERATION_LOOPS, SECOND_GENERATION_LOOPS]) | loops,
        st.builds(Creep, shares, numbers),
        st.builds(Temperature, st.floats(-200, 200), numbers, numbers, shares),
        st.builds(Tolerance, shares, shares, st.integers(0, 2**62)),
        st.builds(IntermittentElements, st.just((0,)), numbers),
        st.builds(MainsHum, numbers, st.floats(1, 1000)),
        st.builds(CrossTalk, st.floats(0, 0.5)),
        st.builds(FlickerNoise, numbers),
        st.builds(GaussianNoise, numbers),
        st.builds(StuckElements, st.just((0,)), numbers),
        st.builds(CorruptedFrames, shares),
    ]
    return tuple(draw(effect) for effect in each if draw(st.booleans()))


@st.composite
def choices(draw, scene: Scene) -> EffectSelection:
    there = sorted(effects_of(scene))
    on = frozenset(draw(st.sets(st.sampled_from(there))))
    if draw(st.booleans()):
        return EffectSelection(on=on, off=frozenset(EFFECTS) - on)
    off = frozenset(draw(st.sets(st.sampled_from(sorted(EFFECTS))))) - on
    return EffectSelection(draw(st.booleans()), draw(st.floats(0.001, 0.5)), on, off)


words = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)


@st.composite
def scenes(draw) -> Scene:
    patch, chain = draw(st.sampled_from(PATCHES)), draw(electronics())
    plate = Plate(
        patch,
        draw(numbers),
        tension=draw(st.sampled_from([0.0, 30.0])),
        foundation=draw(st.sampled_from([0.0, 3e-5, 1e12])),
        fluid=draw(st.booleans()),
        axial_stiffness=draw(st.none() | numbers),
        thickness=draw(st.sampled_from([None, 0.2e-3, 1e-3])),
        inplane=draw(st.sampled_from(["", "held", "free"])),
        unknown_material=draw(st.booleans()),
    )
    scene = Scene(
        "a scene",
        plate,
        draw(layouts(patch)),
        draw(stimuli(patch, plate.stretches)),
        draw(effects(chain)),
        chain,
        draw(st.floats(1.0, 50.0)),
        draw(st.integers(0, 2**63)),
        (draw(st.integers(2, 5)), 1 if patch.strip else 3),
        draw(st.sampled_from(["hinged", "clamped"])),
        title=draw(words.filter(bool)),
        text=draw(words),
    )
    return replace(scene, choice=draw(choices(scene)))


@pytest.mark.full
@pytest.mark.slow
@settings(max_examples=80)
@given(scenes())
def test_any_scene_is_the_same_once_written_and_read(scene):
    read = again(scene)

    said = ("plate", "stimuli", "effects", "transduction", "rate", "seed", "reference", "edge")
    for name in (*said, "title", "text"):
        assert getattr(read, name) == getattr(scene, name)
    assert read.layout.shape == scene.layout.shape
    assert read.layout.gage_length == scene.layout.gage_length
    np.testing.assert_array_equal(read.layout.positions, scene.layout.positions)
    np.testing.assert_array_equal(read.layout.live, scene.layout.live)
    assert read.choice.accuracy == scene.choice.accuracy
    if scene.choice.auto:
        assert read.choice == scene.choice
    else:
        assert kept_effects(read) == kept_effects(scene)
    assert write_scene(read) == write_scene(scene)


@given(st.text(st.sampled_from('"\\\n\r\t\x00\x7f\x85\u2028a[]={}#'), max_size=12))
def test_any_text_is_the_same_once_written_and_read(text):
    read = again(replace(BARE, title=text or "a", text=text))

    assert (read.title, read.text) == (text or "a", text)


@pytest.mark.parametrize(
    "laid",
    [
        Presentation(schedule(), 1.0),
        Presentation(schedule(hold=20.0), 2.5),
        Presentation(schedule((0.1, 0.2, 0.05)), 0.5),
    ],
)
def test_cylinders_are_the_same_once_written_and_read(laid):
    assert again(BARE.laid_on(laid)).laid == laid


@pytest.mark.parametrize(
    "choice",
    [
        LINEAR,
        EffectSelection(),
        EffectSelection(auto=True),
        EffectSelection(off=frozenset(EFFECTS)),
    ],
    ids=["linear", "all", "auto", "none"],
)
def test_a_choice_is_the_same_once_written_and_read(choice):
    assert again(replace(PRESSED, choice=choice)).choice == choice


def test_elements_a_hair_apart_are_written_without_a_grid_that_no_memory_holds():
    near = SensorLayout.scattered(SQUARE, [(0.05, 0.05), (0.05 + 1e-7, 0.05 + 1e-7)])

    read = again(replace(BARE, layout=near))

    np.testing.assert_array_equal(read.layout.positions, near.positions)


def test_an_element_beside_a_notch_is_written_by_its_place():
    u = Polygon([(0, 0), (9, 0), (9, 9), (6, 9), (6, 3), (3, 3), (3, 9), (0, 9)])
    scene = Scene("u", Plate(u), SensorLayout.scattered(u, [(4.0, 2.0)]))

    assert again(scene).layout.positions.tolist() == [[4.0, 2.0]]


def test_what_is_on_though_there_is_nothing_of_it_is_left_out():
    scene = replace(
        BARE, choice=EffectSelection(auto=True, on=frozenset({"creep", "quantisation"}))
    )

    assert 'on = ["quantisation"]' in write_scene(scene)
    assert plan(again(scene)).entries == plan(scene).entries


def test_numbers_of_any_kind_are_written_as_what_they_are():
    scene = PRESSED.touched_by(PointLoad(np.float64(0.05), 0.05, 1), motion=Orbit(0, 4))

    text = write_scene(replace(scene, rate=100, seed=np.int64(7)))
    disk = Disk(np.float64(0.05))
    round_ = write_scene(Scene("round", Plate(disk), SensorLayout.regular(disk, 4, 4)))

    assert "rim_radius = 0.05 " in round_
    assert "rate = 100.0" in text
    assert "seed = 7" in text
    assert "x = 0.05\ny = 0.05\nforce = 1.0" in text
    assert "orbit = { radius = 0.0, period = 4.0 }" in text


HALF_DEAD = replace(BARE.layout, live=np.arange(48).reshape(3, 16) != 5)
ODD_GRID = replace(BARE.layout, positions=BARE.layout.positions + 1e-3)
LARGE = Patch(20.0, 20.0)
RECORD = RecordedMotion(np.array([0.0, 1.0]), np.zeros((2, 3)))
PYRAMID = Mesh(
    np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]) * 0.01,
    np.array([[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]),
)


def pressed_by(rigid) -> Scene:
    return replace(BARE, stimuli=(Stimulus(Indenter(rigid, 0.05, 0.05, force=1.0)),))


UNSAID = {
    "a record": (
        PRESSED.touched_by(*PRESSED.loads, motion=RECORD),
        "a recorded motion, .* its file",
    ),
    "a mesh": (pressed_by(PYRAMID), "an object from a mesh file, which has no record of its file"),
    "a map": (
        pressed_by(HeightMap(np.zeros((2, 2)), 0.01, 0.01)),
        "an object from a height map, .* its file",
    ),
    "half an element": (replace(BARE, layout=HALF_DEAD), "some dead channels"),
    "an odd grid": (replace(BARE, layout=ODD_GRID), "a grid that is not regular"),
    "other steps": (BARE.laid_on(Presentation(schedule()[:9], 1.0)), "order of a schedule"),
    "two cylinders": (BARE.laid_on(Presentation(schedule()[1:3], 1.0)), "order of a schedule"),
    "another order": (
        replace(BARE, effects=(GaussianNoise(0.1), Creep(0.1, 1.0))),
        "of a scene file, creep, gaussian-noise; got gaussian-noise, creep",
    ),
    "an effect of the skin": (replace(BARE, effects=(Foam(3e4),)), "set foundation in"),
    "another's limit": (
        replace(BARE, effects=(StrainLimit(FIRST_GENERATION, 0.1),)),
        "the scene's own electronics",
    ),
    "a rate that cannot be": (replace(BARE, rate=1e6), "lower the rate"),
    "20 m of skin": (
        replace(BARE, plate=Plate(LARGE), layout=SensorLayout.regular(LARGE, 4, 4)),
        "expected sides",
    ),
}


@pytest.mark.parametrize(("scene", "said"), UNSAID.values(), ids=UNSAID)
def test_what_no_scene_file_can_say_is_refused(scene, said):
    with pytest.raises(Refusal, match=said):
        write_scene(scene)


@pytest.mark.parametrize("name", FROM_FILES)
def test_a_ready_scene_that_names_another_file_is_refused(name):
    with pytest.raises(Refusal, match="has no record of its file"):
        write_scene(load_scene(name))


def test_the_file_of_a_ready_scene_or_of_one_s_own_is_found_by_its_name():
    assert scene_file() == scene_file("circle")
    assert scene_file("circle").read_text("utf-8").startswith("format = 1")
    assert scene_file("there/mine.toml") == Path("there/mine.toml")
    with pytest.raises(Refusal, match=r"expected a scene among .*; got 'moon'"):
        scene_file("moon")
