"""Plug-ins of other packages: found, checked, and left out by name where they are broken."""

import importlib
import importlib.util
import json
import os
import subprocess
import sys

import pytest

from kappaskin import _plugins
from kappaskin._plugins import EFFECTS, ESTIMATORS, SOURCES, found_plug_ins, left_out, plug_ins
from kappaskin.errors import Refusal, SourceError
from kappaskin.sources import described_source, open_source

ESTIMATOR = """
from kappaskin.estimation import LeastSquares

class Own(LeastSquares):
    pass
"""

ODD_TEXT = """
class Odd(Exception):
    def __str__(self):
        raise RuntimeError

raise Odd
"""

SOURCE = """
from kappaskin.errors import EndedSource

class Halted(BaseException):
    pass

class Odd(Exception):
    def __str__(self):
        raise RuntimeError

class Short:
    sensor, patient, trouble, temperature = None, False, "", 20.0
    read = record = close = lambda *_: []

def opened(url, sensor):
    match url.partition(":")[2]:
        case "none":
            return None
        case "seven":
            return 7
        case "short":
            return Short()
        case "refused":
            raise EndedSource("the tape is over")
        case "Ctrl+C":
            raise KeyboardInterrupt
        case what:
            raise {"exit": SystemExit, "halt": Halted, "odd": Odd}.get(what, RuntimeError)("no key")
"""

