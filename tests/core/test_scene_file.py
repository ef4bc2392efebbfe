"""Scene files: what they may say, and that everything else is refused with its line."""

import math
from pathlib import Path

import numpy as np
import pytest

from kappaskin import SCENES, GaussianLoad, PointLoad, Refusal, load_scene
from kappaskin.mechanics import Cylinder, Mesh
from kappaskin.scene import Indenter, read_scene

HEAD = "format = 1\n\n[skin]\nsize = [0.1, 0.1]\n"
TOUCH = HEAD + '\n[[touch]]\nwhat = "gaussian"\nx = 0.05\ny = 0.05\nsd = 0.005\nforce = 0.2\n'


def read(text: str, folder: Path = Path()):
    return read_scene(text, folder / "a.toml")


@pytest.mark.parametrize("name", SCENES)
def test_every_ready_scene_says_what_there_is_to_see(name):
    scene = load_scene(name)

    assert scene.name == name
    assert len(scene.title) > 3
    assert scene.text.endswith(".\n")


def test_what_a_file_says_is_what_the_scene_is():
    text = (
        TOUCH + 'path = [\n{ step = "press", seconds = 0.5 },\n{ step = "release", seconds = 1 }]\n'
    )
    scene = read(
        text + "\n[elements]\ngrid = [6, 5]\ndead = [3]\n[electronics.converter]\nbits = 12\n"
    )

    assert scene.loads == (GaussianLoad(0.05, 0.05, 0.005, 0.2),)
    assert scene.duration == 1.5
    assert scene.loads_at(0.0) == ()
    assert scene.loads_at(0.5) == scene.loads
    assert scene.layout.shape == (6, 5)
    assert not scene.layout.live[:, 3].any()
    assert scene.transduction.converter.bits == 12
    assert scene.choice.auto


def test_a_displacement_stands_for_the_force_that_makes_it():
    (load,) = load_scene("off-centre").loads
    assert isinstance(load, PointLoad)
    scene = load_scene("off-centre")
    c = scene.plate.deflection(scene.loads, scene.basis)
    at = scene.basis.at(load.centre()[None])[0] @ c.ravel()
    assert at == pytest.approx(4.89e-3)


def test_a_rigid_object_is_pressed_by_force_or_depth():
    (stimulus,) = load_scene("pencil").stimuli
    assert isinstance(stimulus.what, Indenter)
    assert stimulus.what.rigid == Cylinder(0.0035, 0.07)
    assert (stimulus.what.force, stimulus.what.depth) == (0.25, None)


