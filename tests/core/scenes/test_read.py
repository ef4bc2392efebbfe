"""Scene files: what they may say, and that everything else is refused with its line."""

import math
import os
from pathlib import Path

import numpy as np
import pytest

from kappaskin import GaussianLoad, PointLoad, Refusal, load_scene
from kappaskin.mechanics import Cylinder, Mesh, Stretching
from kappaskin.scenes import SCENES, Indenter, read_scene

HEAD = "format = 1\n\n[skin]\nsize = [0.1, 0.1]\n"
TOUCH = HEAD + '\n[[touch]]\nwhat = "gaussian"\nx = 0.05\ny = 0.05\nsd = 0.005\nforce = 0.2\n'
STEP = '[[touch.path]]\nstep = "tap"\nseconds = 1\n'


def read(text: str, folder: Path = Path()):
    return read_scene(text, folder / "a.toml")


@pytest.mark.parametrize("name", SCENES)
def test_every_ready_scene_says_what_there_is_to_see(name):
    scene = load_scene(name)

    assert scene.name == name
    assert len(scene.title) > 3
    assert scene.text.endswith(".\n")


@pytest.mark.parametrize("file", ["mine.toml", "mine.scene.toml"])
def test_a_scene_is_called_as_its_file_is_whatever_it_ends_in(file):
    scene = read_scene(HEAD, Path(file))
    assert (scene.name, scene.title) == ("mine", "mine")


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


def test_a_displacement_of_a_skin_that_stretches_takes_more_force():
    touch = '[[touch]]\nwhat = "point"\nx = 0.03\ny = 0.05\ndisplacement = -1e-3\n'
    loose, sheet = read(HEAD + touch), read(HEAD + "thickness = 0.25e-3\n" + touch)

    c = Stretching(sheet.plate, sheet.basis).deflection(sheet.loads)

    assert sheet.basis.value(0.03, 0.05, c) == pytest.approx(-1e-3, rel=1e-6)
    assert sheet.loads[0].force < 3 * loose.loads[0].force < 0


def test_an_object_at_a_depth_is_refused_on_a_skin_that_stretches():
    ball = '[[touch]]\nwhat = "sphere"\nx = 0.05\ny = 0.05\nradius = 0.02\ndepth = 1e-3\n'

    with pytest.raises(Refusal, match="give the force, or omit the thickness"):
        read(HEAD + "thickness = 0.25e-3\n" + ball)
    read(HEAD + "thickness = 0.25e-3\n" + ball.replace("depth = 1e-3", "force = 0.1"))


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


CANTILEVER = (
    'format = 1\n[skin]\nshape = "strip"\nsize = [0.3, 0.02]\nedge = "cantilever"\n'
    'rigidity = 2.0\n[elements]\ngrid = [6, 1]\nreads = ["height"]\n'
    '[[touch]]\nwhat = "point"\nx = 0.3\ny = 0.01\nforce = 0.1\n'
)


def test_a_cantilever_moves_as_a_beam_under_a_load_at_its_tip():
    scene = read(CANTILEVER)
    x, a = scene.layout.positions[:, 0], 0.3

    c = scene.plate.deflection(scene.loads, scene.basis).ravel()

    beam = 0.1 * x**2 * (3 * a - x) / (6 * 2.0 * 0.02)
    assert scene.layout.operator(scene.basis) @ c == pytest.approx(beam, rel=1e-3)


