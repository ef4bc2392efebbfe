"""Names outside Python stay: commands and options, files' keys and columns, messages, verdicts.

They are taken from the running program and compared with those of `outside_names.json`. Scripts,
files and programs of others rest on them: add to them, and think twice before one goes. Once a
change is meant, `python tests/test_outside_names.py` in the project's folder stores it.
"""

import contextlib
import io
import json
import re
import socket
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import fields
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, get_args

import h5py
import numpy as np
import pytest
from mcap.reader import make_reader

from kappaskin.cli import FAILED, REFUSED, _add_commands, app, main
from kappaskin.cli.system import _port_text
from kappaskin.errors import Refusal
from kappaskin.frames import Event
from kappaskin.publish.message import CONTACT, SECOND, SWITCHES
from kappaskin.recording.export.tables import columns
from kappaskin.scenes import SCENES, load_scene, write_scene
from kappaskin.sources import Accounting, Diagnosis
from kappaskin.studies import (
    EffectCost,
    accuracy_verdict,
    cost_rows,
    costs,
    effect_rows,
    settings_to_try,
)
from kappaskin.studies.compare import ComparisonRow
from kappaskin.studies.design.measures import MEASURES
from kappaskin.studies.design.study import STUDIES
from kappaskin.studies.drills import DRILLS, row_of
from kappaskin.studies.drills.stand import Drill, DrillOutcome, opened
from kappaskin.studies.regions import REGIONS
from kappaskin.studies.regions import measured as run_region
from kappaskin.studies.stability import rows_of
from kappaskin.studies.stability.gallery import gallery

STORED = Path(__file__).with_name("outside_names.json")
STUDY = """
format = 1
title = "Noise"
rate = 10.0
[skin]
size = [0.1, 0.1]
[elements]
grid = [8, 8]
[effects.gaussian-noise]
rms = 0.1
[[touch]]
what = "point"
x = 0.05
y = 0.05
force = 0.15
[[vary]]
"effects.gaussian-noise.rms" = [0.1, 0.2]
[fit]
functions = [4, 4]
[measure]
what = ["rms", "found"]
frames = 2
[stop]
within = 0.9
least = 2
most = 2
"""


def ran(*arguments: object) -> str:
    """What a command printed; it may fail, but is not refused."""
    with (
        contextlib.redirect_stdout(io.StringIO()) as printed,
        contextlib.redirect_stderr(io.StringIO()) as told,
    ):
        code = main([str(argument) for argument in arguments])
    assert code in (0, FAILED), told.getvalue()
    return printed.getvalue()


def keys_of(value: Any, place: str = "") -> Iterator[str]:
    """The dotted places of all values inside a value: a.b[].c."""
    if isinstance(value, dict) and value:
        for key, inner in value.items():
            yield from keys_of(inner, f"{place}.{key}" if place else key)
    elif isinstance(value, list) and value and isinstance(value[0], dict | list):
        for inner in value:
            yield from keys_of(inner, f"{place}[]")
    else:
        yield place


def keys(value: Any) -> list[str]:
    return sorted(set(keys_of(value)))


def printed_keys(*arguments: object) -> list[str]:
    return keys(json.loads(ran(*arguments, "--json")))


# What there is to type


def commands() -> dict[str, Any]:
    """Each command's arguments with their type and default; those without one must be given."""
    _add_commands()
    return {name: dict(arguments_of(name)) for name in app if not name.startswith("-")}


def arguments_of(name: str) -> Iterator[tuple[str, str]]:
    for argument in app[name].assemble_argument_collection():
        info = argument.field_info
        hint = getattr(argument.hint, "__name__", "") if not get_args(argument.hint) else ""
        kind = hint or str(argument.hint)
        default = "" if info.default is info.empty else f" = {info.default!r}"
        place = "" if info.kind is info.KEYWORD_ONLY else " (by place)"
        yield " ".join(argument.names), f"{kind}{default}{place}"


def exit_codes() -> dict[str, int]:
    with tempfile.TemporaryDirectory() as folder:
        broken = Path(folder) / "broken.mcap"
        broken.write_bytes(b"\x89MCAP0\r\n" + bytes(100))
        arguments = ["repair", str(broken), "--out", str(Path(folder) / "whole.mcap")]
        with contextlib.redirect_stdout(io.StringIO()):
            nothing = main(arguments)
    return {"done": 0, "failed": FAILED, "refused": REFUSED, "repair: nothing left": nothing}


# What commands print and write


