"""What importing the library does, and what it does not."""

import ast
import pkgutil
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest

import kappaskin
import kappaskin.studies

ROOMS = """
import pkgutil, importlib, sys, kappaskin
for module in pkgutil.walk_packages(kappaskin.__path__, "kappaskin."):
    if not module.name.endswith("__main__"):
        importlib.import_module(module.name)
"""


def loaded_by(code: str) -> set[str]:
    """The modules there are in a new process that ran `code`."""
    listing = "\nimport sys\nprint(*sys.modules)"
    return set(subprocess.check_output([sys.executable, "-c", code + listing], text=True).split())


@pytest.mark.parametrize(
    "code", ["from kappaskin import *", ROOMS], ids=["every name", "every room"]
)
def test_importing_the_library_loads_no_gui(code):
    loaded = {name.partition(".")[0] for name in loaded_by(code)}

    assert "kappaskin" in loaded
    gui = {"PySide6", "shiboken6", "vtk", "vtkmodules", "pyvista", "pyvistaqt", "pyqtgraph"}
    asked_for = {"matplotlib", "h5py", "imageio_ffmpeg", "skfem"}
    assert not (gui | asked_for) & loaded


@pytest.mark.parametrize(
    ("code", "rooms"),
    [
        ("import kappaskin", {"_lazy"}),
        ("from kappaskin import Refusal", {"_lazy", "errors"}),
        ("from kappaskin import Patch", {"_files", "_lazy", "_text", "errors", "frames", "skin"}),
    ],
)
def test_a_name_of_the_library_loads_its_room_and_those_below_alone(code, rooms):
    loaded = loaded_by(code)

    ours = {name.split(".")[1] for name in loaded if name.startswith("kappaskin.")}
    assert ours == rooms


def test_a_command_that_is_typed_loads_what_it_needs_alone():
    loaded = loaded_by("from kappaskin.cli import main\nmain(['device', '--help'])")

    commands = {name.split(".")[2] for name in loaded if name.startswith("kappaskin.cli.")}
    assert commands == {"common", "sensor"}
    assert "kappaskin_app" not in loaded
    assert "kappaskin.studies" not in loaded


@pytest.mark.parametrize("arguments", [["--help"], [], ["study", "--help"], ["app", "--help"]])
def test_the_help_loads_no_room(arguments):
    loaded = loaded_by(f"from kappaskin.cli import main\nmain({arguments!r})")

    ours = {name for name in loaded if name.startswith("kappaskin.")}
    rooms = {name.split(".")[1] for name in ours} - {"cli", "errors", "_lazy", "_text"}
    assert rooms <= {"studies"}  # for the names of the figures alone
    assert {name for name in ours if name.startswith("kappaskin.studies.")} <= {
        "kappaskin.studies.figures"
    }
    assert not {"numpy", "scipy", "matplotlib", "PySide6", "vtkmodules"} & loaded


@pytest.mark.parametrize("face", [kappaskin, kappaskin.studies])
def test_every_exported_name_is_what_type_checkers_see(face):
    [seen] = [
        node
        for node in ast.parse(Path(face.__file__).read_text("utf-8")).body
        if isinstance(node, ast.If)
    ]
    typed = {
        (alias.name, node.module)
        for node in seen.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }

    assert {(name, name) for name in face.__all__} == {(name, name) for name, _ in typed}
    for name, module in typed:
        assert getattr(face, name) is getattr(sys.modules[module], name)
    assert set(face.__all__) <= set(dir(face))


@pytest.mark.parametrize("face", [kappaskin, kappaskin.studies])
def test_every_exported_name_is_there_and_is_no_module(face):
    modules = {module.name for module in pkgutil.iter_modules(face.__path__)}

    for name in face.__all__:
        assert hasattr(face, name)  # or raises what its module does
    assert not modules & set(face.__all__)


def test_a_misspelt_name_is_refused_as_of_any_module():
    with pytest.raises(ImportError, match="cannot import name 'LeastSquare'"):
        from kappaskin import LeastSquare  # noqa: F401


def test_the_version_is_that_of_the_package_and_costs_nothing_until_it_is_asked_for():
    assert kappaskin.__version__ == metadata.version("kappaskin")
    assert "importlib.metadata" not in loaded_by("import kappaskin")
