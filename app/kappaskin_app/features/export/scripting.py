"""Python scripts that do what the window does now."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from string import Template
from typing import Any

from kappaskin.errors import Refusal
from kappaskin.estimation import Region
from kappaskin.pipeline import Setup, setup_to_text
from kappaskin.scenes import SCENES, read_scene_text, scene_file, write_scene
from kappaskin_app.shell.session import RECORDED, Session
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.settings.scene import Written
from kappaskin_app.shell.simulation import OWN, region_of

_NAMES = ("Region", "Setup", "load_scene", "planned", "read_scene", "setup_from_text")
_SCRIPT = Template('''\
"""The source, scene and setup of Kappaskin's window, from Python."""

import time
$paths
from kappaskin import $names

$setup

def estimates(seconds):
    """The newest estimate, ten times a second."""
    with Engine() as engine:
        $requests
        end, last = time.monotonic() + seconds, -1
        while time.monotonic() < end:
            status = engine.status()
            estimate = engine.latest(status)
            if estimate is not None and estimate.sequence != last:
                last = estimate.sequence
                yield estimate
            time.sleep(0.1)
        if last < 0:
            print(status.state, status.message)


if __name__ == "__main__":  # the engine is a separate process that imports this file
    for e in estimates(seconds=5.0):
        x, y = 1e3 * e.contact.position
        force, deepest = e.contact.force, 1e3 * abs(e.surface).max()
        print(
            f"{e.device_time:9.3f} s  contact {x:6.2f}, {y:6.2f} mm  force {force:7.4f} N  "
            f"deepest {deepest:6.3f} mm  noise {$noise:.3f} $unit"
        )
''')


@dataclass(frozen=True)
class Script:
    """The `text` of a script, and the `files` that it reads, by name."""

    text: str
    files: Mapping[str, bytes]


def script_of(session: Session, settings: Settings, folder: Path) -> Script:
    """The script for what `session` reads; the files of its setup are to be put into `folder`.

    A `Refusal` without a source, or where the simulation cannot be written as text.
    """
    if not session.source:
        raise Refusal("expected an open source, got none; connect one, then copy again")
    setup, files = _setup(session.engine.requested.setup, folder)
    made, requests = [f"SETUP = {setup}"], ["engine.set_up(SETUP)"]
    if (region := region_of(settings)) != Region():
        made.append(f"REGION = {_constructor(region)}")
        requests.append("engine.scan(REGION)")
    if settings.targets:
        origins = f", {settings.origins!r}" if settings.origins else ""
        requests.append(f"engine.publish({settings.targets!r}{origins})")
    if session.inside:  # planned before it connects, or the engine would show the first scene
        made.append(f"SCENE = {_scene(session, settings)}")
        requests.append("scene = planned(SCENE)")
    requests.append(f"engine.connect({_literal(_source(session))})")
    if session.inside:
        requests += ["engine.play(scene)", "engine.seek(0.0)"]
    sensor = session.status.sensor
    times, unit = sensor.noise_unit if sensor else (1.0, "1/m")
    noise = "e.noise" if times == 1 else f"{times:g} * e.noise"
    return Script(_composed("\n".join(made), requests, noise, unit), files)


def _composed(made: str, requests: list[str], noise: str, unit: str) -> str:
    used = f"{made}{requests}"
    names = ["Engine", *(name for name in _NAMES if f"{name}(" in used)]
    paths = "from pathlib import Path\n" if "Path(" in made else ""
    between = "\n        "
    return _SCRIPT.substitute(
        paths=paths,
        names=", ".join(names),
        setup=f"{made}\n",
        requests=between.join(requests),
        noise=noise,
        unit=unit,
    )


def _source(session: Session) -> str:
    """The name of the source from wherever the script is run; what is played comes after it."""
    if session.inside:
        return "sim:"
    name = session.source
    return (
        f"{RECORDED}{Path(name.removeprefix(RECORDED)).absolute()}" if session.replaying else name
    )


def _literal(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)


def _constructor(value: Any, always: tuple[str, ...] = ()) -> str:
    """A dataclass as it is made: what is not as it usually is of it, and those named `always`."""
    usual, values = type(value)(), {f.name: getattr(value, f.name) for f in fields(value)}
    arguments = (
        f"{n}={_literal(v)}" for n, v in values.items() if n in always or v != getattr(usual, n)
    )
    return f"{type(value).__name__}({', '.join(arguments)})"


def _setup(setup: Setup, folder: Path) -> tuple[str, Mapping[str, bytes]]:
    """A setup as it is made, and the files that it has its calibration and its tare from."""
    text, files = setup_to_text(setup)
    if not files:
        return _constructor(setup, ("Ni", "Nj", "method")), files
    read = f"lambda name: Path({_literal(str(folder))}, name).read_bytes()"
    return f"setup_from_text(\n    {text!r},\n    {read},\n)", files


def _scene(session: Session, settings: Settings) -> str:
    """How the scene is made that is simulated."""
    written = settings.written
    if written is None or session.refusal:
        return _read(write_scene(session.scene), OWN)
    trust = ", trust=True" if written.trust else ""
    if not _is_in_its_file(written):
        return _read(written.text, written.file.absolute(), trust)
    ready = written.file.stem in SCENES and scene_file(written.file.stem) == written.file
    name = written.file.stem if ready else str(written.file.absolute())
    return f"load_scene({_literal(name)}{trust})"


def _is_in_its_file(written: Written) -> bool:
    try:
        return written.file.is_file() and read_scene_text(written.file) == written.text
    except Refusal:
        return False


def _read(text: str, file: Path, trust: str = "") -> str:
    plain = "'''" not in text and "\\" not in text and not text.endswith("'")
    quoted = f"'''{text}'''" if plain else repr(text)
    return f"read_scene({quoted}, Path({_literal(str(file))}){trust})"
