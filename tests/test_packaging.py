import ast
import email
import json
import re
import runpy
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from importlib import metadata
from pathlib import Path

import psutil
import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from kappaskin.cli import system as doctor

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
VERSION = PROJECT["project"]["version"]
CONSTRAINTS = (ROOT / "packaging" / "constraints.txt").read_text("utf-8")


def requirements():
    project = PROJECT["project"]
    optional = project["optional-dependencies"].values()
    groups = PROJECT["dependency-groups"].values()
    asked = [project["dependencies"], PROJECT["build-system"]["requires"], *optional, *groups]
    named = [Requirement(text) for texts in asked for text in texts if isinstance(text, str)]
    return [each for each in named if each.name != "kappaskin"]  # an extra by another name


def pins():
    lines = [line for line in CONSTRAINTS.splitlines() if not line.startswith("#")]
    return {canonicalize_name(name): version for name, version in (i.split("==") for i in lines)}


def imported_by(file):
    """Top-level names of all that a file imports; a dot for what lies beside it."""
    return {
        name.split(".")[0]
        for node in ast.walk(ast.parse(file.read_text("utf-8")))
        for name in (
            [alias.name for alias in node.names]
            if isinstance(node, ast.Import)
            else [node.module or "."]
            if isinstance(node, ast.ImportFrom)
            else []
        )
    }


