"""Commands on this machine and its ports: doctor, drill, new plug-ins, completion in a shell."""

import ctypes
import math
import os
import platform
import re
import shutil
import sys
from dataclasses import asdict
from importlib import metadata
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from kappaskin.cli.common import FAILED, ProgressLine, Switch, lined, print_result, show
from kappaskin.errors import Refusal

if TYPE_CHECKING:
    from kappaskin._plugins import PlugIn
    from kappaskin.sources import Diagnosis

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
    "pyqtgraph",
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


def _plug_ins() -> "list[PlugIn]":
    """Every plug-in of every group, loaded."""
    # The app alone knows the names of its own features: here none is taken.
    from kappaskin import _plugins
    from kappaskin import estimation as estimation
    from kappaskin import scenes as scenes
    from kappaskin.sources import plugged_source

    plugged_source(":", None)
    _plugins.plug_ins(_plugins.FEATURES, _plugins.check_feature)
    return _plugins.found_plug_ins()


def examine() -> dict[str, Any]:
    """Everything that `kappaskin doctor` shows, as JSON values."""
    from kappaskin.sources import Port

    missing = _missing()
    line = f"apt-get install -y --no-install-recommends {' '.join(missing)}" if missing else ""
    return {
        "kappaskin": _version("kappaskin"),
        "python": platform.python_version(),
        "system": platform.platform(),
        "packages": {package: _version(package) for package in PACKAGES},
        "plug_ins": [asdict(one) for one in _plug_ins()],
        "display": _display(),
        "serial_ports": [asdict(port) for port in Port.found()],
        "missing": missing,
        "install": line,
    }


def doctor(port: str = "", *, json: Switch = False) -> int:
    """Show what this machine has, what is missing, and the command that installs it.

    Or examine one port for a few seconds: whether it is absent, busy, not permitted, silent, at
    another baud rate or not a sensor; otherwise its device, frame rate and losses. The
    exit code is 1 if no readings arrive.

    Example: `kappaskin doctor /dev/ttyACM0`

    Parameters
    ----------
    port
        The port or URL to examine; this machine when left out.
    json
        Print one JSON object instead of text.
    """
    from kappaskin.sources import Diagnosis

    if not port:
        machine = examine()
        print_result(machine, json, lambda: _machine_text(machine))
        return 0
    found = Diagnosis.of(port)
    print_result(found.to_json(), json, lambda: _port_text(found))
    return FAILED if found.why else 0


def _port_text(found: "Diagnosis") -> str:
    lines = [_line("port", found.plug)]
    if found.device:
        lines.append(_line("device", found.device))
    if math.isfinite(found.rate):
        rate = f"{found.rate:.1f} frames/s of {found.said_rate:g} nominal"
        known = f"known to {1e3 * found.clock_sd:.2g} ms" if found.clock_sd < math.inf else _DEAF
        lines += [_line("rate", rate), _line("clock", known)]
    if math.isfinite(found.temperature):
        lines.append(_line("temperature", f"{found.temperature:.1f} degrees Celsius"))
    if received := found.accounting.bytes_in:
        lines.append(_line("losses", f"{found.accounting.words}, in {received:,} bytes"))
    lines += [_line(event.kind, event.text) for event in found.events if event.kind != "met"]
    return lined([*lines, _line("verdict", found.why or "well")])


_DEAF = "unknown: no reply to pings"


def _line(name: str, text: str) -> str:
    return f"{name:<20}{text}"


def _machine_text(found: dict[str, Any]) -> str:
    """What `examine` found, for people."""
    from kappaskin._plugins import PlugIn
    from kappaskin.sources import Port

    lines = [_line(name, found[name]) for name in ("kappaskin", "python", "system")]
    for package, version in found["packages"].items():
        lines.append(_line(package, version or "not installed"))
    for one in (PlugIn(**one) for one in found["plug_ins"]):
        lines.append(_line("plug-in", f"{one.text}  {one.file}".rstrip()))
    lines.append(_line("display", found["display"] or "none (`xvfb-run` provides a virtual one)"))
    for port in (Port(**port) for port in found["serial_ports"]):
        may = "" if port.opened else f"  no permission. {port.permission_help}"
        lines.append(_line("serial port", f"{port.words}{may}"))
    if not found["serial_ports"]:
        lines.append(_line("serial ports", "none found"))
    lines.append(_line("missing", " ".join(found["missing"]) or "nothing"))
    if None in found["packages"].values():
        lines.append("Install the desktop app's packages with: pip install 'kappaskin[app]'")
    if found["install"]:
        lines.append(f"Install what is missing with: sudo {found['install']}")
    return lined(lines)


