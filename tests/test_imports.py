"""What importing the library does not do."""

import subprocess
import sys

import pytest

ROOMS = """
import pkgutil, importlib, sys, kappaskin
for module in pkgutil.walk_packages(kappaskin.__path__, "kappaskin."):
    if not module.name.endswith("__main__"):
        importlib.import_module(module.name)
"""


@pytest.mark.parametrize("code", ["import kappaskin, sys", ROOMS], ids=["library", "every room"])
def test_importing_the_library_loads_no_gui(code):
    listing = "\nprint(*sorted({name.partition('.')[0] for name in sys.modules}))"

    loaded = subprocess.run(
        [sys.executable, "-c", code + listing], capture_output=True, text=True, check=True
    ).stdout.split()

    assert "kappaskin" in loaded
    gui = {"PySide6", "shiboken6", "vtk", "vtkmodules", "pyvista", "pyvistaqt", "matplotlib"}
    asked_for = {"h5py", "imageio_ffmpeg", "skfem"}
    assert not (gui | asked_for) & set(loaded)