def references_gained(value, calls, change):
    change()  # The first call fills caches.
    before = sys.getrefcount(value)
    for _ in range(calls):
        change()
    return sys.getrefcount(value) - before


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """A folder with a wheel and a source distribution."""
    folder = tmp_path_factory.mktemp("built")
    command = [sys.executable, "-m", "hatchling", "build", "-d", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    return folder


def wheel(built):
    (file,) = built.glob("*.whl")
    return zipfile.ZipFile(file)


def test_the_wheel_holds_the_three_packages_and_nothing_else(built):
    with wheel(built) as archive:
        names = set(archive.namelist())

    information = f"kappaskin-{VERSION}.dist-info/"
    ours = {
        file.relative_to(ROOT / root).as_posix()
        for root in ("core", "app", "resources")
        for file in (ROOT / root).rglob("*")
        if file.is_file() and "__pycache__" not in file.parts
    }
    assert {name.split("/")[0] for name in ours} == {
        "kappaskin",
        "kappaskin_app",
        "kappaskin_resources",
    }
    assert names - ours == {
        information + name
        for name in ("METADATA", "RECORD", "WHEEL", "entry_points.txt", "licenses/LICENSE")
    }
    assert ours <= names


def test_the_metadata_say_what_it_is_and_for_whom(built):
    project = PROJECT["project"]
    with wheel(built) as archive:
        text = archive.read(f"kappaskin-{VERSION}.dist-info/METADATA").decode()
    told = email.message_from_string(text)

    assert (told["Name"], told["Version"], told["Author"]) == (
        "kappaskin",
        VERSION,
        "The Kappaskin project",
    )
    assert (told["License-Expression"], told["Requires-Python"]) == ("BSD-3-Clause", ">=3.11")
    assert set(told["Keywords"].split(",")) == set(project["keywords"])
    assert told.get_all("Classifier") == project["classifiers"]
    assert set(told.get_all("Provides-Extra")) == set(project["optional-dependencies"])
    assert "distributed>=2025.1; extra == 'dask'" in told.get_all("Requires-Dist")
    assert not {"Home-page", "Project-URL", "Author-email"} & set(told.keys())


def test_the_long_description_is_the_readme_without_links_that_lead_nowhere(built):
    with wheel(built) as archive:
        text = archive.read(f"kappaskin-{VERSION}.dist-info/METADATA").decode()
    shown, readme = text.partition("\n\n")[2], (ROOT / "README.md").read_text("utf-8")
    code = re.compile(r"```.*?```", re.DOTALL)

    assert re.search(r"\]\((?!https://)", readme)
    assert not re.findall(r"\]\((?!https://)|^\[.*?\]: |<img|href=", code.sub("", shown), re.M)
    assert code.findall(shown) == code.findall(readme)
    assert "**The guide** covers first steps" in shown


def test_the_source_distribution_has_what_is_to_be_read(built):
    (file,) = built.glob("*.tar.gz")
    with tarfile.open(file) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    linked = re.findall(r"\]\(([^):#]+)(?:#[^)]*)?\)", (ROOT / "README.md").read_text("utf-8"))

    assert {"CITATION.cff", "CHANGELOG.md", "LICENSE", "packaging/start.py", *linked} <= names


def test_the_citation_names_the_project_and_the_paper():
    told = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    (paper,) = told["references"]

    assert {"cff-version", "message", "title", "authors"} <= set(told)
    assert told["authors"] == PROJECT["project"]["authors"]
    assert (told["license"], told["abstract"]) == (
        PROJECT["project"]["license"],
        PROJECT["project"]["description"],
    )
    assert {"authors", "title", "type"} <= set(paper)
    assert f"*{paper['title']}* ({paper['year']})" in (ROOT / "README.md").read_text("utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["*.whl", pytest.param("*.tar.gz", marks=pytest.mark.full)])
def test_installed_anew_it_runs_and_a_strict_project_finds_its_types(built, kind, tmp_path):
    (archive,) = built.glob(kind)
    variables = runpy.run_path(str(ROOT / "packaging" / "start.py"))["environment"]()

    def run(*command):
        done = subprocess.run(
            [str(word) for word in command],
            cwd=tmp_path,
            env=variables,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    # No network: what it needs is that of this Python.
    run(sys.executable, "-m", "venv", "--without-pip", "venv")
    (site,) = tmp_path.glob("venv/lib/*/site-packages")
    others = [place for place in sys.path if place.endswith("-packages")]
    (site / "others.pth").write_text("\n".join(others))
    programs = tmp_path / "venv" / "bin"
    pip = (sys.executable, "-m", "pip", "--python", programs / "python", "install", "--no-index")
    run(*pip, "--no-deps", "--no-build-isolation", "--ignore-installed", archive)

    assert run(programs / "kappaskin", "--version") == VERSION + "\n"
    assert "--source" in run(programs / "kappaskin", "app", "--help")
    code = "import kappaskin as k, kappaskin_app as a; print(k.__version__, k.__file__, a.__file__)"
    version, *files = run(programs / "python", "-c", code).split()
    assert version == VERSION
    assert all(Path(file).is_relative_to(site) for file in files)

    shutil.copy(ROOT / "tests" / "user_script.py", tmp_path)
    settings = {"typeCheckingMode": "strict", "include": ["user_script.py"], "venv": "venv"}
    (tmp_path / "pyrightconfig.json").write_text(json.dumps(settings | {"venvPath": "."}))
    assert "0 errors, 0 warnings" in run(sys.executable, "-m", "basedpyright", "-p", tmp_path)


def test_constraints_are_pins_without_an_address():
    for line in CONSTRAINTS.splitlines():
        assert re.fullmatch(r"#.*|[A-Za-z0-9._-]+==[A-Za-z0-9.!+]+", line), line
    assert "://" not in CONSTRAINTS


@pytest.mark.parametrize("requirement", requirements(), ids=str)
def test_each_requirement_is_pinned_in_its_range(requirement):
    version = pins()[canonicalize_name(requirement.name)]

    assert requirement.specifier.contains(version)


def test_pins_avoid_what_is_known_to_break():
    assert pins()["pyside6-essentials"] == pins()["shiboken6"] == "6.11.3"
    assert pins()["pyvista"].startswith("0.49.")


def test_start_needs_the_standard_library_alone():
    imported = imported_by(ROOT / "packaging" / "start.py")

    assert "subprocess" in imported
    assert imported <= sys.stdlib_module_names


def test_a_python_that_is_too_old_is_told_in_a_line_what_to_do(monkeypatch):
    start = runpy.run_path(str(ROOT / "packaging" / "start.py"))
    known = start["set_up"].__globals__
    ast.parse((ROOT / "packaging" / "start.py").read_text("utf-8"), feature_version=(3, 8))
    monkeypatch.setitem(known, "OLDEST", (3, 99))

    for names, remedy in (
        ([], r"install a newer one \(Debian 12, .*\)"),
        (
            ["false", Path(sys.executable).name],
            rf"start with {Path(sys.executable).name} .*py",
        ),
    ):
        monkeypatch.setitem(known, "named_pythons", lambda names=names: names)
        with pytest.raises(start["Stop"], match=rf"^expected Python 3\.99 or newer, .*; {remedy}$"):
            start["set_up"]()


def test_a_long_installation_reports_what_it_does_and_why_it_fails(monkeypatch, capfd):
    start = runpy.run_path(str(ROOT / "packaging" / "start.py"))
    monkeypatch.setitem(start["quietly"].__globals__, "REPORT", 0.1)
    code = "import time; print('Collecting a\\n', flush=True); time.sleep(2); exit('no b')"
    command = [sys.executable, "-c", code]

    with pytest.raises(start["Stop"], match=r"(?s)Collecting a\nno b\nexit code 1; check"):
        start["quietly"](command, start["environment"](), "check the network")
    assert "==>   Collecting a\n" in capfd.readouterr().out


def test_a_dependency_group_is_read_with_those_that_it_includes():
    group = runpy.run_path(str(ROOT / "packaging" / "start.py"))["group"]
    groups = PROJECT["dependency-groups"]

    assert group("bundle") == groups["bundle"]
    assert sorted(group("dev")) == sorted([*groups["dev"][1:], *groups["compare"]])


def test_every_task_is_told_in_its_help_and_to_those_who_contribute():
    start = runpy.run_path(str(ROOT / "packaging" / "start.py"))
    contributing = (ROOT / "CONTRIBUTING.md").read_text("utf-8")

    assert {"fast", "cover"} < set(start["TASKS"])
    for task in start["TASKS"]:
        assert re.search(rf"start\.py {task} +\S", start["__doc__"])
        assert task == "app" or f"start.py {task} " in contributing


def test_full_runs_every_step_and_fails_where_one_does(monkeypatch, capfd):
    start = runpy.run_path(str(ROOT / "packaging" / "start.py"))
    known = start["full"].__globals__
    assert {step[0] for step in start["RELEASE"]} <= set(start["TASKS"])
    monkeypatch.setitem(known, "RELEASE", (("--help",), ("nothing",), ("--help",)))
    monkeypatch.setitem(known, "other_pythons", list)

    assert start["full"]([], start["environment"]()) == start["REFUSED"]

    printed = capfd.readouterr().out
    assert printed.count(start["__doc__"]) == 2
    assert re.search(r"==> Failed: python \S*start\.py nothing \(exit code 2\)\n$", printed)


@pytest.mark.parametrize(
    ("now", "code", "rounds", "said"),
    [("late = not seen", 0, 2, "To mend"), ("late = True", 1, 2, ""), ("late = False", 0, 1, "")],
)
def test_what_fails_beside_others_is_told_and_tried_alone(
    tmp_path, monkeypatch, capfd, now, code, rounds, said
):
    start = runpy.run_path(str(ROOT / "packaging" / "start.py"))
    file = tmp_path / "test_window.py"
    file.write_text(
        "from pathlib import Path\n"
        "def test_in_time():\n"
        "    file = Path(__file__).with_name('rounds')\n"
        "    seen = file.read_text() if file.exists() else ''\n"
        "    file.write_text(seen + '.')\n"
        f"    {now}\n"
        "    assert not late\n"
    )
    monkeypatch.setitem(start["run_tests"].__globals__, "TESTS", ("pytest", "-n0"))

    arguments = ["-c", str(ROOT / "pyproject.toml"), f"--rootdir={tmp_path}", str(file)]
    assert start["run_tests"](arguments, start["environment"]()) == code

    assert (tmp_path / "rounds").read_text() == "." * rounds
    assert said in capfd.readouterr().out.splitlines()[-1]


def test_another_python_has_a_venv_of_its_own(monkeypatch):
    start = runpy.run_path(str(ROOT / "packaging" / "start.py"))
    made, ran = [], []
    known = start["core"].__globals__
    monkeypatch.setitem(
        known, "install", lambda venv, *_, python, **__: made.append((venv, python))
    )
    monkeypatch.setitem(known, "run", lambda command, *_, **__: ran.append(command))

    start["core"](["--python", "python3.99", "-x"], {})
    start["core"]([], {})

    (other, name), (own, _) = made
    assert (other.name, name, own.name) == (".venv-core-python3.99", "python3.99", ".venv-core")
    assert [str(other) in ran[0][0], ran[0][-1]] == [True, "-x"]


def test_a_venv_that_is_a_link_is_never_cleared(tmp_path):
    start = runpy.run_path(str(ROOT / "packaging" / "start.py"))
    (tmp_path / "others").mkdir()
    (tmp_path / "others" / "pyvenv.cfg").touch()
    link = tmp_path / ".venv"
    link.symlink_to(tmp_path / "others")

    with pytest.raises(start["Stop"], match="it is a link"):
        start["install"](link, "nothing", keep=False)

    assert (tmp_path / "others" / "pyvenv.cfg").exists()


def displays() -> set[psutil.Process]:
    """The virtual displays that this process has started."""
    return {one for one in psutil.Process().children() if one.name() == "Xvfb"}


@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="no Xvfb: apt-get install -y xvfb")
def test_virtual_displays_are_apart_and_gone_afterwards():
    virtual_display = runpy.run_path(str(ROOT / "packaging" / "start.py"))["virtual_display"]

    before = displays()
    with virtual_display({}) as one, virtual_display({}) as other:
        assert one["DISPLAY"] != other["DISPLAY"]
        assert len(displays() - before) == 2

    assert displays() == before


@pytest.mark.parametrize(
    ("source", "extras"),
    [("core", ["plots", "foxglove"]), ("app", ["app", "film"])],
    ids=["core", "app"],
)
def test_what_is_imported_is_declared(source, extras):
    project, wheels = PROJECT["project"], metadata.packages_distributions()
    asked = list(project["dependencies"])
    for extra in extras:
        asked += project["optional-dependencies"][extra]
    declared = {canonicalize_name(Requirement(text).name) for text in asked}
    own = {".", "kappaskin", "kappaskin_app"}

    imported = {name for file in (ROOT / source).rglob("*.py") for name in imported_by(file)}

    assert "numpy" in imported
    for name in imported - sys.stdlib_module_names - own:
        assert declared & {canonicalize_name(wheel) for wheel in wheels[name]}, name


def test_the_doctor_looks_for_all_that_the_library_and_the_app_need():
    project = PROJECT["project"]
    needed = [*project["dependencies"], *project["optional-dependencies"]["app"]]

    assert {Requirement(text).name for text in needed} <= set(doctor.PACKAGES)


def test_packaging_is_a_folder_not_a_package():
    assert not (ROOT / "packaging" / "__init__.py").exists()  # It would hide PyPI's packaging.


def test_qt_keeps_the_references_to_none_and_true():
    # PySide6 6.12 on Python 3.11 loses one reference a call, and aborts when none is left.
    qtcore = pytest.importorskip("PySide6.QtCore")

    class Sender(qtcore.QObject):
        sent = qtcore.Signal(bool)

    sender = Sender()

    assert references_gained(None, 200, lambda: qtcore.QObject().setObjectName("x")) > -100
    assert references_gained(True, 20, lambda: sender.sent.emit(True)) > -10