WRONG = {
    "a cantilever with two sides": (
        CANTILEVER.replace('shape = "strip"', ""),
        "among hinged, .*, elastic; got 'cantilever'",
    ),
    "a bent cantilever": (
        CANTILEVER.replace("rigidity", "radius = 0.2\nrigidity"),
        "among hinged, sliding, clamped; got 'cantilever'",
    ),
    "an unknown key": (HEAD + "edeg = 'hinged'\n", "line 5: skin.edeg: .* did you mean edge?"),
    "an unknown table": (HEAD + "[elemnts]\ngrid = [4, 4]\n", "line 5: elemnts: .*mean elements?"),
    "an unknown effect": (HEAD + "[effects.creeep]\nshare = 0.1\n", "line 5: .*mean creep?"),
    "a wrong kind": (HEAD + "edge = 3\n", "line 5: skin.edge: expected a text, got 3"),
    "another edge": (HEAD + "edge = 'clampd'\n", "line 5: .*did you mean 'clamped'"),
    "rings of a rectangle": (
        HEAD + "[elements]\nrings = [1, 6]\n",
        "line 5: elements: expected a disk or a cap, got a patch",
    ),
    "two patterns": (
        HEAD + "[elements]\nrings = [1, 6]\nspiral = 9\n",
        "line 7: elements.spiral: expected one pattern, got rings and spiral",
    ),
    "a cap of no radius": (
        "format = 1\n[skin]\nshape = 'cap'\n",
        "line 2: skin: expected radius = a number, got none",
    ),
    "a cap beyond a hemisphere": (
        "format = 1\n[skin]\nshape = 'cap'\nradius = 0.008\nangle = 2\n",
        "line 2: skin: expected a cap whose rim",
    ),
    "a dome too steep": (
        "format = 1\n[skin]\nsize = [0.02, 0.02]\nradius = [0.01, 0.01]\n",
        "line 2: skin: shallow shell theory neglects .* radii of at least 0.045 m",
    ),
    "a negative size": ("format = 1\n[skin]\nsize = [-0.1, 0.1]\n", "line 2: skin: .*metres"),
    "one side": ("format = 1\n[skin]\nsize = [0.1]\n", "line 3: .*list of 2 numbers"),
    "no size": ("format = 1\n", "expected size = a list of 2 numbers, got none"),
    "a newer format": ("format = 2\n", "line 1: format: .*update kappaskin"),
    "no format": ("", "expected format = a whole number, got none"),
    "no TOML": ("format = \n", "an error in it: .*line 1"),
    "a load beside the skin": (TOUCH.replace("x = 0.05", "x = 0.2"), "a load on the patch"),
    "a load that leaves": (
        TOUCH + 'path = [{step="press", seconds=1}, {step="slide", by=[0.2, 0], seconds=1},'
        '{step="release", seconds=1}]\n',
        "a load on the patch",
    ),
    "a load that taps beside the skin": (
        TOUCH + 'path = [{step="slide", by=[0.2, 0], seconds=1}, {step="tap", seconds=1}]\n',
        "a load on the patch",
    ),
    "a step of no time": (
        TOUCH + 'path = [{step="press", seconds=0}]\n',
        "a step that takes 1e-06 to 1e.09 s, got 0 s",
    ),
    "an unknown step": (TOUCH + 'path = [{step="pres", seconds=1}]\n', "line 12: .*'press'"),
    "an unknown step of another touch": (
        TOUCH + STEP + TOUCH.removeprefix(HEAD).lstrip() + STEP.replace("tap", "top"),
        r"line 22: touch\[2\]\.path\[1\]\.step: expected one of .*'top'",
    ),
    "a jump": (
        TOUCH + 'path = [{step="press", seconds=1}, {step="slide", by=[0.01, 0], seconds=1}]\n',
        "ends lifted or at its start",
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
        r"line 7: touch\[1\].file: .*none.stl",
    ),
    "an accuracy of all": ("accuracy = 1.0\n" + HEAD, "line 1: accuracy: .*between 0 and 1"),
    "on and off": (HEAD + "[effects]\non=['skew']\noff=['skew']\n", "skew as both"),
    "an unknown choice": (HEAD + "[effects]\nchoose = 'none'\n", "line 6: effects.choose: .*auto"),
    "an effect of the skin": (HEAD + "[effects.foam]\nx = 1\n", r"set foundation in \[skin\]"),
    "a rate that cannot be": ("rate = 1e6\n" + HEAD, "lower the rate"),
    "a grid of words": (HEAD + "[elements]\ngrid = ['a', 'b']\n", "line 6: elements.grid: "),
    "a listed effect that there is not": (
        HEAD + "[effects]\nchoose = ['mains-hmu']\n",
        "line 6: effects.choose: expected effects among .*mains-hmu",
    ),
    "a list and on": (HEAD + "[effects]\nchoose = []\non = ['quantisation']\n", "got both"),
    "an effect of nothing": (
        HEAD + "[effects]\non = ['creep']\n",
        "line 5: effects: expected effects that occur in this scene, got creep",
    ),
    "a touch on cylinders": (
        TOUCH + "[cylinders]\ndwell = 1.0\n",
        r"^a.toml, line 6: touch\[1\]: .*cylinders",
    ),
    "lengths in mm": (
        "format = 1\n[skin]\nsize = [100, 100]\n",
        "line 2: skin: expected sides of 0.0001 to 10 m, got 100 x 100 m; lengths are in metres",
    ),
    "a place in mm": (
        TOUCH.replace("x = 0.05", "x = 50"),
        r"line 6: touch\[1\]: expected a load on .*positions are in metres",
    ),
    "a vast grid": (HEAD + "[elements]\ngrid = [5000, 5000]\n", "line 5: .*at most 21845 elements"),
    "a grid beyond counting": (HEAD + f"[elements]\ngrid = [{10**30}, 1]\n", "at most 21845"),
    "a vast reference": (
        "reference = [500, 500]\n" + HEAD,
        "line 1: reference: expected at most 4096 functions .* got 500 x 500; take fewer",
    ),
    "a vast reference on a disk": (
        "format = 1\nreference = [32, 32]\n[skin]\nshape = 'disk'\nrim_radius = 0.05\n",
        "line 2: reference: expected at most 400 functions",
    ),
    "many functions at many elements": (
        "format = 1\nrate = 1\nreference = [64, 64]\n[skin]\nsize = [1, 1]\n"
        "[elements]\ngrid = [100, 100]\n",
        "line 3: reference: expected at most 1118 functions .* with 10000 elements",
    ),
    "a negative seed": ("seed = -1\n" + HEAD, "line 1: seed: expected at least 0|0 to .*got -1"),
    "no rate": ("rate = 0\n" + HEAD, "line 1: rate: expected 0.001 to 1e.06 frames/s, got 0"),
    "too soft a skin": (
        HEAD + "rigidity = 1e-300\n",
        "line 5: skin.rigidity: .*1e-12 to 1e.06 N m",
    ),
    "too taut a skin": (HEAD + "tension = 1e7\n", "line 5: skin.tension: expected .* N/m, got"),
    "too hard a push": (
        TOUCH.replace("force = 0.2", "force = 1e300"),
        r"line 11: touch\[1\].force: expected a force of -1e.06 to 1e.06 N",
    ),
    "a grid beyond writing": (
        HEAD + f"[elements]\ngrid = [{10**4000}, {10**4000}]\n",
        "at most 21845",
    ),
    "a list for a number or none": (
        HEAD + '[[touch]]\nwhat = "sphere"\nx = 0.05\ny = 0.05\nradius = 0.02\ndepth = [1.0]\n',
        "touch\\[1\\].depth: expected a number, got \\[1.0\\]",
    ),
    "a number beyond computing": (f"rate = {10**400}\n" + HEAD, "line 1: rate: expected a number"),
    "an endless number": ("seed = " + "9" * 5000 + "\n" + HEAD, "an error in it: .*digits"),
    "lists in lists": ("a = " + "[" * 9999 + "]" * 9999 + HEAD, "nested too deep"),
    "a line of spaces": (
        HEAD + "[elements]\npositions = [\n[" + " " * 9999 + "1, 2]]\n",
        "line 5: elements: 1 of 1 elements lie outside",
    ),
    "keys in keys": ("a" + ".a" * 99999 + " = 1\n" + HEAD, "nested too deep"),
    "many steps": (
        TOUCH + "path = [" + '{step="tap", seconds=1},' * 2000 + "]\n",
        "line 12: .* 1000 at most, got 2000",
    ),
    "an orbit in no time": (
        TOUCH + "orbit = {radius=0.01, period=1e-308}\n",
        "line 12: .*1e-06 to",
    ),
    "an object beside the skin": (
        HEAD + '[[touch]]\nwhat="sphere"\nradius=0.01\nx=0.5\ny=0.05\ndepth=1e-3\n',
        r"line 5: touch\[1\]: expected an object over .* which misses it",
    ),
    "an object that leaves": (
        HEAD + '[[touch]]\nwhat="sphere"\nradius=0.01\nx=0.05\ny=0.05\nforce=1\n'
        'path = [{step="press", seconds=1}, {step="slide", by=[0.2, 0], seconds=1},'
        '{step="release", seconds=1}]\n',
        r"line 5: touch\[1\]: expected an object over .*\(0.25, 0.05\) m, which misses it",
    ),
    "an object that leaves by little more than its radius": (
        HEAD + '[[touch]]\nwhat="sphere"\nradius=0.01\nx=0.05\ny=0.05\nforce=1\n'
        'path = [{step="press", seconds=1}, {step="slide", by=[0.062, 0], seconds=1},'
        '{step="release", seconds=1}]\n',
        r"line 5: touch\[1\]: expected an object over .*\(0.112, 0.05\) m, which misses it",
    ),
    "an object nowhere": (
        HEAD + '[[touch]]\nwhat="sphere"\nradius=0.01\nx=nan\ny=0.05\nforce=1\n',
        r"line 5: touch\[1\]: expected a finite position",
    ),
    "a load moved nowhere": (
        HEAD + '[[touch]]\nwhat="point"\nx=inf\ny=0.05\ndisplacement=1e-3\n',
        r"line 5: touch\[1\]: expected a load on .*x=inf",
    ),
    "an object pressed through": (
        HEAD + '[[touch]]\nwhat="sphere"\nradius=0.01\nx=0.05\ny=0.05\ndepth=1\n',
        "line 5: .*a depth of at most 0.1 m, .* depths are in metres",
    ),
    "a ball as large as the sky": (
        HEAD + '[[touch]]\nwhat="sphere"\nradius=1e300\nx=0.05\ny=0.05\nforce=1\n',
        "line 5: .*sizes above zero in metres, 1000 at most",
    ),
    "noise without end": (
        HEAD + "[effects.uniform-noise]\nrms = 1e308\n",
        "line 5: effects.uniform-noise: .*rms of 0 to 10000 1/m",
    ),
    "loops without end": (
        HEAD + f"[effects.hysteresis]\nthresholds = {list(range(1, 200))}\n"
        f"weights = {[1e-6] * 199}\n",
        "line 5: .*at most 100 thresholds, got 199",
    ),
    "a stuck element that is not there": (
        HEAD + "[effects.stuck]\nelements = [500]\n",
        "line 6: effects.stuck.elements: .*from 0 to 99, got",
    ),
    "a cylinder of no size": (
        HEAD + "[cylinders]\nradii = [0.1, 1e-310, 0.2]\n",
        "line 6: cylinders.radii: expected 0.0001 to 1000 m",
    ),
    "a name that no file has": (
        HEAD + '[[touch]]\nwhat="mesh"\nfile="a\\u0000.stl"\nx=0.05\ny=0.05\nforce=1\n',
        r"line 7: touch\[1\].file: ",
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


@pytest.mark.parametrize("quotes", ['"""', "'''"])
def test_lines_are_counted_past_a_text_that_looks_like_tables(quotes):
    said = f'title = "a\\u2028b"\ntext = {quotes}\n[skin]\nedge = 3\n{quotes}\n' + HEAD
    with pytest.raises(Refusal, match=r"line 10: skin.edge: expected a text, got 4"):
        read(said + "edge = 4\n")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
@pytest.mark.parametrize("says", ['what = "mesh"\nfile', 'what = "point"\nrecorded'])
def test_a_pipe_in_place_of_a_file_is_refused_not_waited_for(tmp_path, says):
    for name in ("way.stl", "way.toml"):
        os.mkfifo(tmp_path / name)

    with pytest.raises(Refusal, match="expected the name of a file in the folder of the scene"):
        read(HEAD + f'[[touch]]\nx = 0.05\ny = 0.05\nforce = 1\n{says} = "way.stl"\n', tmp_path)
    with pytest.raises(Refusal, match=r"cannot be read as a scene \(it is not a file\)"):
        load_scene(str(tmp_path / "way.toml"))


RECORDS = {
    "another heading": (b"t,x,y,a\n0,0,0,0\n", "a first line time,dx,dy,amount, got"),
    "nothing": (b"", "a first line time,dx,dy,amount, got"),
    "a heading alone": (b"time,dx,dy,amount\n", "lines of four numbers"),
    "ragged lines": (b"time,dx,dy,amount\n0,0,0,0\n1,0\n", "a CSV of numbers"),
    "binary": (bytes(range(256)), "a CSV of numbers"),
    "no number": (b"time,dx,dy,amount\n0,0,0,0\n1,nan,0,0\n", "finite poses"),
    "a jump back": (b"time,dx,dy,amount\n0,0,0,0\n1,0,0,0\n0.5,0,0,0\n", "at increasing times"),
    "too hard": (b"time,dx,dy,amount\n0,0,0,0\n1,0,0,1e300\n", "amounts of 0 to 1000"),
    "off the skin": (b"time,dx,dy,amount\n0,0,0,0\n1,1,0,1\n2,0,0,0\n", "a load on the patch"),
    "off the skin at last": (b"time,dx,dy,amount\n0,0,0,1\n1,1,0,1\n", "a load on the patch"),
    "too many": (
        b"time,dx,dy,amount\n" + b"".join(b"%d,0,0,1\n" % n for n in range(20001)),
        "at most 20000 poses",
    ),
    "too large": (b"time,dx,dy,amount\n" + b"0,0,0,0\n" * 2**20, "keep fewer lines"),
}


@pytest.mark.parametrize(("record", "said"), RECORDS.values(), ids=RECORDS)
def test_a_record_that_cannot_be_is_refused(tmp_path, record, said):
    (tmp_path / "way.csv").write_bytes(record)

    with pytest.raises(Refusal, match=rf"line \d+: touch\[1\].*{said}"):
        read(TOUCH + 'recorded = "way.csv"\n', tmp_path)


@pytest.mark.parametrize("prefix", [b"", b"\xef\xbb\xbf"], ids=["plain", "BOM"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"], ids=["LF", "CRLF", "CR"])
def test_files_are_read_however_their_lines_end(tmp_path, prefix, end):
    record = "time,dx,dy,amount\n0,0,0,0\n1,0.01,0,1\n2,0,0,0\n\n"
    for name, text in (("way.csv", record), ("a.toml", TOUCH + 'recorded = "way.csv"\n')):
        (tmp_path / name).write_bytes(prefix + text.replace("\n", end).encode())

    assert load_scene(str(tmp_path / "a.toml")).duration == 2.0
