"""What this machine has, what is missing, and the line that installs it."""

import ctypes
import os
import platform
import shutil
import sys
from dataclasses import asdict
from importlib import metadata
from typing import Any

from kappaskin.sources import serial_ports

PACKAGES = (
    "numpy",
    "scipy",
    "pyserial",
    "cyclopts",
    "pillow",
    "platformdirs",
    "trimesh",
    "mcap",
    "lz4",
    "zstandard",
    "PySide6-Essentials",
    "pyvista",
    "pyvistaqt",
    "vtk",
    "tomlkit",
)

# What Qt and VTK load at run time that no wheel carries: library, and Debian's package of it.
LIBRARIES = {
    "libEGL.so.1": "libegl1",
    "libGL.so.1": "libgl1",
    "libglib-2.0.so.0": "libglib2.0-0",
    "libfontconfig.so.1": "libfontconfig1",
    "libdbus-1.so.3": "libdbus-1-3",
    "libxkbcommon-x11.so.0": "libxkbcommon-x11-0",
    "libxcb-cursor.so.0": "libxcb-cursor0",
    "libxcb-icccm.so.4": "libxcb-icccm4",
    "libxcb-keysyms.so.1": "libxcb-keysyms1",
    "libxcb-shape.so.0": "libxcb-shape0",
}


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def _loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


def _missing() -> list[str]:
    """Debian's packages that are missing; other systems' wheels bring all they need."""
    if not sys.platform.startswith("linux"):
        return []
    missing = [package for library, package in LIBRARIES.items() if not _loads(library)]
    if not _display() and not shutil.which("Xvfb"):
        missing.append("xvfb")
    return missing


def _display() -> str:
    if not sys.platform.startswith("linux"):
        return "native"
    return os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY") or ""


def examine() -> dict[str, Any]:
    """Everything `kappaskin doctor` tells, as JSON values."""
    missing = _missing()
    line = f"apt-get install -y --no-install-recommends {' '.join(missing)}" if missing else ""
    return {
        "kappaskin": _version("kappaskin"),
        "python": platform.python_version(),
        "system": platform.platform(),
        "packages": {package: _version(package) for package in PACKAGES},
        "display": _display(),
        "serial_ports": [asdict(port) for port in serial_ports()],
        "missing": missing,
        "install": line,
    }