FEATURES = """
class Good:
    name = "good"

    def install(self, shell):
        pass

seven = 7
"""


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Puts a package with entry points where this process and those it starts find it."""
    monkeypatch.setattr(_plugins, "_found", {})
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)

    def install(name, code, **points):
        (tmp_path / f"{name}.py").write_text(code)
        there = tmp_path / f"{name}-1.5.dist-info"
        there.mkdir()
        (there / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.5\n")
        groups = (
            f"[kappaskin.{group}]\n" + "\n".join(lines) + "\n" for group, lines in points.items()
        )
        (there / "entry_points.txt").write_text("\n".join(groups))
        importlib.invalidate_caches()  # asked of who makes a module while a program runs

    return install


def accept(name, made):
    """Anything will do."""


def command(*words):
    done = subprocess.run(
        [sys.executable, "-m", "kappaskin", *words], capture_output=True, text=True, check=False
    )
    return done.returncode, done.stdout, done.stderr


def test_what_is_installed_is_loaded_with_its_package_version_and_file(installed, tmp_path) -> None:
    installed(
        "lone_package", "made = 7\ndef opened(url, sensor): ...", sources=["x=lone_package:opened"]
    )

    assert plug_ins(SOURCES, accept).keys() == {"x"}
    (found,) = found_plug_ins()
    assert (found.package, found.version, found.trouble) == ("lone_package", "1.5", "")
    assert found.file == str(tmp_path / "lone_package.py")
    assert found.text == "source x of lone_package 1.5"


@pytest.mark.parametrize(
    ("code", "point", "why"),
    [
        ("raise RuntimeError('no licence')", "x=broken_one:made", "RuntimeError: no licence"),
        ("raise SystemExit(3)", "x=broken_one:made", "SystemExit: 3"),
        ("import no_such_module", "x=broken_one:made", "ModuleNotFoundError"),
        ("made = 1", "x=broken_one:other", "AttributeError"),
        ("def (", "x=broken_one:made", "SyntaxError"),
        ("made = 1", "x=broken_two:made", "ModuleNotFoundError"),
        ("made = 1", "taken=broken_one:made", "ValueError: the name is taken"),
        ("made = 1", "odd=broken_one:made", "TypeError: odd"),
        ("", "x=not a valid:::thing", "ValueError: expected MODULE:OBJECT, got 'not a valid:::"),
        ("", "x=", "ValueError: expected MODULE:OBJECT, got ''"),
        ("class Halt(BaseException): ...\nraise Halt('no key')", "x=broken_one", "Halt: no key"),
        (ODD_TEXT, "x=broken_one:made", "Odd"),
    ],
)
def test_a_broken_one_is_left_out_and_named(installed, code, point, why) -> None:
    installed("broken_one", code, effects=[point])
    sys.modules.pop("broken_one", None)

    def check(name, made):
        if name == "odd":
            raise TypeError(name)

    assert plug_ins(EFFECTS, check, {"taken"}) == {}
    (found,) = found_plug_ins()
    assert f"of broken_one 1.5, left out: {why}" in found.text
    assert why in left_out(EFFECTS, found.name)
    assert left_out(ESTIMATORS, found.name) == "; a plug-in may be missing"


def test_an_odd_name_of_its_module_is_no_trouble(installed, tmp_path) -> None:
    installed("odd_one", "def made(): ...\nmade.__module__ = []", effects=["x=odd_one:made"])

    assert plug_ins(EFFECTS, accept).keys() == {"x"}
    (found,) = found_plug_ins()
    assert (found.file, found.trouble) == (str(tmp_path / "odd_one.py"), "")


def test_ctrl_c_is_never_left_out(installed) -> None:
    installed("slow_one", "raise KeyboardInterrupt", effects=["x=slow_one:made"])
    with pytest.raises(KeyboardInterrupt):
        plug_ins(EFFECTS, accept)


@pytest.mark.parametrize(
    ("said", "text"),
    [
        (None, "source x of an unknown package (unknown version)"),
        ("Metadata-Version: 2.1\nName: bare_one\n", "source x of bare_one (unknown version)"),
    ],
)
def test_what_is_not_said_of_a_package_is_unknown(installed, tmp_path, said, text) -> None:
    installed("bare_one", "made = 7", sources=["x=bare_one:made"])
    metadata = tmp_path / "bare_one-1.5.dist-info" / "METADATA"
    metadata.unlink() if said is None else metadata.write_text(said)

    if importlib.util.find_spec("importlib_metadata"):  # whose finder replaces Python's
        importlib.import_module("importlib_metadata")

    found = plug_ins(SOURCES, accept)
    assert [one.text for one in found_plug_ins()] == [text]
    assert found == {"x": 7}


@pytest.mark.parametrize(
    ("what", "came"),
    [
        ("licence", "RuntimeError: no key"),
        ("exit", "SystemExit: no key"),
        ("halt", "Halted: no key"),
        ("odd", "Odd"),
        ("none", "TypeError: None has no sensor, read, patient, "),
        ("seven", "TypeError: 7 has no sensor, read, patient, "),
        ("short", " has no events, accounting"),
    ],
)
def test_a_source_that_fails_is_refused_with_the_name_of_its_plug_in(
    installed, tmp_path, monkeypatch, what, came
) -> None:
    installed("bad_one", SOURCE, sources=["bad=bad_one:opened"])
    monkeypatch.setattr("kappaskin.sources.source._plugged", lambda: plug_ins(SOURCES, accept))

    for name in (f"bad:{what}", described_source(tmp_path / "board.toml", f"bad:{what}")):
        with pytest.raises(SourceError) as refused:
            open_source(name)
        assert str(refused.value).startswith(f"expected a source for bad:{what}, got ")
        assert came in str(refused.value)
        assert str(refused.value).endswith("; plug-in source bad of bad_one 1.5")


def test_its_own_refusal_and_ctrl_c_pass(installed, monkeypatch) -> None:
    installed("bad_one", SOURCE, sources=["bad=bad_one:opened"])
    monkeypatch.setattr("kappaskin.sources.source._plugged", lambda: plug_ins(SOURCES, accept))

    with pytest.raises(Refusal, match=r"^the tape is over$"):
        open_source("bad:refused")
    with pytest.raises(KeyboardInterrupt):
        open_source("bad:Ctrl+C")


@pytest.mark.slow
@pytest.mark.parametrize("what", ["licence", "none"])
def test_a_recording_of_a_source_that_fails_is_refused(installed, tmp_path, what) -> None:
    installed("bad_one", SOURCE, sources=["bad=bad_one:opened"])

    code, _, complaint = command("record", f"bad:{what}", str(tmp_path / "bad.mcap"))

    assert code == 2
    (line,) = complaint.splitlines()
    assert line.startswith(f"kappaskin: expected a source for bad:{what}, got ")
    assert line.endswith("; plug-in source bad of bad_one 1.5")
    assert list(tmp_path.glob("bad.mcap*")) == []


@pytest.mark.slow
def test_an_estimator_is_used_by_name_and_broken_ones_are_reported_once(
    installed, tmp_path
) -> None:
    points = ["own=good_one:Own", "robust=good_one:Own", "number=good_one:__name__"]
    installed("good_one", ESTIMATOR, estimators=points, effects=["creep=good_one:Own"])

    code, printed, complaint = command("tables", "--method", "own", "--json")
    assert code == 0
    assert json.loads(printed)
    taken, what = (
        "ValueError: the name is taken",
        "kappaskin: plug-in {} of good_one 1.5, left out: ",
    )
    assert complaint.splitlines() == [
        what.format("estimator robust") + taken,
        what.format("estimator number")
        + "TypeError: expected a class of Estimator with all its methods, got 'good_one'",
        what.format("effect creep") + taken,
    ]
    least_squares = json.loads(command("tables", "--json")[1])
    assert [row["rms_mm"] for row in json.loads(printed)] == [
        row["rms_mm"] for row in least_squares
    ]


@pytest.mark.slow
def test_the_doctor_lists_them(installed, tmp_path) -> None:
    installed("good_one", ESTIMATOR, estimators=["own=good_one:Own"], sources=["y=good_one:none"])

    code, printed, _ = command("doctor", "--json")
    found = {one["name"]: one for one in json.loads(printed)["plug_ins"]}
    assert code == 0
    assert found["own"]["file"] == str(tmp_path / "good_one.py")
    assert found["y"]["trouble"].startswith("AttributeError")
    lines = [line for line in command("doctor")[1].splitlines() if line.startswith("plug-in")]
    assert (
        lines[0] == f"plug-in             estimator own of good_one 1.5  {tmp_path / 'good_one.py'}"
    )
    assert "source y of good_one 1.5, left out: AttributeError" in lines[1]


@pytest.mark.slow
def test_the_doctor_lists_what_is_no_feature_as_left_out(installed) -> None:
    points = ["good=pane:Good", "better=pane:Good", "seven=pane:seven"]
    installed("pane", FEATURES, features=points)

    code, printed, _ = command("doctor", "--json")
    found = {one["name"]: one["trouble"] for one in json.loads(printed)["plug_ins"]}
    assert code == 0
    assert found["good"] == ""
    assert found["better"].startswith("TypeError: expected a class with the name 'better' and ")
    assert found["seven"] == "TypeError: expected a class with the name 'seven' and install, got 7"


@pytest.mark.slow
def test_what_needs_a_missing_one_says_so(installed, tmp_path) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(
        "format = 1\n[skin]\nsize = [0.1, 0.1]\n[elements]\ngrid = [4, 4]\n[effects.lag]\ntau = 1\n"
    )

    code, _, complaint = command("plan", str(scene))
    assert code == 2
    assert "expected effects among tension" in complaint
    assert "a plug-in may be missing" in complaint
    assert "a plug-in may be missing" in command("tables", "--method", "own")[2]