def printed() -> dict[str, list[str]]:
    """The keys of what commands print by --json."""
    with tempfile.TemporaryDirectory() as folder:
        answers = {
            "doctor": set(printed_keys("doctor")),
            "plan": printed_keys("plan", "centre"),
            "tables": printed_keys("tables"),
            "calibrate": printed_keys("calibrate", "sim:", "--out", Path(folder) / "a.toml"),
            "press": printed_keys("press", "sim:", "--quick"),
        }
    machine = {key for key in answers["doctor"] if not key.startswith("serial_ports")}
    scene = load_scene("centre")
    measured = list(costs(scene, settings_to_try(scene)[:1]))
    an_effect = EffectCost("hum", kept=True, time_per_frame=0, bound=0, rms_with=0, rms_without=0)
    return answers | {
        "doctor": sorted(machine),
        "tables --as-printed": sorted(json.loads(ran("tables", "--as-printed", "--json"))[0]),
        "cost": keys(cost_rows(scene, measured)),
        "cost --within": keys(accuracy_verdict(scene, measured, 1.0).to_json()),
        "cost --effects": keys(effect_rows(scene, measured[0].setting, [an_effect])),
        "compare": [field.name for field in fields(ComparisonRow)],
        "regions": keys([run_region(0.25, REGIONS[0], 0.25)]),
        "stability": keys(rows_of(next(gallery()))),
    }


def calibration() -> list[str]:
    """The keys of a calibration's file."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "skin.toml"
        ran("calibrate", "sim:", "--out", file, "--json")
        return keys(tomllib.loads(file.read_text("utf-8")))


def quantities() -> dict[str, list[str]]:
    """Columns of tables in order, with type and unit, and the keys of messages of a contact."""
    info: Any = SimpleNamespace(sensor=load_scene("centre").sensor(), functions=(5, 4))
    return {
        "columns": [f"{of.name} {of.kind} {of.unit}".rstrip() for of in columns(info, ())],
        "keys": [*SWITCHES, *(number.key for number in CONTACT)],
        "keys of second": [number.key for number in SECOND],
    }


def arrays() -> dict[str, dict[str, str]]:
    """The arrays of NPZ files, with their kind of number and their axes."""
    with tempfile.TemporaryDirectory() as folder:
        read, shapes = Path(folder) / "read.npz", Path(folder) / "shapes.npz"
        ran("simulate", "centre", "--frames", 2, "--out", read)
        ran("reconstruct", read, "--out", shapes, "--grid", "5x5", "--objects")
        return {"simulate": arrays_in(read), "reconstruct": arrays_in(shapes)}


def arrays_in(file: Path) -> dict[str, str]:
    with np.load(file) as found:
        return {name: f"{found[name].dtype.kind}{found[name].ndim}" for name in sorted(found)}


def study() -> dict[str, list[str]]:
    """The files of a study's folder, and the heads of its table."""
    with tempfile.TemporaryDirectory() as name:
        folder, file = Path(name) / "out", Path(name) / "noise.toml"
        file.write_text(STUDY)
        ran("study", file, "--workers", 1, "--out", folder)
        ran("report", folder)
        results = [json.loads(one.read_text()) for one in (folder / "results").rglob("*.json")]
        return {
            "files": sorted(one.name for one in folder.iterdir()),
            "about.json": keys(json.loads((folder / "about.json").read_text())),
            "result": [key for key in keys(results) if not key.startswith("[].point.")],
            "report.csv": (folder / "report.csv").read_text("utf-8").splitlines()[0].split(","),
        }


@cache
def recording() -> Path:
    """A recording of a second, which stays for all that is told of it."""
    file = Path(tempfile.mkdtemp(prefix="kappaskin-names-")) / "press.mcap"
    command = [sys.executable, "-m", "kappaskin", "record", "sim:circle", str(file)]
    subprocess.run([*command, "--seconds", "1"], check=True, capture_output=True)
    return file


def recorded() -> dict[str, Any]:
    """Topics of a recording with their fields, what `info` tells, and the columns of exports."""
    with recording().open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    topics = {
        channel.topic: {
            "encoding": channel.message_encoding,
            "schema": summary.schemas[channel.schema_id].name,
            "fields": fields_of(summary.schemas[channel.schema_id].data.decode()),
        }
        for channel in summary.channels.values()
    }
    told = json.loads(ran("info", recording(), "--json"))
    exports = {}
    for ending in ("csv", "npz", "h5"):
        file = recording().with_suffix(f".{ending}")
        ran("export", recording(), "--to", file, "--preset", "everything")
        exports[ending] = columns_of(file)
        file.unlink()
    return {"topics": topics, "info": sorted(told), "exports": exports}


