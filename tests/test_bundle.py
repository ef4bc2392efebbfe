"""What the bundle's recipe says is there, and is what a desktop understands."""

import configparser
import importlib.util
import os
import re
import runpy
import shutil
import subprocess
import sys
from importlib import metadata
from pathlib import Path
from xml.etree import ElementTree

import pytest
from PIL import Image

from kappaskin_resources import __file__ as resources

ROOT = Path(__file__).parents[1]
RECIPE = ROOT / "packaging" / "bundle"
CONTENTS = runpy.run_path(str(RECIPE / "contents.py"))
BUILD = runpy.run_path(str(RECIPE / "build.py"))
MIME = "{http://www.freedesktop.org/standards/shared-mime-info}"
NEEDS_LINUX = pytest.mark.skipif(sys.platform != "linux", reason="binaries as Linux has them")


def entry():
    read = configparser.ConfigParser(interpolation=None)
    read.optionxform = str
    read.read(RECIPE / "kappaskin.desktop", "utf-8")
    return read["Desktop Entry"]


def kinds():
    return ElementTree.parse(RECIPE / "kappaskin.xml").getroot().findall(f"{MIME}mime-type")


@pytest.mark.parametrize("name", CONTENTS["HIDDEN"])
def test_what_is_imported_by_name_is_there(name):
    pytest.importorskip(name.partition(".")[0])

    assert importlib.util.find_spec(name)


def test_nothing_goes_in_that_is_left_out():
    hidden = {*CONTENTS["HIDDEN"], *CONTENTS["PACKAGES"]}

    assert not hidden & set(CONTENTS["EXCLUDED"])


def test_the_desktop_entry_opens_the_kinds_of_files_that_are_told_of():
    said = entry()

    assert said["Exec"] == "kappaskin app %f"
    assert set(said["MimeType"].strip(";").split(";")) == {kind.get("type") for kind in kinds()}
    assert (ROOT / "resources/kappaskin_resources/icons" / f"{said['Icon']}.svg").is_file()


@pytest.mark.skipif(shutil.which("desktop-file-validate") is None, reason="not installed")
def test_the_desktop_entry_is_valid():
    subprocess.run(["desktop-file-validate", str(RECIPE / "kappaskin.desktop")], check=True)


def test_files_are_told_by_the_endings_that_the_app_gives_them():
    from kappaskin_app.shell.simulation import OWN

    patterns = [glob.get("pattern") for kind in kinds() for glob in kind.findall(f"{MIME}glob")]

    names = ("press.mcap", "press.mcap.part", OWN.name, "SIM-0001-20261122.calibration.toml")
    for name in names:
        assert sum(Path(name).match(pattern) for pattern in patterns) == 1, name
    assert not any(Path("pyproject.toml").match(pattern) for pattern in patterns)


@pytest.mark.skipif(shutil.which("update-mime-database") is None, reason="not installed")
@pytest.mark.parametrize("name", ["my bundle", "R&D", "a|b", '100 % "$HOME" `ls`', r"a\b"])
def test_it_installs_for_one_user_from_a_folder_of_any_name(name, tmp_path):
    bundle, home = tmp_path / name, tmp_path / "my home"
    pytest.importorskip("PySide6")
    drawn = tmp_path / "kappaskin.png"
    BUILD["draw"](BUILD["ICON"], drawn)
    BUILD["add_desktop"](bundle, drawn)

    surroundings = {"HOME": str(home), "PATH": os.environ["PATH"]}
    subprocess.run([bundle / "install.sh"], env=surroundings, check=True, capture_output=True)

    share = home / ".local" / "share"
    desktop = (share / "applications" / "kappaskin.desktop").read_text()
    (told,) = re.findall(r'^Exec="(.*)" app %f$', desktop, re.MULTILINE)
    assert not re.search(r'(?<!\\)["`$]|(?<!%)%(?!%)', told)
    # A text of a desktop entry, then what is quoted in a command, then its fields.
    for escape in (r"\\(.)", r"\\(.)", "%(%)"):
        told = re.sub(escape, r"\1", told)
    assert told == f"{bundle}/kappaskin"
    assert "*.scene.toml" in (share / "mime" / "globs").read_text()
    assert (share / "icons/hicolor/256x256/apps/kappaskin.png").read_bytes() == drawn.read_bytes()