def test_files_that_a_scene_names_lie_beside_it(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    trimesh.creation.icosphere(radius=10.0).export(tmp_path / "ball.stl")
    (tmp_path / "way.csv").write_text("time,dx,dy,amount\n0,0,0,0\n1,0.01,0,1\n2,0,0,0\n")
    text = HEAD + '[[touch]]\nwhat = "mesh"\nfile = "ball.stl"\nunit = 1e-3\nx = 0.05\ny = 0.05\n'
    scene = read(text + 'depth = 1e-3\nrecorded = "way.csv"\n', tmp_path)

    (stimulus,) = scene.stimuli
    assert isinstance(stimulus.what, Indenter)
    assert isinstance(stimulus.what.rigid, Mesh)
    assert stimulus.pose_at(0.5).dx == pytest.approx(0.005)
    assert scene.duration == 2.0


WRONG = {
    "an unknown key": (HEAD + "edeg = 'hinged'\n", "line 5: skin.edeg: .* did you mean edge?"),
    "an unknown table": (HEAD + "[elemnts]\ngrid = [4, 4]\n", "line 5: elemnts: .*mean elements?"),
    "an unknown effect": (HEAD + "[effects.creeep]\nshare = 0.1\n", "line 5: .*mean creep?"),
    "a wrong kind": (HEAD + "edge = 3\n", "line 5: skin.edge: expected a text, got 3"),
    "another edge": (HEAD + "edge = 'clampd'\n", "line 5: .*did you mean 'clamped'"),
    "a negative size": ("format = 1\n[skin]\nsize = [-0.1, 0.1]\n", "line 2: skin: .*metres"),
    "one side": ("format = 1\n[skin]\nsize = [0.1]\n", "line 3: .*list of 2 numbers"),
    "no size": ("format = 1\n", "expected size = a list of 2 numbers, got none"),
    "a newer format": ("format = 2\n", "line 1: format: .*get a newer kappaskin"),
    "no format": ("", "expected format = a whole number, got none"),
    "no TOML": ("format = \n", "a mistake in it: .*line 1"),
    "a load beside the skin": (TOUCH.replace("x = 0.05", "x = 0.2"), "a load on the patch"),
    "a load that leaves": (
        TOUCH + 'path = [{step="press", seconds=1}, {step="slide", by=[0.2, 0], seconds=1},'
        '{step="release", seconds=1}]\n',
        "a load on the patch",
    ),
    "a step of no time": (TOUCH + 'path = [{step="press", seconds=0}]\n', "more than 0 s"),
    "an unknown step": (TOUCH + 'path = [{step="pres", seconds=1}]\n', "line 12: .*'press'"),
    "a jump": (
        TOUCH + 'path = [{step="press", seconds=1}, {step="slide", by=[0.01, 0], seconds=1}]\n',
        "ends lifted or where it began",
    ),
    "two motions": (TOUCH + "path = []\norbit = {radius=0.01, period=1}\n", "expected one motion"),
    "no steps": (TOUCH + "path = []\n", "at least one step"),
    "force and depth": (
        HEAD + '[[touch]]\nwhat="sphere"\nradius=0.01\nx=0.05\ny=0.05\nforce=1\ndepth=1e-3\n',
        "a force in N or a depth in m",
    ),
    "a sphere of no size": (
        HEAD + '[[touch]]\nwhat="sphere"\nradius=-0.01\nx=0.05\ny=0.05\nforce=1\n',
        r"line 5: touch\[1\]: ",
    ),
    "an object and a load": (
        TOUCH + '[[touch]]\nwhat="sphere"\nradius=0.01\nx=0.05\ny=0.05\nforce=1\n',
        "press alone, got 2",
    ),
    "no such file": (
        HEAD + '[[touch]]\nwhat="mesh"\nfile="none.stl"\nx=0.05\ny=0.05\nforce=1\n',
        r"line 5: touch\[1\]: .*none.stl",
    ),
    "an accuracy of all": ("accuracy = 1.0\n" + HEAD, "an accuracy between 0 and 1"),
    "on and off": (HEAD + "[effects]\non=['skew']\noff=['skew']\n", "skew as both"),
    "an unknown choice": (HEAD + "[effects]\nchoose = 'none'\n", "line 6: effects.choose: .*auto"),
    "an effect of the skin": (HEAD + "[effects.foam]\nx = 1\n", r"\[skin\] has the foundation"),
    "a rate that cannot be": ("rate = 1e6\n" + HEAD, "lower the rate"),
    "a grid of words": (HEAD + "[elements]\ngrid = ['a', 'b']\n", "line 6: elements.grid: "),
    "a listed effect that there is not": (
        HEAD + "[effects]\nchoose = ['mains-hmu']\n",
        "line 6: effects.choose: expected effects among .*mains-hmu",
    ),
    "a list and on": (HEAD + "[effects]\nchoose = []\non = ['quantisation']\n", "got both"),
    "an effect of nothing": (
        HEAD + "[effects]\non = ['creep']\n",
        "line 5: effects: expected effects that there is something of .* got creep",
    ),
    "a touch on cylinders": (
        TOUCH + "[cylinders]\ndwell = 1.0\n",
        r"^a.toml, line 6: touch\[1\]: .*cylinders",
    ),
    "an element that is not there": (HEAD + "[elements]\ndead = [100]\n", "line 5: elements: .*99"),
}


@pytest.mark.parametrize(("text", "said"), WRONG.values(), ids=WRONG)
def test_what_is_wrong_is_refused_with_its_line_and_the_remedy(text, said):
    with pytest.raises(Refusal, match=said) as refused:
        read(text)
    assert str(refused.value).startswith("a.toml")
    assert str(refused.value).count("a.toml") == 1


def test_a_key_inside_an_array_of_tables_is_found_in_the_right_one():
    text = TOUCH + '\n[[touch]]\nwhat = "point"\nx = 0.05\ny = 0.05\nfroce = 1.0\n'
    with pytest.raises(Refusal, match=r"line 17: touch\[2\].froce: .*mean force"):
        read(text)


def test_a_file_that_is_not_there_is_refused_plainly(tmp_path):
    with pytest.raises(Refusal, match="cannot be read as a scene"):
        load_scene(str(tmp_path / "none.toml"))
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(Refusal, match="cannot be read as a scene"):
        load_scene(str(tmp_path / "binary.toml"))


def test_infinite_numbers_are_refused():
    with pytest.raises(Refusal):
        read(HEAD.replace("[0.1, 0.1]", "[inf, 0.1]"))
    assert read(HEAD + "radius = inf\n").plate.patch.radius == math.inf
    with pytest.raises(Refusal):
        read(HEAD + "radius = nan\n")
    assert np.isfinite(read(HEAD).plate.rigidity)