def fields_of(schema: str) -> list[str]:
    """The fields of a message, and of those in it, as ROS 2 writes them."""
    lines = (line.partition("#")[0].strip() for line in schema.splitlines())
    return [line for line in lines if line and set(line) != {"="}]


def columns_of(file: Path) -> Any:
    if file.suffix == ".npz":
        return arrays_in(file)
    if file.suffix == ".csv":
        lines = file.read_text("utf-8").splitlines()
        columns = next(line for line in lines if not line.startswith("#")).split(",")
        return list(dict.fromkeys(re.sub(r"\d+", "#", column) for column in columns))
    with h5py.File(file) as opened:
        names: list[str] = []
        opened.visit(names.append)
        return {"datasets": sorted(names), "attributes": sorted(opened.attrs)}


def udp() -> dict[str, list[str]]:
    """The keys of each kind of datagram."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = str(free.getsockname()[1])
    start = [sys.executable, "-m", "kappaskin"]
    with subprocess.Popen(
        [*start, "listen", "--udp", port, "--seconds", "30", "--json"],
        stdout=subprocess.PIPE,
        text=True,
    ) as listening:
        publish = [*start, "publish", "sim:circle", "--udp", f"127.0.0.1:{port}", "--seconds", "6"]
        subprocess.run(publish, check=True, capture_output=True)
        listening.terminate()
        lines, _ = listening.communicate(timeout=30)
    found: dict[str, set[str]] = {}
    for message in map(json.loads, lines.splitlines()):
        found.setdefault(message["kind"], set()).update(keys_of(message))
    return {kind: sorted(names) for kind, names in found.items()}


# What files may say


def scenes() -> dict[str, list[str]]:
    """The ready scenes, and every key that one of them is written with."""
    written = set[str]()
    for name in SCENES:
        with contextlib.suppress(Refusal):  # of a mesh, whose file no scene knows
            written |= set(keys_of(tomllib.loads(write_scene(load_scene(name)))))
    return {"names": sorted(SCENES), "keys": sorted(written)}


def studies() -> dict[str, list[str]]:
    """The ready studies, what they measure, and the drills."""
    return {
        "names": sorted(STUDIES),
        "measures": list(MEASURES),
        "drills": [drill.name for drill in DRILLS],
    }


def drill() -> dict[str, Any]:
    """The keys of a drill's row, and its verdicts."""

    def failing(stand: object) -> DrillOutcome:
        return DrillOutcome(failures=("it fails",))

    def done(stand: object) -> DrillOutcome:
        return DrillOutcome()

    with opened(None, 0) as device:
        held, failed = (row_of(Drill("a", "b", run), device) for run in (done, failing))
    return {"keys": sorted(held), "verdicts": [held["verdict"], failed["verdict"]]}


def doctor() -> dict[str, Any]:
    """What `doctor PORT` prints: its keys in JSON, and in text its labels and its verdict."""
    event = Event(0.0, "lost", "no reply")
    found = Diagnosis("A", "A", "", "B", 1.0, 1.0, 0.1, 20.0, Accounting(bytes_in=1), (event,))
    lines = _port_text(found).splitlines()
    return {
        "keys": sorted(found.to_json()),
        "labels": [line.split()[0] for line in lines],
        "verdict": lines[-1].split()[1],
    }


FAST = (commands, exit_codes, quantities, arrays, scenes, studies, doctor)
SLOW = (printed, calibration, study, recorded, udp, drill)


def sections(functions: Iterable[Callable[[], Any]] = (*FAST, *SLOW)) -> dict[str, Any]:
    return {function.__name__: json.loads(json.dumps(function())) for function in functions}


@pytest.mark.parametrize(
    "section",
    [*FAST, *(pytest.param(each, marks=pytest.mark.slow) for each in SLOW)],
    ids=lambda section: section.__name__,
)
def test_names_outside_python_are_those_that_were_promised(section: Callable[[], Any]) -> None:
    stored = json.loads(STORED.read_text("utf-8"))

    [(name, found)] = sections([section]).items()

    assert found == stored[name], (
        "others rest on these names: add to them, think twice before one goes; if the change is "
        "meant, run `python tests/test_outside_names.py`"
    )


def test_every_stored_name_is_compared() -> None:
    stored = json.loads(STORED.read_text("utf-8"))

    assert set(stored) == {section.__name__ for section in (*FAST, *SLOW)}


if __name__ == "__main__":
    STORED.write_text(json.dumps(sections(), indent=1, ensure_ascii=False) + "\n", "utf-8")