def drill(source: str = "", *, json: Switch = False, long: Switch = False) -> int:
    """Inject faults into the line to a device, and report the outcome of each.

    A relay before the device corrupts the traffic: noise, cuts, floods, unplugged cables. Exit code
    1 if a drill fails. Close the app first: the drill needs the port.

    Example: `kappaskin drill /dev/ttyACM0`

    Parameters
    ----------
    source
        The device's port, or a URL that pyserial opens; a simulated device when left out.
    json
        Print one JSON list of rows instead of a table.
    long
        Run each drill for longer: 100 times unplugged, ten seconds of noise.
    """
    try:
        from kappaskin.studies import drills_text, run_drills
    except ImportError as error:
        raise Refusal("expected a system with pseudo-terminals (Linux, macOS)") from error
    with ProgressLine() as show_progress:
        rows = run_drills(source or None, long, show_progress)
    print_result(rows, json, lambda: drills_text(rows))
    return FAILED if any(row["verdict"] == "failed" for row in rows) else 0


# The plug-in that each template is, and as which its name is taken.
_TEMPLATES = {
    "sensor": ("tilt", "a scheme of a source"),
    "effect": ("lag", "an effect"),
    "estimator": ("ridge", "an estimator"),
    "feature": ("peak", "a feature of the app"),
}


def _is_taken(kind: str, name: str) -> bool:
    """Whether a plug-in of this `name` would be left out."""
    from kappaskin.estimation import METHODS
    from kappaskin.scenes.effects import EFFECTS
    from kappaskin.sources import own_schemes

    if kind == "feature":  # core never imports the app: its features are folders
        app = find_spec("kappaskin_app")
        places = (app and app.submodule_search_locations) or []
        return any((Path(place) / "features" / name).is_dir() for place in places)
    return name in {"sensor": own_schemes(), "effect": EFFECTS, "estimator": METHODS}[kind]


def new(kind: Literal["sensor", "effect", "estimator", "feature"], name: str, /) -> None:
    """Write a package of a plug-in, with a test, to a new folder here.

    It works as it is: change its code to yours. `pip install -e ./kappaskin-NAME` installs it,
    `pytest kappaskin-NAME` tests it, and `kappaskin doctor` lists it.

    Example: `kappaskin new estimator ridge`

    Parameters
    ----------
    kind
        What it adds: a source of frames, an effect in simulations, an estimator of shapes, or a
        feature of the app.
    name
        Its name: lower-case letters, digits and single hyphens.
    """
    from kappaskin._files import write_whole

    example, taken = _TEMPLATES[kind]
    if not re.fullmatch(r"[a-z][a-z0-9]*(-[a-z0-9]+)*", name) or len(name) > 40:
        raise Refusal(
            "expected a name of a letter, then letters, digits and single hyphens, all lower-case "
            f"and 40 at most, such as {example}, got {name!r:.60}"
        )
    folder, module = Path(f"kappaskin-{name}"), f"kappaskin_{name.replace('-', '_')}"
    if find_spec(module):
        raise Refusal(f"the module {module} is installed already; choose another name")
    if _is_taken(kind, name):
        raise Refusal(f"{name} is {taken} of Kappaskin already; choose another name")
    words = {
        f"kappaskin_{example}": module,
        example.title(): name.title().replace("-", ""),
        example: name,
    }

    def named(text: str) -> str:
        return re.sub("|".join(words), lambda found: words[found[0]], text)

    try:
        folder.mkdir()
    except FileExistsError as error:
        raise Refusal(f"{folder} is here already; choose another name, or remove it") from error
    except OSError as error:
        raise Refusal(f"{folder} cannot be written ({error.strerror}); go elsewhere") from error
    for file in (files("kappaskin_resources") / "templates" / kind).iterdir():
        if file.is_file():  # pip adds a folder of compiled modules
            write_whole(folder / named(file.name), named(file.read_text("utf-8")))
    show(f"{folder}: written; `pip install -e ./{folder}` installs it")


def install_completion(
    *, shell: Literal["bash", "zsh", "fish", "powershell"] | None = None
) -> None:
    """Install completion of commands and options for your shell.

    Writes a completion file, and a line that loads it into the shell's start-up file.

    Example: `kappaskin --install-completion --shell zsh`

    Parameters
    ----------
    shell
        The shell; the present one when left out.
    """
    from cyclopts.completion import ShellDetectionError

    from kappaskin.cli import app

    try:
        file = app.install_completion(shell=shell)
    except ShellDetectionError as error:
        raise Refusal(f"the shell was not detected ({error}); give it with --shell") from error
    except OSError as error:
        raise Refusal(f"completion cannot be written ({error}); check the permissions") from error
    show(f"{file}: installed; open a new shell to use it")