@NEEDS_LINUX
def test_a_stripped_file_that_no_longer_loads_is_told():
    elf = bytearray(Path(importlib.util.find_spec("_ctypes").origin).read_bytes())
    assert BUILD["loads"](bytes(elf))
    at = int.from_bytes(elf[32:40], "little")
    size, count = (int.from_bytes(elf[i : i + 2], "little") for i in (54, 56))
    first = next(at + i * size for i in range(count) if elf[at + i * size] == 1)

    elf[first + 8] ^= 1  # where the segment lies in the file

    assert not BUILD["loads"](bytes(elf))


def test_the_icon_is_drawn_from_what_the_window_shows(tmp_path):
    qtgui = pytest.importorskip("PySide6.QtGui")
    assert Path(resources).parent / "icons" / "kappaskin.svg" == BUILD["ICON"]

    BUILD["draw"](BUILD["ICON"], tmp_path / "icon.png")

    icon = qtgui.QImage(str(tmp_path / "icon.png"))
    assert icon.size().toTuple() == (256, 256)
    assert icon.pixelColor(0, 0).alpha() == 0  # its corners are round
    assert icon.pixelColor(128, 80).name() == "#ffb347"  # the ball


@pytest.mark.parametrize(
    ("version", "drawn", "wrong"),
    [
        (metadata.version("kappaskin"), True, []),
        ("9.9", True, ["--version: expected"]),
        (metadata.version("kappaskin"), False, ["no skin is drawn"]),
    ],
)
def test_another_version_or_a_window_without_a_skin_fails_the_trial(
    version, drawn, wrong, tmp_path
):
    down = Image.linear_gradient("L")
    shaded = Image.merge("RGB", (down, down.rotate(90), down))
    (shaded if drawn else down).save(tmp_path / "window.png")
    bundle, room = tmp_path / "dist" / "kappaskin", tmp_path / "room"
    bundle.mkdir(parents=True)
    room.mkdir()
    # Tells its version, or leaves the picture where the last argument says.
    script = f"#!/bin/sh\n[ $# = 1 ] && echo {version} || for to; do :; done\n"
    script += f'[ $# = 1 ] || cp "{tmp_path}/window.png" "$to"\n'
    (bundle / "kappaskin").write_text(script)
    (bundle / "kappaskin").chmod(0o755)

    trial = runpy.run_path(str(RECIPE / "trying.py"))["Trial"](bundle, room)
    trial.tell_version()
    trial.open("window")

    assert len(trial.failures) == len(wrong)
    assert all(told.startswith(start) for told, start in zip(trial.failures, wrong, strict=True))


def test_what_is_left_out_is_imported_by_no_line_of_ours():
    left_out = "|".join(re.escape(name) for name in CONTENTS["EXCLUDED"])
    code = re.compile(rf"^(?:import|from) (?:{left_out})\b", re.MULTILINE)

    for root in ("core", "app"):
        for file in (ROOT / root).rglob("*.py"):
            assert not code.search(file.read_text("utf-8")), file


@pytest.mark.parametrize(("argument", "why"), [("--try", "leave out --try"), ("--tri", "or --try")])
def test_what_cannot_be_tried_is_told(argument, why, tmp_path):
    code = shutil.copytree(RECIPE, tmp_path / "packaging" / "bundle") / "build.py"

    ran = subprocess.run([sys.executable, code, argument], capture_output=True, text=True)

    assert ran.returncode == 2
    assert why in ran.stderr
    assert not (tmp_path / "dist").exists()


def test_programs_are_started_by_module_as_a_bundle_can():
    starts = re.compile(r"\[\s*sys\.executable,\s*([^,\]]+)")
    found = {
        file.name: starts.findall(file.read_text("utf-8"))
        for folder in ("core", "app")
        for file in (ROOT / folder).rglob("*.py")
    }
    assert {word for words in found.values() for word in words} == {'"-m"'}
