"""What is optional is imported when it is asked for, and says what installs it when missing."""

import json
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

PROJECT = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text("utf-8"))
EXTRAS = PROJECT["project"]["optional-dependencies"]
OTHERS = {"compare": "scikit-fem"}  # what is asked for under its own name
MODULES = {
    "PySide6-Essentials": ("PySide6", "shiboken6"),
    "imageio-ffmpeg": ("imageio_ffmpeg",),
    "rerun-sdk": ("rerun",),
    "scikit-fem": ("skfem",),
    "vtk": ("vtk", "vtkmodules"),
}
ASKS = {
    "app": ["app"],
    "plots": ["figures", "--out", "figures"],
    "cluster": ["study", "paper-elements", "--scheduler", "tcp://127.0.0.1:1", "--out", "study"],
    "hdf5": ["export", "{recording}", "--to", "out.h5"],
    "compare": ["compare"],
    "rerun": ["export", "{recording}", "--to", "out.rrd"],
    "foxglove": ["publish", "sim:", "--seconds", "30", "--foxglove", "127.0.0.1:8765"],
}
"""What asks for what is optional, but `film`, `gamepad` and `parquet`: they need more than words.

Those are in app/features/export/test_exports.py, core/hand/test_gamepad.py and
core/recording/test_importing.py.
"""

BARRED = """
import sys

class Bar:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {barred}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Bar())
"""
TOLD = """
import contextlib, importlib, io, json, pkgutil, kappaskin
from kappaskin.cli import main

def imported(name):
    try:
        importlib.import_module(name)
    except ImportError:
        return False
    return True

def run(words):
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(out):
        return main(words), out.getvalue()

if __name__ == "__main__":
    plain, asked = json.loads(sys.argv[1])
    rooms = [module.name for module in pkgutil.walk_packages(kappaskin.__path__, "kappaskin.")]
    missing = [name for name in rooms if not name.endswith("__main__") and not imported(name)]
    told = {"missing": missing, "plain": [run(words)[0] for words in plain]}
    print(json.dumps(told | {"asked": {extra: run(words) for extra, words in asked.items()}}))
"""


def modules(*extras: str) -> set[str]:
    """What extras bring, by the names it is imported by."""
    names = [
        Requirement(text).name for extra in extras for text in EXTRAS.get(extra) or [OTHERS[extra]]
    ]
    return {module for name in names for module in MODULES.get(name, (name,))}


def without(barred: set[str], code: str, folder: Path, *arguments: str) -> str:
    """What `code` printed, in a process for which some packages are not installed."""
    script = folder / "script.py"
    script.write_text(BARRED.format(barred=barred) + code)
    command = [sys.executable, str(script), *arguments]
    return subprocess.run(
        command, cwd=folder, capture_output=True, text=True, timeout=180, check=True
    ).stdout


def test_every_extra_is_tried_here():
    assert set(EXTRAS) - {"dask"} == {*ASKS, "film", "gamepad", "parquet"} - set(OTHERS)
    assert EXTRAS["dask"] == ["kappaskin[cluster]"]  # as it was called


@pytest.mark.full
def test_without_any_extra_the_library_works_and_says_what_installs_what_is_asked_for(
    recording, tmp_path
):
    plain = [["tables"], ["doctor"], ["info", str(recording)]]
    asked = {extra: [word.format(recording=recording) for word in ASKS[extra]] for extra in ASKS}

    printed = without(modules(*ASKS, "film"), TOLD, tmp_path, json.dumps([plain, asked]))

    told = json.loads(printed)
    assert told["missing"] == ["kappaskin.publish.foxglove"]
    assert told["plain"] == [0, 0, 0]
    for extra, (code, said) in told["asked"].items():
        assert code == 2
        assert f"pip install '{OTHERS.get(extra, f'kappaskin[{extra}]')}'" in said
    assert [file.name for file in tmp_path.iterdir()] == ["script.py"]


def test_a_plain_run_imports_nothing_optional(tmp_path):
    code = (
        "from kappaskin.cli import main\nmain(['tables'])\nmain([])\nprint(*sys.modules, sep='\\n')"
    )

    loaded = without(set(), code, tmp_path).splitlines()

    assert "kappaskin" in loaded
    assert not modules(*ASKS, "film") & {name.partition(".")[0] for name in loaded}
